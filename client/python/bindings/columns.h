// Answers and queries for the Python modules of the engine and of the client.
//
// An Answer is memory with columns, exposed through the buffer protocol. Python creates numpy arrays over it
// (client/python/clearance/_result.py), which keep it alive as their base. A Query has the parsed arguments of a call.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "client/python/bindings/block_pool.h"
#include "client/python/bindings/gil.h"
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

using BytesOfMargins =
    nb::ndarray<const std::uint8_t, nb::shape<-1, sizeof(MarginEntry)>, nb::c_contig, nb::device::cpu>;
using PairMargins = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

/// Shares its arrays with Python, without copies.
struct Query : QueryOptions {
  std::optional<PairsArray> pairs;  ///< by default all enabled pairs
  std::optional<BodiesArray> bodies;
  std::optional<PosesArray> configurations;  ///< (K, M, 7)
  std::optional<BodiesArray> joints;
  std::optional<PositionsArray> positions;  ///< (K, J)
  std::optional<BytesOfMargins> margins;
  std::optional<PairMargins> pair_margins;
  std::optional<PositionRow> weights;  ///< (J,)
  bool points_by_default;              ///< whether to add points and normal if there are few rows
  std::uint64_t scene_revision = 0;    ///< in process: that of the ids; 0 for the present one
};

/// Copies the margins and weights of a query to a type with such members.
template <class To>
void copy_margins(const Query& q, To& to) {
  if (q.margins) to.margins = {reinterpret_cast<const MarginEntry*>(q.margins->data()), q.margins->shape(0)};
  if (q.pair_margins) to.pair_margins = {q.pair_margins->data(), q.pair_margins->shape(0)};
  if (q.weights) to.weights = {q.weights->data(), q.weights->shape(0)};
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

inline void bind_query(nb::module_& m) {
  nb::class_<Query> query(m, "Query");
  query.def(
      "__init__",
      [](Query* self, std::optional<PairsArray> pairs, std::optional<BodiesArray> bodies,
         std::optional<PosesArray> configurations, bool points_by_default, std::optional<BodiesArray> joints,
         std::optional<PositionsArray> positions) {
        if (configurations && (!bodies || configurations->shape(1) != bodies->shape(0)))
          throw nb::value_error("configurations: expected one pose for each of bodies");
        if (positions && (!joints || positions->shape(1) != joints->shape(0)))
          throw nb::value_error("positions: expected one for each of joints");
        new (self) Query{{},
                         std::move(pairs),
                         std::move(bodies),
                         std::move(configurations),
                         std::move(joints),
                         std::move(positions),
                         {},
                         {},
                         {},
                         points_by_default};
      },
      nb::arg("pairs").none(), nb::arg("bodies").none(), nb::arg("configurations").none(), nb::arg("points_by_default"),
      nb::arg("joints").none() = nb::none(), nb::arg("positions").none() = nb::none());
  query.def(
      "at",
      [](const Query& q, std::optional<PosesArray> configurations, std::optional<PositionsArray> positions) {
        Query other = q;
        other.configurations = std::move(configurations);
        other.positions = std::move(positions);
        return other;
      },
      nb::arg("configurations").none(), nb::arg("positions").none(),
      "The same in other configurations, whose shapes are for the caller to have checked.");
  query.def_rw("scene_revision", &Query::scene_revision);
  query.def("set_margins", [](Query& q, BytesOfMargins margins) { q.margins = std::move(margins); });
  query.def("set_pair_margins", [](Query& q, PairMargins margins) { q.pair_margins = std::move(margins); });
  query.def("set_weights", [](Query& q, PositionRow weights) { q.weights = std::move(weights); });
  for_each_query_option([&query](const QueryOption& option, auto member) {
    using T = std::remove_reference_t<decltype(member(std::declval<QueryOptions&>()))>;
    query.def_prop_rw(
        option.name, [member](Query& q) { return static_cast<OptionInPython<T>>(member(q)); },
        [member](Query& q, OptionInPython<T> value) { member(q) = static_cast<T>(value); });
  });
}

/// Returns the rows of query_options.h that are members of Requested: {name: (tag, kind, default, words, unit, text,
/// bytes in a record)}.
template <class Requested>
nb::dict query_options() {
  nb::dict rows;
  for_each_query_option([&rows](const QueryOption& option, auto member) {
    if constexpr (requires(Requested & requested) { member(requested); }) {
      using T = std::remove_cvref_t<decltype(member(kDefaultOptions))>;
      const bool is_word = option.legal.kind == Legal::Kind::kWord;
      const char* kind = std::is_same_v<T, bool>       ? "bool"
                         : is_word                     ? "word"
                         : std::is_floating_point_v<T> ? "number"
                         : std::is_signed_v<T>         ? "integer"
                                                       : "count";
      rows[option.name] =
          nb::make_tuple(option.tag, kind, static_cast<OptionInPython<T>>(member(kDefaultOptions)),
                         is_word ? option.legal.text : "", option.unit, option.text, sizeof(OptionOnWire<T>));
    }
  });
  return rows;
}

/// Offset of each column in a block: in the order of Field, aligned to 64 bytes (wire/protocol.h).
struct Layout {
  std::array<std::int64_t, kFieldCount> offset;  ///< -1 if absent
  std::uint64_t bytes = 0;
};

/// \param joints number of the query's joints
inline Layout layout_of(std::uint32_t fields, std::uint64_t rows, std::uint64_t joints) {
  Layout layout;
  for (int i = 0; i < kFieldCount; ++i) {
    layout.offset[i] = -1;
    if (!(fields >> i & 1u)) continue;
    layout.offset[i] = static_cast<std::int64_t>(layout.bytes);
    layout.bytes += (rows * field_bytes(i, joints) + 63) / 64 * 64;
  }
  return layout;
}

/// Columns and the properties of the whole answer.
struct Answer {
  std::shared_ptr<void> owner;  ///< of `base`
  const std::byte* base = nullptr;
  std::uint64_t bytes = 0;
  bool writable = true;
  std::array<std::int64_t, kFieldCount> offset{};

  std::uint32_t fields = 0;
  std::uint64_t rows = 0, capacity = 0, total = 0, configurations = 0, pairs = 0, joints = 0;
  std::uint64_t scene_revision = 0, snapshot_revision = 0, engine_ns = 0, server_ns = 0;
  std::int64_t snapshot_stamp_ns = 0, snapshot_sequence = 0, pose_age_ns = -1;
  std::string backend;
};

inline void bind_answer(nb::module_& m) {
  static PyType_Slot slots[] = {
      {Py_bf_getbuffer, reinterpret_cast<void*>(+[](PyObject* self, Py_buffer* view, int flags) -> int {
         Answer* answer = nb::inst_ptr<Answer>(self);
         return PyBuffer_FillInfo(view, self, const_cast<std::byte*>(answer->base),
                                  static_cast<Py_ssize_t>(answer->bytes), answer->writable ? 0 : 1, flags);
       })},
      {0, nullptr}};
  nb::class_<Answer>(m, "Answer", nb::type_slots(slots))
      .def("offset", [](const Answer& a, int field) { return a.offset.at(static_cast<std::size_t>(field)); })
      .def_ro("fields", &Answer::fields)
      .def_ro("rows", &Answer::rows)
      .def_ro("capacity", &Answer::capacity)
      .def_ro("total", &Answer::total)
      .def_ro("configurations", &Answer::configurations)
      .def_ro("pairs", &Answer::pairs)
      .def_ro("joints", &Answer::joints)
      .def_ro("scene_revision", &Answer::scene_revision)
      .def_ro("snapshot_revision", &Answer::snapshot_revision)
      .def_ro("snapshot_stamp_ns", &Answer::snapshot_stamp_ns)
      .def_ro("snapshot_sequence", &Answer::snapshot_sequence)
      .def_ro("pose_age_ns", &Answer::pose_age_ns)
      .def_ro("engine_ns", &Answer::engine_ns)
      .def_ro("server_ns", &Answer::server_ns)
      .def_ro("backend", &Answer::backend);
}

inline constexpr const char* kFieldNames[kFieldCount] = {
    "distance",   "lower",  "upper",         "status", "flags",         "point_a",   "point_b",
    "normal",     "pieces", "gradient",      "pair",   "configuration", "points32",  "gradient_joints",
    "pair_lower", "time",   "first_contact", "steps",  "bounds",        "free_scale"};

/// Output arrays of the caller: a list with an array or None for each field. Python has checked dtype and contiguity;
/// shapes are checked here, once the answer's size is known.
class OutArrays {
 public:
  OutArrays() = default;
  explicit OutArrays(nb::handle list) {
    if (list.is_none()) return;
    std::size_t i = 0;
    for (nb::handle item : list) {
      if (i == kFieldCount) throw nb::value_error("out: too many arrays");
      if (!item.is_none()) {
        if (PyObject_GetBuffer(item.ptr(), &view_[i], PyBUF_WRITABLE | PyBUF_C_CONTIGUOUS) != 0)
          throw nb::python_error();
        fields_ |= 1u << i;
      }
      ++i;
    }
  }
  OutArrays(OutArrays&& other) noexcept : view_(other.view_), fields_(other.fields_) { other.fields_ = 0; }
  OutArrays& operator=(OutArrays&& other) noexcept {
    std::swap(view_, other.view_);
    std::swap(fields_, other.fields_);
    return *this;
  }
  OutArrays(const OutArrays&) = delete;
  OutArrays& operator=(const OutArrays&) = delete;
  ~OutArrays() {  // holding the GIL
    for (int i = 0; i < kFieldCount; ++i) {
      if (fields_ >> i & 1u) PyBuffer_Release(&view_[static_cast<std::size_t>(i)]);
    }
  }

  std::uint32_t fields() const { return fields_; }
  std::byte* data(int field) const { return static_cast<std::byte*>(view_[static_cast<std::size_t>(field)].buf); }

  /// Throws ValueError unless every array has the shape of the answer (for kWithin, space for all rows) and no arrays
  /// overlap.
  void check(Reduce reduce, std::uint64_t configurations, std::uint64_t pairs, std::uint64_t joints,
             std::uint64_t rows) const {
    check_apart();
    for (int i = 0; i < kFieldCount; ++i) {
      if (!(fields_ >> i & 1u)) continue;
      std::vector<std::uint64_t> expected;
      if (reduce == Reduce::kNone) {
        expected = {configurations, pairs};
      } else if (reduce == Reduce::kNearest) {
        expected = {configurations, configurations ? rows / configurations : 0};
      } else {
        expected = {rows};
      }
      if ((1u << i) & (kFieldPointA | kFieldPointB | kFieldNormal)) expected.push_back(3);
      if ((1u << i) & (kFieldPieces | kFieldPair | kFieldPairLower | kFieldFirstContact | kFieldBounds))
        expected.push_back(2);
      if ((1u << i) & kFieldGradient) expected.insert(expected.end(), {2, 6});
      if ((1u << i) & kFieldGradientJoints) expected.push_back(joints);
      const Py_buffer& view = view_[static_cast<std::size_t>(i)];
      bool fits = view.ndim == static_cast<int>(expected.size());
      for (int d = 0; fits && d < view.ndim; ++d) {
        const auto have = static_cast<std::uint64_t>(view.shape[d]);
        const std::uint64_t want = expected[static_cast<std::size_t>(d)];
        fits = reduce == Reduce::kWithin && d == 0 ? have >= want : have == want;
      }
      if (fits) continue;
      std::vector<std::uint64_t> shape(view.shape, view.shape + view.ndim);
      throw nb::value_error(("out['" + std::string(kFieldNames[i]) + "']: expected shape " + text(expected) +
                             (reduce == Reduce::kWithin ? " or more rows" : "") + ", got " + text(shape))
                                .c_str());
    }
  }

 private:
  void check_apart() const {
    for (int i = 0; i < kFieldCount; ++i) {
      for (int j = i + 1; j < kFieldCount; ++j) {
        if (!(fields_ >> i & fields_ >> j & 1u)) continue;
        const Py_buffer &a = view_[static_cast<std::size_t>(i)], &b = view_[static_cast<std::size_t>(j)];
        if (data(i) < data(j) + b.len && data(j) < data(i) + a.len) {
          throw nb::value_error(
              ("out['" + std::string(kFieldNames[i]) + "'] and out['" + kFieldNames[j] + "'] share memory").c_str());
        }
      }
    }
  }

  static std::string text(const std::vector<std::uint64_t>& shape) {
    std::string s = "(";
    for (std::size_t i = 0; i < shape.size(); ++i) s += (i ? ", " : "") + std::to_string(shape[i]);
    return s + (shape.size() == 1 ? ",)" : ")");
  }

  std::array<Py_buffer, kFieldCount> view_{};
  std::uint32_t fields_ = 0;
};

/// Raises clearance.<name>(code, text), or with code < 0 clearance.<name>(text).
inline void raise_ours(const char* name, int code, const char* text) {
  const nb::object type = nb::module_::import_("clearance._errors").attr(name);
  const nb::object arguments = code < 0 ? nb::make_tuple(nb::str(text)) : nb::make_tuple(code, nb::str(text));
  or_park([&] {
    PyErr_SetObject(type.ptr(), arguments.ptr());
    return true;
  });
}

/// A handle is valid only in the process that created it, since threads and locks do not survive a fork.
class ProcessGuard {
 public:
  void check(const char* what) const {
    if (::getpid() == pid_) return;
    throw std::runtime_error(std::string(what) + " was made by process " + std::to_string(pid_) +
                             " and cannot be used after a fork; make a new one in the child");
  }

 private:
  pid_t pid_ = ::getpid();
};

}  // namespace clearance::python
