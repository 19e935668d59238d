// Authenticates TCP clients by their public keys.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "server/access/authorized_keys.h"
#include "server/requests/transport.h"

namespace clearance {

class KeyAuthenticator {
 public:
  explicit KeyAuthenticator(std::shared_ptr<AuthorizedKeys> keys) : keys_(std::move(keys)) {}

  /// Whether the current list has a key. The arguments come from unauthenticated peers.
  bool admits(RequestHandler& handler, const std::string& address, const std::string& key);
  /// Counts a rejected peer, and logs it at most once a second.
  void rejected(RequestHandler& handler, const std::string& what);
  /// Checks now and then whether the list has changed.
  void tick();
  const KeyPair& own() const { return keys_->own(); }

 private:
  void refresh();

  std::shared_ptr<AuthorizedKeys> keys_;
  std::chrono::steady_clock::time_point next_line_{}, next_check_{};
  std::uint64_t unsaid_ = 0;
};

}  // namespace clearance
