#include "reloader.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>

namespace clearance {

namespace {

constexpr int kNicer = 10;  // than the threads that answer

}  // namespace

Reloader::~Reloader() {
  if (thread_.joinable()) thread_.join();
}

std::optional<Reloader::Outcome> Reloader::poll() {
  std::optional<Outcome> outcome;
  if (thread_.joinable() && ended_) {
    thread_.join();
    outcome = std::move(outcome_);
    outcome_ = {};
    ended_ = false;
  }
  if (!thread_.joinable() && asked_.exchange(false)) {
    outcome_.number = ++begun_;
    thread_ = std::thread([this] { load(); });
  }
  return outcome;
}

void Reloader::load() {
  const auto begin = std::chrono::steady_clock::now();
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNicer);  // of this thread, and of those that it starts
  try {
    outcome_.engine = make_();
  } catch (const std::exception& error) {
    outcome_.error = error.what();
  }
  outcome_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  ended_ = true;
  done_();
}

}  // namespace clearance
