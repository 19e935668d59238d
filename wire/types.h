// Enumerations and columns of queries and answers.
//
// Shared by the engine, the daemon and every client. Plain enums only, without transport or geometry. Values are part
// of the wire format and are never renumbered. Python mirrors them in client/python/clearance/_words.py (a test
// compares the two).
#pragma once

#include <cstdint>

namespace clearance {

/// Status of one pair (or one reduced group) in one configuration.
enum class Status : std::uint8_t {
  kOk = 0,           ///< apart: lower > 0, and the interval is within the tolerance
  kOverlap = 1,      ///< a common point is proved: upper <= 0 (if signed, also within the tolerance)
  kContact = 2,      ///< neither is provable: lower <= 0 <= upper
  kBeyond = 3,       ///< proved farther than max_distance (with Reduce::kAny, than the margins); not refined
  kUnconverged = 4,  ///< the interval is valid but wider than the tolerance
  kBadPose = 5,      ///< a pose with NaN, Inf or a quaternion that cannot be normalised
  kNoPose = 6,       ///< a movable body without a pose
  kUnknownBody = 7,  ///< a body id outside the scene
  kStalePose = 8,    ///< a pose older than max_pose_age_ns
};

/// Facts about one answer, as bits.
enum Flag : std::uint16_t {
  kFlagRenormalised = 1 << 1,        ///< a quaternion's norm was off by more than 1e-3
  kFlagRoundingLimited = 1 << 2,     ///< as narrow as the arithmetic allows
  kFlagNonsmooth = 1 << 3,           ///< witness points are not unique; the gradient is one of several
  kFlagPieces = 1 << 4,              ///< a body of several convex parts overlaps: the depth is a lower bound
  kFlagIncomplete = 1 << 5,          ///< a reduced group contains a bad or missing pose
  kFlagUncertaintyLimited = 1 << 6,  ///< uncertainty widens the interval beyond the tolerance
  kFlagBeyondLimits = 1 << 7,        ///< a joint that places one of the bodies is beyond its limits
  kFlagHalfTurn = 1 << 8,            ///< a body turns by nearly half a turn: its direction of rotation is ambiguous
};

/// Arithmetic of the iterations; the bounds are valid in either.
enum class Precision : std::uint8_t { kF64 = 0, kF32 = 1 };

/// Rows of an answer.
enum class Reduce : std::uint8_t {
  kNone = 0,     ///< one row per configuration and pair
  kWithin = 1,   ///< sparse: only pairs not proved farther than max_distance, up to max_results, with the total
  kNearest = 2,  ///< one row per configuration and body; with k, one for each of the k nearest pairs, or of all
  kMin = 3,      ///< one row per configuration
  kAny = 4,      ///< one row per configuration: kBeyond if every pair is proved farther than its margin, otherwise a
                 ///< pair proved within its margin (kOk, kContact, kOverlap) or, failing that, an undecided pair
};

/// Columns of an answer, as bits of a mask and (by position) as the order of columns in a reply.
enum Field : std::uint32_t {
  kFieldDistance = 1u << 0,         ///< float64, metres
  kFieldLower = 1u << 1,            ///< float64, metres, certified
  kFieldUpper = 1u << 2,            ///< float64, metres, certified
  kFieldStatus = 1u << 3,           ///< uint8, Status
  kFieldFlags = 1u << 4,            ///< uint16, Flag bits
  kFieldPointA = 1u << 5,           ///< 3 float64, metres, world frame
  kFieldPointB = 1u << 6,           ///< 3 float64, metres, world frame
  kFieldNormal = 1u << 7,           ///< 3 float64, unit, world frame, from a towards b
  kFieldPieces = 1u << 8,           ///< 2 uint32, index of the nearest convex part within each body
  kFieldGradient = 1u << 9,         ///< 2 x 6 float64, of a and b: by a turn about its origin, a shift; world axes
  kFieldPair = 1u << 10,            ///< 2 uint32, body ids (a, b); always present in reductions without kFieldVerdict
  kFieldConfiguration = 1u << 11,   ///< uint32; always present with Reduce::kWithin
  kFieldPoints32 = 1u << 12,        ///< 2 x 3 float32, metres: points of a and b from their body's origin; world axes
  kFieldGradientJoints = 1u << 13,  ///< J float64: by the position of each of the query's joints, in their order
  kFieldPairLower = 1u << 14,       ///< 2 uint32, body ids: the pair whose lower bound is the row's; reductions
  kFieldTime = 1u << 15,            ///< float64, 0 to 1: time of the row's witness points in the motion, or NaN
  kFieldFirstContact = 1u << 16,    ///< 2 float64, 0 to 1: time until which pairs are proved beyond their margins, and
                                    ///< a time at which one is proved within; inf if there is none
  kFieldSteps = 1u << 17,           ///< uint32, evaluations of the motion
  kFieldBounds = 1u << 18,          ///< 2 float32, metres: lower and upper, rounded outward
  kFieldFreeScale = 1u << 19,      ///< float64, kAny with weights: every pair is proved to stay beyond its margin while
                                   ///< no joint moves by more than this times its weight; 0 if not proved even now
  kFieldVerdict = 1u << 20,        ///< uint8, kAny only: kFieldStatus, but kOk for any pair proved within its margin
  kFieldHessianJoints = 1u << 21,  ///< J x J float64: second derivative by the positions of the query's joints
  kFieldRate = 1u << 22,           ///< float64, m/s: first derivative by time at the query's velocities
  kFieldCurvature = 1u << 23,      ///< float64, m/s^2: second derivative by time while the velocities stay constant
  kFieldSmoothRadius = 1u << 24,   ///< float64, metres of relative motion over which the active features stay; 0 where
                                   ///< second derivatives jump, NaN where there are none
  kFieldRateBounds = 1u << 25,     ///< 2 float64, m/s: interval of the one-sided derivatives by time, certified
};
inline constexpr int kFieldCount = 26;
inline constexpr std::uint32_t kKnownFields = (1u << kFieldCount) - 1;
/// Columns of motions only.
inline constexpr std::uint32_t kMotionFields = kFieldTime | kFieldFirstContact | kFieldSteps;
/// Columns of second derivatives, and of velocities; from the CPU only.
inline constexpr std::uint32_t kSecondOrderFields =
    kFieldHessianJoints | kFieldRate | kFieldCurvature | kFieldSmoothRadius | kFieldRateBounds;
/// Those that depend on velocities.
inline constexpr std::uint32_t kRateFields = kFieldRate | kFieldCurvature | kFieldRateBounds;
/// Columns whose rows have an entry for each joint, or for each pair of joints.
inline constexpr std::uint32_t kJointFields = kFieldGradientJoints | kFieldHessianJoints;
inline constexpr std::uint32_t kFieldPoints = kFieldPointA | kFieldPointB;
inline constexpr std::uint32_t kDefaultFields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;

/// Bytes of one row of each column, by bit position of its Field; for kJointFields, bytes of one entry.
inline constexpr std::uint32_t kFieldBytes[kFieldCount] = {8, 8, 8, 1,  2, 24, 24, 24, 8, 96, 8, 4, 24,
                                                           8, 8, 8, 16, 4, 8,  8,  1,  8, 8,  8, 8, 16};
/// Bytes of one row of a column.
/// \param joints number of the query's joints; from a frame, only if wire::expect_width() has passed
constexpr std::uint64_t field_bytes(int bit, std::uint64_t joints) {
  const bool by_joint = (1u << bit) == kFieldGradientJoints, by_two = (1u << bit) == kFieldHessianJoints;
  return kFieldBytes[bit] * (by_two ? joints * joints : by_joint ? joints : 1);
}

/// Alignment of each column of a reply, in bytes.
inline constexpr std::uint64_t kColumnAlignment = 64;

/// The margin of the pairs of one body or group (selectors) with another, in either order.
struct MarginEntry {
  std::uint32_t a = 0, b = 0;
  double margin = 0;  ///< metres
};
static_assert(sizeof(MarginEntry) == 16);

/// A pair selector: a body id, or a group index with kGroupBit set, or every body.
inline constexpr std::uint32_t kGroupBit = 0x80000000u;
inline constexpr std::uint32_t kEveryBody = 0xFFFFFFFFu;
/// "No such body or convex part" in an answer.
inline constexpr std::uint32_t kNone = 0xFFFFFFFEu;

/// Maximum length of a body's or group's name, in bytes.
inline constexpr int kMaxNameBytes = 63;

/// Maximum rows of a dense answer with points and normal by default.
inline constexpr std::uint64_t kDefaultPointsRows = 100000;

}  // namespace clearance
