#include "server/zmq/key_authenticator.h"

#include <stdexcept>
#include <utility>

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {
namespace {

constexpr auto kReadKeysEvery = std::chrono::seconds(1);

}  // namespace

bool KeyAuthenticator::admits(RequestHandler& handler, const std::string& address, const std::string& key) {
  refresh();
  const AuthorizedKeys::Entry* entry = keys_->find(key);
  if (!entry) {
    rejected(handler,
             "reason=\"this key is not authorized\" address=" + log_text(address) + " key=\"" + log_text(key) + "\"");
    return false;
  }
  ++handler.counter("zmq.keys_accepted");
  log::info("event=key_accepted address={} key=\"{}\" name=\"{}\" rights={}", log_text(address), log_text(key),
            log_text(entry->name), rights_text(entry->rights));
  return true;
}

void KeyAuthenticator::rejected(RequestHandler& handler, const std::string& what) {
  ++handler.counter("zmq.rejected");
  const auto now = std::chrono::steady_clock::now();
  if (now < next_line_) {
    ++unsaid_;  // a peer that keeps trying must not fill the log
    return;
  }
  next_line_ = now + std::chrono::seconds(1);
  log::warn("event=zmq_rejected more={} {}", std::exchange(unsaid_, 0), what);
}

void KeyAuthenticator::tick() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_check_) return;
  next_check_ = now + kReadKeysEvery;
  refresh();
}

void KeyAuthenticator::refresh() {
  try {
    if (keys_->refresh()) log::info("event=keys_read keys={}", keys_->size());
  } catch (const std::runtime_error& error) {
    log::error("event=keys_not_read error=\"{}\"", log_text(error.what()));
  }
}

}  // namespace clearance
