#include "engine/selection/margins.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "engine/narrow/work_meter.h"
#include "engine/selection/plan.h"

namespace clearance {

namespace {

constexpr std::uint64_t kWorkPerUnit = 16;
constexpr std::uint64_t kSlice = 4096;  // pairs matched together

[[noreturn]] void reject(const std::string& what, QueryErrorCode code = QueryErrorCode::kBadQuery) {
  throw engine::QueryError(code, what);
}

void check(double margin, const std::string& place) {
  if (!(margin >= 0) || std::isinf(margin))
    reject(place + ": expected a finite number of metres >= 0, got " + std::to_string(margin));
}

std::string name_of(std::uint32_t selector, const engine::Scene& scene) {
  if (selector == kEveryBody) return "'*'";
  const std::uint32_t index = selector & ~kGroupBit;
  if (selector & kGroupBit)
    return index < scene.groups().size() ? "'" + scene.groups()[index].name + "'" : "group " + std::to_string(index);
  return index < scene.bodies().size() ? "'" + scene.bodies()[index].name + "'" : "body " + std::to_string(index);
}

// By body: a bit for each entry that names it.
class NamedBy {
 public:
  NamedBy(std::size_t bodies, std::size_t entries) : words_((entries + 63) / 64), bits_(bodies * words_) {}

  void add(std::size_t entry, std::uint32_t selector, const engine::Scene& scene) {
    const auto mark = [&](std::size_t body) { bits_[body * words_ + entry / 64] |= std::uint64_t{1} << entry % 64; };
    if (selector == kEveryBody)
      for (std::size_t body = 0; body < scene.bodies().size(); ++body) mark(body);
    else if (selector & kGroupBit)
      for (const std::uint32_t body : scene.groups()[selector & ~kGroupBit].bodies) mark(body);
    else
      mark(selector);
  }
  std::size_t words() const { return words_; }
  std::uint64_t word(std::uint32_t body, std::size_t i) const { return bits_[body * words_ + i]; }

 private:
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

// The last entry that names the pair in either order, negative if there is none.
std::ptrdiff_t last_entry(BodyPair pair, const NamedBy& first, const NamedBy& second) {
  for (std::size_t i = first.words(); i-- > 0;)
    if (const std::uint64_t both =
            (first.word(pair.a, i) & second.word(pair.b, i)) | (first.word(pair.b, i) & second.word(pair.a, i)))
      return static_cast<std::ptrdiff_t>(64 * i) + 63 - std::countl_zero(both);
  return -1;
}

// Bodies of a selector. Throws QueryError for an unknown one.
std::uint64_t count_named(std::uint32_t selector, const engine::Scene& scene, const std::string& place) {
  if (selector == kEveryBody) return scene.bodies().size();
  const std::uint32_t index = selector & ~kGroupBit;
  const bool is_group = selector & kGroupBit;
  if (index >= (is_group ? scene.groups().size() : scene.bodies().size()))
    reject(place + ": unknown " + name_of(selector, scene));
  return is_group ? scene.groups()[index].bodies.size() : 1;
}

std::vector<double> from_entries(const QueryView& query, const engine::Scene& scene, const PairList& pairs) {
  const std::span<const MarginEntry> entries = query.margins;
  const std::size_t bodies = scene.bodies().size();
  std::uint64_t work = pairs.size() * ((entries.size() + 63) / 64);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto [a, b, margin] = entries[i];
    const std::string place =
        "margins[" + std::to_string(i) + "] (" + name_of(a, scene) + ", " + name_of(b, scene) + ")";
    work += count_named(a, scene, place) + count_named(b, scene, place);
    check(margin, place);
  }
  if (entries.size() > Margins::kMostEntries || work > Margins::kMostWork)
    reject("margins: " + std::to_string(entries.size()) + " entries for " + std::to_string(pairs.size()) +
               " pairs are too many for one query: list the pairs explicitly, or use fewer entries",
           QueryErrorCode::kTooLarge);
  NamedBy first(bodies, entries.size()), second(bodies, entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    first.add(i, entries[i].a, scene);
    second.add(i, entries[i].b, scene);
  }
  std::vector<double> each(pairs.size(), query.margin);
  std::vector<BodyPair> storage;
  for (std::uint64_t begin = 0; begin < pairs.size(); begin += kSlice) {
    const auto slice = pairs.slice(begin, std::min(kSlice, pairs.size() - begin), storage);
    for (std::size_t i = 0; i < slice.size(); ++i) {
      if (slice[i].a >= bodies || slice[i].b >= bodies) continue;
      if (const auto entry = last_entry(slice[i], first, second); entry >= 0)
        each[begin + i] = entries[static_cast<std::size_t>(entry)].margin;
    }
  }
  units_of_this_thread += work / kWorkPerUnit;
  return each;
}

}  // namespace

Margins::Margins(const QueryView& query, const engine::Scene& scene, const PairList& pairs)
    : least_(query.margin), most_(query.margin) {
  check(query.margin, "margin");
  if (!query.margins.empty() && !query.pair_margins.empty())
    reject("margins: either entries or one for each pair, not both");
  if (!query.margins.empty()) each_ = from_entries(query, scene, pairs);
  if (!query.pair_margins.empty()) {
    if (query.pair_margins.size() != pairs.size())
      reject("pair_margins: expected one for each of " + std::to_string(pairs.size()) + " pairs, got " +
             std::to_string(query.pair_margins.size()));
    for (std::size_t i = 0; i < query.pair_margins.size(); ++i)
      check(query.pair_margins[i], "pair_margins[" + std::to_string(i) + "]");
    each_.assign(query.pair_margins.begin(), query.pair_margins.end());
  }
  if (each_.empty()) return;
  const auto [least, most] = std::minmax_element(each_.begin(), each_.end());
  least_ = *least;
  most_ = *most;
}

}  // namespace clearance
