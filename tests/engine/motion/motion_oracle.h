// Answers about motions before a judge of 60 digits, who looks at each where it is said to be near, where it was made
// to be, and downhill from there.
#pragma once

#include <functional>

#include "tests/engine/motion/motion_cases.h"

namespace clearance::test {

/// What was found. The engine as it is must leave wrong() at 0; a mutant must not.
struct MotionFindings {
  int motions = 0;          ///< judged
  int free = 0;             ///< proved to be, by a margin within 1e-4 m of the least distance that was found
  int hits = 0;             ///< likewise: found not to be
  int undecided = 0;        ///< likewise: neither, after 512 configurations
  int on_device = 0;        ///< likewise: asked of a device, whose CPU finished what it left open
  int least_on_device = 0;  ///< least distances that a device was asked for, or a MotionDecider has found
  int overlaps = 0;         ///< of the motions, least distances of 0
  int nearer = 0;           ///< wrong: points nearer than a lower bound
  int farther = 0;          ///< wrong: witnesses farther than their upper bound
  int untrue = 0;           ///< wrong: statuses, decisions and first contacts that the truth contradicts
  int wide = 0;             ///< wrong: `ok`, and wider than asked

  int wrong() const { return nearer + farther + untrue + wide; }
  void add(const MotionFindings& other);
  std::string text() const;
};

/// All motions of a case: reduced to their least distance, decided by a margin beside it, and, where `each_pair`, every
/// pair for itself.
void check_motions(const MotionCase& c, Random& random, bool each_pair, MotionFindings& findings);

/// Cases of every kind in turn, four motions each: as many motions as asked for, or a few more. Those of a seed are
/// always the same. \param only one kind, or all where it is negative. Ends early once something is wrong, if
/// `until_wrong`. \param backend of EngineOptions; what a device does not answer the CPU does
MotionFindings check_many(std::uint64_t seed, int motions, int only = -1, bool until_wrong = false,
                          const std::string& backend = "cpu");

/// What somebody else than the engine's CPU says of one motion.
struct MotionDecision {
  enum Kind { kFree, kHit, kOpen } kind = kOpen;
  BodyPair pair{};
  double time = 0, lower = 0, upper = 0;  ///< of a hit: when, and how far the pair is apart then
  double free_until = 0;                  ///< of a hit where first contact is asked for
  // Of the least distance, whose bounds these are then:
  double contact = 0;     ///< where first contact is asked for: when a pair is within its margin; inf: never
  bool by_slack = false;  ///< the interval is wider than asked since bodies are not known exactly
};
using MotionDecider = std::function<MotionDecision(const Scene&, const QueryView&)>;
/// Decisions and least distances alone, of motions that joints alone make, with first contact and without: cases as
/// those of check_many(). What is open counts as undecided.
MotionFindings check_decisions(std::uint64_t seed, int motions, int only, const MotionDecider& decide);

}  // namespace clearance::test
