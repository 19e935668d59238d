// What goes into a query and what comes out, as views over memory that the caller owns.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "engine/base/body_pair.h"
#include "engine/base/query_error.h"
#include "engine/pose/pose.h"
#include "wire/model.h"
#include "wire/types.h"

namespace clearance {

/// A batch of minimum-distance questions. Views must stay valid until the job is done.
struct QueryView {
  /// Pairs to answer, in this order; a selector pair expands to its enabled pairs in lexicographic order. Read only
  /// when `all_pairs` is false.
  std::span<const BodyPair> pairs;
  /// Answer every enabled pair; with configurations, every enabled pair with at least one moved body.
  bool all_pairs = true;

  /// Configurations: K sets of poses of M bodies that replace their current poses (their children follow).
  /// K = 0: the current poses, answered as one configuration.
  std::uint32_t configuration_count = 0;
  std::span<const std::uint32_t> bodies;  ///< (M,) ids of the moved bodies, without repeats
  std::span<const Pose> configurations;   ///< (K, M) poses; of a body with a parent: relative to the parent
  std::span<const std::uint32_t> joints;  ///< (J,) ids of the joints that move, without repeats
  std::span<const double> positions;      ///< (K, J) radians and metres; other joints stay as they are

  double max_distance = std::numeric_limits<double>::infinity();  ///< metres; pairs proved farther are kBeyond
  /// Reduce::kAny, which has no max_distance, and motions: farther than this each pair must be proved. Metres, finite,
  /// >= 0.
  double margin = 0;
  std::span<const MarginEntry> margins;    ///< in place of `margin` for the pairs that they name; later entries win
  std::span<const double> pair_margins{};  ///< or (P,): of each pair, in the order of the pairs
  /// kFieldFreeScale, of Reduce::kAny: (J,) radians and metres >= 0 that joints go at a scale of 1.
  std::span<const double> weights{};
  /// Not 0: motions, each of which asks for up to so many configurations. 2k and 2k + 1 are the ends of motion k; the
  /// answer has K / 2 of them. Joints go in a straight line from one end to the other, and bodies as well, which turn
  /// at a constant speed the shorter way. Reduce::kNone, kMin, kAny; `margin` is what kFieldFirstContact is about.
  std::uint32_t max_steps = 0;
  double abs_tol = 0.0;   ///< metres; wanted: upper - lower <= max(abs_tol, rel_tol * |distance|)
  double rel_tol = -1.0;  ///< ratio; negative: the default of the precision (1e-6 float64, 1e-4 float32)
  Precision precision = Precision::kF64;
  bool signed_distance = false;  ///< also the penetration depth of overlapping pairs
  Model model = Model::kTruth;   ///< kPieces: bodies with convex pieces by these alone (Scene::by_pieces())
  Reduce reduce = Reduce::kNone;
  Format format = Format::kFull;
  std::uint32_t fields = kDefaultFields;  ///< Field bits
  std::uint64_t max_results = 1u << 20;   ///< rows of Reduce::kWithin that may come back
  std::int64_t max_pose_age_ns = 0;       ///< pairs with an older pose get kStalePose in place of an answer; 0: any age
  std::uint64_t scene_revision = 0;       ///< the scene the caller knows, whose bodies and pairs are meant; 0: any
  /// Warm state of this client; 0: none (answers repeat bit for bit). The CPU's reductions begin cold all the same.
  std::uint64_t warm_slot = 0;
};

/// What of a query says which pairs it answers: the same without configurations, reduction and columns.
QueryView for_pairs(QueryView query);

/// The default relative tolerance of a precision.
constexpr double default_rel_tol(Precision p) {
  return p == Precision::kF32 ? 1e-4 : 1e-6;
}

/// How large the answer to a query is.
struct QuerySize {
  std::uint64_t configurations = 0;  ///< K, at least 1; of motions how many they are
  std::uint64_t pairs = 0;           ///< P, after selectors are expanded
  std::uint64_t rows = 0;            ///< rows to make room for (Reduce::kWithin: the most that may come back)
  std::uint32_t fields = 0;  ///< columns that will be written, after the query's format and reduction have their say
  std::uint32_t joints = 0;  ///< J
};

/// Caller-owned columns, each of at least QuerySize::rows rows; a null column is not written.
struct ReplyView {
  std::uint64_t rows = ~std::uint64_t{0};  ///< room in each column; start() refuses a query that needs more
  double* distance = nullptr;
  double* lower = nullptr;
  double* upper = nullptr;
  std::uint8_t* status = nullptr;
  std::uint16_t* flags = nullptr;
  double* point_a = nullptr;               ///< (rows, 3)
  double* point_b = nullptr;               ///< (rows, 3)
  double* normal = nullptr;                ///< (rows, 3)
  std::uint32_t* pieces = nullptr;         ///< (rows, 2)
  double* gradient = nullptr;              ///< (rows, 2, 6); order and frame: kFieldGradient
  BodyPair* pair = nullptr;                ///< (rows,)
  std::uint32_t* configuration = nullptr;  ///< (rows,)
  CompactAnswer* compact = nullptr;        ///< (rows,)
  double* gradient_joints = nullptr;       ///< (rows, joints), metres a radian or metre
  BodyPair* pair_lower = nullptr;          ///< (rows,)
  double* time = nullptr;                  ///< (rows,)
  double* first_contact = nullptr;         ///< (rows, 2)
  std::uint32_t* steps = nullptr;          ///< (rows,)
  float* bounds = nullptr;                 ///< (rows, 2)
  double* free_scale = nullptr;            ///< (rows,)
  std::uint32_t joints = 0;                ///< J: entries a row of gradient_joints
};

/// Calls f(column of each view..., entries a row) for every column that there may be, in the order of Field. Views may
/// be const.
template <class F, class... View>
void for_each_column(F&& f, View&... view) {
  int joints = 0;  // of whichever has them
  ((joints = view.joints ? static_cast<int>(view.joints) : joints), ...);
  f(view.distance..., 1);
  f(view.lower..., 1);
  f(view.upper..., 1);
  f(view.status..., 1);
  f(view.flags..., 1);
  f(view.point_a..., 3);
  f(view.point_b..., 3);
  f(view.normal..., 3);
  f(view.pieces..., 2);
  f(view.gradient..., 12);
  f(view.pair..., 1);
  f(view.configuration..., 1);
  f(view.compact..., 1);
  f(view.gradient_joints..., joints);
  f(view.pair_lower..., 1);
  f(view.time..., 1);
  f(view.first_contact..., 2);
  f(view.steps..., 1);
  f(view.bounds..., 2);
  f(view.free_scale..., 1);
}

/// A view of columns laid out one after another in the order of Field, each starting on a 64-byte boundary: the layout
/// of a reply on the wire and of the engine's own buffers. With `base` null only the size is computed.
/// \param rows rows of each column. \param fields Field bits. \param bytes receives the size of the block, if not null.
/// \param joints QuerySize::joints
ReplyView reply_view_over(std::byte* base, std::uint64_t rows, std::uint32_t fields, std::uint64_t* bytes = nullptr,
                          std::uint32_t joints = 0);

/// What is known about the whole answer once the job is done.
struct ReplyInfo {
  std::uint64_t rows = 0;               ///< rows written
  std::uint64_t total = 0;              ///< Reduce::kWithin: pairs found, also those past max_results; else rows
  std::uint64_t snapshot_revision = 0;  ///< of the poses
  std::int64_t snapshot_stamp_ns = 0;   ///< newest publisher's stamp among the poses
  std::int64_t snapshot_sequence = 0;   ///< its publisher's count of the update that brought that stamp; 0: not counted
  std::int64_t oldest_receipt_ns = 0;   ///< oldest monotonic receipt among poses of movable bodies; 0: none
  std::int64_t pose_age_ns = -1;  ///< from that receipt to the query's begin, which max_pose_age_ns limits; -1: none
  std::uint64_t scene_revision = 0;
  std::uint64_t pairs_evaluated = 0;  ///< pair-configurations that boxes alone did not answer
  std::string_view backend;           ///< that answered: "cpu", "cuda" or "reference"
};

}  // namespace clearance
