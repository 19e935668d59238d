// The scene of a daemon in Python: its bodies and joints, and requests that change them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/python/bindings/connection.h"
#include "client/python/bindings/query.h"

namespace clearance::python {

/// The part of _client.Client for poses, joints, points and bodies.
class PyClientScene {
 public:
  using VertexRows = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
  using TriangleRows = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

  Connection& use() const { return *connection_; }

  nb::tuple set_poses(const BodiesArray& ids, const PoseRows& poses, std::int64_t stamp_ns, std::int64_t sequence,
                      const std::optional<TwistRows>& velocities) const;
  nb::tuple set_joints(const BodiesArray& ids, const PositionRow& positions, std::int64_t stamp_ns,
                       std::int64_t sequence, const std::optional<PositionRow>& velocities) const;
  nb::tuple set_points(std::uint32_t body, const CloudRows& xyz, const std::optional<double>& radius,
                       std::int64_t stamp_ns, std::int64_t sequence) const;
  /// Returns joints as in _joints.py, and groups.
  nb::tuple joints() const;
  nb::tuple attach(std::uint32_t child, std::uint32_t parent, const std::optional<PoseRows>& pose,
                   const BodiesArray& allow) const;
  nb::tuple allow(std::uint32_t a, std::uint32_t b, bool allow) const;
  nb::tuple reload(double timeout_s) const;
  /// \param shape a shape argument of Client.add_body()
  /// \param numbers vertices (V, 3), or sizes (1, 3)
  /// \param uncertainties of position and angle, padding, max_speed
  /// \param triangles (T, 3) of a mesh, otherwise empty
  /// \param cloud (N, 3) points, otherwise empty
  /// \param replaces whether shape and radius replace those of a body
  nb::tuple add_body(const std::string& name, const std::string& shape, const VertexRows& numbers, double radius,
                     std::uint32_t parent, bool is_static, const std::optional<PoseRows>& pose,
                     const std::array<double, 4>& uncertainties, const TriangleRows& triangles, int mesh_as,
                     const CloudRows& cloud, bool replaces) const;
  nb::tuple remove_body(const std::string& name) const;
  /// Returns revision, backend, pair count, bodies as in _names.BodyInfo, groups.
  nb::tuple scene(bool refresh) const;
  nb::list body_states() const;

 protected:
  void open(const std::vector<std::string>& urls, const ConnectOptions& options) {
    connection_ = std::make_shared<Connection>(urls, options);
  }

  ConnectionPtr connection_;
};

template <class T>
void bind_client_scene(nb::class_<T>& client) {
  client
      .def("set_poses", &PyClientScene::set_poses, nb::arg("ids"), nb::arg("poses"), nb::arg("stamp_ns"),
           nb::arg("sequence"), nb::arg("velocities").none())
      .def("set_points", &PyClientScene::set_points, nb::arg("body"), nb::arg("xyz"), nb::arg("radius").none(),
           nb::arg("stamp_ns"), nb::arg("sequence"))
      .def("set_joints", &PyClientScene::set_joints, nb::arg("ids"), nb::arg("positions"), nb::arg("stamp_ns"),
           nb::arg("sequence"), nb::arg("velocities").none())
      .def("joints", &PyClientScene::joints)
      .def("attach", &PyClientScene::attach, nb::arg("child"), nb::arg("parent"), nb::arg("pose").none(),
           nb::arg("allow"))
      .def("allow", &PyClientScene::allow, nb::arg("a"), nb::arg("b"), nb::arg("allow"))
      .def("reload", &PyClientScene::reload, nb::arg("timeout_s"))
      .def("add_body", &PyClientScene::add_body, nb::arg("name"), nb::arg("shape"), nb::arg("numbers"),
           nb::arg("radius"), nb::arg("parent"), nb::arg("static"), nb::arg("pose").none(), nb::arg("uncertainties"),
           nb::arg("triangles"), nb::arg("mesh_as"), nb::arg("cloud"), nb::arg("replaces"))
      .def("remove_body", &PyClientScene::remove_body, nb::arg("name"))
      .def("scene", &PyClientScene::scene, nb::arg("refresh"))
      .def("body_states", &PyClientScene::body_states);
}

}  // namespace clearance::python
