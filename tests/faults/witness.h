// Clients that send queries with known answers without end, and check every bit of the replies.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "client/client.h"
#include "tests/patience.h"

namespace clearance::faults {

/// A query that owns its arrays, and the engine's own answer to it.
struct KnownQuery {
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> configurations;
  Query query;                    ///< views of the above
  std::vector<std::byte> answer;  ///< row and pair counts, then every column
};

/// Queries of all kinds and sizes about a scene, with answers by an engine in this process. Every query places all
/// movable bodies, so that pose updates do not change its answer.
class Exam {
 public:
  Exam(const std::string& scene_file, std::uint64_t seed);
  const KnownQuery& draw(std::mt19937_64& random) const { return *queries_[random() % queries_.size()]; }
  const std::vector<std::unique_ptr<KnownQuery>>& queries() const { return queries_; }

 private:
  std::vector<std::unique_ptr<KnownQuery>> queries_;
};

/// Returns whether the reply has the engine's bits.
bool is_right(const Result& reply, const KnownQuery& known);
/// Returns the answer, repeating the query if LCM lost one. Throws as Client::distances().
Result request_surely(Client& client, const KnownQuery& known);

/// LCM loses packets if a core reads them too late; an answer is then late, but never wrong.
inline bool may_lose(const std::string& url) {
  return url.rfind("udpm://", 0) == 0;
}
/// Timeout of a call that must not be late.
inline std::chrono::nanoseconds patience(const std::string& url) {
  return may_lose(url) ? std::chrono::seconds(5) : kPatience;
}

/// A client on its own thread.
class Witness {
 public:
  struct Counts {
    std::uint64_t right = 0;    ///< answers with all bits correct
    std::uint64_t wrong = 0;    ///< answers with a wrong bit: must be 0
    std::uint64_t lost = 0;     ///< calls that ended with a ConnectionError
    std::uint64_t renewed = 0;  ///< calls that ended with NewEpoch, which was acknowledged
    std::uint64_t late = 0;     ///< calls that ended with a TimeoutError
    std::uint64_t busy = 0;     ///< rejected (RequestError)
    std::uint64_t others = 0;   ///< calls that ended with another error: must be 0
  };

  /// Connects and gets every query answered once, so that its segments have their final size.
  /// \param load share of the time in which it sends queries
  /// \param timeout of each call
  Witness(const std::string& url, const Exam& exam, std::uint64_t seed, double load, std::chrono::nanoseconds timeout);
  Witness(const std::string& url, const Exam& exam, std::uint64_t seed, double load = 1)
      : Witness(url, exam, seed, load, patience(url)) {}
  ~Witness() { stop(); }
  void stop();

  Counts counts() const;
  /// Correct answers so far.
  std::uint64_t right() const { return right_; }
  /// The messages of the first few errors.
  std::vector<std::string> complaints() const;
  const std::string& url() const { return url_; }

 private:
  void evaluate(const KnownQuery& known);
  void run(std::uint64_t seed);
  void acknowledge();
  void complain(const std::string& text);

  std::string url_;
  const Exam& exam_;
  double load_;
  Client client_;
  std::atomic<std::uint64_t> right_{0};
  mutable std::mutex mutex_;
  Counts counts_;
  std::vector<std::string> complaints_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

using Witnesses = std::vector<std::unique_ptr<Witness>>;

/// Waits until each witness has this many more correct answers, at most kPatience each. Describes those that did not,
/// or returns an empty string.
std::string await_answers(const Witnesses& witnesses, std::uint64_t count);

}  // namespace clearance::faults
