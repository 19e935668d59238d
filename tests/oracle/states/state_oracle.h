// Compares decisions about states and motions with covers, without them, and with exact arithmetic.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "tests/oracle/states/robot_scene.h"

namespace clearance::exact {

/// Where the states and obstacles of a round are. Motions pass through such states at random times.
enum class StateKind {
  kUniform,   ///< states anywhere within the limits, a few obstacles anywhere near the robot
  kNear,      ///< states next to one, the same obstacles
  kTouching,  ///< an obstacle 0.01 to 8 mm farther or nearer than the margin from a link's surface
  kDeep,      ///< an obstacle that reaches far into a link, lies in it, or holds it
};
inline constexpr int kStateKinds = 4;
std::string name_of(StateKind kind);

/// Results of a comparison of states or of motions.
struct StateTally {
  std::int64_t count = 0, free = 0, hit = 0;  ///< with covers
  std::int64_t wrong = 0;                     ///< free with covers and hit without, or the reverse
  std::int64_t fewer = 0, more = 0;           ///< decided without covers only, or with covers only
  std::int64_t other_pairs = 0;               ///< hits that name another pair, and undecided states of another verdict
  std::int64_t other_bits = 0;         ///< states whose columns differ if bounds are requested, too; motions of another
                                       ///< verdict alone than among others
  std::int64_t exact = 0, untrue = 0;  ///< decisions compared with the oracle, and those that contradict it
  std::int64_t close_free = 0, close_hit = 0;  ///< states with an obstacle within 1 mm of touching a margin of 0
  std::int64_t inside = 0;                     ///< ... with an obstacle that lies in a link
  std::int64_t pairs = 0, open = 0;            ///< evaluated without covers, and with them

  void add(const StateTally& other);
  std::int64_t errors() const { return wrong + fewer + other_pairs + other_bits + untrue; }
  std::string text() const;
};

/// Tallies by kind and by margin.
inline constexpr std::array<double, 3> kStateMargins = {0, 0.005, 0.02};
using StateTable = std::array<std::array<StateTally, kStateMargins.size()>, kStateKinds>;

/// Results of a comparison of distances to a tolerance.
struct DistanceTally {
  std::int64_t count = 0, rows = 0;                  ///< states, and rows that have a distance
  std::int64_t apart = 0, overlap = 0, contact = 0;  ///< with covers
  std::int64_t wrong = 0;              ///< intervals that do not hold the exact engine's, and statuses against its
  std::int64_t wider = 0;              ///< than the tolerance, without a flag, or unconverged
  std::int64_t exact = 0, untrue = 0;  ///< rows compared with the oracle, and those that contradict it
  std::int64_t surfaces = 0;           ///< of the rows compared, those about a solid, a surface or a cloud alone
  std::int64_t carried = 0;            ///< likewise: those about an obstacle that a link carries, among others
  std::int64_t pairs = 0,
               evaluated = 0;  ///< evaluated to the last digits without covers, and to the tolerance with them

  void add(const DistanceTally& other);
  std::int64_t errors() const { return wrong + wider + untrue; }
  std::string text() const;
};

/// Tallies by kind and by tolerance, in metres.
inline constexpr std::array<double, 6> kDistanceTolerances = {1e-6, 1e-4, 1e-3, 1e-2, 5e-2, 1e-1};
using DistanceTable = std::array<std::array<DistanceTally, kDistanceTolerances.size()>, kStateKinds>;

/// Covers and tables, made once for a robot.
struct RobotCovers {
  std::shared_ptr<const engine::Engine> maker;  ///< they are kept while it lives
  std::shared_ptr<CoverStore> covers;
  std::shared_ptr<JointTableStore> tables;
};
/// Makes the covers of a robot, and leaves those of obstacles to others. Throws std::runtime_error after ten minutes.
RobotCovers covers_of(const RobotScene& made);

/// Two engines with one scene, and the oracle.
class StateOracle {
 public:
  StateOracle(const RobotScene& made, const RobotCovers& of_robot);
  /// One round of a kind: places obstacles, and compares some states. The oracle solves one of them.
  void round(StateKind kind, std::size_t margin, Random& random, StateTally& tally);
  /// The same for motions.
  void round_of_motions(StateKind kind, std::size_t margin, Random& random, StateTally& tally);
  /// The same for distances of states to a tolerance: least, of each body, or of each pair.
  void round_of_distances(StateKind kind, std::size_t tolerance, Random& random, DistanceTally& tally);

 private:
  struct Round;

  std::vector<double> uniform_state(Random& random) const;
  std::vector<double> free_state(std::size_t margin, Random& random);
  double put(std::uint32_t obstacle, std::uint32_t link, const std::vector<double>& q, double gap, Random& random);
  void set_pose(std::uint32_t body, const Pose& X);
  void park();
  void place_obstacles(Round& round, Random& random);
  void add_states(Round& round, Random& random);
  void add_motions(Round& round, Random& random);
  void attach_last(Random& random);
  void attach_some(Round& round, Random& random);
  void end(const Round& round);
  using Comparison = void (StateOracle::*)(const Round& round, Random& random, StateTally& tally);
  void compare_round(Round& round, Random& random, StateTally& tally, Comparison comparison);
  std::vector<MarginEntry> some_margins(const Round& round, Random& random, QueryView& query) const;
  void count(const Round& round, const ReplyView& expected, const ReplyView& found, StateTally& tally) const;
  void compare(const Round& round, Random& random, StateTally& tally);
  void compare_bits(const QueryView& query, StateTally& tally);
  void compare_motions(const Round& round, Random& random, StateTally& tally);
  std::vector<BodyPair> pairs_of_motions(const QueryView& query) const;
  void compare_alone(const QueryView& query, const ReplyView& all, StateTally& tally);
  void solve(const QueryView& query, std::size_t state, Status verdict, StateTally& tally);
  void solve_motion(const Round& round, const QueryView& query, std::size_t motion, Status verdict, Random& random,
                    StateTally& tally);
  bool is_contradicted(const QueryView& query, std::span<const double> positions, Status verdict) const;
  std::vector<BodyPair> pairs_of_states(const QueryView& query, bool of_world) const;
  void solve_distance(const QueryView& query, const ReplyView& found, std::uint32_t carried, Random& random,
                      DistanceTally& tally) const;

  const RobotScene& made_;
  engine::Engine without_, with_;  // covers of obstacles arrive while they work
  std::vector<std::uint32_t> joints_;
  std::array<std::vector<std::vector<double>>, kStateMargins.size()>
      free_;  ///< states free of everything but obstacles
  std::vector<std::uint32_t> placed_;
};

/// Rounds of every kind and margin in turn, until `count` states are compared.
StateTable compare_states(StateOracle& oracle, std::int64_t count, std::uint64_t seed);
/// The same for motions.
StateTable compare_motions(StateOracle& oracle, std::int64_t count, std::uint64_t seed);
/// Rounds of every kind and tolerance in turn, until the distances of `count` states are compared.
DistanceTable compare_distances(StateOracle& oracle, std::int64_t count, std::uint64_t seed);

}  // namespace clearance::exact
