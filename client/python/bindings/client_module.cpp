// clearance._client: the C++ client in a Python process. The public interface is clearance/_front/client.py.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <utility>

#include "client/client.h"
#include "client/python/bindings/answer.h"
#include "client/python/bindings/client_scene.h"
#include "client/python/bindings/connection.h"
#include "client/python/bindings/gil.h"
#include "client/python/bindings/matrices.h"
#include "client/python/bindings/path.h"
#include "client/python/bindings/pending.h"
#include "client/python/bindings/query.h"
#include "client/python/bindings/remote_plan.h"
#include "client/requests.h"
#include "wire/layout.h"

namespace clearance::python {
namespace {

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

using Matrices = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
using WritablePoseRows = nb::ndarray<double, nb::shape<-1, 7>, nb::c_contig, nb::device::cpu>;

class PyClient : public PyClientScene {
 public:
  PyClient(const std::vector<std::string>& urls, double timeout_s, const std::string& server_key,
           const std::string& key, std::optional<double> hang_s, bool as_planning) {
    ConnectOptions options{duration_of(timeout_s), server_key, key, {}, as_planning};
    if (hang_s) options.hang = duration_of(*hang_s);
    const GilRelease release;
    open(urls, options);
  }

  std::unique_ptr<PyPending> submit(const Query& query, std::optional<PosesArray> poses,
                                    std::optional<PositionsArray> positions, bool copy) const {
    const Configurations at{std::move(poses), std::move(positions)};
    Pending pending = use().with([&](Client& client) {
      check_scene(client, query);
      return client.submit(query_of(query, at));
    });
    return std::make_unique<PyPending>(connection_, std::move(pending), copy,
                                       beyond_limits(query, numbers_of(at.positions)));
  }

  /// Returns the answer, or nothing after the timeout. Combines submit, wait and answer.
  std::optional<Answer> ask(const Query& query, std::optional<PosesArray> poses,
                            std::optional<PositionsArray> positions, bool copy, double timeout_s) const {
    const Configurations at{std::move(poses), std::move(positions)};
    return answer_to(query, query_of(query, at), copy, timeout_s);
  }

  /// The same for positions of joints, and the ends of motions or velocities (RowsOfRun). Returns None for arrays that
  /// need a conversion, and False after the timeout.
  nb::object ask_rows(const Query& query, bool copy, double timeout_s, nb::handle first, nb::handle second) const {
    const RowsOfRun rows(query, first, second);
    if (rows.count() == 0) return nb::none();
    clearance::Query requested = query_of(query);
    requested.positions = rows.numbers();
    requested.velocities = rows.velocities();
    std::optional<Answer> answer = answer_to(query, requested, copy, timeout_s);
    return answer ? nb::cast(std::move(*answer)) : nb::bool_(false);
  }

  nb::tuple find_path(const Query& query, const PathSearch& search) const {
    return python::find_path(query, search, [&] { return Prover(*this, query); });
  }

 private:
  /// Proves motions by requests, within the client's timeout each. Other threads may use the connection between them.
  class Prover final : public EdgeProver {
   public:
    Prover(const PyClient& client, const Query& query)
        : client_(client), query_(query), requested_(query_of(query)), timeout_s_(client.use().timeout_s()) {}

    bool is_free(std::span<const double> ends) override {
      requested_.positions = ends;
      const std::optional<Result> reply = client_.reply_to(query_, requested_, timeout_s_);
      if (!reply) throw TimeoutError("plan(): no answer within the client's timeout");
      if (Clock::now() - tested_ > kSearchSignalPeriod) {
        check_signals();
        tested_ = Clock::now();
      }
      return reply->verdict()[0] == Status::kBeyond;
    }

   private:
    const PyClient& client_;
    const Query& query_;
    clearance::Query requested_;
    const double timeout_s_;
    Clock::time_point tested_ = Clock::now();
  };

  std::optional<Answer> answer_to(const Query& query, const clearance::Query& requested, bool copy,
                                  double timeout_s) const {
    std::optional<Result> reply = reply_to(query, requested, timeout_s);
    if (!reply) return std::nullopt;
    return answer_of(connection_, std::move(*reply), copy, beyond_limits(query, requested.positions));
  }

  /// Returns the reply, or nothing after the timeout.
  std::optional<Result> reply_to(const Query& query, const clearance::Query& requested, double timeout_s) const {
    UnderWay under_way{connection_, std::nullopt};
    std::optional<Result> reply;
    const auto deadline = Clock::now() + duration_of(timeout_s);
    while (true) {
      use().with([&](Client& client) {
        std::optional<Pending>& pending = under_way.pending;
        if (!pending) {
          check_scene(client, query);
          pending.emplace(client.submit(requested));
        }
        const auto left = deadline - Clock::now();
        if (pending->wait_for(std::clamp<Clock::duration>(left, Clock::duration(0), kSlice))) reply = pending->get();
      });
      if (reply) return reply;
      if (Clock::now() >= deadline) return std::nullopt;
      check_signals();
    }
  }

 public:
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
      return client.prepare(query_of(query)).on_device(configurations);
    }));
  }

  double ping(nb::bytes payload) const {
    const std::span<const std::byte> bytes(static_cast<const std::byte*>(payload.data()), payload.size());
    const auto took = use().with([&](Client& client) { return client.ping(bytes); });
    return std::chrono::duration<double>(took).count();
  }
};

void translate_exceptions() {
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
}

void bind_client(nb::module_& m) {
  nb::class_<PyPending>(m, "Pending")
      .def("wait", &PyPending::wait, nb::arg("timeout_s"))
      .def("answer", &PyPending::answer)
      .def("cancel", &PyPending::cancel);

  nb::class_<PyClient> type(m, "Client");
  bind_client_scene(type);
  bind_find_path<Query>(type);
  type.def(nb::init<const std::vector<std::string>&, double, const std::string&, const std::string&,
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
      .def("ask_rows", &PyClient::ask_rows, nb::arg("query"), nb::arg("copy"), nb::arg("timeout_s"),
           nb::arg("first").none(), nb::arg("second") = nb::none())
      .def_static(
          "check_options", [](const Query& query) { check_contradictions(query_of(query)); }, nb::arg("query"))
      .def("pairs", &PyClient::pairs, nb::arg("query"))
      .def("certificate", &PyClient::certificate, nb::arg("query"), nb::arg("poses").none(),
           nb::arg("positions").none(), nb::arg("rows").none())
      .def("plan_on_device", &PyClient::plan_on_device, nb::arg("query"), nb::arg("configurations"))
      .def("stats", [](const PyClient& c) { return c.use().with([](Client& client) { return client.stats(); }); })
      .def("ping", &PyClient::ping, nb::arg("payload"));
}

}  // namespace

NB_MODULE(_client, m) {
  nb::set_leak_warnings(false);  // a program that ends with exit() does not free its caches
  translate_exceptions();
  bind_query<Query>(m);
  bind_answer(m);
  bind_remote_plan(m);

  bind_client(m);

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
