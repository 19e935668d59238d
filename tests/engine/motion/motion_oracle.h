// Checks answers about motions with an oracle of 60 digits: at the times where each motion is reported or constructed
// to be near, and by descent from there.
#pragma once

#include <functional>

#include "tests/engine/motion/motion_cases.h"

namespace clearance::test {

/// Findings. wrong() must be 0 for the unchanged engine, and positive for a mutant.
struct MotionFindings {
  int motions = 0;          ///< motions checked
  int free = 0;             ///< proved free, by a margin within 1e-4 m of the least sampled distance
  int hits = 0;             ///< likewise, found not to be free
  int undecided = 0;        ///< likewise, undecided after 512 configurations
  int stopped = 0;          ///< decisions that a lower limit of steps ended, undecided
  int decided = 0;          ///< decisions reached within lower limits of steps
  int by_covers = 0;        ///< verdicts of an engine with covers
  int turned = 0;           ///< segments of trajectories with an obstacle just beyond a place where a body turns back
  int on_device = 0;        ///< likewise, queried on a device; its CPU completed the unresolved ones
  int least_on_device = 0;  ///< least distances requested from a device, or computed by a MotionDecider
  int overlaps = 0;         ///< least distances of 0
  int nearer = 0;           ///< wrong: points nearer than a lower bound
  int farther = 0;          ///< wrong: witnesses farther than their upper bound
  int untrue = 0;           ///< wrong: statuses, decisions and first contacts that contradict the exact result
  int wide = 0;             ///< wrong: `ok`, but wider than the tolerance

  int wrong() const { return nearer + farther + untrue + wide; }
  void add(const MotionFindings& other);
  std::string text() const;
};

/// Checks all motions of a case: reduced to their least distance, decided for a margin near it, both again with fewer
/// and fewer steps and, if `each_pair`, each pair alone.
void check_motions(const MotionCase& c, Random& random, bool each_pair, MotionFindings& findings);

/// Checks cases of every kind in turn, four motions each, until at least `motions` are done. A seed determines the
/// cases. Ends early after a wrong result if `until_wrong`.
/// \param only the only kind to check, or all if negative
/// \param backend of EngineOptions; the CPU answers the motions that a device passes on
MotionFindings check_many(std::uint64_t seed, int motions, int only = -1, bool until_wrong = false,
                          const std::string& backend = "cpu");

/// Checks trajectories (MotionKind::kTrajectory) of two to four segments, and for some of them verdicts by covers.
MotionFindings check_trajectories(std::uint64_t seed, int trajectories);

/// Decision of another implementation about one motion.
struct MotionDecision {
  enum Kind { kFree, kHit, kOpen } kind = kOpen;
  BodyPair pair{};
  double time = 0, lower = 0, upper = 0;  ///< of a hit: its time, and the pair's distance then
  double free_until = 0;                  ///< of a hit, if first contact is requested
  // Of the least distance, with the bounds above:
  double contact = 0;     ///< if requested: the time at which a pair is within its margin, or inf
  bool by_slack = false;  ///< the interval exceeds the tolerance because of uncertain bodies
};
using MotionDecider = std::function<MotionDecision(const QueryView&)>;
/// Makes the decider of the motions of a scene, which outlives it.
using MakeMotionDecider = std::function<MotionDecider(const engine::Scene&)>;
/// Checks only decisions and least distances of motions of joints, with and without first contact, for the cases of
/// check_many(). Unresolved motions count as undecided.
MotionFindings check_decisions(std::uint64_t seed, int motions, int only, const MakeMotionDecider& make);

}  // namespace clearance::test
