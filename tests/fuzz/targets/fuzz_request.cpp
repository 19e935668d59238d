// Arbitrary requests to the daemon's loop: each is answered once, by a frame that a client accepts, and a valid query
// after them is answered, too.
#include "tests/fuzz/changing_scene.h"
#include "tests/fuzz/frames.h"
#include "tests/server/core/memory_transport.h"

namespace clearance::fuzz {
namespace {

/// Runs every parser of a client on a reply. A rejected reply is a bug of the daemon.
void check_reply(const MemoryFrame& frame) {
  const auto [payload, records] = wire::split_payload(frame.header(), frame.payload());
  wire::PassedOver unknown;
  const std::uint64_t epoch = wire::read_records(
      "reply", records, unknown, [&](const wire::RecordView&) { return frame.type() == wire::FrameType::kReply; });
  require(unknown.empty(), "only replies to queries have records of their own");
  require(records.empty() || epoch != 0, "records end in the epoch");
  switch (frame.type()) {
    case wire::FrameType::kScene:
      wire::parse_scene(payload);
      break;
    case wire::FrameType::kReply:
      wire::parse_reply(payload, records);
      break;
    case wire::FrameType::kPairTable:
      wire::parse_pair_table(payload);
      break;
    case wire::FrameType::kPosesDone:
      wire::parse_poses_done(payload);
      break;
    case wire::FrameType::kBodyStates:
      wire::parse_states(payload);
      break;
    case wire::FrameType::kStats:
      wire::parse_stats(payload);
      break;
    case wire::FrameType::kSceneChanged:
      wire::parse_scene_changed(payload);
      break;
    case wire::FrameType::kJoints:
      wire::parse_joints(payload);
      break;
    case wire::FrameType::kCertificate:
      require(!payload.empty(), "a certificate has a document");
      break;
    case wire::FrameType::kPlan:
      wire::parse_plan(payload);
      break;
    case wire::FrameType::kPlanDone:
      wire::parse_plan_done(payload);
      break;
    case wire::FrameType::kError:
      require(!wire::parse_error(payload).text.empty(), "an error says why");
      break;
    case wire::FrameType::kPong:
      break;
    default:
      require(false, "replies are of a known type");
  }
}

}  // namespace
}  // namespace clearance::fuzz

CLEARANCE_FUZZ_TARGET(request) {
  using namespace clearance;
  using namespace clearance::fuzz;
  // An engine for each input, because poses and attachments of one must not affect the next.
  engine::Engine::Options options;
  options.threads = 1;
  static const engine::Scene scene = small_scene();
  engine::Engine engine(scene, options);
  MemoryClient client, other;  // declared before the loop, which may hold their requests until its end
  Loop loop(engine, on_one_thread());
  serve_changing_scenes(loop);
  auto owned = std::make_unique<MemoryTransport>();
  MemoryTransport& transport = *owned;
  loop.add(std::move(owned));
  client.room = 8 << 20;
  client.sees_end = bytes.empty() || (bytes[0] & std::byte{4}) == std::byte{0};
  transport.unaligned = !bytes.empty() && (bytes[0] & std::byte{2}) != std::byte{0};

  Input in(bytes);
  std::size_t sent = 0, accepted = 0;
  while (!in.empty() && sent < 16) {
    transport.send(client, next_frame(in).bytes);
    ++sent;
  }
  turn_until_idle(loop);
  // Queries that wait for poses wait for longer than this.
  const std::size_t held = loop.held();
  require(client.replies.size() + held == sent && client.sinks == static_cast<int>(held),
          "each request is answered once, or held");
  for (const auto& reply : client.replies) {
    check_reply(*reply);
    accepted += reply->type() != wire::FrameType::kError;
  }
  TestQuery good;
  good.pairs = {{0, 1}};
  transport.send(other, good.frame(7));
  while (loop.turn()) {
  }
  require(other.replies.size() == 1 && other.replies[0]->type() == wire::FrameType::kReply,
          "a good query is answered after bad ones");
  return sent > 0 && accepted + held == sent;
}
