#include "engine/selection/pair_lister.h"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <numeric>
#include <string>

namespace clearance {

void PairList::copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const {
  assert(begin + count <= size());
  if (table_)
    table_->copy(begin, count, out);
  else
    std::copy_n(pairs_->begin() + static_cast<std::ptrdiff_t>(begin), count, out);
}

std::span<const BodyPair> PairList::slice(std::uint64_t begin, std::uint64_t count,
                                          std::vector<BodyPair>& storage) const {
  if (!table_) return list().subspan(begin, count);
  storage.resize(count);
  copy(begin, count, storage.data());
  return storage;
}

BodyPair PairList::at(std::uint64_t position) const {
  BodyPair pair;
  copy(position, 1, &pair);
  return pair;
}

namespace {

constexpr std::uint64_t kPairsPerUnit = 16;   // pairs visited per unit of work
constexpr std::uint64_t kPairsPerTurn = 512;  // pairs visited between tests of the meter

// Limit on the pairs that the groups of one query name together: as many as the largest request could list. Otherwise a
// few bytes could exhaust memory.
constexpr std::uint64_t kMaxNamedByGroups = std::uint64_t{1} << 25;

bool has(const std::vector<std::uint32_t>& ascending, std::uint32_t body) {
  return std::binary_search(ascending.begin(), ascending.end(), body);
}

[[noreturn]] void reject(std::uint64_t position, const std::string& what) {
  throw engine::QueryError(QueryErrorCode::kBadQuery, "pairs[" + std::to_string(position) + "]: " + what);
}

}  // namespace

PairLister::PairLister(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PairTable> table,
                       std::span<const std::uint32_t> moved)
    : scene_(scene), table_(std::move(table)) {
  const bool every = query.all_pairs || (query.pairs.size() == 1 && query.pairs[0] == BodyPair{kEveryBody, kEveryBody});
  if (moved.empty() && every) {
    step_ = ListingStep::kTable;
  } else if (query.all_pairs) {
    std::vector<std::uint32_t> ascending(moved.begin(), moved.end());
    std::sort(ascending.begin(), ascending.end());
    pairs_.reserve(std::min<std::uint64_t>(table_->size(), ascending.size() * scene.bodies().size()));
    begin_expanding(std::move(ascending), members(kEveryBody));
  } else {
    named_ = query.pairs;
    step_ = moved.empty() && named_.size() == table_->size() ? ListingStep::kCompare : ListingStep::kCount;
  }
}

bool PairLister::advance(WorkMeter& meter) {
  while (!is_done()) {
    const std::uint64_t visited = step_ == ListingStep::kCompare ? compare_some()
                                  : step_ == ListingStep::kCount ? count_some()
                                  : step_ == ListingStep::kList  ? list_some()
                                                                 : expand_some();
    meter.count(visited / kPairsPerUnit);
    if (!is_done() && meter.is_over()) return false;
  }
  return true;
}

// Whether the list is the scene's whole table, as returned to clients.
std::uint64_t PairLister::compare_some() {
  BodyPair storage[kPairsPerTurn];
  const std::uint64_t count = std::min(kPairsPerTurn, table_->size() - next_);
  table_->copy(next_, count, storage);
  if (!std::equal(storage, storage + count, named_.begin() + static_cast<std::ptrdiff_t>(next_))) {
    step_ = ListingStep::kCount;
    next_ = 0;
  } else if ((next_ += count) == table_->size()) {
    step_ = ListingStep::kTable;
  }
  return count;
}

// Counts an upper bound on the named pairs, since listing them takes time as well.
std::uint64_t PairLister::count_some() {
  const std::uint64_t begin = next_, end = std::min<std::uint64_t>(begin + kPairsPerTurn, named_.size());
  for (; next_ < end; ++next_) {
    const BodyPair p = named_[next_];
    const std::uint64_t as = bodies_named(p.a), bs = bodies_named(p.b);
    const bool is_group = (p.a | p.b) & kGroupBit;
    has_group_ |= is_group;
    most_ += is_group ? std::max(as * bs, as + bs) : 1;
    if (has_group_ && most_ > kMaxNamedByGroups)
      throw engine::QueryError(QueryErrorCode::kTooLarge, "pairs[" + std::to_string(next_) + "]: with it groups name " +
                                                              std::to_string(most_) + " pairs, more than the " +
                                                              std::to_string(kMaxNamedByGroups) +
                                                              " of one query: split it, or query all pairs");
  }
  if (next_ == named_.size()) {
    step_ = ListingStep::kList;
    next_ = 0;
    pairs_.reserve(most_);  // once, because moving millions of them takes long
  }
  return end - begin;
}

std::uint64_t PairLister::list_some() {
  const std::uint64_t begin = next_, end = std::min<std::uint64_t>(begin + kPairsPerTurn, named_.size());
  while (next_ < end) {
    const BodyPair p = named_[next_];
    if ((p.a | p.b) & kGroupBit) {
      begin_expanding(members(p.a), members(p.b));
      ++next_;
      return next_ - begin + both_.size();
    }
    if (p.a == p.b) reject(next_, "body " + std::to_string(p.a) + " with itself");
    for (const std::uint32_t body : {p.a, p.b})
      if (body < scene_.bodies().size() && scene_.bodies()[body].parts.empty())
        reject(next_, "'" + scene_.bodies()[body].name + "' is a frame without geometry");
    pairs_.push_back(p);
    ++next_;
  }
  if (next_ == named_.size()) step_ = ListingStep::kDone;
  return end - begin;
}

// Sorts, and removes repeats.
std::vector<std::uint32_t> PairLister::members(std::uint32_t selector) const {
  std::vector<std::uint32_t> all;
  if (selector == kEveryBody) {
    all.resize(scene_.bodies().size());
    std::iota(all.begin(), all.end(), 0);
  } else if (selector & kGroupBit) {
    const std::uint32_t group = selector & ~kGroupBit;
    if (group >= scene_.groups().size())
      reject(next_,
             "unknown group " + std::to_string(group) + "; the scene has " + std::to_string(scene_.groups().size()));
    all = scene_.groups()[group].bodies;
  } else if (selector < scene_.bodies().size()) {
    all.push_back(selector);
  }
  assert(std::is_sorted(all.begin(), all.end()));
  return all;
}

std::uint64_t PairLister::bodies_named(std::uint32_t selector) const {
  if (selector == kEveryBody) return scene_.bodies().size();
  if (!(selector & kGroupBit)) return 1;
  const std::uint32_t group = selector & ~kGroupBit;
  return group < scene_.groups().size() ? scene_.groups()[group].bodies.size() : 0;
}

void PairLister::begin_expanding(std::vector<std::uint32_t> as, std::vector<std::uint32_t> bs) {
  as_ = std::move(as);
  bs_ = std::move(bs);
  both_.clear();
  std::set_union(as_.begin(), as_.end(), bs_.begin(), bs_.end(), std::back_inserter(both_));
  body_ = other_ = 0;
  step_ = ListingStep::kExpand;
}

// Lists the enabled pairs of a body in as_ and one in bs_, each once, in lexicographic order: each body with later ones
// of the other side.
std::uint64_t PairLister::expand_some() {
  std::uint64_t visited = 0;
  for (; body_ < both_.size() && visited < kPairsPerTurn; ++body_, other_ = 0) {
    const std::uint32_t body = both_[body_];
    const std::vector<std::uint32_t>& others = !has(as_, body) ? as_ : !has(bs_, body) ? bs_ : both_;
    if (other_ == 0)
      other_ = static_cast<std::size_t>(std::upper_bound(others.begin(), others.end(), body) - others.begin());
    ++visited;
    for (; other_ < others.size(); ++other_) {
      if (visited++ == kPairsPerTurn) return visited;
      if (table_->enabled(body, others[other_])) pairs_.push_back({body, others[other_]});
    }
  }
  if (body_ == both_.size()) step_ = named_.empty() ? ListingStep::kDone : ListingStep::kList;
  return visited;
}

}  // namespace clearance
