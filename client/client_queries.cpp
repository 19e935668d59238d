// Queries of a client.
#include <cstring>

#include "client/client_impl.h"
#include "wire/api/decisions.h"

namespace clearance {

using wire::FrameType;

Result Client::distances(const Query& query) {
  return result_of(impl().receive(impl().send_query(FrameType::kQuery, query), FrameType::kReply));
}

Check Client::check(const Query& query) {
  const Result result = distances(as_check(query));
  return check_with_limits(query, result, [&](bool is_now) {
    return &impl().joints_at(result.scene_revision(), is_now ? result.snapshot_revision() : 0);
  });
}

Result Client::motions(const Query& query) {
  return distances(as_motions(query));
}

PathCheck Client::check_path(const Query& query) {
  return check_path_with(
      query, [this](const Query& motions) { return distances(motions); },
      [this](const Result& result) { return &impl().joints_at(result.scene_revision(), 0); });
}

PreparedPath Client::prepare_path(const Query& query) {
  return {*this, query, query.joints.empty() ? JointsInfo() : joint_states()};
}

std::vector<double> Client::free_scale(const Query& query, std::span<const double> weights) {
  const Result result = distances(as_free_scale(query, weights));
  return {result.free_scale().begin(), result.free_scale().end()};
}

void Client::wait_for_poses(std::int64_t stamp_ns, std::uint32_t of, Duration timeout) {
  if (stamp_ns <= 0)
    throw std::invalid_argument("wait_for_poses: expected a stamp above 0, got " + std::to_string(stamp_ns));
  if (timeout <= Duration(0) || timeout > std::chrono::nanoseconds(kLongestPoseWait))
    throw std::invalid_argument("wait_for_poses: expected a timeout above 0, at most 10 s, got " +
                                std::to_string(timeout.count()) + " ns");
  Query query{.all_pairs = false};
  query.min_pose_stamp_ns = stamp_ns;
  query.deadline_ns = timeout.count();
  query.wait_for = of;
  query.check_scene = of != kEveryBody;
  const std::uint64_t request = impl().send_query(FrameType::kQuery, query);
  impl().receive(request, FrameType::kReply, timeout + impl().connection.timeout());
}

std::vector<IdPair> Client::pairs(const Query& query) {
  const auto frame = impl().receive(impl().send_query(FrameType::kPairs, query), FrameType::kPairTable);
  const auto table = impl().checked([&] { return wire::parse_pair_table(impl().body_of(*frame)); });
  std::vector<IdPair> pairs(table.pairs.size());
  if (!pairs.empty()) std::memcpy(pairs.data(), table.pairs.data(), table.pairs.size_bytes());
  return pairs;
}

std::string Client::certificate(const Query& query, std::optional<std::span<const std::uint64_t>> rows) {
  const auto frame =
      impl().receive(impl().send_query(FrameType::kCertify, query, {.rows = rows}), FrameType::kCertificate);
  const std::span<const std::byte> text = impl().body_of(*frame);
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

}  // namespace clearance
