// Where those who knock at TCP endpoints with keys are looked up.
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

  /// Whether a key may come in, by the list as it is now. Both are texts that others chose.
  bool admits(RequestHandler& handler, const std::string& address, const std::string& key);
  /// Counts somebody who was refused, and tells of it at most once a second.
  void refused(RequestHandler& handler, const std::string& what);
  /// Looks now and then whether the list has changed.
  void tick();
  const KeyPair& own() const { return keys_->own(); }

 private:
  void refresh();

  std::shared_ptr<AuthorizedKeys> keys_;
  std::chrono::steady_clock::time_point next_line_{}, next_look_{};
  std::uint64_t unsaid_ = 0;
};

}  // namespace clearance
