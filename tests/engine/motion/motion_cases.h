// Random and adversarial motions: robots of all kinds of joints, bodies beside and on them.
#pragma once

#include "tests/engine/motion/exact_motion.h"

namespace clearance::test {

/// What is hard about the motions of a case.
enum class MotionKind : std::uint8_t {
  kRandom,   ///< as kGraze; joints may be many turns around
  kPlate,    ///< small balls go through or just beside plates of 0.1 mm
  kGraze,    ///< balls and plates that are passed, or cut into, by 1e-6 to 1e-4 m
  kSwing,    ///< half turns
  kContact,  ///< contact at the start or the end, or nearly
  kStill,    ///< of no length
  kUnsure,   ///< bodies that may stand elsewhere and otherwise
  kFar,      ///< up to 1e5 m from the origin, with grazes
};
inline constexpr int kMotionKinds = 8;
const char* name_of(MotionKind kind);

/// A scene, what the judge knows of it, and motions in it.
class MotionCase {
 public:
  /// \param folder for the robot's file, which is read at once
  MotionCase(Random& random, MotionKind kind, int count, const std::string& folder);
  MotionCase(const MotionCase&) = delete;
  MotionCase& operator=(const MotionCase&) = delete;

  Scene scene;
  ExactScene exact;
  Motions motions;
  std::vector<double> named;  ///< of each motion: a time at which two bodies are near, made so

  /// One of the motions by itself.
  Motions one(std::uint32_t motion) const;

 private:
  void add_robot(const std::string& folder);
  void add_bodies();
  void add_ball(const std::string& name, const std::string& parent);
  void add_motion();
  void add_obstacle(std::uint32_t motion);
  void put(const std::string& name, const ExactScene::Shape& shape, const Pose& X);
  RealVec any_across(const RealVec& way);

  Random& random_;
  MotionKind kind_;
  double far_ = 0;                     // metres from the origin
  std::vector<std::uint32_t> moving_;  // balls that motions move, mostly
};

}  // namespace clearance::test
