// Queries in Python: the parsed arguments of a call, without its configurations, which each run gives.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "client/python/bindings/numpy_rows.h"
#include "wire/query_options.h"
#include "wire/types.h"

namespace clearance::python {

namespace nb = nanobind;

using PairsArray = nb::ndarray<const std::uint32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using BodiesArray = nb::ndarray<const std::uint32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using PosesArray = nb::ndarray<const double, nb::shape<-1, -1, 7>, nb::c_contig, nb::device::cpu>;
using PositionsArray = nb::ndarray<const double, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using CloudRows = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using PositionRow = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using PoseRows = nb::ndarray<const double, nb::shape<-1, 7>, nb::c_contig, nb::device::cpu>;
using TwistRows = nb::ndarray<const double, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu>;
using SixNumbers = std::array<double, 6>;

/// Of an update of `count` entries. Throws ValueError unless there are none, or one for each entry.
inline std::span<const SixNumbers> velocities_of(const std::optional<TwistRows>& rows, std::size_t count) {
  if (!rows) return {};
  if (rows->shape(0) != count) throw nb::value_error("velocities: expected one for each body");
  return {reinterpret_cast<const SixNumbers*>(rows->data()), count};
}
inline std::span<const double> velocities_of(const std::optional<PositionRow>& row, std::size_t count) {
  if (!row) return {};
  if (row->shape(0) != count) throw nb::value_error("velocities: expected one for each joint");
  return {row->data(), count};
}

using BytesOfMargins =
    nb::ndarray<const std::uint8_t, nb::shape<-1, sizeof(MarginEntry)>, nb::c_contig, nb::device::cpu>;
using PairMargins = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

/// Shares its arrays with Python, without copies. Not changed after its first run, so that threads may share it.
struct Query : QueryOptions {
  std::optional<PairsArray> pairs;    ///< by default all enabled pairs
  std::optional<BodiesArray> bodies;  ///< (M,) that the poses of a run move
  std::optional<BodiesArray> joints;  ///< (J,) that the positions of a run move
  std::uint64_t scene_revision = 0;   ///< scene of these ids; 0 for any
  std::optional<BytesOfMargins> margins;
  std::optional<PairMargins> pair_margins;
  std::optional<PositionRow> weights;       ///< (J,)
  std::optional<PositionRow> speed_errors;  ///< (J + 2 M,)
  std::optional<PositionsArray> growths;    ///< (K, M) of one run's bodies
  std::optional<PositionRow> velocities;    ///< (K * J,) of the next run
  std::optional<PositionRow> twists;        ///< (K * M * 6,) of the next run
  std::optional<PositionRow> lower, upper;  ///< (J,) limits of the joints
  bool points_by_default = false;           ///< whether an engine adds points and normal if there are few rows
};

/// Input of one run: configurations, shared with Python for the duration of the call.
struct Configurations {
  std::optional<PosesArray> poses;          ///< (K, M, 7)
  std::optional<PositionsArray> positions;  ///< (K, J)

  /// Throws ValueError unless the arrays have the query's bodies and joints, and are given if it has any.
  void check(const Query& q) const {
    if (poses.has_value() != q.bodies.has_value() || (poses && poses->shape(1) != q.bodies->shape(0)))
      throw nb::value_error("configurations: expected one pose for each of bodies");
    if (positions.has_value() != q.joints.has_value() || (positions && positions->shape(1) != q.joints->shape(0)))
      throw nb::value_error("positions: expected one for each of joints");
    if (poses && positions && poses->shape(0) != positions->shape(0))
      throw nb::value_error("positions: expected as many configurations as there are of poses");
  }
  std::size_t count() const { return poses ? poses->shape(0) : positions ? positions->shape(0) : 0; }
};

/// Whether a position is beyond the limits of the query's joints.
/// \param positions (K, J)
inline bool beyond_limits(const Query& q, std::span<const double> positions) {
  if (!q.lower) return false;
  const std::size_t joints = q.lower->shape(0);
  const double *row = positions.data(), *const end = row + positions.size();
  for (; row != end; row += joints)
    for (std::size_t j = 0; j < joints; ++j)
      if (row[j] < q.lower->data()[j] || row[j] > q.upper->data()[j]) return true;
  return false;
}

/// Arrays of one run of a query that moves joints alone, read in place: positions, with the ends of motions, or with
/// velocities.
class RowsOfRun {
 public:
  /// \param second ends if the query is of motions, else velocities; may be None
  RowsOfRun(const Query& q, nb::handle first, nb::handle second)
      : first_(first, columns(q)), second_(second.is_none() ? first : second, columns(q)) {
    const std::span<const double> a = first_.numbers(), b = second_.numbers();
    if (a.empty() || a.size() != b.size()) return;
    const std::size_t joints = columns(q);
    numbers_ = a;
    count_ = a.size() / joints;
    if (second.is_none()) return;
    if (q.max_evaluations == 0) {
      velocities_ = b;
      return;
    }
    motions_.reserve(2 * a.size());
    for (std::size_t i = 0; i < a.size(); i += joints)
      for (const double* row : {&a[i], &b[i]}) motions_.insert(motions_.end(), row, row + joints);
    numbers_ = motions_;
    count_ = numbers_.size() / joints;
  }
  /// (count(), J); empty for inputs that need a conversion, or are wrong.
  std::span<const double> numbers() const { return numbers_; }
  /// (count(), J), or empty.
  std::span<const double> velocities() const { return velocities_; }
  std::size_t count() const { return count_; }

 private:
  static std::size_t columns(const Query& q) { return q.joints && !q.bodies ? q.joints->shape(0) : 0; }

  NumpyRows first_, second_;
  std::vector<double> motions_;
  std::span<const double> numbers_, velocities_;
  std::size_t count_ = 0;
};

/// Copies the margins, weights, growths and velocities of a query to a type with such members.
template <class To>
void copy_margins(const Query& q, To& to) {
  if (q.margins) to.margins = {reinterpret_cast<const MarginEntry*>(q.margins->data()), q.margins->shape(0)};
  if (q.pair_margins) to.pair_margins = {q.pair_margins->data(), q.pair_margins->shape(0)};
  if (q.weights) to.weights = {q.weights->data(), q.weights->shape(0)};
  if (q.speed_errors) to.speed_errors = {q.speed_errors->data(), q.speed_errors->shape(0)};
  if (q.growths) to.growths = {q.growths->data(), q.growths->shape(0) * q.growths->shape(1)};
  if (q.velocities) to.velocities = {q.velocities->data(), q.velocities->shape(0)};
  if (q.twists) to.twists = {q.twists->data(), q.twists->shape(0)};
}

/// Python's type of an option of type T.
template <class T>
using OptionInPython = std::conditional_t<std::is_enum_v<T>, std::uint8_t, T>;

inline std::span<const std::uint32_t> ids_of(const std::optional<BodiesArray>& array) {
  return array ? std::span(array->data(), array->shape(0)) : std::span<const std::uint32_t>();
}
inline std::span<const double> numbers_of(const std::optional<PositionsArray>& array) {
  return array ? std::span(array->data(), array->shape(0) * array->shape(1)) : std::span<const double>();
}

/// \tparam T Query or a type derived from it
template <class T>
void bind_query(nb::module_& m) {
  nb::class_<T> query(m, "Query");
  query.def(
      "__init__",
      [](T* self, std::optional<PairsArray> pairs, std::optional<BodiesArray> bodies, std::optional<BodiesArray> joints,
         std::uint64_t scene_revision) {
        new (self) T();
        self->pairs = std::move(pairs);
        self->bodies = std::move(bodies);
        self->joints = std::move(joints);
        self->scene_revision = scene_revision;
      },
      nb::arg("pairs").none(), nb::arg("bodies").none(), nb::arg("joints").none(), nb::arg("scene_revision"));
  query.def_rw("points_by_default", &T::points_by_default);
  query.def("set_margins", [](T& q, BytesOfMargins margins) { q.margins = std::move(margins); });
  query.def("set_pair_margins", [](T& q, PairMargins margins) { q.pair_margins = std::move(margins); });
  query.def("set_weights", [](T& q, PositionRow weights) { q.weights = std::move(weights); });
  query.def("set_speed_errors", [](T& q, PositionRow errors) { q.speed_errors = std::move(errors); });
  query.def("set_growths", [](T& q, PositionsArray growths) { q.growths = std::move(growths); });
  query.def(
      "at_velocities",
      [](const T& q, std::optional<PositionRow> velocities, std::optional<PositionRow> twists) {
        T copy = q;
        copy.velocities = std::move(velocities);
        copy.twists = std::move(twists);
        return copy;
      },
      nb::arg("velocities").none(), nb::arg("twists").none());
  query.def("set_limits", [](T& q, PositionRow lower, PositionRow upper) {
    const std::size_t joints = q.joints ? q.joints->shape(0) : 0;
    if (lower.shape(0) != joints || upper.shape(0) != joints)
      throw nb::value_error("limits: expected one for each of joints");
    q.lower = std::move(lower);
    q.upper = std::move(upper);
  });
  for_each_query_option([&query](const QueryOption& option, auto member) {
    using Value = std::remove_reference_t<decltype(member(std::declval<QueryOptions&>()))>;
    query.def_prop_rw(
        option.name, [member](T& q) { return static_cast<OptionInPython<Value>>(member(q)); },
        [member](T& q, OptionInPython<Value> value) { member(q) = static_cast<Value>(value); });
  });
}

/// Returns the rows of query_options.h that are members of Requested: {name: (tag, kind, default, words, unit, text,
/// bytes in a record, least, most, text of these)}, whose last three are 0, 0 and empty for an option without a range.
template <class Requested>
nb::dict query_options() {
  nb::dict rows;
  for_each_query_option([&rows](const QueryOption& option, auto member) {
    if constexpr (requires(Requested& requested) { member(requested); }) {
      using T = std::remove_cvref_t<decltype(member(kDefaultOptions))>;
      const bool is_word = option.legal.kind == Legal::Kind::kWord;
      const char* kind = std::is_same_v<T, bool>       ? "bool"
                         : is_word                     ? "word"
                         : std::is_floating_point_v<T> ? "number"
                         : std::is_signed_v<T>         ? "integer"
                                                       : "count";
      const Legal& legal = option.legal;
      const bool has_range = legal.kind == Legal::Kind::kRange;
      const std::string ends =
          std::to_string(std::int64_t(legal.least)) + " to " + std::to_string(std::int64_t(legal.most));
      rows[option.name] = nb::make_tuple(option.tag, kind, static_cast<OptionInPython<T>>(member(kDefaultOptions)),
                                         is_word ? legal.text : "", option.unit, option.text, sizeof(OptionOnWire<T>),
                                         has_range ? legal.least : 0.0, has_range ? legal.most : 0.0,
                                         !has_range   ? std::string()
                                         : legal.text ? legal.text
                                                      : ends);
    }
  });
  return rows;
}

}  // namespace clearance::python
