#include "engine/robot/pair_findings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <numbers>

namespace clearance {

namespace {

constexpr std::size_t kBatch = 256;  // configurations of one evaluation

// A box of positions, for which a proof is attempted.
struct Region {
  std::vector<double> middle, half;  // by column
};

// Travel (Kinematics::travel()) of all configurations whose positions are no larger than these.
double most_travel(const Kinematics& robot, std::span<const double> largest) {
  double most = 0;
  for (const KinematicStep& step : robot.steps()) {
    if (step.kind != KinematicStep::Kind::kSliding && step.kind != KinematicStep::Kind::kPlanar) continue;
    const double q = largest[step.column];
    most = std::max(most, (step.mimics ? std::abs(step.multiplier) * q + std::abs(step.offset) : q) * (1 + 0x1p-50));
    if (step.kind == KinematicStep::Kind::kPlanar) most = std::max(most, largest[step.column + 1]);
  }
  return most;
}

class PairSearch {
 public:
  PairSearch(const RobotModel& robot, const Kinematics& kinematics, const LinkPair& pair,
             const PairDistances& distances, const FindingOptions& options)
      : kinematics_(kinematics),
        distances_(distances),
        options_(options),
        paths_(paths_between(kinematics, pair.a, pair.points_a, pair.b, pair.points_b)),
        moves_(robot.columns.size(), false) {
    for (const Mover& mover : paths_.front().movers()) moves_[mover.column] = true;
    for (std::size_t c = 0; c < moves_.size(); ++c) add_column(robot, robot.columns[c], moves_[c]);
  }

  bool is_rigid() const { return std::find(moves_.begin(), moves_.end(), true) == moves_.end(); }

  Found find() {
    // One sample suffices for two links without a relative motion.
    const std::uint32_t samples = is_rigid() ? 1 : std::max(options_.samples, 1u);
    std::uint32_t overlaps = 0, apart = 0;
    evaluate_samples(samples, &overlaps, &apart);
    if (overlaps && apart) return {PairFinding::kSometimes, 0};
    if (overlaps < samples && apart < samples) return {PairFinding::kSometimes, 0};  // some were undecided
    Found found;
    const bool proved = prove(overlaps > 0, &found.steps);
    if (overlaps) {
      found.finding = proved ? PairFinding::kAlways : PairFinding::kAlwaysSeen;
    } else {
      found.finding = proved ? PairFinding::kNever : PairFinding::kNeverSeen;
    }
    if (refuted_) found.finding = PairFinding::kSometimes;
    return found;
  }

 private:
  void add_column(const RobotModel& robot, const RobotColumn& column, bool moves) {
    double lower = column.lower, upper = column.upper;
    if (!std::isfinite(lower) || !std::isfinite(upper)) {
      const JointKind kind = robot.joints[column.joint].kind;
      const bool slides =
          kind == JointKind::kPrismatic || (kind == JointKind::kPlanar && !column.name.ends_with("/theta"));
      if (slides && moves)
        throw RobotError("joint \"" + column.name +
                         "\" slides without limits: pairs that it never brings into contact cannot be found");
      lower = slides ? 0 : -std::numbers::pi * (1 + 0x1p-50);
      upper = slides ? 0 : std::numbers::pi * (1 + 0x1p-50);
    }
    const double middle = 0.5 * lower + 0.5 * upper;
    box_.middle.push_back(middle);
    box_.half.push_back(moves ? std::max(upper - middle, middle - lower) * (1 + 0x1p-50) : 0);
  }

  void evaluate_samples(std::uint32_t samples, std::uint32_t* overlaps, std::uint32_t* apart) {
    std::mt19937_64 random(options_.seed);
    std::vector<double> positions;
    for (std::uint32_t n = 0; n < samples; ++n)
      for (std::size_t c = 0; c < moves_.size(); ++c) {
        const double x = n == 0 ? 0 : 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1;
        positions.push_back(box_.middle[c] + x * box_.half[c]);
      }
    for (const SignedBounds& bounds : evaluate(positions)) {
      *overlaps += bounds.upper <= 0;
      *apart += bounds.lower > 0;
    }
  }

  std::vector<SignedBounds> evaluate(const std::vector<double>& positions) {
    std::vector<SignedBounds> bounds(moves_.empty() ? 1 : positions.size() / moves_.size());
    distances_(positions, bounds);
    if (options_.margin > 0)
      for (SignedBounds& b : bounds)
        b = {std::nextafter(b.lower - options_.margin, -HUGE_VAL), std::nextafter(b.upper - options_.margin, HUGE_VAL)};
    return bounds;
  }

  // Bound on the motion of the points within a region, from the tightest path, and the column that moves them most.
  double way(const Region& region, std::size_t* widest) const {
    std::vector<double> ends(region.middle.size());
    for (std::size_t c = 0; c < ends.size(); ++c) ends[c] = std::abs(region.middle[c]) + region.half[c];
    const double travel = most_travel(kinematics_, ends);
    double least = HUGE_VAL;
    for (const MotionPath& path : paths_) {
      const double way = path.way(region.half, travel);
      if (way >= least) continue;
      least = way;
      double most = -1;
      for (const Mover& mover : path.movers()) {
        const double part = MotionPath::way_of(mover, travel) * region.half[mover.column];
        if (part > most) most = part, *widest = mover.column;
      }
    }
    return least;
  }

  // Proves that the pair overlaps (or is apart) everywhere. A region is done if the bounds at its middle exceed all
  // motion within it; otherwise it is halved.
  bool prove(bool overlap, std::uint32_t* steps) {
    std::deque<Region> open = {box_};
    while (!open.empty()) {
      const std::size_t count = std::min(open.size(), kBatch);
      if (*steps + count > options_.most_steps) return false;
      std::vector<double> positions;
      for (std::size_t i = 0; i < count; ++i)
        positions.insert(positions.end(), open[i].middle.begin(), open[i].middle.end());
      const std::vector<SignedBounds> bounds = evaluate(positions);
      *steps += static_cast<std::uint32_t>(count);
      for (std::size_t i = 0; i < count; ++i) {
        Region region = std::move(open.front());
        open.pop_front();
        refuted_ = refuted_ || (overlap ? bounds[i].lower > 0 : bounds[i].upper <= 0);
        if (refuted_) return false;
        std::size_t widest = 0;
        const double moved = way(region, &widest);
        if (overlap ? -bounds[i].upper >= moved : bounds[i].lower > moved) continue;
        if (!(moved > 0)) return false;  // no motion, and still undecided
        Region other = region;
        region.half[widest] = other.half[widest] = 0.5 * region.half[widest];
        region.middle[widest] -= region.half[widest];
        other.middle[widest] += other.half[widest];
        // The halves are enlarged to cover the rounding of their middles.
        const double margin = 0x1p-50 * (std::abs(box_.middle[widest]) + box_.half[widest]);
        region.half[widest] += margin;
        other.half[widest] += margin;
        open.push_back(std::move(region));
        open.push_back(std::move(other));
      }
    }
    return true;
  }

  const Kinematics& kinematics_;
  const PairDistances& distances_;
  const FindingOptions& options_;
  std::vector<MotionPath> paths_;
  std::vector<bool> moves_;  // by column: whether it moves the links relative to each other
  Region box_;
  bool refuted_ = false;
};

// The link that a link moves with: up over fixed joints.
std::uint32_t carrier(const RobotModel& robot, std::uint32_t link) {
  while (robot.links[link].joint != kNone && robot.joints[robot.links[link].joint].kind == JointKind::kFixed)
    link = robot.joints[robot.links[link].joint].parent;
  return link;
}

}  // namespace

Found find_pair(const RobotModel& robot, const Kinematics& kinematics, const LinkPair& pair,
                const PairDistances& distances, const FindingOptions& options) {
  const std::uint32_t a = carrier(robot, pair.a), b = carrier(robot, pair.b);
  const auto parent = [&](std::uint32_t link) {
    const std::uint32_t joint = robot.links[link].joint;
    return joint == kNone ? kNone : carrier(robot, robot.joints[joint].parent);
  };
  if (a == b || parent(a) == b || parent(b) == a) return {PairFinding::kAdjacent, 0};
  return PairSearch(robot, kinematics, pair, distances, options).find();
}

}  // namespace clearance
