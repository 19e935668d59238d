// The answer to a query of an engine or of a client.
#pragma once

#include <clearance/query.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string_view>
#include <utility>

namespace clearance {

/// Properties of a whole answer.
struct ResultInfo {
  std::uint64_t rows = 0;
  std::uint64_t total = 0;                      ///< pairs found by Reduce::kWithin, including those past max_results
  std::uint64_t configurations = 0, pairs = 0;  ///< K, P
  std::uint32_t fields = 0;                     ///< Field bits of the columns
  std::uint32_t joints = 0;                     ///< J with gradient_joints or hessian_joints, otherwise 0
  std::uint64_t epoch = 0;                      ///< run of the daemon that answered, or 0
  std::uint64_t scene_revision = 0, snapshot_revision = 0;
  std::int64_t snapshot_stamp_ns = 0;  ///< newest stamp among the poses, publisher's clock; 0 without stamps
  std::int64_t snapshot_sequence = 0;  ///< its publisher's count of the update with that stamp; 0 if not counted
  std::int64_t pose_age_ns = -1;   ///< age of the oldest received pose when the query began; -1 if none was received
  std::uint64_t engine_ns = 0;     ///< time in the engine; 0 for calls of an Engine that wait for the answer
  std::uint64_t server_ns = 0;     ///< time in the daemon, otherwise 0
  std::array<char, 16> backend{};  ///< "cpu", "cuda" or "reference"
};

/// Columns of an answer, as views of memory that its copies share: the engine's, or the received frame (over shared
/// memory, a slot that the last copy returns). A column that was not requested is empty.
class Result {
 public:
  Result() = default;
  /// \param columns memory of the columns in the order of Field, each on a multiple of kColumnAlignment
  /// \param stored_rows rows of each column in that memory; `info.rows` of them are valid
  Result(const ResultInfo& info, const std::byte* columns, std::uint64_t stored_rows, std::shared_ptr<const void> owner)
      : info_(info), columns_(columns), stored_rows_(stored_rows), owner_(std::move(owner)) {}

  const ResultInfo& info() const { return info_; }
  std::size_t rows() const { return static_cast<std::size_t>(info_.rows); }
  std::uint64_t total() const { return info_.total; }
  std::uint64_t configurations() const { return info_.configurations; }
  std::uint64_t pairs() const { return info_.pairs; }
  std::uint32_t fields() const { return info_.fields; }
  std::uint32_t joints() const { return info_.joints; }

  std::span<const double> distance() const { return column<double>(kFieldDistance); }  ///< (rows,) metres
  std::span<const double> lower() const { return column<double>(kFieldLower); }
  std::span<const double> upper() const { return column<double>(kFieldUpper); }
  std::span<const Status> status() const { return column<Status>(kFieldStatus); }
  std::span<const std::uint16_t> flags() const { return column<std::uint16_t>(kFieldFlags); }
  std::span<const double> point_a() const { return column<double>(kFieldPointA); }  ///< (rows * 3,) world frame
  std::span<const double> point_b() const { return column<double>(kFieldPointB); }
  std::span<const double> normal() const { return column<double>(kFieldNormal); }
  std::span<const std::uint32_t> pieces() const { return column<std::uint32_t>(kFieldPieces); }  ///< (rows * 2,)
  /// (rows * 12,); order and frame as in kFieldGradient.
  std::span<const double> gradient() const { return column<double>(kFieldGradient); }
  std::span<const IdPair> pair() const { return column<IdPair>(kFieldPair); }
  std::span<const std::uint32_t> configuration() const { return column<std::uint32_t>(kFieldConfiguration); }
  /// (rows * joints(),) metres per radian or metre: d distance / d position of each of the query's joints, in their
  /// order. 0 for overlapping bodies without a requested depth, NaN without witness points; one of several gradients
  /// with the flag kFlagNonsmooth.
  std::span<const double> gradient_joints() const { return column<double>(kFieldGradientJoints); }
  /// (rows * joints() * joints(),) second derivatives, symmetric: m/rad^2, m/rad for a sliding and a turning joint, 1/m
  /// for two sliding ones. One of several where smooth_radius() is 0.
  std::span<const double> hessian_joints() const { return column<double>(kFieldHessianJoints); }
  /// (rows,) m/s and m/s^2: first and second derivative by time at the query's velocities, if these stay constant.
  std::span<const double> rate() const { return column<double>(kFieldRate); }
  std::span<const double> curvature() const { return column<double>(kFieldCurvature); }
  /// (rows * 2,) m/s: certified interval of the one-sided derivatives by time; infinite where a velocity is unknown.
  std::span<const double> rate_bounds() const { return column<double>(kFieldRateBounds); }
  /// (rows,) metres; kFieldSmoothRadius.
  std::span<const double> smooth_radius() const { return column<double>(kFieldSmoothRadius); }
  std::span<const IdPair> pair_lower() const { return column<IdPair>(kFieldPairLower); }
  std::span<const double> time() const { return column<double>(kFieldTime); }  ///< of motions, 0 to 1
  /// (rows * 2,) of motions; kFieldFirstContact.
  std::span<const double> first_contact() const { return column<double>(kFieldFirstContact); }
  std::span<const std::uint32_t> steps() const { return column<std::uint32_t>(kFieldSteps); }  ///< of motions
  /// (rows * 2,) lower and upper, metres, rounded outward.
  std::span<const float> bounds() const { return column<float>(kFieldBounds); }
  /// (rows * 6,) both witness points, each relative to its body's origin, along the world's axes; kFieldPoints32.
  std::span<const float> points32() const { return column<float>(kFieldPoints32); }
  std::span<const double> free_scale() const { return column<double>(kFieldFreeScale); }
  std::span<const Status> verdict() const { return column<Status>(kFieldVerdict); }  ///< of Reduce::kAny
  /// Whether every configuration or motion of Reduce::kAny is proved free, by the column verdict.
  bool all_free() const {
    const std::span<const Status> rows = verdict();
    return !rows.empty() && std::ranges::all_of(rows, [](Status s) { return s == Status::kBeyond; });
  }

  std::uint64_t epoch() const { return info_.epoch; }
  std::uint64_t scene_revision() const { return info_.scene_revision; }
  std::uint64_t snapshot_revision() const { return info_.snapshot_revision; }
  std::int64_t snapshot_stamp_ns() const { return info_.snapshot_stamp_ns; }
  std::int64_t snapshot_sequence() const { return info_.snapshot_sequence; }
  std::int64_t pose_age_ns() const { return info_.pose_age_ns; }
  std::uint64_t engine_ns() const { return info_.engine_ns; }
  std::uint64_t server_ns() const { return info_.server_ns; }
  std::string_view backend() const {
    return {info_.backend.data(), strnlen(info_.backend.data(), info_.backend.size())};
  }

  /// The bytes of a column's valid rows, or nothing if it is absent.
  std::span<const std::byte> bytes(Field field) const {
    if (!(info_.fields & field)) return {};
    std::uint64_t offset = 0;
    for (std::uint32_t before = info_.fields & (field - 1u); before; before &= before - 1)
      offset += (stored_rows_ * row_bytes(std::countr_zero(before)) + kColumnAlignment - 1) / kColumnAlignment *
                kColumnAlignment;
    return {columns_ + offset, static_cast<std::size_t>(info_.rows * row_bytes(std::countr_zero(unsigned{field})))};
  }

 private:
  std::uint64_t row_bytes(int bit) const { return field_bytes(bit, info_.joints); }
  template <class T>
  std::span<const T> column(Field field) const {
    const std::span<const std::byte> all = bytes(field);
    return {reinterpret_cast<const T*>(all.data()), all.size() / sizeof(T)};
  }

  ResultInfo info_;
  const std::byte* columns_ = nullptr;
  std::uint64_t stored_rows_ = 0;
  std::shared_ptr<const void> owner_;
};

}  // namespace clearance
