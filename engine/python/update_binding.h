// Poses, joints, points and attachments of the engine in a Python process.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/python/editor_binding.h"

namespace clearance::python {

/// The part of _engine.Engine that updates bodies and joints, and lists them.
class PyUpdates : public PyEditor {
 public:
  // Updates. `revision` is the scene revision of their body ids.

  nb::tuple set_poses(const BodiesArray& ids, const PoseRows& poses, std::int64_t stamp_ns, std::int64_t sequence,
                      const std::optional<TwistRows>& velocities, std::uint64_t revision) const;
  nb::tuple set_joints(const BodiesArray& ids, const PositionRow& positions, std::int64_t stamp_ns,
                       std::int64_t sequence, const std::optional<PositionRow>& velocities) const;
  nb::tuple set_points(std::uint32_t body, const CloudRows& xyz, const std::optional<double>& radius,
                       std::int64_t stamp_ns, std::int64_t sequence, std::uint64_t revision) const;
  /// See Client.joints().
  nb::tuple joints() const;
  nb::tuple attach(std::uint32_t child, std::uint32_t parent, const std::optional<PoseRows>& pose,
                   const BodiesArray& allow, std::uint64_t revision) const;
  nb::tuple allow(std::uint32_t a, std::uint32_t b, bool allow, std::uint64_t revision) const;
  nb::list body_states() const;
};

template <class T>
void bind_updates(nb::class_<T>& engine) {
  engine
      .def("set_poses", &PyUpdates::set_poses, nb::arg("ids"), nb::arg("poses"), nb::arg("stamp_ns"),
           nb::arg("sequence"), nb::arg("velocities").none(), nb::arg("revision"))
      .def("set_points", &PyUpdates::set_points, nb::arg("body"), nb::arg("xyz"), nb::arg("radius").none(),
           nb::arg("stamp_ns"), nb::arg("sequence"), nb::arg("revision"))
      .def("set_joints", &PyUpdates::set_joints, nb::arg("ids"), nb::arg("positions"), nb::arg("stamp_ns"),
           nb::arg("sequence"), nb::arg("velocities").none())
      .def("joints", &PyUpdates::joints)
      .def("attach", &PyUpdates::attach, nb::arg("child"), nb::arg("parent"), nb::arg("pose").none(), nb::arg("allow"),
           nb::arg("revision"))
      .def("allow", &PyUpdates::allow, nb::arg("a"), nb::arg("b"), nb::arg("allow"), nb::arg("revision"))
      .def("body_states", &PyUpdates::body_states);
}

}  // namespace clearance::python
