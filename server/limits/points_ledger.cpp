#include "server/limits/points_ledger.h"

#include "server/base/rejected_request.h"

namespace clearance {

void PointsLedger::begin(std::uint64_t client, std::uint64_t count) {
  const auto refuse = [&](wire::ErrorCode code, std::uint64_t got, const char* whose, std::uint64_t most,
                          const char* option) {
    throw RejectedRequest{code, "points: " + std::to_string(got) + " points " + whose + " are more than the " +
                                    std::to_string(most) + " that there may be (" + option + ")"};
  };
  if (count > limits_.max_points_of_body)
    refuse(wire::ErrorCode::kTooLarge, count, "of one body", limits_.max_points_of_body, "limit max-body-points");
  std::uint64_t own = count, all = count;
  for (const auto& [name, held] : bodies_) {
    all += held.count;
    if (held.client == client) own += held.count;
  }
  for (const auto& [who, under_way] : under_way_) {
    all += under_way;
    if (who == client) own += under_way;
  }
  if (own > limits_.max_points_of_client)
    refuse(wire::ErrorCode::kTooLarge, own, "of this client, with those that they replace",
           limits_.max_points_of_client, "limit max-client-points");
  if (all > limits_.max_points)
    refuse(wire::ErrorCode::kBusy, all, "of all clients, with those that they replace", limits_.max_points,
           "limit max-points");
  under_way_[client] += count;
}

void PointsLedger::end(std::uint64_t client, const std::string& body, std::uint64_t count, bool replaced) {
  if ((under_way_[client] -= count) == 0) under_way_.erase(client);
  if (replaced) bodies_[body] = {client, count};
}

}  // namespace clearance
