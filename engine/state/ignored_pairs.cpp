#include "engine/state/ignored_pairs.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "engine/base/query_error.h"

namespace clearance {

namespace {

BodyPair in_order(std::uint32_t a, std::uint32_t b) {
  return {std::min(a, b), std::max(a, b)};
}

std::vector<BodyPair> pairs_of(const engine::Scene& scene) {
  std::vector<BodyPair> pairs;
  for (const auto& [a, b] : scene.ignored()) pairs.push_back(in_order(a, b));
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

// The bodies that a selector names, as a mask.
std::vector<std::uint8_t> named(std::uint32_t selector, const engine::Scene& scene) {
  const auto reject = [](const std::string& what) {
    throw engine::QueryError(QueryErrorCode::kBadQuery, "allow, forbid: unknown " + what);
  };
  std::vector<std::uint8_t> is_named(scene.bodies().size(), selector == kEveryBody);
  if (selector == kEveryBody) return is_named;
  const std::uint32_t index = selector & ~kGroupBit;
  if (selector & kGroupBit) {
    if (index >= scene.groups().size()) reject("group " + std::to_string(index));
    for (const std::uint32_t body : scene.groups()[index].bodies) is_named[body] = 1;
  } else {
    if (index >= scene.bodies().size()) reject("body " + std::to_string(index));
    is_named[index] = 1;
  }
  return is_named;
}

[[noreturn]] void reject_number(std::size_t pairs) {
  throw engine::QueryError(QueryErrorCode::kTooLarge, "allow: " + std::to_string(pairs) + " pairs, more than the " +
                                                          std::to_string(IgnoredPairs::kMostAdded) +
                                                          " that a scene may be given at run time");
}

// Ascending pairs, each once.
std::vector<BodyPair> pairs_named(std::uint32_t a, std::uint32_t b, const engine::Scene& scene) {
  const std::vector<std::uint8_t> of_a = named(a, scene), of_b = named(b, scene);
  const auto count = [](const auto& is_named) {
    return static_cast<std::size_t>(std::count(is_named.begin(), is_named.end(), 1));
  };
  if (count(of_a) * count(of_b) > 2 * IgnoredPairs::kMostAdded) reject_number(count(of_a) * count(of_b));
  std::vector<std::uint32_t> members;
  for (std::uint32_t j = 0; j < of_b.size(); ++j)
    if (of_b[j]) members.push_back(j);
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < of_a.size(); ++i)
    for (const std::uint32_t j : of_a[i] ? std::span(members) : std::span<std::uint32_t>())
      if (i != j && !(scene.bodies()[i].is_static && scene.bodies()[j].is_static)) pairs.push_back(in_order(i, j));
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

std::vector<BodyPair> united(std::span<const BodyPair> a, std::span<const BodyPair> b) {
  std::vector<BodyPair> all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  return all;
}

std::vector<BodyPair> without(std::span<const BodyPair> a, std::span<const BodyPair> b) {
  std::vector<BodyPair> left;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(left));
  return left;
}

}  // namespace

std::vector<BodyPair> changed_pairs(std::span<const BodyPair> was, std::span<const BodyPair> is) {
  std::vector<BodyPair> changed;
  std::set_symmetric_difference(was.begin(), was.end(), is.begin(), is.end(), std::back_inserter(changed));
  return changed;
}

IgnoredPairs::IgnoredPairs(const engine::Scene& scene)
    : of_scene_(scene.ignored().size()), always_(pairs_of(scene)), all_(always_) {}

void IgnoredPairs::merge() {
  std::vector<BodyPair> held;
  for (const Held& h : held_) held.push_back(h.pair);
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  all_ = united(always_, held);
}

void IgnoredPairs::allow(std::uint32_t a, std::uint32_t b, const engine::Scene& scene) {
  std::vector<BodyPair> more = united(always_, pairs_named(a, b, scene));
  if (more.size() + held_.size() > of_scene_ + kMostAdded) reject_number(more.size() + held_.size() - of_scene_);
  always_ = std::move(more);
  merge();
}

void IgnoredPairs::forbid(std::uint32_t a, std::uint32_t b, const engine::Scene& scene) {
  const std::vector<std::uint8_t> of_a = named(a, scene), of_b = named(b, scene);
  const auto is_named = [&](BodyPair p) { return (of_a[p.a] && of_b[p.b]) || (of_a[p.b] && of_b[p.a]); };
  std::erase_if(always_, is_named);
  std::erase_if(held_, [&](const Held& h) { return is_named(h.pair); });
  merge();
}

void IgnoredPairs::allow_attached(std::uint32_t child, std::span<const std::uint32_t> others,
                                  const engine::Scene& scene) {
  std::vector<Held> fresh;
  for (const std::uint32_t other : others) {
    for (const BodyPair pair : pairs_named(child, other, scene)) fresh.push_back({pair, child});
    if (const std::size_t all = always_.size() + held_.size() + fresh.size(); all > of_scene_ + kMostAdded)
      reject_number(all - of_scene_);
  }
  held_.insert(held_.end(), fresh.begin(), fresh.end());
  merge();
}

void IgnoredPairs::release(std::uint32_t child) {
  std::erase_if(held_, [&](const Held& h) { return h.child == child; });
  merge();
}

void IgnoredPairs::take_over(const IgnoredPairs& old, const engine::Scene& old_scene,
                             std::span<const std::uint32_t> now, std::span<const std::uint8_t> keeps,
                             const engine::Scene& scene) {
  const auto translated = [&](std::span<const BodyPair> pairs) {
    std::vector<BodyPair> mine;
    for (const BodyPair p : pairs)
      if (now[p.a] != kNone && now[p.b] != kNone &&
          !(scene.bodies()[now[p.a]].is_static && scene.bodies()[now[p.b]].is_static))
        mine.push_back(in_order(now[p.a], now[p.b]));
    std::sort(mine.begin(), mine.end());
    return mine;
  };
  const std::vector<BodyPair> loaded = pairs_of(old_scene);
  always_ =
      without(united(always_, translated(without(old.always_, loaded))), translated(without(loaded, old.always_)));
  for (const Held& h : old.held_) {
    const std::vector<BodyPair> pair = translated(std::span(&h.pair, 1));
    if (now[h.child] != kNone && keeps[now[h.child]] && !pair.empty()) held_.push_back({pair[0], now[h.child]});
  }
  merge();
}

}  // namespace clearance
