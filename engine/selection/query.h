// Input and output of queries, as views over memory that the caller owns.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "engine/base/body_pair.h"
#include "engine/base/query_error.h"
#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

inline constexpr std::uint32_t kMostControlPoints = 8;  ///< of a motion
inline constexpr double kMostGrowth = 1000;             ///< metres

/// A batch of minimum-distance queries. Views must stay valid until the job is done.
struct QueryView {
  /// Pairs to answer, in this order; a selector pair expands to its enabled pairs in lexicographic order. Read only
  /// when `all_pairs` is false.
  std::span<const BodyPair> pairs;
  /// Answer every enabled pair; with configurations, every enabled pair with at least one moved body.
  bool all_pairs = true;

  /// K configurations: poses of M bodies that replace their current poses (their children follow). With K = 0, the
  /// current poses are one configuration.
  std::uint32_t configuration_count = 0;
  std::span<const std::uint32_t> bodies;  ///< (M,) ids of the moved bodies, without repeats
  std::span<const Pose> configurations;   ///< (K, M) poses; relative to the parent if there is one
  std::span<const std::uint32_t> joints;  ///< (J,) ids of the joints that move, without repeats
  std::span<const double> positions;      ///< (K, J) radians and metres; other joints do not move

  double max_distance = std::numeric_limits<double>::infinity();  ///< metres; pairs proved to be farther are kBeyond
  /// Distance that pairs are tested against by Reduce::kAny, which has no max_distance, and by motions. Metres, finite,
  /// >= 0.
  double margin = 0;
  std::span<const MarginEntry> margins;    ///< replace `margin` for their pairs; later entries win
  std::span<const double> pair_margins{};  ///< (P,) instead of `margins`, in the order of the pairs
  /// For kFieldFreeScale of Reduce::kAny: (J,) radians and metres >= 0 by which joints may move at a scale of 1.
  std::span<const double> weights{};
  /// For motions: (K, M) metres >= 0 by which the moved bodies are grown on all sides, along with their poses: linearly
  /// in time, or as the Bezier curve of control_points. Their followers are not grown. Empty for none.
  std::span<const double> growths{};
  /// For kFieldRate and kFieldCurvature: (K, J) speeds of the joints in rad/s and m/s, and (K, M, 6) twists of the
  /// bodies: rad/s, and m/s of the origin, world axes. Those that are not given are 0.
  std::span<const double> velocities{};
  std::span<const double> twists{};
  /// For kFieldRateBounds: (J + 2 M,) bounds >= 0 on the errors of velocities: of the joints, rad/s and m/s, then of each
  /// body rad/s and m/s. Empty for none.
  std::span<const double> speed_errors{};
  std::uint32_t k = 0;  ///< of Reduce::kNearest: the k nearest pairs of each configuration; 0 for the nearest per body
  /// Maximum evaluations per motion; 0 if there are no motions. Configurations 2k and 2k + 1 are the ends of motion k,
  /// so the answer has K / 2 motions. Joints and bodies move in a straight line, and bodies turn the shorter way at
  /// constant speed. For Reduce::kNone, kMin and kAny; `margin` applies to kFieldFirstContact.
  std::uint32_t max_evaluations = 0;
  /// Control points per motion, 2 to kMostControlPoints. With n > 2, configurations n k to n k + n - 1 are those of
  /// motion k: its joints, and the positions of its bodies, move along Bezier curves of degree n - 1. Bodies do not turn
  /// then: all of their quaternions in a motion are equal.
  std::uint32_t control_points = 2;
  double abs_tol = 0.0;   ///< metres: upper - lower <= max(abs_tol, rel_tol * |distance|) is requested
  double rel_tol = -1.0;  ///< ratio; if negative, the default of the precision (1e-6 float64, 1e-4 float32)
  Precision precision = Precision::kF64;
  bool signed_distance = false;  ///< computes the penetration depth of overlapping pairs
  Reduce reduce = Reduce::kNone;
  std::uint32_t fields = kDefaultFields;  ///< Field bits
  std::uint64_t max_results = 1u << 20;   ///< limit on rows of Reduce::kWithin
  std::int64_t max_pose_age_ns = 0;       ///< pairs with older poses get kStalePose; 0 for no limit
  std::uint64_t scene_revision = 0;       ///< scene whose ids the query uses; 0 for the present one
};

/// Strips a query to its pair selection: no configurations, reduction or columns.
QueryView for_pairs(QueryView query);

/// The default relative tolerance of a precision.
constexpr double default_rel_tol(Precision p) {
  return p == Precision::kF32 ? 1e-4 : 1e-6;
}

/// Size of the answer to a query.
struct QuerySize {
  std::uint64_t configurations = 0;  ///< K, at least 1; the number of motions if there are any
  std::uint64_t pairs = 0;           ///< P, after selectors are expanded
  std::uint64_t rows = 0;            ///< rows to allocate; an upper bound for Reduce::kWithin
  std::uint32_t fields = 0;          ///< columns that will be written, given the reduction
  std::uint32_t joints = 0;          ///< J
};

/// Caller-owned columns, each of at least QuerySize::rows rows; a null column is not written.
struct ReplyView {
  std::uint64_t rows = ~std::uint64_t{0};  ///< size of each column; start() rejects a query that needs more
  double* distance = nullptr;
  double* lower = nullptr;
  double* upper = nullptr;
  std::uint8_t* status = nullptr;
  std::uint16_t* flags = nullptr;
  double* point_a = nullptr;               ///< (rows, 3)
  double* point_b = nullptr;               ///< (rows, 3)
  double* normal = nullptr;                ///< (rows, 3)
  std::uint32_t* parts = nullptr;          ///< (rows, 2)
  double* gradient = nullptr;              ///< (rows, 2, 6); order and frame: kFieldGradient
  BodyPair* pair = nullptr;                ///< (rows,)
  std::uint32_t* configuration = nullptr;  ///< (rows,)
  float* points32 = nullptr;               ///< (rows, 2, 3)
  double* gradient_joints = nullptr;       ///< (rows, joints), metres per radian or metre
  BodyPair* pair_lower = nullptr;          ///< (rows,)
  double* time = nullptr;                  ///< (rows,)
  double* first_contact = nullptr;         ///< (rows, 2)
  std::uint32_t* steps = nullptr;          ///< (rows,)
  float* bounds = nullptr;                 ///< (rows, 2)
  double* free_scale = nullptr;            ///< (rows,)
  std::uint8_t* verdict = nullptr;         ///< (rows,)
  double* hessian_joints = nullptr;        ///< (rows, joints, joints), symmetric
  double* rate = nullptr;                  ///< (rows,)
  double* curvature = nullptr;             ///< (rows,)
  double* smooth_radius = nullptr;         ///< (rows,)
  double* rate_bounds = nullptr;           ///< (rows, 2)
  std::uint32_t joints = 0;                ///< J, the entries per row of gradient_joints
};

/// Calls f(column of each view..., entries per row) for every possible column, in the order of Field. Views may be
/// const.
template <class F, class... View>
void for_each_column(F&& f, View&... view) {
  int joints = 0;  // of any view with that column
  ((joints = view.joints ? static_cast<int>(view.joints) : joints), ...);
  f(view.distance..., 1);
  f(view.lower..., 1);
  f(view.upper..., 1);
  f(view.status..., 1);
  f(view.flags..., 1);
  f(view.point_a..., 3);
  f(view.point_b..., 3);
  f(view.normal..., 3);
  f(view.parts..., 2);
  f(view.gradient..., 12);
  f(view.pair..., 1);
  f(view.configuration..., 1);
  f(view.points32..., 6);
  f(view.gradient_joints..., joints);
  f(view.pair_lower..., 1);
  f(view.time..., 1);
  f(view.first_contact..., 2);
  f(view.steps..., 1);
  f(view.bounds..., 2);
  f(view.free_scale..., 1);
  f(view.verdict..., 1);
  f(view.hessian_joints..., joints * joints);
  f(view.rate..., 1);
  f(view.curvature..., 1);
  f(view.smooth_radius..., 1);
  f(view.rate_bounds..., 2);
}

/// A view of columns laid out one after another in the order of Field, each on a 64-byte boundary: the layout of a
/// reply on the wire and of the engine's buffers. If `base` is null, only the size is computed.
/// \param rows of each column
/// \param fields Field bits
/// \param bytes receives the size of the block; may be null
/// \param joints QuerySize::joints
ReplyView reply_view_over(std::byte* base, std::uint64_t rows, std::uint32_t fields, std::uint64_t* bytes = nullptr,
                          std::uint32_t joints = 0);

/// Information about the whole answer, available once the job is done.
struct ReplyInfo {
  std::uint64_t rows = 0;               ///< rows written
  std::uint64_t total = 0;              ///< for Reduce::kWithin, pairs found, also beyond max_results; otherwise rows
  std::uint64_t snapshot_revision = 0;  ///< of the poses
  std::int64_t snapshot_stamp_ns = 0;   ///< newest stamp of the poses
  std::int64_t snapshot_sequence = 0;   ///< sequence number of the update with that stamp, or 0
  std::int64_t oldest_receipt_ns = 0;   ///< oldest monotonic receipt among poses of movable bodies, or 0
  std::int64_t pose_age_ns = -1;        ///< age of that receipt when the query began, or -1
  std::uint64_t scene_revision = 0;
  std::uint64_t pairs_evaluated = 0;  ///< pair-configurations not rejected by their boxes
  std::string_view backend;           ///< "cpu", "cuda" or "reference"
};

}  // namespace clearance
