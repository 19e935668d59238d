// Answers for the Python modules of the engine and of the client.
//
// An Answer is memory with columns, exposed through the buffer protocol. Python creates numpy arrays over it
// (client/python/clearance/_query/result.py), which keep it alive as their base.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "client/python/bindings/block_pool.h"
#include "client/python/bindings/gil.h"
#include "wire/types.h"

namespace clearance::python {

namespace nb = nanobind;

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

inline constexpr int kVerdictBit = std::countr_zero(static_cast<std::uint32_t>(kFieldVerdict));

/// Columns and the properties of the whole answer.
struct Answer {
  /// Whether the verdict of every row is kBeyond.
  bool all_free() const {
    const std::int64_t at = offset[kVerdictBit];
    if (at < 0) throw nb::attribute_error("the column 'verdict' was not requested");
    const auto* verdict = reinterpret_cast<const Status*>(base + at);
    return std::all_of(verdict, verdict + rows, [](Status s) { return s == Status::kBeyond; });
  }

  std::shared_ptr<void> owner;  ///< of `base`
  const std::byte* base = nullptr;
  std::uint64_t bytes = 0;
  bool writable = true;
  std::array<std::int64_t, kFieldCount> offset{};

  std::uint32_t fields = 0;
  std::uint64_t rows = 0, total = 0, configurations = 0, pairs = 0, joints = 0;
  std::uint64_t scene_revision = 0, snapshot_revision = 0, engine_ns = 0, server_ns = 0;
  std::int64_t snapshot_stamp_ns = 0, snapshot_sequence = 0, pose_age_ns = -1;
  bool beyond_limits = false;  ///< whether a position of the run is beyond the limits of the query's joints
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
      .def("all_free", &Answer::all_free)
      .def_ro("beyond_limits", &Answer::beyond_limits)
      .def_ro("fields", &Answer::fields)
      .def_ro("rows", &Answer::rows)
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

/// Raises clearance.<name>(code, text), or with code < 0 clearance.<name>(text).
inline void raise_ours(const char* name, int code, const char* text) {
  const nb::object type = nb::module_::import_("clearance._errors").attr(name);
  const nb::object arguments = code < 0 ? nb::make_tuple(nb::str(text)) : nb::make_tuple(code, nb::str(text));
  or_park([&] {
    PyErr_SetObject(type.ptr(), arguments.ptr());
    return true;
  });
}

}  // namespace clearance::python
