// Who publishes poses over LCM: order, losses and quarrels.
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

/// Follows the sequence numbers of each publisher on each channel. UDP loses and (on real networks) reorders and
/// repeats: the newest message wins, an older one is left out however old it is, and what is missing is counted.
///
/// A publisher draws its id when it starts, so one that has begun anew is another one. One that keeps its id is known
/// by its clock, which goes on where its count begins anew: a lower sequence under a stamp newer than all before cannot
/// be an old message. From then on messages with stamps from before are those of its former life, whatever their
/// sequence.
class PublisherLog {
 public:
  using Clock = std::chrono::steady_clock;
  /// Publishers remembered; past that the one silent for longest is forgotten.
  static constexpr std::size_t kMaxPublishers = 256;

  enum class Sequencing { kNew, kNext, kGap, kRestart, kRepeated, kOld };
  struct Note {
    Sequencing sequencing = Sequencing::kNew;
    std::uint64_t missing = 0;  ///< kGap: messages between the last and this one
    bool use() const { return sequencing != Sequencing::kRepeated && sequencing != Sequencing::kOld; }
  };

  /// \param stamp_ns the publisher's clock; 0: it gives none.
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
    std::int64_t begun_ns = 0;   ///< first stamp since it began anew; 0: it has not
    Clock::time_point last;      ///< of a message that was used
  };
  std::unordered_map<Key, Publisher, Hash> publishers_;
};

/// Notices publishers that move the same body, or joint, in turns. One that takes over from another (a restart) is no
/// quarrel.
class OwnerLog {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kWindow{5};
  static constexpr std::size_t kRemembered = 4;  ///< publishers of each: that many may take turns and be noticed

  explicit OwnerLog(std::size_t things) : owners_(things) {}

  /// Returns those of this update that others have moved since this publisher did, within the window.
  std::vector<std::uint32_t> note(std::int64_t publisher, std::span<const std::uint32_t> ids, Clock::time_point now);

 private:
  struct Owner {
    std::int64_t publisher = 0;
    Clock::time_point last;
  };
  std::vector<std::array<Owner, kRemembered>> owners_;  // by id; the last to move it first
};

/// The loop's numbers for clients and publishers that drew their own. Past so many all are numbered anew.
class LcmClients {
 public:
  static constexpr std::size_t kMaxClients = 4096;
  std::uint64_t number_of(std::int64_t lcm_client);

 private:
  std::unordered_map<std::int64_t, std::uint64_t> numbers_;
};

}  // namespace clearance
