#include "engine/query/plan.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <string>

#include "engine/base/digest.h"
#include "engine/narrow/work_meter.h"

namespace clearance {

std::span<const BodyPair> PairList::slice(std::uint64_t begin, std::uint64_t count, std::vector<BodyPair>& room) const {
  assert(begin + count <= size());
  if (!table_) return std::span(pairs_).subspan(begin, count);
  room.resize(count);
  table_->copy(begin, count, room.data());
  return room;
}

BodyPair PairList::at(std::uint64_t position) const {
  assert(position < size());
  if (!table_) return pairs_[position];
  BodyPair pair;
  table_->copy(position, 1, &pair);
  return pair;
}

namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw QueryError(QueryErrorCode::kBadQuery, what);
}

void check_numbers(const QueryView& q) {
  if (!(q.max_distance >= 0)) refuse("max_distance: expected metres >= 0, got " + std::to_string(q.max_distance));
  if (!(q.abs_tol >= 0) || std::isinf(q.abs_tol))
    refuse("abs_tol: expected metres >= 0, got " + std::to_string(q.abs_tol));
  if (std::isnan(q.rel_tol) || q.rel_tol >= 1)
    refuse("rel_tol: expected a ratio below 1, got " + std::to_string(q.rel_tol));
  if (q.precision > Precision::kF32) refuse("precision: unknown value " + std::to_string(int(q.precision)));
  if (q.reduce > Reduce::kMin) refuse("reduce: unknown value " + std::to_string(int(q.reduce)));
  if (q.format > Format::kCompact) refuse("format: unknown value " + std::to_string(int(q.format)));
  if (q.fields >= 1u << kFieldCount) refuse("fields: unknown bits in " + std::to_string(q.fields));
  if (q.max_pose_age_ns < 0)
    refuse("max_pose_age_ns: expected nanoseconds >= 0, got " + std::to_string(q.max_pose_age_ns));
  if (q.stale_status && q.max_pose_age_ns == 0) refuse("stale_status: is for a query with max_pose_age_ns");
}

// Ascending, each once.
std::vector<std::uint32_t> members(std::uint32_t selector, const Scene& scene, std::size_t position) {
  std::vector<std::uint32_t> all;
  if (selector == kEveryBody) {
    all.resize(scene.bodies().size());
    for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  } else if (selector & kGroupBit) {
    const std::uint32_t group = selector & ~kGroupBit;
    if (group >= scene.groups().size())
      refuse("pairs[" + std::to_string(position) + "]: unknown group " + std::to_string(group) + "; the scene has " +
             std::to_string(scene.groups().size()));
    all = scene.groups()[group].bodies;
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
  } else if (selector < scene.bodies().size()) {
    all.push_back(selector);
  }
  return all;
}

// Appends the enabled pairs of a body of `as` and one of `bs`, each once, in lexicographic order; both ascending.
void append_enabled(const std::vector<std::uint32_t>& as, const std::vector<std::uint32_t>& bs, const PairTable& table,
                    std::vector<BodyPair>& pairs) {
  std::vector<std::uint32_t> all;
  std::set_union(as.begin(), as.end(), bs.begin(), bs.end(), std::back_inserter(all));
  const auto has = [](const std::vector<std::uint32_t>& bodies, std::uint32_t body) {
    return std::binary_search(bodies.begin(), bodies.end(), body);
  };
  for (const std::uint32_t body : all) {
    const std::vector<std::uint32_t>& others = !has(as, body) ? as : !has(bs, body) ? bs : all;
    for (auto other = std::upper_bound(others.begin(), others.end(), body); other != others.end(); ++other)
      if (table.enabled(body, *other)) pairs.push_back({body, *other});
  }
}

// Pairs of bodies that the groups of one query may name together: as many as the largest request could name itself. A
// few bytes would fill memory otherwise.
constexpr std::uint64_t kPairsPerUnit = 16;  // of work: that are listed
constexpr std::uint64_t kMaxNamedByGroups = std::uint64_t{1} << 25;

void check_named_by_groups(std::span<const BodyPair> pairs, const Scene& scene) {
  const auto count = [&scene](std::uint32_t selector) -> std::uint64_t {
    if (selector == kEveryBody) return scene.bodies().size();
    const std::uint32_t group = selector & ~kGroupBit;
    return !(selector & kGroupBit) ? 1 : group < scene.groups().size() ? scene.groups()[group].bodies.size() : 0;
  };
  std::uint64_t named = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::uint64_t as = count(pairs[i].a), bs = count(pairs[i].b);
    named += (pairs[i].a | pairs[i].b) & kGroupBit ? std::max(as * bs, as + bs) : 1;  // looking them up takes time, too
    if (named > kMaxNamedByGroups)
      throw QueryError(QueryErrorCode::kTooLarge, "pairs[" + std::to_string(i) + "]: with it groups name " +
                                                      std::to_string(named) + " pairs, more than the " +
                                                      std::to_string(kMaxNamedByGroups) +
                                                      " of one query: split it, or ask about all pairs");
  }
}

// Explicit pairs as given; a pair with a group expands to its enabled pairs, each once, in lexicographic order.
std::vector<BodyPair> expand(const QueryView& q, const Scene& scene, const PairTable& table) {
  const auto plain = [](BodyPair p) { return !((p.a | p.b) & kGroupBit) && p.a != p.b; };
  if (std::all_of(q.pairs.begin(), q.pairs.end(), plain)) return {q.pairs.begin(), q.pairs.end()};
  check_named_by_groups(q.pairs, scene);
  std::vector<BodyPair> pairs;
  for (std::size_t i = 0; i < q.pairs.size(); ++i) {
    const BodyPair p = q.pairs[i];
    if (!(p.a & kGroupBit) && !(p.b & kGroupBit)) {
      if (p.a == p.b) refuse("pairs[" + std::to_string(i) + "]: body " + std::to_string(p.a) + " with itself");
      pairs.push_back(p);
      continue;
    }
    append_enabled(members(p.a, scene, i), members(p.b, scene, i), table, pairs);
  }
  return pairs;
}

// In lexicographic order: a moved body with all that follow it, another one with the moved that follow it.
std::vector<BodyPair> pairs_of_moved(const std::vector<std::uint32_t>& moved, const Scene& scene,
                                     const PairTable& table) {
  const auto n = static_cast<std::uint32_t>(scene.bodies().size());
  std::vector<std::uint32_t> ascending(moved);
  std::sort(ascending.begin(), ascending.end());
  std::vector<BodyPair> pairs;
  auto next = ascending.begin();  // the first that is not below a
  for (std::uint32_t a = 0; a < n && next != ascending.end(); ++a) {
    if (*next == a) {
      ++next;
      for (std::uint32_t b = a + 1; b < n; ++b)
        if (table.enabled(a, b)) pairs.push_back({a, b});
    } else {
      for (auto b = next; b != ascending.end(); ++b)
        if (table.enabled(a, *b)) pairs.push_back({a, *b});
    }
  }
  return pairs;
}

std::uint32_t written_fields(const QueryView& q) {
  constexpr std::uint32_t kPacked =
      kFieldDistance | kFieldLower | kFieldUpper | kFieldPoints | kFieldNormal | kFieldGradient;
  std::uint32_t fields =
      q.format == Format::kCompact ? (q.fields & ~kPacked) | kFieldCompact : q.fields & ~kFieldCompact;
  if (q.reduce != Reduce::kNone) fields |= kFieldPair;
  if (q.reduce == Reduce::kWithin) fields |= kFieldConfiguration;
  return fields;
}

// All pairs have changed whatever has, and with a body more or less there is a row more or less for the nearest of
// each.
bool still_means(const QueryView& query, const PoseSnapshot& snapshot, const Scene& scene) {
  return !query.all_pairs && snapshot.history->still_means(
                                 {query.scene_revision, query.bodies, query.pairs, query.reduce == Reduce::kNearest},
                                 snapshot.scene_changes, scene);
}

}  // namespace

Plan make_plan(const QueryView& query, const Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
               std::uint64_t max_rows, bool with_configurations) {
  check_numbers(query);
  if (query.scene_revision != 0 && query.scene_revision != snapshot->scene_revision &&
      !still_means(query, *snapshot, scene))
    throw QueryError(QueryErrorCode::kWrongScene, "the scene is revision " + std::to_string(snapshot->scene_revision) +
                                                      ", the query is for " + std::to_string(query.scene_revision));
  Plan plan;
  plan.query = query;
  if (plan.query.rel_tol < 0) plan.query.rel_tol = default_rel_tol(query.precision);
  plan.snapshot = std::move(snapshot);

  std::vector<std::uint8_t> seen(scene.bodies().size(), 0);
  for (std::size_t i = 0; i < query.bodies.size(); ++i) {
    const std::uint32_t b = query.bodies[i];
    const std::string place = "bodies[" + std::to_string(i) + "]: ";
    if (b >= scene.bodies().size()) refuse(place + "unknown body " + std::to_string(b));
    if (scene.bodies()[b].is_static) refuse(place + "'" + scene.bodies()[b].name + "' is static and cannot be moved");
    if (seen[b]++) refuse(place + "'" + scene.bodies()[b].name + "' is named twice");
  }
  if (query.configuration_count > 0 && query.bodies.empty()) refuse("configurations without bodies that they move");
  plan.bodies.assign(query.bodies.begin(), query.bodies.end());
  plan.query.bodies = plan.bodies;
  plan.query.configurations = {};
  if (with_configurations) {
    const std::uint64_t wanted = std::uint64_t{query.configuration_count} * query.bodies.size();
    if (query.configurations.size() != wanted)
      refuse("configurations: expected " + std::to_string(wanted) + " poses (" +
             std::to_string(query.configuration_count) + " x " + std::to_string(query.bodies.size()) + "), got " +
             std::to_string(query.configurations.size()));
    plan.configurations = query.configurations;
  }

  const PairTable& table = *plan.snapshot->pairs;
  plan.moved = plan.snapshot->with_followers(plan.bodies);
  const bool every = query.pairs.size() == 1 && query.pairs[0] == BodyPair{kEveryBody, kEveryBody};
  if (!query.all_pairs &&
      !(query.bodies.empty() && (every || table.is(query.pairs))))  // who sends the table back means all of it
    plan.pairs = PairList(expand(query, scene, table));
  else if (!query.bodies.empty())
    plan.pairs = PairList(pairs_of_moved(plan.moved, scene, table));
  else
    plan.pairs = PairList(plan.snapshot->pairs);
  plan.query.pairs = {};
  units_of_this_thread +=
      (plan.pairs.list().size() + query.pairs.size() + query.bodies.size()) / kPairsPerUnit + seen.size() / 1024;

  QuerySize& size = plan.size;
  size.configurations = std::max<std::uint64_t>(query.configuration_count, 1);
  size.pairs = plan.pairs.size();
  size.fields = written_fields(query);
  // K and P are below 2^32 and 2^64 / 2^32 rows would never pass max_rows: compare by division.
  const std::uint64_t per_configuration = query.reduce == Reduce::kMin       ? 1
                                          : query.reduce == Reduce::kNearest ? scene.bodies().size()
                                                                             : size.pairs;
  const bool too_many = per_configuration > 0 && size.configurations > max_rows / per_configuration;
  size.rows = too_many ? max_rows + 1 : size.configurations * per_configuration;
  if (query.reduce == Reduce::kWithin) size.rows = std::min(size.rows, query.max_results);
  if (size.rows > max_rows)
    throw QueryError(QueryErrorCode::kTooLarge, std::to_string(size.configurations) + " configurations x " +
                                                    std::to_string(per_configuration) +
                                                    " rows are more than the limit of " + std::to_string(max_rows));
  return plan;
}

void Plan::keep_configurations() {
  if (configurations.data() == kept_configurations.data()) return;
  count_copied(configurations.size_bytes());
  kept_configurations.assign(configurations.begin(), configurations.end());
  configurations = kept_configurations;
}

std::uint64_t warm_question(const Plan& plan) {
  Digest d;
  d.add(plan.snapshot->scene_revision);
  d.add(plan.size.configurations);
  d.add(plan.size.pairs);
  for (const BodyPair pair : plan.pairs.list()) d.add(std::uint64_t{pair.a} << 32 | pair.b);
  return d.value();
}

}  // namespace clearance
