#include "tests/oracle/states/state_oracle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/engine/same_rows.h"
#include "tests/oracle/states/exact_state.h"
#include "tests/oracle/states/state_round.h"

namespace clearance::exact {
namespace {

constexpr int kFreeStates = 64;

}  // namespace

std::string name_of(StateKind kind) {
  constexpr std::array<const char*, kStateKinds> kNames = {"uniform", "near", "touching", "deep"};
  return kNames[static_cast<std::size_t>(kind)];
}

void StateTally::add(const StateTally& o) {
  count += o.count, free += o.free, hit += o.hit, wrong += o.wrong, fewer += o.fewer, more += o.more;
  other_pairs += o.other_pairs, other_bits += o.other_bits, exact += o.exact, untrue += o.untrue;
  close_free += o.close_free, close_hit += o.close_hit, inside += o.inside, pairs += o.pairs, open += o.open;
}

std::string StateTally::text() const {
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%lld (%lld free, %lld hit): %lld wrong, %lld fewer, %lld more, %lld other pairs, %lld other bits; "
      "%lld of %lld contradict the oracle; within 1 mm %lld free, %lld hit; %lld with an obstacle inside; exact pairs "
      "%lld -> %lld",
      static_cast<long long>(count), static_cast<long long>(free), static_cast<long long>(hit),
      static_cast<long long>(wrong), static_cast<long long>(fewer), static_cast<long long>(more),
      static_cast<long long>(other_pairs), static_cast<long long>(other_bits), static_cast<long long>(untrue),
      static_cast<long long>(exact), static_cast<long long>(close_free), static_cast<long long>(close_hit),
      static_cast<long long>(inside), static_cast<long long>(pairs), static_cast<long long>(open));
  return text;
}

RobotCovers covers_of(const RobotScene& made) {
  const auto robot =
      std::make_shared<const engine::Engine>(engine::Scene(made.robot), engine::Engine::Options{.threads = 1});
  if (!robot->wait_covers(std::chrono::minutes(10))) throw std::runtime_error("covers are not made in time");
  return {robot, robot->cover_store(), robot->joint_table_store()};
}

StateOracle::StateOracle(const RobotScene& made, const RobotCovers& of_robot)
    : made_(made),
      without_(engine::Scene(made.scene), {.threads = 1, .covers = engine::Covers::kOff}),
      with_(engine::Scene(made.scene),
            {.threads = 1, .cover_store = of_robot.covers, .joint_table_store = of_robot.tables}) {
  for (std::uint32_t j = 0; j < made_.scene.joints().size(); ++j) joints_.push_back(j);
  park();
  Random random(1);
  for (std::size_t m = 0; m < kStateMargins.size(); ++m)
    for (int tries = 0; tries < 20'000 && free_[m].size() < kFreeStates; ++tries) {
      const std::vector<double> q = uniform_state(random);
      const test::Answer answer = test::evaluate(without_, query_of(joints_, q, kStateMargins[m]));
      if (is_free(static_cast<Status>(answer.view.verdict[0]))) free_[m].push_back(q);
    }
}

std::vector<double> StateOracle::uniform_state(Random& random) const {
  std::vector<double> q;
  for (const SceneJoint& joint : made_.scene.joints())
    q.push_back(random.uniform(std::max(joint.lower, -3.15), std::min(joint.upper, 3.15)));
  return q;
}

std::vector<double> StateOracle::free_state(std::size_t margin, Random& random) {
  const auto& pool = free_[margin];
  if (pool.empty()) return uniform_state(random);
  return pool[static_cast<std::size_t>(random.integer(0, static_cast<int>(pool.size()) - 1))];
}

void StateOracle::set_pose(std::uint32_t body, const Pose& X) {
  const BodyPose pose[] = {{body, X}};
  without_.set_poses(pose);
  with_.set_poses(pose);
}

void StateOracle::park() {
  for (std::size_t i = 0; i < made_.obstacles.size(); ++i)
    set_pose(made_.obstacles[i], Pose{{100 + 10 * static_cast<double>(i), 0, 0}});
  placed_.clear();
}

// Turns an obstacle at random, and moves it towards a link along their witness points. Returns the distance that this
// leaves for convex bodies, or infinity if it cannot be placed.
double StateOracle::put(std::uint32_t obstacle, std::uint32_t link, const std::vector<double>& q, double gap,
                        Random& random) {
  Pose X = random.rotation(random.direction() * 5.0);
  set_pose(obstacle, X);
  const BodyPair pair[] = {{link, obstacle}};
  QueryView query;
  query.joints = joints_;
  query.positions = q;
  query.configuration_count = 1;
  query.all_pairs = false;
  query.pairs = pair;
  query.fields = kFieldDistance | kFieldStatus | kFieldPoints;
  const test::Answer answer = test::evaluate(without_, query);
  if (answer.view.status[0] != static_cast<std::uint8_t>(Status::kOk)) return kInf;
  const double *a = answer.view.point_a, *b = answer.view.point_b;
  const Vec3d way{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  X.translation += way * ((answer.view.distance[0] - gap) / norm(way));
  set_pose(obstacle, X);
  placed_.push_back(obstacle);
  return gap;
}

void StateOracle::place_obstacles(Round& round, Random& random) {
  const auto any_of = [&](const std::vector<std::uint32_t>& from) {
    return from[static_cast<std::size_t>(random.integer(0, static_cast<int>(from.size()) - 1))];
  };
  round.through = free_state(round.margin_index, random);
  if (round.is_close()) {
    round.gap = round.kind == StateKind::kDeep ? -random.log_uniform(0.005, 0.15)
                                               : random.sign() * random.log_uniform(1e-5, 8e-3);
    const double gap =
        put(any_of(made_.obstacles), any_of(made_.links), round.through, round.margin + round.gap, random);
    if (gap == kInf) round.gap = kInf;
  } else {
    for (int n = random.integer(1, 4); n > 0; --n)
      put(any_of(made_.obstacles), any_of(made_.links), free_state(round.margin_index, random),
          random.uniform(-0.02, 0.3), random);
  }
}

void StateOracle::add_states(Round& round, Random& random) {
  round.count = round.is_close() ? 8 : 64;
  const double spread = round.is_close() ? 1e-4 : 0.03;
  for (std::size_t k = 0; k < round.count; ++k) {
    std::vector<double> state = round.kind == StateKind::kUniform ? uniform_state(random) : round.through;
    if (round.kind != StateKind::kUniform && k > 0)
      for (double& position : state) position += random.uniform(-spread, spread);
    round.positions.insert(round.positions.end(), state.begin(), state.end());
  }
  // Positions that covers cannot use.
  if (round.kind == StateKind::kUniform && random.chance(0.25)) {
    const double odd[] = {std::nan(""), kInf, 1e7, -9e5, 1e3, -40.0};
    const std::size_t at = static_cast<std::size_t>(random.integer(0, static_cast<int>(round.positions.size()) - 1));
    round.positions[at] = odd[random.integer(0, 5)];
  }
}

// Hangs the last placed obstacle onto a link.
void StateOracle::attach_last(Random& random) {
  const std::uint32_t link =
      made_.links[static_cast<std::size_t>(random.integer(0, static_cast<int>(made_.links.size()) - 1))];
  const Pose X = random.rotation(random.direction() * 0.2);
  for (engine::Engine* engine : {&without_, &with_}) engine->attach(placed_.back(), link, &X);
}

// Hangs an obstacle onto a link for some rounds.
void StateOracle::attach_some(Round& round, Random& random) {
  round.is_attached = round.kind <= StateKind::kNear && !placed_.empty() && random.chance(0.125);
  if (round.is_attached) attach_last(random);
}

void StateOracle::end(const Round& round) {
  if (round.is_attached)
    for (engine::Engine* engine : {&without_, &with_}) engine->attach(placed_.back(), kNone);
  park();
}

void StateOracle::compare_round(Round& round, Random& random, StateTally& tally, Comparison comparison) {
  attach_some(round, random);
  (this->*comparison)(round, random, tally);
  end(round);
}

void StateOracle::round(StateKind kind, std::size_t margin, Random& random, StateTally& tally) {
  Round round{.kind = kind, .margin = kStateMargins[margin], .margin_index = margin};
  place_obstacles(round, random);
  add_states(round, random);
  compare_round(round, random, tally, &StateOracle::compare);
}

// Sometimes a margin of its own for one obstacle: the others have none.
std::vector<MarginEntry> StateOracle::some_margins(const Round& round, Random& random, QueryView& query) const {
  std::vector<MarginEntry> entries;
  if (!random.chance(0.125) || placed_.empty()) return entries;
  entries.push_back({placed_.back(), kEveryBody, round.margin});
  query.margin = 0;
  query.margins = entries;
  return entries;
}

void StateOracle::count(const Round& round, const ReplyView& expected, const ReplyView& found,
                        StateTally& tally) const {
  for (std::size_t k = 0; k < round.count; ++k) {
    const auto e = static_cast<Status>(expected.verdict[k]), f = static_cast<Status>(found.verdict[k]);
    ++tally.count;
    tally.free += is_free(f);
    tally.hit += is_hit(f);
    tally.wrong += (is_free(e) && is_hit(f)) || (is_hit(e) && is_free(f));
    tally.fewer += is_decided(e) && !is_decided(f);
    tally.more += !is_decided(e) && is_decided(f);
    const bool is_close = round.margin == 0 && std::abs(round.gap) < 1e-3;
    tally.close_free += is_close && is_free(f);
    tally.close_hit += is_close && is_hit(f);
    tally.inside += round.kind == StateKind::kDeep && is_hit(f) && round.gap < -0.02;
  }
}

void StateOracle::compare(const Round& round, Random& random, StateTally& tally) {
  QueryView query = query_of(joints_, round.positions, round.margin);
  const std::vector<MarginEntry> entries = some_margins(round, random, query);
  const test::Answer expected = test::evaluate(without_, query);
  const bool names_pair = random.chance(0.5);
  if (!names_pair) query.fields = kFieldVerdict;
  test::evaluate(with_, query);  // covers may pay from the second answer on a snapshot on
  const test::Answer found = test::evaluate(with_, query);
  tally.pairs += static_cast<std::int64_t>(expected.info.pairs_evaluated);
  tally.open += static_cast<std::int64_t>(found.info.pairs_evaluated);
  count(round, expected.view, found.view, tally);
  for (std::size_t k = 0; k < round.count; ++k) {
    const auto e = static_cast<Status>(expected.view.verdict[k]), f = static_cast<Status>(found.view.verdict[k]);
    tally.other_pairs += (names_pair && is_hit(e) && is_hit(f) && expected.view.pair[k] != found.view.pair[k]) ||
                         (!is_decided(e) && !is_decided(f) && e != f);
  }
  const auto chosen = static_cast<std::size_t>(random.integer(0, static_cast<int>(round.count) - 1));
  if (entries.empty() && made_.has_oracle())
    solve(query, chosen, static_cast<Status>(found.view.verdict[chosen]), tally);
  if (random.chance(0.0625)) compare_bits(query, tally);
}

// Today's columns of a check keep their bits, also one state at a time.
void StateOracle::compare_bits(const QueryView& batch, StateTally& tally) {
  QueryView query = batch;
  query.fields = kFieldLower | kFieldUpper | kFieldStatus | kFieldPair;
  const test::Answer expected = test::evaluate(without_, query);
  const std::size_t width = joints_.size();
  query.configuration_count = 1;
  for (std::size_t k = 0; k < batch.configuration_count; ++k) {
    query.positions = batch.positions.subspan(k * width, width);
    const test::Answer found = test::evaluate(with_, query);
    const ReplyView &e = expected.view, &f = found.view;
    tally.other_bits += e.status[k] != f.status[0] || e.pair[k] != f.pair[0] ||
                        std::memcmp(&e.lower[k], &f.lower[0], sizeof(double)) != 0 ||
                        std::memcmp(&e.upper[k], &f.upper[0], sizeof(double)) != 0;
  }
}

// Whether the oracle contradicts a free state for some pair, or a hit for all.
bool StateOracle::is_contradicted(const QueryView& query, std::span<const double> positions, Status verdict) const {
  const std::vector<PlacedBody> bodies = placed_bodies(made_, with_, positions);
  const std::vector<BodyPair> pairs = with_.pairs(for_pairs(query));
  if (is_free(verdict))
    return std::any_of(pairs.begin(), pairs.end(),
                       [&](BodyPair p) { return is_nearer(bodies[p.a], bodies[p.b], query.margin); });
  return std::all_of(pairs.begin(), pairs.end(),
                     [&](BodyPair p) { return is_farther(bodies[p.a], bodies[p.b], query.margin); });
}

void StateOracle::solve(const QueryView& batch, std::size_t state, Status verdict, StateTally& tally) {
  const std::size_t width = joints_.size();
  const auto positions = batch.positions.subspan(state * width, width);
  const bool is_finite = std::all_of(positions.begin(), positions.end(), [](double q) { return std::isfinite(q); });
  if (!is_decided(verdict) || !is_finite) return;  // of other links, a pair may be hit
  ++tally.exact;
  tally.untrue += is_contradicted(batch, positions, verdict);
}

StateTable compare_states(StateOracle& oracle, std::int64_t count, std::uint64_t seed) {
  return compare_rounds<StateTable>(count, seed, [&](auto&&... of_round) { oracle.round(of_round...); });
}

StateTable compare_motions(StateOracle& oracle, std::int64_t count, std::uint64_t seed) {
  return compare_rounds<StateTable>(count, seed, [&](auto&&... of_round) { oracle.round_of_motions(of_round...); });
}

}  // namespace clearance::exact
