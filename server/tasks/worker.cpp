#include "server/tasks/worker.h"

#include <sys/eventfd.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

namespace clearance {

Worker::Worker(const Options& options, std::function<void()> done)
    : call_(std::move(done)),
      own_thread_(options.own_thread),
      nice_(options.nice),
      wake_fd_(eventfd(0, EFD_CLOEXEC)),
      scheduler_(options.slice) {
  if (!wake_fd_) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
  if (own_thread_) thread_ = std::thread([this] { serve(); });
}

Worker::~Worker() {
  ending_ = true;
  wake();
  if (thread_.joinable()) thread_.join();
}

void Worker::wake() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_fd_.get(), &one, sizeof one);
}

void Worker::add(QueryPtr query) {
  with_workers_.push_back(query.get());
  deadline_ = std::min(deadline_, query->deadline());
  if (added_.put(std::move(query))) wake();
}

std::vector<Worker::QueryPtr> Worker::take() {
  std::vector<QueryPtr> taken = done_.take();
  std::erase_if(with_workers_, [&](const ScheduledQuery* query) {
    return std::any_of(taken.begin(), taken.end(), [&](const QueryPtr& one) { return one.get() == query; });
  });
  return taken;
}

void Worker::check_clients() {
  for (ScheduledQuery* query : with_workers_) query->check_client();
}

void Worker::expire(ScheduledQuery::Clock::time_point now) {
  if (now < deadline_) return;
  deadline_ = ScheduledQuery::Clock::time_point::max();
  for (ScheduledQuery* query : with_workers_)
    if (query->deadline() > now)
      deadline_ = std::min(deadline_, query->deadline());
    else
      query->expire();
}

void Worker::drop(std::shared_ptr<void> thing) {
  if (dropped_.put(std::move(thing))) wake();
}

bool Worker::work() {
  dropped_.take();
  for (QueryPtr& query : added_.take()) scheduler_.add(std::move(query));
  if (scheduler_.empty()) return false;
  scheduler_.work(Scheduler::Clock::now(), [this](QueryPtr query) {
    if (done_.put(std::move(query)) && own_thread_) call_();
  });
  return true;
}

void Worker::serve() {
  // For this thread alone, which Linux lets a thread do.
  if (nice_ != 0) setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + nice_);
  while (!ending_) {
    if (work()) continue;
    std::uint64_t woken;  // set after the mailboxes
    [[maybe_unused]] const auto taken = read(wake_fd_.get(), &woken, sizeof woken);
  }
}

}  // namespace clearance
