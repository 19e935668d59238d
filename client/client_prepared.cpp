// Prepared queries of a client.
#include <algorithm>
#include <span>
#include <type_traits>

#include "client/client_impl.h"
#include "wire/api/owned_query.h"
#include "wire/api/query_names.h"

namespace clearance {

using wire::ErrorCode;
using wire::FrameType;

namespace {

/// Checks the options, as the daemon does in each run. Throws RequestError.
void check_options(const Query& query) {
  try {
    wire::QueryHeader alone;
    copy_options(query, alone);
    wire::parse_query(std::as_bytes(std::span(&alone, 1)), false, query_records(query));
  } catch (const wire::WireError& error) {
    throw RequestError(static_cast<std::uint16_t>(error.code), error.what());
  }
  check_contradictions(query);
}

}  // namespace

struct Client::Impl::Prepared final : clearance::Prepared::Runner {
  Prepared(std::shared_ptr<Impl> of, const Query& query) : client(std::move(of)), owned(query) {
    check_options(query);
    revision = client->get_scene().revision;
    names = names_in(owned.query, *client->scene, joints());
  }

  Result run(const clearance::Prepared::Inputs& inputs) override {
    return in_present_scene([&](const QueryExtras& extras) {
      const std::uint64_t id = client->send_query(FrameType::kQuery, at(inputs), extras);
      return result_of(client->receive(id, FrameType::kReply));
    });
  }

  Pending submit(const clearance::Prepared::Inputs& inputs, WhenDone when_done) override {
    if (is_stale()) throw_stale();
    return Impl::submit(client, at(inputs), std::move(when_done), {.scene_revision = revision});
  }

  DeviceQuery on_device(std::uint32_t configurations) override {
    return in_present_scene([&](QueryExtras extras) {
      extras.plan = configurations;
      return Impl::open_plan(client, owned.query, extras);
    });
  }

  bool is_stale() override {
    const SceneInfo& known = client->get_scene();
    if (known.revision == revision) return false;
    why = changed_name(names, owned.query, known, joints());
    if (why.empty()) revision = known.revision;
    return !why.empty();
  }

 private:
  /// Sends a query, and again if the scene has changed and the ids have kept their meaning.
  template <class Send>
  std::invoke_result_t<Send, QueryExtras> in_present_scene(Send&& send) {
    try {
      return send(QueryExtras{.scene_revision = revision});
    } catch (const RequestError& error) {
      if (error.code != static_cast<std::uint16_t>(ErrorCode::kWrongScene)) throw;
    }
    const SceneInfo now = client->fetch_scene();  // the caller's own ids stay those of its last scene
    why = changed_name(names, owned.query, now, joints());
    if (!why.empty()) throw_stale();
    revision = now.revision;
    return send(QueryExtras{.scene_revision = revision});
  }
  [[noreturn]] void throw_stale() const {
    throw StaleQuery(static_cast<std::uint16_t>(ErrorCode::kWrongScene), client->url() + ": prepared query: " + why);
  }
  Query at(const clearance::Prepared::Inputs& inputs) const {
    Query query = owned.query;
    query.positions = inputs.positions;
    query.configurations = inputs.configurations;
    query.growths = inputs.growths;
    query.velocities = inputs.velocities;
    query.twists = inputs.twists;
    return query;
  }
  JointsInfo joints() const { return owned.joints.empty() ? JointsInfo() : client->fetch_joints(); }

  const std::shared_ptr<Impl> client;
  const OwnedQuery owned;
  QueryNames names;
  std::uint64_t revision = 0;  ///< a scene in which the ids have their meaning
  std::string why;             ///< what changed, if the query is stale
};

Prepared Client::prepare(const Query& query) {
  impl();  // throws if moved from
  return Prepared(std::make_unique<Impl::Prepared>(impl_, query));
}

}  // namespace clearance
