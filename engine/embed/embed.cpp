#include "engine/embed/embed.h"

#include <cmath>

#include "engine/engine.h"

namespace clearance::embed {
namespace {

static_assert(sizeof(Pose7) == sizeof(Pose) && sizeof(IdPair) == sizeof(BodyPair));
static_assert(sizeof(std::array<double, 3>) == sizeof(Vec3d));

Pose pose_of(const Pose7& X) {
  return {{X[0], X[1], X[2]}, X[3], X[4], X[5], X[6]};
}
Vec3d vector_of(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

clearance::Scene::BodyOptions options_of(const BodyOptions& options) {
  clearance::Scene::BodyOptions ours{
      .radius = options.radius, .parent = options.parent, .is_static = options.is_static};
  if (options.X_parent_body) ours.pose = pose_of(*options.X_parent_body);
  return ours;
}

/// Converts the engine's errors to those of the installed library, whose types programs can catch.
template <class F>
auto translated(F&& f) {
  try {
    return f();
  } catch (const clearance::SceneError& error) {
    throw SceneError(error.what());
  } catch (const clearance::QueryError& error) {
    throw QueryError(static_cast<std::uint16_t>(error.code), error.what());
  }
}

QueryView view_of(const Query& query) {
  for_each_query_option([&query](const QueryOption& option, auto member) {
    if constexpr (!requires(QueryView & view) { member(view); })
      if (member(query) != member(kDefaultOptions))
        throw std::invalid_argument(std::string("query: ") + option.name + " is for a daemon's client");
  });
  QueryView view;
  copy_options(query, view);
  view.all_pairs = query.pairs.empty() && query.all_pairs;
  view.pairs = {reinterpret_cast<const BodyPair*>(query.pairs.data()), query.pairs.size()};
  view.bodies = query.bodies;
  view.configurations = {reinterpret_cast<const Pose*>(query.configurations.data()), query.configurations.size()};
  view.joints = query.joints;
  view.positions = query.positions;
  view.configuration_count = static_cast<std::uint32_t>(configuration_count(query));
  view.margins = query.margins;
  view.pair_margins = query.pair_margins;
  view.weights = query.weights;
  return view;
}

}  // namespace

// --- Scene

struct Scene::Impl {
  clearance::Scene scene;
};

Scene::Scene() : impl_(std::make_unique<Impl>()) {}
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;
Scene::~Scene() = default;

Scene Scene::load(const std::string& path, bool allow_outside) {
  return translated([&] {
    Scene scene;
    scene.impl_->scene = clearance::Scene::load(path, allow_outside);
    return scene;
  });
}

std::uint32_t Scene::add_hull(const std::string& name, std::span<const std::array<double, 3>> vertices,
                              const BodyOptions& options) {
  const std::span<const Vec3d> rows(reinterpret_cast<const Vec3d*>(vertices.data()), vertices.size());
  return translated([&] { return impl_->scene.add_hull(name, rows, options_of(options)); });
}
std::uint32_t Scene::add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale,
                              bool submeshes, const BodyOptions& options) {
  return add_mesh(name, path, scale, submeshes ? MeshAs::kParts : MeshAs::kAuto, options);
}
std::uint32_t Scene::add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale,
                              MeshAs mesh_as, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_mesh(name, path, vector_of(scale), mesh_as, options_of(options)); });
}
std::uint32_t Scene::add_mesh(const std::string& name, std::span<const std::array<double, 3>> vertices,
                              std::span<const std::array<std::uint32_t, 3>> triangles, MeshAs mesh_as,
                              const BodyOptions& options) {
  const std::span<const Vec3d> rows(reinterpret_cast<const Vec3d*>(vertices.data()), vertices.size());
  return translated([&] { return impl_->scene.add_mesh(name, rows, triangles, mesh_as, options_of(options)); });
}
std::uint32_t Scene::add_box(const std::string& name, std::array<double, 3> size, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_box(name, vector_of(size), options_of(options)); });
}
std::uint32_t Scene::add_sphere(const std::string& name, double radius, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_sphere(name, radius, options_of(options)); });
}
std::uint32_t Scene::add_capsule(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_capsule(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_cylinder(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_cylinder(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_cone(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_cone(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_ellipsoid(const std::string& name, std::array<double, 3> radii, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_ellipsoid(name, vector_of(radii), options_of(options)); });
}
std::uint32_t Scene::add_half_space(const std::string& name, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_half_space(name, options_of(options)); });
}
void Scene::add_robot(const std::string& name, const RobotOptions& options) {
  const clearance::RobotOptions ours{.urdf = options.urdf,
                                     .srdf = options.srdf,
                                     .packages = options.packages,
                                     .parent = options.parent,
                                     .base = pose_of(options.X_parent_base),
                                     .is_static = options.is_static,
                                     .mesh_as = options.mesh_as,
                                     .home = options.home,
                                     .padding = options.padding};
  translated([&] { impl_->scene.add_robot(name, ours); });
}
void Scene::add_group(const std::string& name, std::span<const std::string> bodies) {
  translated([&] { impl_->scene.add_group(name, bodies); });
}
void Scene::ignore(const std::string& a, const std::string& b) {
  translated([&] { impl_->scene.ignore(a, b); });
}

// --- Answer

struct Answer::Impl {
  struct AlignedDelete {
    void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t{kColumnAlignment}); }
  };

  explicit Impl(const QuerySize& answer) : size(answer) {
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, size.rows, size.fields, &bytes, size.joints);
    block.reset(new (std::align_val_t{kColumnAlignment}) std::byte[bytes ? bytes : 1]);
    view = reply_view_over(block.get(), size.rows, size.fields, nullptr, size.joints);
  }
  template <class T, class C>
  std::span<const T> column(const C* begin, std::size_t width) const {
    if (!begin) return {};
    return {reinterpret_cast<const T*>(begin), static_cast<std::size_t>(info.rows) * width};
  }

  QuerySize size;
  std::unique_ptr<std::byte[], AlignedDelete> block;
  ReplyView view;
  ReplyInfo info;
};

Answer::Answer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Answer::Answer(Answer&&) noexcept = default;
Answer& Answer::operator=(Answer&&) noexcept = default;
Answer::~Answer() = default;

std::size_t Answer::rows() const {
  return impl_->info.rows;
}
std::uint64_t Answer::total() const {
  return impl_->info.total;
}
std::uint64_t Answer::configurations() const {
  return impl_->size.configurations;
}
std::uint64_t Answer::pairs() const {
  return impl_->size.pairs;
}
std::uint32_t Answer::fields() const {
  return impl_->size.fields;
}
std::span<const double> Answer::distance() const {
  return impl_->column<double>(impl_->view.distance, 1);
}
std::span<const double> Answer::lower() const {
  return impl_->column<double>(impl_->view.lower, 1);
}
std::span<const double> Answer::upper() const {
  return impl_->column<double>(impl_->view.upper, 1);
}
std::span<const Status> Answer::status() const {
  return impl_->column<Status>(impl_->view.status, 1);
}
std::span<const std::uint16_t> Answer::flags() const {
  return impl_->column<std::uint16_t>(impl_->view.flags, 1);
}
std::span<const double> Answer::point_a() const {
  return impl_->column<double>(impl_->view.point_a, 3);
}
std::span<const double> Answer::point_b() const {
  return impl_->column<double>(impl_->view.point_b, 3);
}
std::span<const double> Answer::normal() const {
  return impl_->column<double>(impl_->view.normal, 3);
}
std::span<const std::uint32_t> Answer::pieces() const {
  return impl_->column<std::uint32_t>(impl_->view.parts, 2);
}
std::span<const double> Answer::gradient() const {
  return impl_->column<double>(impl_->view.gradient, 12);
}
std::span<const double> Answer::gradient_joints() const {
  return impl_->column<double>(impl_->view.gradient_joints, impl_->size.joints);
}
std::span<const IdPair> Answer::pair() const {
  return impl_->column<IdPair>(impl_->view.pair, 1);
}
std::span<const std::uint32_t> Answer::configuration() const {
  return impl_->column<std::uint32_t>(impl_->view.configuration, 1);
}
std::span<const float> Answer::points32() const {
  return impl_->column<float>(impl_->view.points32, 6);
}
std::span<const IdPair> Answer::pair_lower() const {
  return impl_->column<IdPair>(impl_->view.pair_lower, 1);
}
std::span<const double> Answer::time() const {
  return impl_->column<double>(impl_->view.time, 1);
}
std::span<const double> Answer::first_contact() const {
  return impl_->column<double>(impl_->view.first_contact, 2);
}
std::span<const std::uint32_t> Answer::steps() const {
  return impl_->column<std::uint32_t>(impl_->view.steps, 1);
}
std::span<const double> Answer::free_scale() const {
  return impl_->column<double>(impl_->view.free_scale, 1);
}
std::uint64_t Answer::snapshot_revision() const {
  return impl_->info.snapshot_revision;
}
std::int64_t Answer::snapshot_stamp_ns() const {
  return impl_->info.snapshot_stamp_ns;
}
std::string_view Answer::backend() const {
  return impl_->info.backend;
}

// --- Engine

struct Engine::Impl {
  Impl(clearance::Scene scene, const clearance::Engine::Options& options) : engine(std::move(scene), options) {}
  clearance::Engine engine;
};

Engine::Engine(Scene scene, const EngineOptions& options) {
  clearance::Engine::Options ours;
  ours.backend = options.backend;
  ours.threads = options.threads;
  ours.devices = options.devices;
  impl_ = translated([&] { return std::make_unique<Impl>(std::move(scene.impl_->scene), ours); });
}
Engine::Engine(Engine&&) noexcept = default;
Engine& Engine::operator=(Engine&&) noexcept = default;
Engine::~Engine() = default;

std::size_t Engine::body_count() const {
  return impl_->engine.scene().bodies().size();
}
const std::string& Engine::body_name(std::uint32_t body) const {
  return impl_->engine.scene().bodies().at(body).name;
}
std::uint32_t Engine::body(std::string_view name) const {
  const std::uint32_t id = impl_->engine.scene().find_body(name);
  if (id == kNone) throw std::invalid_argument("no body is named \"" + std::string(name) + "\"");
  return id;
}
std::uint32_t Engine::group(std::string_view name) const {
  if (name == "*") return kEveryBody;
  const std::uint32_t index = impl_->engine.scene().find_group(name);
  if (index == kNone) throw std::invalid_argument("no group is named \"" + std::string(name) + "\"");
  return index | kGroupBit;
}
std::string_view Engine::backend() const {
  return impl_->engine.backend();
}

PosesSet Engine::set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns) {
  std::vector<BodyPose> batch;
  batch.reserve(poses.size());
  for (const auto& [body, X] : poses) batch.push_back({body, pose_of(X)});
  const PoseUpdateResult done = translated([&] { return impl_->engine.set_poses(batch, stamp_ns); });
  return {done.revision, done.applied, done.bad, done.unknown, done.fixed};
}
PosesSet Engine::set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns) {
  std::vector<std::pair<std::uint32_t, Pose7>> by_id;
  by_id.reserve(poses.size());
  for (const auto& [name, X] : poses) by_id.emplace_back(body(name), X);
  return set_poses(by_id, stamp_ns);
}
PosesSet Engine::set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns) {
  std::vector<JointPosition> batch;
  for (const auto& [joint, position] : positions) batch.push_back({joint, position});
  const PoseUpdateResult done = translated([&] { return impl_->engine.set_joints(batch, stamp_ns); });
  return {done.revision, done.applied, done.bad, done.unknown, done.fixed};
}
std::vector<std::uint32_t> Engine::joints(std::string_view group) const {
  for (const JointGroup& known : impl_->engine.scene().joint_groups())
    if (known.name == group) return known.joints;
  throw std::invalid_argument("no robot or group of joints is named \"" + std::string(group) + "\"");
}
std::uint32_t Engine::joint(std::string_view name) const {
  const std::uint32_t id = impl_->engine.scene().find_joint(name);
  if (id == kNone) throw std::invalid_argument("no joint is named \"" + std::string(name) + "\"");
  return id;
}
void Engine::attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child,
                    std::span<const std::uint32_t> allow) {
  const Pose X_pc = X_parent_child ? pose_of(*X_parent_child) : Pose();
  translated([&] { return impl_->engine.attach(child, parent, X_parent_child ? &X_pc : nullptr, allow); });
}
std::uint32_t Engine::allow(std::uint32_t a, std::uint32_t b) {
  return translated([&] { return impl_->engine.allow(a, b, true); }).applied;
}
std::uint32_t Engine::forbid(std::uint32_t a, std::uint32_t b) {
  return translated([&] { return impl_->engine.allow(a, b, false); }).applied;
}

Check Engine::check(const Query& query) const {
  const clearance::Scene& scene = impl_->engine.scene();
  const Answer answer = distances(as_check(query));
  std::vector<std::uint32_t> joints(query.joints.begin(), query.joints.end());
  std::vector<double> positions(query.positions.begin(), query.positions.end());
  if (query.joints.empty() && query.configurations.empty()) {
    for (std::uint32_t joint = 0; joint < scene.joints().size(); ++joint) {
      const JointState state = impl_->engine.joint_state(joint);
      joints.push_back(joint);
      positions.push_back(state.status == Status::kOk ? state.position : std::nan(""));
    }
  }
  std::vector<JointLimits> limits;
  for (const std::uint32_t joint : joints) {
    const SceneJoint& of = scene.joints().at(joint);
    const RobotColumn& column = scene.robots()[of.robot]->model.columns[of.column];
    limits.push_back({column.lower, column.upper});
  }
  return check_of(answer, joints, limits, positions);
}

std::vector<double> Engine::free_scale(const Query& query, std::span<const double> weights) const {
  const Answer answer = distances(as_free_scale(query, weights));
  return {answer.free_scale().begin(), answer.free_scale().end()};
}

Answer Engine::distances(const Query& query) const {
  return translated([&] {
    PreparedQuery prepared = impl_->engine.prepare(view_of(query));
    auto answer = std::make_unique<Answer::Impl>(prepared.size());
    Job job = impl_->engine.start(std::move(prepared), answer->view);
    while (!job.advance()) {
    }
    answer->info = job.info();
    return Answer(std::move(answer));
  });
}

std::vector<IdPair> Engine::pairs(const Query& query) const {
  return translated([&] {
    std::vector<IdPair> pairs;
    for (const BodyPair& pair : impl_->engine.pairs(view_of(query))) pairs.push_back({pair.a, pair.b});
    return pairs;
  });
}

}  // namespace clearance::embed
