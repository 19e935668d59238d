// The class _engine.Scene, wrapped by clearance/_scene/scene.py.
#include "engine/python/scene_bindings.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

#include "client/python/bindings/answer.h"
#include "client/python/bindings/gil.h"
#include "client/python/bindings/query.h"
#include "engine/bvh/surface.h"
#include "engine/cover/cover_record.h"
#include "engine/scene/body_ball.h"
#include "engine/scene/mesh_warning.h"
#include "engine/scene/scene.h"

namespace clearance::python {
namespace {

using VertexRows = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using TriangleRows = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using PoseRow = nb::ndarray<const double, nb::shape<7>, nb::c_contig, nb::device::cpu>;

using BodyUncertainty = std::array<double, 4>;  // uncertainty of position and angle, padding, max_speed

engine::Scene::BodyOptions options(const std::optional<std::string>& parent, bool is_static,
                                   const std::optional<PoseRow>& pose, const BodyUncertainty& uncertainties) {
  engine::Scene::BodyOptions o;
  o.uncertainty = {uncertainties[0], uncertainties[1]};
  o.padding = uncertainties[2];
  o.max_speed = uncertainties[3];
  o.parent = parent.value_or("");
  o.is_static = is_static;
  if (pose) o.pose = pose_from(pose->data());
  return o;
}

const Body& body_at(const engine::Scene& scene, std::uint32_t id) {
  if (id >= scene.bodies().size()) throw nb::value_error("body: no such id");
  return scene.bodies()[id];
}

/// A numpy array that owns a copy of the rows.
template <class T, class Row>
nb::object array_of(const std::vector<Row>& rows) {
  static_assert(sizeof(Row) == 3 * sizeof(T));
  auto* copy = new std::vector<Row>(rows);
  nb::capsule owner(copy, [](void* p) noexcept { delete static_cast<std::vector<Row>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, T>(copy->data(), {copy->size(), 3}, owner));
}

bool is_solid(const Body& body) {
  const Surface* surface = surface_of(body);
  return surface && surface->is_solid();
}

nb::list bodies(const engine::Scene& scene) {
  nb::list list;
  for (const Body& b : scene.bodies()) {
    std::uint64_t vertices = 0;
    for (const ConvexPartPtr& part : b.parts) vertices += part->vertices.size();
    list.append(nb::make_tuple(b.name, b.parent, b.is_static, b.parts.size(), vertices, b.model_error, extent_of(b),
                               b.hull_excess, b.empty_share, triangle_count(b), is_solid(b), is_cloud(b), b.model_inner,
                               b.uncertainty.position, b.uncertainty.angle, b.padding, b.max_speed));
  }
  return list;
}

nb::list parts(const engine::Scene& scene, std::uint32_t id) {
  nb::list list;
  for (const ConvexPartPtr& part : body_at(scene, id).parts) {
    list.append(nb::make_tuple(array_of<double>(part->vertices), part->radius));
  }
  return list;
}

nb::object display(const engine::Scene& scene, std::uint32_t id) {
  const auto& mesh = body_at(scene, id).display;
  if (!mesh) return nb::none();
  return nb::make_tuple(array_of<double>(mesh->vertices), array_of<std::uint32_t>(mesh->triangles));
}

/// (N, 5) float32 for each level of a body's cover: centre, outer and inner radius of each ball of its cut. Reads the
/// cover from the cache, or makes it in seconds; empty for bodies that have none.
nb::list cover(const engine::Scene& scene, std::uint32_t id) {
  const std::vector<ConvexPartPtr> parts = body_at(scene, id).parts;
  std::optional<TimedCover> made;
  if (may_have_cover(parts)) {
    const GilRelease release;
    const Cache cache = Cache::of_environment();
    const std::string name = cover_name(parts);
    made = read_cover(cache, name);
    if (!made) made = make_timed_cover(cache, name, parts);
  }
  nb::list levels;
  for (int level = 0; made && level < Cover::kLevels; ++level) {
    static_assert(sizeof(CoverBall) == 5 * sizeof(float));
    auto* balls = new std::vector<CoverBall>(cut_at(made->cover, level));
    nb::capsule owner(balls, [](void* p) noexcept { delete static_cast<std::vector<CoverBall>*>(p); });
    levels.append(nb::ndarray<nb::numpy, float>(balls->data(), {balls->size(), 5}, owner));
  }
  return levels;
}

}  // namespace

namespace {

using Options = engine::Scene::BodyOptions;

// Binds a function that adds a body: `add` takes the scene, the name, its own arguments and the options.
template <class... Own, class Add, class... Names>
void bind_shape(nb::class_<engine::Scene>& scene, const char* function, Add add, Names... names) {
  static_assert(sizeof...(Own) == sizeof...(Names));
  scene.def(
      function,
      [add](engine::Scene& s, const std::string& name, Own... own, const std::optional<std::string>& parent,
            bool is_static, const std::optional<PoseRow>& pose, const BodyUncertainty& uncertainties) {
        return std::invoke(add, s, name, own..., options(parent, is_static, pose, uncertainties));
      },
      nb::arg("name"), nb::arg(names)..., nb::arg("parent").none(), nb::arg("static"), nb::arg("pose").none(),
      nb::arg("uncertainties"));
}

// The same with the radius by which the parts are grown, which is the last of its own arguments in Python.
template <class... Own, class Add, class... Names>
void bind_grown(nb::class_<engine::Scene>& scene, const char* function, Add add, Names... names) {
  bind_shape<Own..., double>(
      scene, function,
      [add](engine::Scene& s, const std::string& name, Own... own, double radius, Options o) {
        o.radius = radius;
        return std::invoke(add, s, name, own..., o);
      },
      names...);
}

// Binds the functions that add bodies.
void bind_shapes(nb::class_<engine::Scene>& scene) {
  using S = engine::Scene;
  using Name = std::string;
  bind_grown<const VertexRows&>(
      scene, "add_hull",
      [](S& s, const Name& name, const VertexRows& v, const Options& o) {
        return s.add_hull(name, rows_of<Vec3d>(v), o);
      },
      "vertices", "radius");
  bind_grown<const std::string&, double, double, double, int, bool>(
      scene, "add_mesh",
      [](S& s, const Name& name, const std::string& path, double sx, double sy, double sz, int mesh_as, bool y_up,
         const Options& o) {
        const GilRelease release;
        return s.add_mesh(name, path, {sx, sy, sz}, static_cast<MeshAs>(mesh_as), o, y_up ? UpAxis::kY : UpAxis::kZ);
      },
      "path", "sx", "sy", "sz", "mesh_as", "y_up", "radius");
  bind_grown<const VertexRows&, const TriangleRows&, int>(
      scene, "add_mesh_of",
      [](S& s, const Name& name, const VertexRows& v, const TriangleRows& t, int mesh_as, const Options& o) {
        const GilRelease release;
        return s.add_mesh(name, rows_of<Vec3d>(v), rows_of<Triangle>(t), static_cast<MeshAs>(mesh_as), o);
      },
      "vertices", "triangles", "mesh_as", "radius");
  bind_grown<const CloudRows&, double, bool>(
      scene, "add_points",
      [](S& s, const Name& name, const CloudRows& v, double voxel, bool requires_pose, Options o) {
        o.requires_pose = requires_pose;
        const GilRelease release;
        return s.add_points(name, rows_of<CloudPoint>(v), voxel, o);
      },
      "points", "voxel", "requires_pose", "radius");
  bind_grown<double, double, double>(
      scene, "add_box",
      [](S& s, const Name& name, double x, double y, double z, const Options& o) {
        return s.add_box(name, {x, y, z}, o);
      },
      "x", "y", "z", "radius");
  bind_grown<double, double, double>(
      scene, "add_ellipsoid",
      [](S& s, const Name& name, double x, double y, double z, const Options& o) {
        return s.add_ellipsoid(name, {x, y, z}, o);
      },
      "x", "y", "z", "radius");
  bind_shape<double>(scene, "add_sphere", &S::add_sphere, "radius");
  bind_shape<double, double>(scene, "add_capsule", &S::add_capsule, "radius", "length");
  bind_grown<double, double>(scene, "add_cone", &S::add_cone, "radius", "length", "grown");
  bind_grown<double, double>(scene, "add_cylinder", &S::add_cylinder, "radius", "length", "grown");
  bind_grown<>(scene, "add_half_space", &S::add_half_space, "radius");
}

void bind_robots(nb::class_<engine::Scene>& scene) {
  scene
      .def(
          "add_robot",
          [](engine::Scene& s, const std::string& name, const std::string& urdf, const std::string& srdf,
             const std::map<std::string, std::string>& packages, const std::optional<PoseRow>& base,
             const std::string& parent, bool fixed, bool visual,
             const std::optional<std::map<std::string, double>>& home, const std::string& home_state, double padding,
             const std::map<std::string, double>& link_padding,
             const std::map<std::string, std::pair<double, double>>& link_uncertainty, int mesh_as,
             const std::map<std::string, int>& link_mesh_as) {
            engine::RobotOptions o{.urdf = urdf, .srdf = srdf, .packages = packages, .parent = parent};
            if (base) o.base = pose_from(base->data());
            o.is_static = fixed;
            o.visual = visual;
            o.home = home;
            o.home_state = home_state;
            o.padding = padding;
            o.link_padding = link_padding;
            for (const auto& [link, doubt] : link_uncertainty) o.link_uncertainty[link] = {doubt.first, doubt.second};
            o.mesh_as = static_cast<MeshAs>(mesh_as);
            for (const auto& [link, how] : link_mesh_as) o.link_mesh_as[link] = static_cast<MeshAs>(how);
            const GilRelease release;
            return s.add_robot(name, o);
          },
          nb::arg("name"), nb::arg("urdf"), nb::arg("srdf"), nb::arg("packages"), nb::arg("base").none(),
          nb::arg("parent"), nb::arg("static"), nb::arg("visual"), nb::arg("home").none(), nb::arg("home_state"),
          nb::arg("padding"), nb::arg("link_padding"), nb::arg("link_uncertainty"), nb::arg("mesh_as"),
          nb::arg("link_mesh_as"))
      .def("robot_warnings", [](const engine::Scene& s, std::uint32_t first) {
        std::vector<std::string> all;
        for (std::size_t i = first; i < s.robots().size(); ++i)
          all.insert(all.end(), s.robots()[i]->model.warnings.begin(), s.robots()[i]->model.warnings.end());
        return all;
      });
}

}  // namespace

void bind_scene(nb::module_& m) {
  nb::class_<engine::Scene> scene(m, "Scene");
  scene.def(nb::init<>())
      .def_static("load", &engine::Scene::load, nb::arg("path"), nb::arg("allow_outside"),
                  nb::call_guard<GilRelease>());
  bind_shapes(scene);
  bind_robots(scene);
  scene.def("warnings", [](const engine::Scene& s) { return s.warnings(); })
      .def("add_group", [](engine::Scene& s, const std::string& name,
                           const std::vector<std::string>& members) { s.add_group(name, members); })
      .def("ignore", &engine::Scene::ignore)
      .def("bodies", &bodies)
      .def("groups",
           [](const engine::Scene& s) {
             nb::list list;
             for (const Group& g : s.groups()) list.append(nb::make_tuple(g.name, g.bodies));
             return list;
           })
      .def("ignored", &engine::Scene::ignored)
      .def("initial_pose",
           [](const engine::Scene& s, std::uint32_t id) -> nb::object {
             const std::optional<Pose>& X = body_at(s, id).pose;
             if (!X) return nb::none();
             return tuple_of(*X);
           })
      .def("source", [](const engine::Scene& s, std::uint32_t id) { return body_at(s, id).source; })
      .def("pieces", &parts)
      .def("display", &display)
      .def("cover", &cover)
      .def("mesh_warnings",
           [](const engine::Scene& s, std::uint32_t first) {
             nb::list list;
             for (const MeshWarning& warning : mesh_warnings(s, first))
               list.append(nb::make_tuple(s.bodies()[warning.body].name, warning.text));
             return list;
           })
      .def("save", &engine::Scene::save, nb::arg("folder"), nb::call_guard<GilRelease>())
      .def("revision", &engine::Scene::revision);
}

}  // namespace clearance::python
