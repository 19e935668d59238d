// Clients that ask without end what is known already, and look at every bit of what they are told.
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

/// A question that owns its arrays, and the engine's own answer to it.
struct KnownQuery {
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> configurations;
  Query query;                    ///< views of the above
  std::vector<std::byte> answer;  ///< row and pair counts, then every column
};

/// Questions of all kinds and sizes about a scene, with answers by an engine in this process. Every question places all
/// movable bodies, so that no pose update changes its answer.
class Exam {
 public:
  Exam(const std::string& scene_file, std::uint64_t seed);
  const KnownQuery& draw(std::mt19937_64& random) const { return *questions_[random() % questions_.size()]; }
  const std::vector<std::unique_ptr<KnownQuery>>& questions() const { return questions_; }

 private:
  std::vector<std::unique_ptr<KnownQuery>> questions_;
};

/// Whether the reply holds the engine's own bits.
bool is_right(const Reply& reply, const KnownQuery& question);
/// The answer; asks again where LCM lost one. Throws as Client::distances().
Reply ask_surely(Client& client, const KnownQuery& question);

/// LCM loses packets when a core is late to read them; an answer is then late, never wrong.
inline bool may_lose(const std::string& url) {
  return url.rfind("udpm://", 0) == 0;
}
/// How long a call may take that is not to be late.
inline std::chrono::nanoseconds patience(const std::string& url) {
  return may_lose(url) ? std::chrono::seconds(5) : kPatience;
}

/// A client on a thread of its own.
class Witness {
 public:
  struct Counts {
    std::uint64_t right = 0;    ///< answers with every bit as it should be
    std::uint64_t wrong = 0;    ///< answers with another bit: never
    std::uint64_t lost = 0;     ///< calls that ended with a ConnectionError
    std::uint64_t renewed = 0;  ///< calls that ended with NewEpoch, which was acknowledged
    std::uint64_t late = 0;     ///< calls that ended with a TimeoutError
    std::uint64_t busy = 0;     ///< refused (RequestError)
    std::uint64_t others = 0;   ///< that ended with anything else: never
  };

  /// Connects and has every question answered once, so that its segments have their size. \param load of the time that
  /// it asks; the rest it sleeps. \param timeout of each call.
  Witness(const std::string& url, const Exam& exam, std::uint64_t seed, double load, std::chrono::nanoseconds timeout);
  Witness(const std::string& url, const Exam& exam, std::uint64_t seed, double load = 1)
      : Witness(url, exam, seed, load, patience(url)) {}
  ~Witness() { stop(); }
  void stop();

  Counts counts() const;
  /// Right answers so far.
  std::uint64_t right() const { return right_; }
  /// The first few errors, in words.
  std::vector<std::string> complaints() const;
  const std::string& url() const { return url_; }

 private:
  void ask(const KnownQuery& question);
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

/// Waits until each has had so many more right answers, at most kPatience for each of them. Returns whom it waited for
/// in vain, or an empty text.
std::string await_answers(const Witnesses& witnesses, std::uint64_t count);

}  // namespace clearance::faults
