// Limits of requests in progress per client: the accounts alone, without a loop.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/base/rejected_request.h"
#include "server/limits/quotas.h"

namespace clearance {
namespace {

constexpr auto kPlanning = ServiceClass::kPlanning;

constexpr Quotas::Limits kSmall{.max_waiting_per_client = 3, .max_waiting_bytes = 1000, .max_client_bytes = 500};

/// The rejection of a client, or an empty string if it is admitted.
template <class Check>
std::string rejection(Check check) {
  try {
    check();
    return "";
  } catch (const RejectedRequest& rejection) {
    EXPECT_EQ(rejection.code, wire::ErrorCode::kBusy);
    return rejection.text;
  }
}

class ClientQuotas : public testing::Test {
 protected:
  std::string requests(std::uint64_t client) {
    return rejection([&] { quotas_.check_requests(client); });
  }
  std::string bytes(std::uint64_t client, std::uint64_t count, std::uint64_t unsent = 0) {
    return rejection([&] { quotas_.check_bytes(client, kPlanning, count, unsent); });
  }

  Quotas quotas_{kSmall};
};

TEST_F(ClientQuotas, RequestsOfOneClient) {
  std::vector<Quotas::Share> shares;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(requests(1), "");
    shares.push_back(quotas_.take(1, kPlanning, 0));
  }
  EXPECT_EQ(requests(1), "3 queries of this client are under way already; retry later (limit max-waiting)");
  EXPECT_EQ(requests(2), "") << "another client is not concerned";
  shares.pop_back();
  EXPECT_EQ(requests(1), "");
}

TEST_F(ClientQuotas, BytesOfOneClient) {
  const Quotas::Share share = quotas_.take(1, kPlanning, 300);
  EXPECT_EQ(bytes(1, 200), "");
  EXPECT_EQ(bytes(1, 150), "");
  EXPECT_EQ(
      bytes(1, 201),
      "the requests and replies of this client under way take 300 bytes already; retry later (limit max-client-mib)");
  EXPECT_EQ(bytes(2, 500), "") << "another client is not concerned";
  EXPECT_EQ(
      bytes(1, 150, 51),
      "the requests and replies of this client under way take 351 bytes already; retry later (limit max-client-mib)")
      << "replies that it has not taken count";
}

TEST_F(ClientQuotas, OneRequestMayAlwaysBeUnderWay) {
  EXPECT_EQ(bytes(1, 5000), "");
  EXPECT_EQ(
      bytes(1, 5000, 1),
      "the requests and replies of this client under way take 1 bytes already; retry later (limit max-client-mib)");
  const Quotas::Share large = quotas_.take(1, kPlanning, 5000);
  EXPECT_NE(bytes(1, 0), "");
  EXPECT_EQ(bytes(2, 1), "the requests and replies under way take 5000 bytes already; retry later");
}

TEST_F(ClientQuotas, BytesOfAllClients) {
  std::vector<Quotas::Share> shares;
  for (std::uint64_t client = 1; client <= 3; ++client) {
    EXPECT_EQ(bytes(client, 300), "");
    shares.push_back(quotas_.take(client, kPlanning, 300));
  }
  EXPECT_EQ(bytes(4, 100), "");
  EXPECT_EQ(bytes(4, 101), "the requests and replies under way take 900 bytes already; retry later");
  shares.erase(shares.begin());
  EXPECT_EQ(bytes(4, 400), "");
}

TEST_F(ClientQuotas, AShareIsGivenBackOnce) {
  Quotas::Share share = quotas_.take(1, kPlanning, 500);
  Quotas::Share moved = std::move(share);
  share.give_back();
  EXPECT_NE(bytes(1, 1), "") << "it is another's by now";
  Quotas::Share other = quotas_.take(2, kPlanning, 400);
  {
    Quotas::Share taken;
    taken = std::move(moved);
    EXPECT_NE(bytes(1, 1), "");
    taken.give_back();
    EXPECT_EQ(bytes(1, 1), "");
    taken.give_back();
  }
  EXPECT_EQ(bytes(1, 500), "");
  EXPECT_EQ(bytes(3, 601), "the requests and replies under way take 400 bytes already; retry later");
}

TEST_F(ClientQuotas, AmongManyClientsThoseWithRequestsUnderWayAreKept) {
  std::vector<Quotas::Share> kept;
  for (std::uint64_t client = 1; client <= 1000; ++client) {
    Quotas::Share share = quotas_.take(client, kPlanning, 0);
    if (client % 500 == 0) kept.push_back(std::move(share));
  }
  for (const std::uint64_t client : {500, 1000}) {
    const Quotas::Share second = quotas_.take(client, kPlanning, 0), third = quotas_.take(client, kPlanning, 0);
    EXPECT_NE(requests(client), "") << client;
  }
  EXPECT_EQ(requests(501), "");
}

}  // namespace
}  // namespace clearance
