// Random and adversarial motions: robots with all kinds of joints, and bodies on and around them.
#pragma once

#include "tests/engine/motion/exact_motion.h"

namespace clearance::test {

/// The difficulty of a case's motions.
enum class MotionKind : std::uint8_t {
  kRandom,   ///< as kGraze; joint angles may include many turns
  kPlate,    ///< small balls pass through plates of 0.1 mm, or just miss them
  kGraze,    ///< balls and plates that are missed, or cut into, by 1e-6 to 1e-4 m
  kSwing,    ///< half turns
  kContact,  ///< contact at the start or the end, or almost
  kStill,    ///< of zero length
  kUnsure,   ///< bodies of uncertain position and rotation
  kFar,      ///< up to 1e5 m from the origin, with grazes
  kCurve,    ///< joints along curves of degree 2 to 7: plates and grazes
  /// Joints, and bodies along lines or curves, which may grow: plates and grazes, also of a link and such a body.
  kMeanwhile,
  /// Segments of one trajectory that overshoots its knots: plates and grazes between knots, and where it turns back.
  kTrajectory,
};
inline constexpr int kStraightKinds = 8, kMotionKinds = 10, kAllKinds = 11;
const char* name_of(MotionKind kind);

/// A scene, its exact description for the oracle, and motions in it.
class MotionCase {
 public:
  /// \param folder for the robot's file, which is read immediately
  /// \param count of motions, or of segments
  MotionCase(Random& random, MotionKind kind, int count, const std::string& folder);
  MotionCase(const MotionCase&) = delete;
  MotionCase& operator=(const MotionCase&) = delete;

  engine::Scene scene;
  ExactScene exact;
  Motions motions;
  std::vector<double> named;  ///< for each motion: a time at which two bodies are near by construction
  int beyond_turns = 0;       ///< obstacles just beyond the place where a body turns back

  /// One of the motions alone.
  Motions one(std::uint32_t motion) const;

 private:
  void add_robot(const std::string& folder);
  void add_bodies();
  void add_ball(const std::string& name, const std::string& parent);
  void add_motion();
  void add_curve();
  void add_bodies_meanwhile();
  void let_meet();
  RealVec way_at(std::uint32_t motion, std::uint32_t body, const Real& t) const;
  void add_trajectory(int segments);
  void name_turn(std::uint32_t segment, std::size_t joint);
  void add_obstacle(std::uint32_t motion);
  void put(const std::string& name, const ExactScene::Shape& shape, const Pose& X);
  RealVec any_across(const RealVec& way);

  Random& random_;
  MotionKind kind_;
  bool passes_plates_ = false;         // small balls pass through plates, or just miss them
  double far_ = 0;                     // metres from the origin
  std::vector<bool> turns_;            // of each segment: whether all joints stop at its named time
  std::vector<std::uint32_t> moving_;  // balls moved by most motions
};

}  // namespace clearance::test
