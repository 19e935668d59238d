// The engine in a Python process, whose scene can change.
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
#include <span>
#include <string>

#include "client/python/bindings/gil.h"
#include "client/python/bindings/process_guard.h"
#include "client/python/bindings/query.h"
#include "engine/editor/scene_editor.h"

namespace clearance::python {

/// Throws QueryError if body ids or selectors of a scene revision have other names in the engine's scene.
void check_ids(const engine::Engine& engine, std::uint64_t revision, std::span<const std::uint32_t> ids,
               bool with_parents = false);
/// The same for all ids of a query.
/// @param revision 0 for the present one
void check_query_ids(const engine::Engine& engine, std::uint64_t revision, const QueryView& query);

/// The part of _engine.Engine that changes the scene.
class PyEditor {
 public:
  using VertexRows = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
  using TriangleRows = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

  /// The present engine. A call that uses several of its functions holds it, so that they see one scene.
  std::shared_ptr<engine::Engine> use() const {
    guard_.check("this Engine");
    return editor_->engine();
  }

  // The arguments are those of the client's module; each returns the fields of SceneChanged.

  /// @param revision of the parent's id
  nb::tuple add_body(const std::string& name, const std::string& shape, const VertexRows& numbers, double radius,
                     std::uint32_t parent, bool is_static, const std::optional<PoseRows>& pose,
                     const std::array<double, 4>& uncertainties, const TriangleRows& triangles, int mesh_as,
                     const CloudRows& cloud, std::uint64_t revision);
  nb::tuple remove_body(const std::string& name);
  nb::tuple replace(const std::string& name, const std::string& shape, const VertexRows& numbers, double radius,
                    const TriangleRows& triangles, int mesh_as, const CloudRows& cloud);
  /// The loaded scene with its changes, the current revision, and the current parent of each body.
  nb::tuple scene_state() const;

 protected:
  void open(const engine::Scene& scene, const engine::Engine::Options& options) {
    const GilRelease release;
    editor_ = std::make_unique<SceneEditor>(scene, options);
  }

  /// Calls a function of the engine without the interpreter's lock, and returns its PoseUpdateResult.
  template <class F>
  nb::tuple update(F&& f) const {
    guard_.check("this Engine");
    std::uint64_t scene_revision = 0;
    const PoseUpdateResult r = [&] {
      const GilRelease release;
      return editor_->update([&](engine::Engine& engine) {
        const PoseUpdateResult done = f(engine);
        scene_revision = engine.scene_revision();
        return done;
      });
    }();
    return nb::make_tuple(r.revision, scene_revision, r.applied, r.bad, r.unknown, r.fixed);
  }

  ProcessGuard guard_;

 private:
  template <class F>
  nb::tuple change(F&& f);

  std::unique_ptr<SceneEditor> editor_;
};

template <class T>
void bind_scene_changes(nb::class_<T>& engine) {
  engine
      .def("add_body", &PyEditor::add_body, nb::arg("name"), nb::arg("shape"), nb::arg("numbers"), nb::arg("radius"),
           nb::arg("parent"), nb::arg("static"), nb::arg("pose").none(), nb::arg("uncertainties"), nb::arg("triangles"),
           nb::arg("mesh_as"), nb::arg("cloud"), nb::arg("revision"))
      .def("remove_body", &PyEditor::remove_body, nb::arg("name"))
      .def("replace", &PyEditor::replace, nb::arg("name"), nb::arg("shape"), nb::arg("numbers"), nb::arg("radius"),
           nb::arg("triangles"), nb::arg("mesh_as"), nb::arg("cloud"))
      .def("scene_state", &PyEditor::scene_state);
}

}  // namespace clearance::python
