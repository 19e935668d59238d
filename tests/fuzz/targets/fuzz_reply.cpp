// Arbitrary replies to the client library: it accepts only replies that pass its checks, and reports an error
// otherwise.
#include <memory>

#include "client/channel/channel.h"
#include "client/client.h"
#include "tests/fuzz/frames.h"
#include "wire/aligned_buffer.h"

namespace clearance::fuzz {
namespace {

class InputReply final : public Frame {
 public:
  InputReply(const wire::FrameHeader& header, Bytes payload) : header_(header), size_(payload.size()) {
    payload_ = aligned_bytes(size_ + 1);
    if (size_ > 0) std::memcpy(payload_.get(), payload.data(), size_);
  }
  const wire::FrameHeader& header() const override { return header_; }
  Bytes payload() const override { return {payload_.get(), size_}; }

 private:
  wire::FrameHeader header_;
  AlignedBytes payload_;
  std::size_t size_;
};

/// Reads every byte of a column.
template <class T>
void touch(std::span<const T> column) {
  static volatile unsigned sink = 0;
  for (const std::byte b : std::as_bytes(column)) sink = sink + std::to_integer<unsigned>(b);
}

void use(Result reply) {
  require(reply.fields() == 0 || reply.rows() < (std::uint64_t{1} << 32),
          "a reply has no more rows than fit its frame");
  for (int bit = 0; bit < kFieldCount; ++bit) touch(reply.bytes(static_cast<Field>(1u << bit)));
  touch(std::span<const char>(reply.backend()));
}

/// Reads a frame as the calls of client.cpp do. Throws WireError, ConnectionError.
void interpret(Bytes frame) {
  wire::FrameHeader header;
  const Bytes whole = wire::split_frame(frame, header), payload = wire::split_payload(header, whole).body;
  switch (static_cast<wire::FrameType>(header.type)) {
    case wire::FrameType::kReply:  // also reads its records
      return use(result_of(std::make_unique<InputReply>(header, whole)));
    case wire::FrameType::kScene: {
      const auto scene = wire::parse_scene(payload);
      for (std::uint64_t i = 0; i < scene.bodies.size(); ++i) wire::name_of(scene.bodies[i].name);
      for (std::uint64_t i = 0; i < scene.groups.size(); ++i) {
        const wire::GroupRecord group = scene.groups[i];
        wire::name_of(group.name);
        for (std::uint32_t m = 0; m < group.member_count; ++m)
          require(scene.members[group.first_member + m] < scene.bodies.size(), "members of a group are bodies");
      }
      return;
    }
    case wire::FrameType::kPairTable: {
      const auto table = wire::parse_pair_table(payload);
      return touch(Bytes(table.pairs.data(), table.pairs.size_bytes()));
    }
    case wire::FrameType::kPosesDone:
      wire::parse_poses_done(payload);
      return;
    case wire::FrameType::kBodyStates: {
      const auto states = wire::parse_states(payload);
      return touch(Bytes(states.states.data(), states.states.size_bytes()));
    }
    case wire::FrameType::kPlan: {
      const auto plan = wire::parse_plan(payload);
      for (std::uint64_t i = 0; i < plan.columns.size(); ++i) {
        const wire::PlanColumnRecord column = plan.columns[i];
        require(column.offset <= plan.header.memory_bytes &&
                    static_cast<unsigned __int128>(plan.header.rows) * column.row_bytes <=
                        plan.header.memory_bytes - column.offset,
                "columns lie in the plan's memory");
      }
      return;
    }
    case wire::FrameType::kPlanDone:
      wire::parse_plan_done(payload);
      return;
    case wire::FrameType::kStats: {
      const auto counters = wire::parse_stats(payload);
      for (std::uint64_t i = 0; i < counters.size(); ++i) wire::name_of(counters[i].name);
      return;
    }
    case wire::FrameType::kSceneChanged:
      wire::parse_scene_changed(payload);
      return;
    case wire::FrameType::kPong:
      return touch(payload);
    case wire::FrameType::kError:
      require(wire::parse_error(payload).text.size() <= payload.size(), "an error's text lies in its frame");
      return;
    default:
      throw wire::WireError(wire::ErrorCode::kUnknownType, wire::type_name(header.type));
  }
}

}  // namespace
}  // namespace clearance::fuzz

CLEARANCE_FUZZ_TARGET(reply) {
  using namespace clearance::fuzz;
  Input in(bytes);
  bool accepted = !bytes.empty();
  while (!in.empty()) {
    try {
      interpret(next_frame(in).bytes);
    } catch (const clearance::wire::WireError&) {
      accepted = false;
    } catch (const clearance::ConnectionError&) {
      accepted = false;
    }
  }
  return accepted;
}
