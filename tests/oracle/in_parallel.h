// Distributes the work of oracle runs to threads.
#pragma once

#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace clearance::exact {

/// Calls f(0) ... f(count - 1), each once, on some threads. After an exception no more calls begin, and one exception
/// is rethrown.
template <class Function>
void in_parallel(std::size_t count, int threads, const Function& f) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr error;
  const auto work = [&] {
    for (std::size_t k; (k = next++) < count;) try {
        f(k);
      } catch (...) {
        const std::lock_guard lock(mutex);
        error = std::current_exception();
        next = count;
      }
  };
  std::vector<std::thread> all;
  for (int t = 0; t < threads; ++t) all.emplace_back(work);
  for (std::thread& t : all) t.join();
  if (error) std::rethrow_exception(error);
}

}  // namespace clearance::exact
