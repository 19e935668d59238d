#include "tests/faults/bad_frames.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "tests/server/core/memory_transport.h"
#include "wire/wire.h"

namespace clearance::faults {
namespace {

using wire::FrameType;
using Bytes = std::vector<std::byte>;

template <class Record, class Change>
void change(Bytes& frame, std::size_t at, Change what) {
  Record record;
  std::memcpy(&record, frame.data() + at, sizeof record);
  what(record);
  std::memcpy(frame.data() + at, &record, sizeof record);
}
template <class Change>
void change_header(Bytes& frame, Change what) {
  change<wire::FrameHeader>(frame, 0, what);
}
template <class Change>
void change_query(Bytes& frame, Change what) {
  change<wire::QueryHeader>(frame, sizeof(wire::FrameHeader), what);
}
/// Sets the header's size to that of the actual payload.
void mend_size(Bytes& frame) {
  change_header(frame, [&](auto& h) { h.payload_bytes = frame.size() - sizeof h; });
}

template <class T>
T one_of(std::mt19937_64& random, std::initializer_list<T> all) {
  return all.begin()[random() % all.size()];
}

/// A valid query of a few pairs, or of configurations.
Bytes good_frame(std::uint64_t id, std::mt19937_64& random) {
  TestQuery query;
  query.header.max_distance = 5;
  if (random() % 2)
    for (std::uint64_t n = 1 + random() % 20; n > 0; --n)
      query.pairs.push_back(
          {static_cast<std::uint32_t>(random() % 50), static_cast<std::uint32_t>(50 + random() % 50)});
  query.header.reduce = static_cast<std::uint8_t>(random() % 4);
  if (query.pairs.empty() || random() % 2) {
    query.bodies = {3, 7};
    query.configurations.assign(2 * (1 + random() % 4), Pose7{1, 2, 3, 1, 0, 0, 0});
    query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  }
  return query.frame(id);
}

/// A request of one record, followed by `extra` zeros.
template <class Record>
Bytes record_frame(FrameType type, std::uint64_t id, const Record& record, std::size_t extra = 0) {
  Bytes payload(sizeof record + extra);
  std::memcpy(payload.data(), &record, sizeof record);
  return simple_frame(type, id, payload);
}

Bytes bad_poses(std::uint64_t id, std::mt19937_64& random) {
  wire::PosesHeader poses;
  poses.count = one_of<std::uint64_t>(random, {3, std::uint64_t{1} << 58, ~std::uint64_t{0}, 1000});
  const std::size_t extra = one_of<std::size_t>(random, {0, 64, 128, 63});
  return record_frame(FrameType::kSetPoses, id, poses, extra);
}

Bytes bad_attachment(std::uint64_t id, std::mt19937_64& random) {
  wire::AttachRecord attach;
  attach.child = static_cast<std::uint32_t>(random() % 100);
  attach.parent = static_cast<std::uint32_t>(random() % 100);
  std::size_t extra = 0;
  switch (random() % 5) {
    case 0:
      attach.child = 10'000 + static_cast<std::uint32_t>(random() % 1000);
      break;
    case 1:
      attach.parent = one_of<std::uint32_t>(random, {10'000, kGroupBit, 0x7FFFFFFF});
      break;
    case 2:
      attach.parent = attach.child;
      break;
    case 3:
      attach.has_pose = static_cast<std::uint8_t>(2 + random() % 254);
      break;
    default:
      extra = 1 + random() % 64;
  }
  return record_frame(FrameType::kAttach, id, attach, extra);
}

Bytes bad_body(std::uint64_t id, std::mt19937_64& random) {
  wire::NewBodyRecord body;
  wire::set_name(body.name, "thing");
  body.shape = static_cast<std::uint8_t>(1 + random() % 4);
  std::fill(std::begin(body.size), std::end(body.size), 0.5);
  switch (random() % 8) {
    case 0:
      body.shape = static_cast<std::uint8_t>(9 + random() % 240);
      break;
    case 1:
      body.size[0] = one_of(random, {-1.0, std::nan(""), std::numeric_limits<double>::infinity()});
      break;
    case 2:
      wire::set_name(body.name, "");
      break;
    case 3:
      std::memset(body.name, 'x', sizeof body.name);  // no terminator
      break;
    case 4:
      body.vertex_count = one_of<std::uint64_t>(random, {1, std::uint64_t{1} << 60, ~std::uint64_t{0}});
      break;
    case 5:
      body.has_pose = 1;  // with a quaternion of 0
      break;
    case 6:
      body.parent = 10'000;
      break;
    default:
      body.shape = static_cast<std::uint8_t>(wire::BodyShape::kHull);  // with no vertex, or a NaN vertex
      std::fill(std::begin(body.size), std::end(body.size), 0.0);
      if (random() % 2) {
        body.vertex_count = 1;
        Bytes frame = record_frame(FrameType::kAddBody, id, body, sizeof(wire::VertexRecord));
        change<wire::VertexRecord>(frame, frame.size() - sizeof(wire::VertexRecord),
                                   [](auto& v) { v.xyz[1] = std::nan(""); });
        return frame;
      }
  }
  return record_frame(FrameType::kAddBody, id, body);
}

void spoil_values(Bytes& frame, std::mt19937_64& random) {
  const double bad = one_of(random, {std::nan(""), -1.0, -std::numeric_limits<double>::infinity()});
  change_query(frame, [&](auto& q) {
    switch (random() % 4) {
      case 0:
        q.max_distance = bad;
        break;
      case 1:
        q.abs_tol = bad;
        break;
      case 2:
        q.rel_tol = one_of(random, {std::nan(""), 1.0, 1e300, std::numeric_limits<double>::infinity()});
        break;
      default:
        q.max_pose_age_ns = -static_cast<std::int64_t>(1 + random() % 1000);
    }
  });
}

void spoil_choices(Bytes& frame, std::mt19937_64& random) {
  const auto high = static_cast<std::uint8_t>(4 + random() % 252);
  change_query(frame, [&](auto& q) {
    switch (random() % 7) {
      case 0:
        q.precision = high;
        break;
      case 1:
        q.signed_distance = high;
        break;
      case 2:
        q.reduce = high;
        break;
      case 3:
        q.fields |= 1u << (kFieldCount + random() % (32 - kFieldCount));
        break;
      default:
        q.reserved[random() % std::size(q.reserved)] = 1 + random();
    }
  });
}

}  // namespace

Bytes bad_frame(std::string_view kind, std::uint64_t id, std::mt19937_64& random) {
  Bytes frame = good_frame(id, random);
  if (kind == "magic") {
    change_header(frame, [&](auto& h) { h.magic ^= 1u << random() % 32; });
  } else if (kind == "version") {
    change_header(frame, [&](auto& h) { h.version ^= static_cast<std::uint16_t>(1u << random() % 16); });
  } else if (kind == "type") {
    change_header(frame, [&](auto& h) { h.type = static_cast<std::uint16_t>(100 + random() % 60000); });
  } else if (kind == "said size") {
    change_header(frame, [&](auto& h) {
      h.payload_bytes = one_of<std::uint64_t>(random, {0, h.payload_bytes + 1, h.payload_bytes - 1, ~std::uint64_t{0},
                                                       std::uint64_t{1} << 63, ~std::uint64_t{0} - 63});
    });
  } else if (kind == "reserved words") {
    change_header(frame, [&](auto& h) { h.reserved[random() % std::size(h.reserved)] = 1 + random() % 1000; });
  } else if (kind == "cut") {
    frame.resize(sizeof(wire::FrameHeader) + random() % (frame.size() - sizeof(wire::FrameHeader)));
    mend_size(frame);
  } else if (kind == "longer") {
    frame.resize(frame.size() + 1 + random() % 3000);
    mend_size(frame);
  } else if (kind == "noise") {
    frame.resize(sizeof(wire::FrameHeader) + 1 + random() % 4000);
    for (std::size_t i = sizeof(wire::FrameHeader); i < frame.size(); ++i) frame[i] = static_cast<std::byte>(random());
    mend_size(frame);
    const auto type = one_of(
        random, {FrameType::kQuery, FrameType::kPairs, FrameType::kDescribe, FrameType::kSetPoses, FrameType::kAttach,
                 FrameType::kGetStates, FrameType::kGetStats, FrameType::kReload, FrameType::kAddBody,
                 FrameType::kRemoveBody, FrameType::kAllow, FrameType::kSetJoints, FrameType::kGetJoints});
    change_header(frame, [&](auto& h) { h.type = static_cast<std::uint16_t>(type); });
  } else if (kind == "counts") {
    change_query(frame, [&](auto& q) {
      const auto odd = one_of<std::uint32_t>(random, {1000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF});
      (random() % 3 == 0 ? q.pair_count : random() % 2 ? q.body_count : q.configuration_count) = odd;
      q.all_pairs = 0;
    });
  } else if (kind == "values") {
    spoil_values(frame, random);
  } else if (kind == "choices") {
    spoil_choices(frame, random);
  } else if (kind == "groups without end") {
    TestQuery query;
    query.pairs.assign(4000 + random() % 1000, IdPair{kEveryBody, kEveryBody});
    query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
    frame = query.frame(id, random() % 2 ? FrameType::kQuery : FrameType::kPairs);
  } else if (kind == "another scene") {
    change_header(frame, [&](auto& h) { h.scene_revision = 1 + random(); });
  } else if (kind == "poses") {
    frame = bad_poses(id, random);
  } else if (kind == "attachment") {
    frame = bad_attachment(id, random);
  } else if (kind == "new body") {
    frame = bad_body(id, random);
  } else if (kind == "removed body") {
    wire::RemoveBodyRecord gone;
    wire::set_name(gone.name, "nobody" + std::to_string(random() % 1000));
    frame = record_frame(FrameType::kRemoveBody, id, gone, random() % 2);
  } else if (kind == kFlippedBits) {
    for (std::uint64_t n = 1 + random() % 3; n > 0; --n)
      frame[sizeof(wire::FrameHeader) + random() % (frame.size() - sizeof(wire::FrameHeader))] ^=
          static_cast<std::byte>(1u << random() % 8);
  } else {
    throw std::logic_error("no such kind");
  }
  return frame;
}

}  // namespace clearance::faults
