// Publishers of poses over LCM: order, losses and conflicts.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/engine.h"

namespace clearance {

/// Follows the sequence numbers of each publisher on each channel. UDP loses, reorders and repeats messages: the newest
/// wins, older ones are left out, and missing ones are counted.
///
/// A publisher draws its id when it starts, so after a restart it is another one. If it keeps its id, its clock shows
/// the restart: a lower sequence with a newer stamp than all before cannot be an old message. From then on, messages
/// with earlier stamps are old, whatever their sequence.
class PublisherLog {
 public:
  using Clock = std::chrono::steady_clock;
  /// Publishers remembered. Beyond it, the one silent for longest is forgotten.
  static constexpr std::size_t kMaxPublishers = 256;

  enum class Sequencing { kNew, kNext, kGap, kRestart, kRepeated, kOld };
  struct Note {
    Sequencing sequencing = Sequencing::kNew;
    std::uint64_t missing = 0;  ///< kGap: messages between the last and this one
    bool use() const { return sequencing != Sequencing::kRepeated && sequencing != Sequencing::kOld; }
  };

  /// @param stamp_ns the publisher's clock, or 0 if it has none
  Note note(int channel, std::int64_t publisher, std::int64_t sequence, std::int64_t stamp_ns, Clock::time_point now);
  std::size_t size() const { return publishers_.size(); }

 private:
  struct Key {
    std::int64_t publisher;
    int channel;
    bool operator==(const Key&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Key& key) const {
      return std::hash<std::int64_t>()(key.publisher) * 31 + static_cast<std::size_t>(key.channel);
    }
  };
  struct Publisher {
    std::int64_t sequence = 0;
    std::int64_t newest_ns = 0;  ///< stamp
    std::int64_t begun_ns = 0;   ///< first stamp since a restart, or 0
    Clock::time_point last;      ///< of an accepted message
  };
  std::unordered_map<Key, Publisher, Hash> publishers_;
};

/// Detects publishers that move the same body or joint in turns. A single takeover (after a restart) is no conflict.
class OwnerLog {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kWindow{5};
  static constexpr std::size_t kRemembered = 4;  ///< publishers of each, which is the most that are detected in turns

  explicit OwnerLog(std::size_t things) : owners_(things) {}

  /// Returns those of this update that others have moved since this publisher did, within the window.
  std::vector<std::uint32_t> note(std::int64_t publisher, std::span<const std::uint32_t> ids, Clock::time_point now);

 private:
  struct Owner {
    std::int64_t publisher = 0;
    Clock::time_point last;
  };
  std::vector<std::array<Owner, kRemembered>> owners_;  // by id, the last to move it first
};

/// Maps ids that clients and publishers drew to the loop's numbers. Beyond the limit all are numbered again.
class LcmClients {
 public:
  static constexpr std::size_t kMaxClients = 4096;
  std::uint64_t number_of(std::int64_t lcm_client);

 private:
  std::unordered_map<std::int64_t, std::uint64_t> numbers_;
};

}  // namespace clearance
