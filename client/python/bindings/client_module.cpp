// clearance._client: the C++ client in a Python process. The public interface is clearance/_client_front.py.
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <span>
#include <utility>

#include "client/client.h"
#include "client/python/bindings/answer.h"
#include "client/python/bindings/connection.h"
#include "client/python/bindings/gil.h"
#include "client/python/bindings/matrices.h"
#include "client/python/bindings/query.h"
#include "client/python/bindings/remote_plan.h"
#include "wire/layout.h"

namespace clearance::python {
namespace {

using Clock = std::chrono::steady_clock;

/// Interval at which a waiting call checks for Ctrl-C and lets other threads use the connection.
constexpr std::chrono::milliseconds kSlice{10};

using RowNumbers = nb::ndarray<const std::uint64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

static_assert(sizeof(IdPair) == 8 && sizeof(Pose7) == 56);

clearance::Query query_of(const Query& q) {
  clearance::Query query;
  if (q.pairs) {
    query.pairs = {reinterpret_cast<const IdPair*>(q.pairs->data()), q.pairs->shape(0)};
    query.all_pairs = false;
  }
  query.bodies = ids_of(q.bodies);
  query.joints = ids_of(q.joints);
  copy_options(q, query);
  copy_margins(q, query);
  // A query without a stamp can still have a maximum wait.
  if (!q.min_pose_stamp_ns) query.pose_wait_ns = 0;
  return query;
}

clearance::Query query_of(const Query& q, const Configurations& at) {
  at.check(q);
  clearance::Query query = query_of(q);
  if (at.poses)
    query.configurations = {reinterpret_cast<const Pose7*>(at.poses->data()), at.poses->shape(0) * at.poses->shape(1)};
  query.positions = numbers_of(at.positions);
  return query;
}

/// Throws unless the client's scene is that of the query's ids.
void check_scene(Client& client, const Query& q) {
  if (!q.scene_revision) return;
  const std::uint64_t now = client.scene().revision;
  if (now == q.scene_revision) return;
  throw RequestError(
      static_cast<std::uint16_t>(wire::ErrorCode::kWrongScene),
      "the scene is revision " + std::to_string(now) + ", the query is for " + std::to_string(q.scene_revision));
}

/// Returns descriptions for numpy dtypes: {"FrameHeader": [("magic", "<u4"), ...], ...}.
nb::dict wire_structs() {
  nb::dict structs;
  nb::list members;
  wire::for_each_struct(
      [&](const char* name) {
        members = nb::list();
        structs[name] = members;
      },
      [&](const char* name, const std::string& format) { members.append(nb::make_tuple(name, format)); });
  return structs;
}

Answer answer_of(const ConnectionPtr& connection, Result reply, bool copy, bool beyond_limits) {
  Answer a;
  a.beyond_limits = beyond_limits;
  a.fields = reply.fields();
  a.rows = reply.rows();
  a.total = reply.total();
  a.configurations = reply.configurations();
  a.pairs = reply.pairs();
  a.joints = reply.joints();
  a.scene_revision = reply.scene_revision();
  a.snapshot_revision = reply.snapshot_revision();
  a.snapshot_stamp_ns = reply.snapshot_stamp_ns();
  a.snapshot_sequence = reply.snapshot_sequence();
  a.pose_age_ns = reply.pose_age_ns();
  a.engine_ns = reply.engine_ns();
  a.server_ns = reply.server_ns();
  a.backend = reply.backend();
  if (copy) {
    const Layout layout = layout_of(a.fields, a.rows, a.joints);
    a.owner = plain_blocks().take(layout.bytes);
    a.base = static_cast<const std::byte*>(a.owner.get());
    a.bytes = layout.bytes;
    a.offset = layout.offset;
    for (std::size_t i = 0; i < kFieldCount; ++i) {
      if (!(a.fields >> i & 1u) || a.rows == 0) continue;
      const std::span<const std::byte> column = reply.bytes(static_cast<Field>(1u << i));
      std::memcpy(static_cast<std::byte*>(a.owner.get()) + layout.offset[i], column.data(), column.size());
    }
    connection->discard(std::move(reply));
    return a;
  }
  // A view of the frame, from its first column to the end of its last.
  const std::byte* first = nullptr;
  const std::byte* last = nullptr;
  a.offset.fill(-1);
  for (std::size_t i = 0; i < kFieldCount; ++i) {
    if (!(a.fields >> i & 1u)) continue;
    const std::span<const std::byte> column = reply.bytes(static_cast<Field>(1u << i));
    if (!first) first = column.data();
    last = column.data() + column.size();
    a.offset[i] = column.data() - first;
  }
  a.base = first;
  a.bytes = static_cast<std::uint64_t>(last - first);
  a.writable = false;
  auto* leased = new Result(std::move(reply));
  a.owner = std::shared_ptr<void>(leased, [connection](void* p) {
    auto* r = static_cast<Result*>(p);
    connection->discard(std::move(*r));
    delete r;
  });
  return a;
}

/// A request that the destructor abandons.
struct UnderWay {
  ConnectionPtr connection;
  std::optional<Pending> pending;
  ~UnderWay() {
    if (pending) connection->discard(std::move(*pending));
  }
};

/// A pending request.
class PyPending {
 public:
  PyPending(ConnectionPtr connection, Pending pending, bool copy, bool beyond_limits)
      : connection_(std::move(connection)),
        pending_(std::in_place, std::move(pending)),
        copy_(copy),
        beyond_limits_(beyond_limits) {}
  ~PyPending() { cancel(); }
  PyPending(const PyPending&) = delete;
  PyPending& operator=(const PyPending&) = delete;

 private:
  template <class F>
  auto use(F&& f) {
    return connection_->with([&](Client&) {
      if (!pending_) throw std::logic_error("this request is over");
      return f(*pending_);
    });
  }

 public:
  /// Waits for at most `timeout_s`, and returns whether the answer has arrived.
  bool wait(double timeout_s) {
    const auto deadline = Clock::now() + duration_of(timeout_s);
    while (true) {
      const auto left = deadline - Clock::now();
      const auto slice = std::clamp<Clock::duration>(left, Clock::duration(0), kSlice);
      if (use([&](Pending& pending) { return pending.wait_for(slice); })) return true;
      if (left <= kSlice) return false;
      check_signals();
    }
  }

  /// Returns the answer. Call once, after wait() has returned true.
  Answer answer() {
    Result reply = use([](Pending& pending) { return pending.get(); });
    pending_.reset();
    return answer_of(connection_, std::move(reply), copy_, beyond_limits_);
  }

  void cancel() {
    if (!pending_) return;
    connection_->discard(std::move(*pending_));
    pending_.reset();
  }

 private:
  ConnectionPtr connection_;
  std::optional<Pending> pending_;
  bool copy_, beyond_limits_;
};

using VertexRows = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using TriangleRows = nb::ndarray<const std::uint32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

using Matrices = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
using WritablePoseRows = nb::ndarray<double, nb::shape<-1, 7>, nb::c_contig, nb::device::cpu>;

class PyClient {
 public:
  PyClient(const std::vector<std::string>& urls, double timeout_s, const std::string& server_key,
           const std::string& key, std::optional<double> hang_s, bool as_planning) {
    ConnectOptions options{duration_of(timeout_s), server_key, key, {}, as_planning};
    if (hang_s) options.hang = duration_of(*hang_s);
    const GilRelease release;
    connection_ = std::make_shared<Connection>(urls, options);
  }

  Connection& use() const { return *connection_; }

  std::unique_ptr<PyPending> submit(const Query& query, std::optional<PosesArray> poses,
                                    std::optional<PositionsArray> positions, bool copy) const {
    const Configurations at{std::move(poses), std::move(positions)};
    Pending pending = use().with([&](Client& client) {
      check_scene(client, query);
      return client.submit(query_of(query, at));
    });
    return std::make_unique<PyPending>(connection_, std::move(pending), copy, at.beyond_limits(query));
  }

  /// Returns the answer, or nothing after the timeout. Combines submit, wait and answer.
  std::optional<Answer> ask(const Query& query, std::optional<PosesArray> poses,
                            std::optional<PositionsArray> positions, bool copy, double timeout_s) const {
    const Configurations at{std::move(poses), std::move(positions)};
    UnderWay under_way{connection_, std::nullopt};
    std::optional<Result> reply;
    const auto deadline = Clock::now() + duration_of(timeout_s);
    while (true) {
      use().with([&](Client& client) {
        std::optional<Pending>& pending = under_way.pending;
        if (!pending) {
          check_scene(client, query);
          pending.emplace(client.submit(query_of(query, at)));
        }
        const auto left = deadline - Clock::now();
        if (pending->wait_for(std::clamp<Clock::duration>(left, Clock::duration(0), kSlice))) reply = pending->get();
      });
      if (reply) return answer_of(connection_, std::move(*reply), copy, at.beyond_limits(query));
      if (Clock::now() >= deadline) return std::nullopt;
      check_signals();
    }
  }

  nb::object pairs(const Query& query) const {
    auto* pairs = new std::vector<IdPair>();
    nb::capsule owner(pairs, [](void* p) noexcept { delete static_cast<std::vector<IdPair>*>(p); });
    // One configuration of zeros.
    const std::vector<Pose7> poses(query.bodies ? query.bodies->shape(0) : 0);
    const std::vector<double> positions(query.joints ? query.joints->shape(0) : 0);
    *pairs = use().with([&](Client& client) {
      check_scene(client, query);
      clearance::Query requested = query_of(query);
      requested.configurations = poses;
      requested.positions = positions;
      return client.pairs(requested);
    });
    return nb::cast(nb::ndarray<nb::numpy, std::uint32_t>(pairs->data(), {pairs->size(), 2}, owner));
  }

  /// \param rows row numbers; null for all
  std::string certificate(const Query& query, std::optional<PosesArray> poses, std::optional<PositionsArray> positions,
                          const std::optional<RowNumbers>& rows) const {
    const Configurations at{std::move(poses), std::move(positions)};
    std::optional<std::span<const std::uint64_t>> numbers;
    if (rows) numbers.emplace(rows->data(), rows->shape(0));
    return use().with([&](Client& client) {
      check_scene(client, query);
      return client.certificate(query_of(query, at), numbers);
    });
  }

  /// \param configurations number of configurations; 0 for the current poses
  std::unique_ptr<PyRemotePlan> plan_on_device(const Query& query, std::uint32_t configurations) const {
    return std::make_unique<PyRemotePlan>(connection_, use().with([&](Client& client) {
      check_scene(client, query);
      return client.plan_on_device(query_of(query), configurations);
    }));
  }

  nb::tuple set_poses(const BodiesArray& ids, const PoseRows& poses, std::int64_t stamp_ns,
                      std::int64_t sequence) const {
    if (ids.shape(0) != poses.shape(0)) throw nb::value_error("poses: expected one pose for each body");
    std::vector<std::pair<std::uint32_t, Pose7>> batch(ids.shape(0));
    for (std::size_t i = 0; i < batch.size(); ++i) {
      batch[i].first = ids.data()[i];
      std::copy_n(poses.data() + 7 * i, 7, batch[i].second.begin());
    }
    return done(use().with([&](Client& client) { return client.set_poses(batch, stamp_ns, sequence); }));
  }

  nb::tuple set_joints(const BodiesArray& ids, const PositionRow& positions, std::int64_t stamp_ns,
                       std::int64_t sequence) const {
    if (ids.shape(0) != positions.shape(0)) throw nb::value_error("positions: expected one for each joint");
    std::vector<std::pair<std::uint32_t, double>> batch(ids.shape(0));
    for (std::size_t i = 0; i < batch.size(); ++i) batch[i] = {ids.data()[i], positions.data()[i]};
    return done(use().with([&](Client& client) { return client.set_joints(batch, stamp_ns, sequence); }));
  }

  nb::tuple set_points(std::uint32_t body, const CloudRows& xyz, const std::optional<double>& radius,
                       std::int64_t stamp_ns, std::int64_t sequence) const {
    const std::span<const std::array<float, 3>> points(reinterpret_cast<const std::array<float, 3>*>(xyz.data()),
                                                       xyz.shape(0));
    return done(
        use().with([&](Client& client) { return client.set_points(body, points, radius, stamp_ns, sequence); }));
  }

  /// Returns joints as in _joints.py, and groups.
  nb::tuple joints() const {
    const JointsInfo info = use().with([](Client& client) { return client.joint_states(); });
    nb::list joints, groups;
    for (const JointInfo& j : info.joints)
      joints.append(nb::make_tuple(j.name, j.lower, j.upper, j.position, static_cast<int>(j.status), j.beyond_limits,
                                   j.stamp_ns, j.age_ns));
    for (const JointGroupInfo& g : info.groups) groups.append(nb::make_tuple(g.name, g.joints));
    return nb::make_tuple(joints, groups);
  }

  nb::tuple attach(std::uint32_t child, std::uint32_t parent, const std::optional<PoseRows>& pose,
                   const BodiesArray& allow) const {
    Pose7 X_pc{};
    if (pose) {
      if (pose->shape(0) != 1) throw nb::value_error("pose: expected one pose");
      std::copy_n(pose->data(), 7, X_pc.begin());
    }
    const std::span<const std::uint32_t> allowed(allow.data(), allow.shape(0));
    return done(
        use().with([&](Client& client) { return client.attach(child, parent, pose ? &X_pc : nullptr, allowed); }));
  }

  nb::tuple allow(std::uint32_t a, std::uint32_t b, bool allow) const {
    return done(use().with([&](Client& client) { return allow ? client.allow(a, b) : client.forbid(a, b); }));
  }

  nb::tuple reload(double timeout_s) const {
    return changed(use().with([&](Client& client) { return client.reload(duration_of(timeout_s)); }));
  }
  /// \param shape a shape argument of Client.add_body()
  /// \param numbers vertices (V, 3), or sizes (1, 3)
  /// \param uncertainties of position and angle, padding, max_speed
  /// \param triangles (T, 3) of a mesh, otherwise empty
  /// \param cloud (N, 3) points, otherwise empty
  /// \param replaces whether shape and radius replace those of a body
  nb::tuple add_body(const std::string& name, const std::string& shape, const VertexRows& numbers, double radius,
                     std::uint32_t parent, bool is_static, const std::optional<PoseRows>& pose,
                     const std::array<double, 4>& uncertainties, const TriangleRows& triangles, int mesh_as,
                     const CloudRows& cloud, bool replaces) const {
    const auto* rows = reinterpret_cast<const std::array<double, 3>*>(numbers.data());
    NewBody body;
    body.name = name;
    if (shape == "vertices" || shape == "mesh") body.vertices = {rows, numbers.shape(0)};
    body.triangles = {reinterpret_cast<const std::array<std::uint32_t, 3>*>(triangles.data()), triangles.shape(0)};
    body.mesh_as = static_cast<MeshAs>(mesh_as);
    if (shape == "box") body.box = rows[0];
    if (shape == "sphere") body.sphere = rows[0][0];
    if (shape == "capsule") body.capsule = {rows[0][0], rows[0][1]};
    if (shape == "cylinder") body.cylinder = {rows[0][0], rows[0][1]};
    if (shape == "cone") body.cone = {rows[0][0], rows[0][1]};
    if (shape == "ellipsoid") body.ellipsoid = rows[0];
    body.half_space = shape == "half_space";
    if (shape == "points") {
      body.points.emplace(reinterpret_cast<const std::array<float, 3>*>(cloud.data()), cloud.shape(0));
      body.voxel = rows[0][0];
    }
    body.radius = radius;
    body.parent = parent;
    body.is_static = is_static;
    body.uncertainty_position = uncertainties[0];
    body.uncertainty_angle = uncertainties[1];
    body.padding = uncertainties[2];
    body.max_speed = uncertainties[3];
    if (pose) std::copy_n(pose->data(), 7, body.pose.emplace().begin());
    return changed(use().with([&](Client& client) { return replaces ? client.replace(body) : client.add_body(body); }));
  }
  nb::tuple remove_body(const std::string& name) const {
    return changed(use().with([&](Client& client) { return client.remove_body(name); }));
  }

  /// Returns revision, backend, pair count, bodies as in _names.BodyInfo, groups.
  nb::tuple scene(bool refresh) const {
    const SceneInfo info = use().with([&](Client& client) {
      if (refresh) client.refresh();
      return client.scene();
    });
    nb::list bodies, groups;
    for (const BodyInfo& b : info.bodies) {
      bodies.append(nb::make_tuple(b.name, b.parent, b.is_static, b.piece_count, b.vertex_count, b.model_error,
                                   b.extent, b.hull_excess, b.empty_share, b.triangle_count, b.is_solid, b.is_cloud));
    }
    for (const GroupInfo& g : info.groups) groups.append(nb::make_tuple(g.name, g.bodies));
    return nb::make_tuple(info.revision, info.backend, info.pair_count, bodies, groups);
  }

  nb::list body_states() const {
    nb::list list;
    for (const BodyStateInfo& s : use().with([](Client& client) { return client.body_states(); })) {
      const Pose7& X = s.pose;
      list.append(nb::make_tuple(nb::make_tuple(X[0], X[1], X[2], X[3], X[4], X[5], X[6]), static_cast<int>(s.status),
                                 s.parent, s.stamp_ns, s.age_ns));
    }
    return list;
  }

  double ping(nb::bytes payload) const {
    const std::span<const std::byte> bytes(static_cast<const std::byte*>(payload.data()), payload.size());
    const auto took = use().with([&](Client& client) { return client.ping(bytes); });
    return std::chrono::duration<double>(took).count();
  }

 private:
  /// Returns scene revision, number of bodies, id of the new one, seconds.
  static nb::tuple changed(const SceneChanged& r) {
    return nb::make_tuple(r.scene_revision, r.body_count, r.body, r.seconds);
  }
  static nb::tuple done(const UpdateResult& r) {
    return nb::make_tuple(r.revision, r.scene_revision, r.applied, r.bad, r.unknown, r.fixed);
  }

  ConnectionPtr connection_;
};

}  // namespace

NB_MODULE(_client, m) {
  nb::set_leak_warnings(false);  // a program that ends with exit() does not free its caches
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const DaemonHung& e) {
      raise_ours("DaemonHung", -1, e.what());
    } catch (const TimeoutError& e) {
      raise_ours("TimeoutError", -1, e.what());
    } catch (const ConnectionError& e) {
      raise_ours("ConnectionError", -1, e.what());
    } catch (const NewEpoch& e) {
      raise_ours("NewEpoch", e.code, e.what());
    } catch (const RequestError& e) {
      raise_ours(e.code < 16 ? "QueryError" : "RequestError", e.code, e.what());
    }
  });
  bind_query(m);
  bind_answer(m);
  bind_remote_plan(m);

  nb::class_<PyPending>(m, "Pending")
      .def("wait", &PyPending::wait, nb::arg("timeout_s"))
      .def("answer", &PyPending::answer)
      .def("cancel", &PyPending::cancel);

  nb::class_<PyClient>(m, "Client")
      .def(nb::init<const std::vector<std::string>&, double, const std::string&, const std::string&,
                    std::optional<double>, bool>(),
           nb::arg("urls"), nb::arg("timeout_s"), nb::arg("server_key"), nb::arg("key"), nb::arg("hang_s").none(),
           nb::arg("as_planning"))
      .def_prop_ro("url", [](const PyClient& c) { return c.use().with([](Client& client) { return client.url(); }); })
      .def_prop_ro("epoch",
                   [](const PyClient& c) { return c.use().with([](Client& client) { return client.epoch(); }); })
      .def("acknowledge_epoch",
           [](const PyClient& c) { return c.use().with([](Client& client) { return client.acknowledge_epoch(); }); })
      .def_prop_rw(
          "timeout_s", [](const PyClient& c) { return c.use().timeout_s(); },
          [](PyClient& c, double seconds) { c.use().set_timeout(seconds); })
      .def("submit", &PyClient::submit, nb::arg("query"), nb::arg("poses").noconvert().none(),
           nb::arg("positions").noconvert().none(), nb::arg("copy"))
      .def("ask", &PyClient::ask, nb::arg("query"), nb::arg("poses").noconvert().none(),
           nb::arg("positions").noconvert().none(), nb::arg("copy"), nb::arg("timeout_s"))
      .def("pairs", &PyClient::pairs, nb::arg("query"))
      .def("certificate", &PyClient::certificate, nb::arg("query"), nb::arg("poses").none(),
           nb::arg("positions").none(), nb::arg("rows").none())
      .def("plan_on_device", &PyClient::plan_on_device, nb::arg("query"), nb::arg("configurations"))
      .def("set_poses", &PyClient::set_poses, nb::arg("ids"), nb::arg("poses"), nb::arg("stamp_ns"),
           nb::arg("sequence"))
      .def("set_points", &PyClient::set_points, nb::arg("body"), nb::arg("xyz"), nb::arg("radius").none(),
           nb::arg("stamp_ns"), nb::arg("sequence"))
      .def("set_joints", &PyClient::set_joints, nb::arg("ids"), nb::arg("positions"), nb::arg("stamp_ns"),
           nb::arg("sequence"))
      .def("joints", &PyClient::joints)
      .def("attach", &PyClient::attach, nb::arg("child"), nb::arg("parent"), nb::arg("pose").none(), nb::arg("allow"))
      .def("allow", &PyClient::allow, nb::arg("a"), nb::arg("b"), nb::arg("allow"))
      .def("reload", &PyClient::reload, nb::arg("timeout_s"))
      .def("add_body", &PyClient::add_body, nb::arg("name"), nb::arg("shape"), nb::arg("numbers"), nb::arg("radius"),
           nb::arg("parent"), nb::arg("static"), nb::arg("pose").none(), nb::arg("uncertainties"), nb::arg("triangles"),
           nb::arg("mesh_as"), nb::arg("cloud"), nb::arg("replaces"))
      .def("remove_body", &PyClient::remove_body, nb::arg("name"))
      .def("scene", &PyClient::scene, nb::arg("refresh"))
      .def("body_states", &PyClient::body_states)
      .def("stats", [](const PyClient& c) { return c.use().with([](Client& client) { return client.stats(); }); })
      .def("ping", &PyClient::ping, nb::arg("payload"));

  m.attr("OPTIONS") = query_options<QueryOptions>();
  m.def("wire_structs", &wire_structs);
  m.def(
      "poses_of_matrices",
      [](const Matrices& matrices, double tolerance, const WritablePoseRows& poses) {
        if (poses.shape(0) != matrices.shape(0)) throw nb::value_error("poses: expected one row for each matrix");
        return poses_of_matrices(matrices.data(), matrices.shape(0), tolerance, poses.data());
      },
      nb::arg("matrices"), nb::arg("tolerance"), nb::arg("poses").noconvert());
}

}  // namespace clearance::python
