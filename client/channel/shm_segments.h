// The segments of a shared-memory connection: the one in use, and smaller ones that still hold requests or frames.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/channel/shm_client_segment.h"
#include "client/channel/shm_socket.h"

namespace clearance {

using SegmentPtr = std::shared_ptr<ClientSegment>;

/// Not thread-safe.
class ShmSegments {
 public:
  /// \param socket has to outlive this
  ShmSegments(ShmSocket& socket, std::string url) : socket_(socket), url_(std::move(url)) {}

  void open(const shm::UniqueFd& first) { current_ = std::make_shared<ClientSegment>(first, url_); }
  const SegmentPtr& current() const { return current_; }
  /// Changes to a segment with slots of this size. Returns false and sets `why` if the daemon rejects it.
  bool grow(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline, const Channel::Watch& watch,
            std::string& why);
  /// Releases outgrown segments without requests, replies or frames.
  void retire_outgrown();
  /// Returns segment and slot of a pending request; a null segment if there is none.
  std::pair<SegmentPtr, std::uint32_t> find(std::uint64_t request_id) const;
  /// Receives the newly posted replies. Returns false for an invalid entry.
  bool collect();

 private:
  bool request(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline, const Channel::Watch& watch,
               std::string& why);

  ShmSocket& socket_;
  std::string url_;
  SegmentPtr current_;
  std::vector<SegmentPtr> outgrown_;
};

}  // namespace clearance
