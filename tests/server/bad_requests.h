// Requests that the daemon must reject, with code and message: the same over every transport.
//
// For the scene of kSmallSceneYaml and small_scene(): table (0, static), cup (1), link1 (2), link2 (3), one group.
#pragma once

#include <string>
#include <vector>

#include "wire/wire.h"

namespace clearance {

struct BadRequest {
  std::string name;
  wire::FrameHeader header;
  std::vector<std::byte> payload;
  wire::ErrorCode code;
  std::string text;  ///< start of the rejection's message
};

/// \param scene_revision the daemon's
std::vector<BadRequest> bad_requests(std::uint64_t scene_revision);

/// A frame that must be answered: the distance of table and cup.
std::vector<std::byte> good_query(std::uint64_t request_id);

}  // namespace clearance
