// Simulates UDP between a publisher and the daemon: loses, repeats and delays messages at random from a seed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <utility>
#include <vector>

namespace clearance {

class FaultyLink {
 public:
  struct Faults {
    double lose = 0;       ///< probabilities
    double duplicate = 0;  ///< the copy may arrive later than the message
    double delay = 0;
    int most_delay = 0;  ///< maximum delay of a message or copy, in messages
  };
  struct Counts {
    int sent = 0, lost = 0, duplicated = 0, overtaken = 0;
  };
  using Deliver = std::function<void(std::span<const std::byte>)>;

  FaultyLink(std::uint32_t seed, const Faults& faults, Deliver deliver)
      : random_(seed), faults_(faults), deliver_(std::move(deliver)) {}

  /// Accepts a message and delivers those that are due, possibly including this one.
  /// \param sequence ascending
  void send(std::int64_t sequence, std::vector<std::byte> message) {
    ++counts_.sent;
    if (chance(faults_.lose)) {
      ++counts_.lost;
    } else {
      if (chance(faults_.duplicate)) {
        ++counts_.duplicated;
        held_.push_back({sequence, counts_.sent + delay(), message});
      }
      const int later = chance(faults_.delay) ? delay() : 0;
      held_.push_back({sequence, counts_.sent + later, std::move(message)});
    }
    flush(counts_.sent);
  }
  /// Delivers all held messages, and causes no faults afterwards.
  void heal() {
    faults_ = {};
    flush(counts_.sent + 1'000'000);
  }

  const Counts& counts() const { return counts_; }
  /// Sequence numbers in order of delivery.
  const std::vector<std::int64_t>& delivered() const { return delivered_; }

 private:
  struct Held {
    std::int64_t sequence;
    int due;
    std::vector<std::byte> message;
  };
  bool chance(double p) { return std::uniform_real_distribution<double>(0, 1)(random_) < p; }
  int delay() { return std::uniform_int_distribution<int>(0, faults_.most_delay)(random_); }
  void flush(int now) {
    std::stable_sort(held_.begin(), held_.end(), [](const Held& a, const Held& b) { return a.due < b.due; });
    auto at = held_.begin();
    for (; at != held_.end() && at->due <= now; ++at) {
      if (at->sequence < newest_) ++counts_.overtaken;
      newest_ = std::max(newest_, at->sequence);
      delivered_.push_back(at->sequence);
      deliver_(at->message);
    }
    held_.erase(held_.begin(), at);
  }

  std::mt19937 random_;
  Faults faults_;
  Deliver deliver_;
  Counts counts_;
  std::int64_t newest_ = 0;
  std::vector<std::int64_t> delivered_;
  std::vector<Held> held_;
};

}  // namespace clearance
