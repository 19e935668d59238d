// The daemon on an LCM network (lcmtypes/). liblcm's thread reads the socket into queues, and the loop's thread does
// the rest: requests become frames for the loop, and its replies become messages.
#include <algorithm>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>

#include "server/lcm/lcm_announcer.h"
#include "server/lcm/lcm_link.h"
#include "server/lcm/lcm_metrics.h"
#include "server/lcm/lcm_points.h"
#include "server/lcm/lcm_pose_intake.h"
#include "server/lcm/lcm_publishers.h"
#include "server/lcm/lcm_timer.h"
#include "server/lcm/lcm_translate.h"
#include "server/requests/error_frame.h"
#include "server/requests/transport.h"
#include "wire/lcm/lcm_bus.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using Clock = std::chrono::steady_clock;
using clearance_lcm::frame_t;
using clearance_lcm::joint_update_t;
using clearance_lcm::moving_joint_update_t;
using clearance_lcm::moving_pose_update_t;
using clearance_lcm::points_t;
using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;

constexpr int kMessagesPerPoll = 64;
/// Messages that liblcm keeps between two polls, per channel.
constexpr int kChannelQueue = 512;
constexpr std::uint64_t kMaxLcmRequestBytes = std::uint64_t{16} << 20;

class LcmTransport final : public Transport {
 public:
  LcmTransport(const LcmAddress& address, const LcmPoses& allowed_poses, std::uint64_t gateway_bytes)
      : url_(address.url()),
        allowed_poses_(allowed_poses),
        link_(std::make_shared<LcmLink>(open_lcm_port(address, gateway_bytes))),
        assembler_({.frame_bytes = kMaxLcmRequestBytes, .total_bytes = 4 * kMaxLcmRequestBytes, .frames = 256}),
        distances_hz_(std::max(0.0, address.distances_hz)) {
    if (!allowed_poses.any) link_->rights &= ~kMayPose;  // also by frames, whose bodies are not yet known
    const auto listen = [this](const char* name, auto method) {
      link_->port->subscribe(name, kChannelQueue,
                             [this, method](std::span<const std::byte> packet) { (this->*method)(packet); });
    };
    listen("CLEARANCE_POSES", &LcmTransport::on_poses<pose_update_t>);
    listen("CLEARANCE_JOINTS", &LcmTransport::on_poses<joint_update_t>);
    listen("CLEARANCE_MOVING_POSES", &LcmTransport::on_poses<moving_pose_update_t>);
    listen("CLEARANCE_MOVING_JOINTS", &LcmTransport::on_poses<moving_joint_update_t>);
    listen("CLEARANCE_POINTS", &LcmTransport::on_points);
    listen("CLEARANCE_QUERY", &LcmTransport::on_query);
    listen("CLEARANCE_FRAME_IN", &LcmTransport::on_frame);
    listen("CLEARANCE_STATUS", &LcmTransport::on_status);
  }

  std::string url() const override { return url_; }

  std::vector<int> descriptors() const override {
    std::vector<int> all = link_->port->descriptors();
    all.push_back(timer_.get());
    return all;
  }

  bool polls_by_system_call() const override { return true; }
  bool prepare_sleep() override { return link_->port->has_work(); }

  int poll(RequestHandler& handler) override {
    attach(handler);
    timer_.clear();
    handed_in_ = 0;
    link_->port->begin_turn(handler);
    for (int i = 0; i < kMessagesPerPoll && link_->port->handle(); ++i) ++metrics_->messages;
    serve();
    return handed_in_;
  }

  void tick(RequestHandler& handler) override {
    attach(handler);
    link_->port->tick(handler);
    assembler_.expire(Clock::now());
    points_.expire(Clock::now());
    serve();
  }

 private:
  /// The loop is known from its first call on.
  void attach(RequestHandler& handler) {
    if (!handler_) {
      handler_ = &handler;
      metrics_.emplace(handler);
      intake_.emplace(handler, *metrics_, clients_, allowed_poses_);
      announcer_.emplace(handler, *metrics_, link_, distances_hz_);
    }
    const engine::Scene* scene = &handler.engine().scene();
    if (scene != scene_) intake_->set_scene(*scene);
    scene_ = scene;
  }

  template <class Message>
  bool decode(std::span<const std::byte> packet, Message& message) {
    return metrics_->accept(decode_checked(packet, message));
  }

  template <class Update>
  void on_poses(std::span<const std::byte> packet) {
    Update update;
    if (decode(packet, update)) handed_in_ += intake_->take(update);
  }

  void on_points(std::span<const std::byte> packet) {
    points_t part;
    if (!decode(packet, part)) return;
    const std::optional<std::uint32_t> body = intake_->body_of(part);
    if (!body) return;
    const std::uint64_t bad = points_.counts().bad;
    std::optional<FrameBytes> whole = points_.add(part, *body, Clock::now());
    if (points_.counts().bad != bad) metrics_->accept("points_t: its part and sizes do not fit together");
    if (!whole || !intake_->is_in_order(part)) return;
    ++metrics_->clouds;
    const auto log_error = [this, name = part.body](LcmLink&, const FrameBytes& reply) {
      wire::FrameHeader header;
      std::memcpy(&header, reply.bytes.get(), sizeof header);
      if (header.type != static_cast<std::uint16_t>(wire::FrameType::kError)) return;
      const auto payload = wire::split_payload(header, reply.span().subspan(sizeof header)).body;
      metrics_->log_rate_limited("points", "points of '" + name + "' rejected: " + wire::parse_error(payload).text);
    };
    // The body was checked against allowed_poses_, so this needs the right even where frames do not have it.
    auto sink = std::make_unique<LcmSink>(link_, clients_.number_of(part.publisher_id), log_error, kMayPose);
    const auto frame = std::make_shared<FrameBytes>(std::move(*whole));
    hand_in(frame->span(), frame, std::move(sink));
  }

  void on_query(std::span<const std::byte> packet) {
    query_t query;
    if (!decode(packet, query)) return;
    if (query.client_id == 0) {
      metrics_->accept("query_t: client_id is 0; draw one at random");
      return;
    }
    std::vector<std::uint32_t> joints;
    for (const std::string& name : query.joints) {
      joints.push_back(handler_->engine().scene().find_joint(name));
      if (joints.back() == kNone)
        return reject(query, wire::ErrorCode::kBadQuery,
                      "joints[" + std::to_string(joints.size() - 1) + "]: there is no joint '" + name + "'");
    }
    std::shared_ptr<std::vector<std::byte>> frame;
    try {
      frame = std::make_shared<std::vector<std::byte>>(query_frame_of(query, joints));
    } catch (const wire::WireError& error) {
      return reject(query, error.code, error.what());
    }
    hand_in(*frame, frame, sink_of(query));
  }

  std::unique_ptr<LcmSink> sink_of(const query_t& query) {
    ++metrics_->queries;
    return std::make_unique<LcmSink>(link_, clients_.number_of(query.client_id), reply_to(query.client_id));
  }

  void reject(const query_t& query, wire::ErrorCode code, const std::string& why) {
    const wire::FrameHeader header =
        wire::make_header(wire::FrameType::kQuery, static_cast<std::uint64_t>(query.request_id), 0, 0,
                          static_cast<std::uint64_t>(query.client_id));
    send_error(*sink_of(query), header, handler_->engine().scene_revision(), code, why);
  }

  void on_frame(std::span<const std::byte> packet) {
    frame_t part;
    if (!decode(packet, part)) return;
    if (part.client_id == 0) {
      metrics_->accept("frame_t: client_id is 0; draw one at random");
      return;
    }
    const std::uint64_t bad = assembler_.counts().bad;
    auto whole = assembler_.add(part, Clock::now());
    if (assembler_.counts().bad != bad) metrics_->accept("frame_t: its part and sizes do not fit together");
    if (!whole || !is_in_order(*whole, part.sequence)) return;
    ++metrics_->frames;
    auto sink = std::make_unique<LcmSink>(link_, clients_.number_of(whole->client_id),
                                          frame_to(whole->client_id, whole->request_id));
    const auto frame = std::make_shared<FrameBytes>(std::move(whole->frame));
    hand_in(frame->span(), frame, std::move(sink));
  }

  /// Whether a frame that changes state is newer than its client's last such frame. A late or repeated one would move
  /// bodies back.
  bool is_in_order(const FrameAssembler::Whole& whole, std::int64_t sequence) {
    wire::FrameHeader header;
    std::memcpy(&header, whole.frame.bytes.get(), sizeof header);
    if ((right_for(static_cast<wire::FrameType>(header.type)) & ~kMayQuery) == 0) return true;
    const auto note = changes_.note(0, whole.client_id, sequence, 0, Clock::now());
    if (note.use()) return true;
    ++(note.sequencing == PublisherLog::Sequencing::kRepeated ? metrics_->repeated : metrics_->reordered);
    metrics_->log_rate_limited("old", "client " + std::to_string(whole.client_id) + ": frame " +
                                          std::to_string(sequence) +
                                          " is not newer than its last that changed something, left out");
    return false;
  }

  /// @param owner of the frame's memory
  void hand_in(std::span<const std::byte> frame, const std::shared_ptr<void>& owner, std::unique_ptr<ReplySink> sink) {
    wire::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    ++handed_in_;
    const std::span<const std::byte> payload = frame.subspan(sizeof header);
    if (payload.size() <= kLargePayload) return handler_->on_frame(header, payload, std::move(sink));
    const OwnPayload fetched{{owner, payload.data()}, payload.size()};
    handler_->on_large_frame(header, payload.size(), [fetched] { return fetched; }, std::move(sink));
  }

  void on_status(std::span<const std::byte> packet) {
    // The type's hash, then server_id, both big-endian.
    if (packet.size() < 16) return;
    std::uint64_t id = 0;
    for (int i = 8; i < 16; ++i) id = id << 8 | std::to_integer<std::uint64_t>(packet[i]);
    if (static_cast<std::int64_t>(id) == link_->server_id) return;
    ++metrics_->other_daemons;
    metrics_->log_rate_limited("other",
                               "another clearanced publishes under the same channels; give one of them a prefix");
  }

  void serve() {
    handed_in_ += announcer_->serve();
    link_->outbox.flush(Clock::now());
    link_->announcements.flush(Clock::now());
    metrics_->publishers = intake_->publishers();
    metrics_->given_up = assembler_.counts().given_up + points_.counts().given_up;
    metrics_->replies = link_->replies;
    metrics_->dropped = link_->dropped;
    metrics_->sent = link_->outbox.sent() + link_->announcements.sent();
    metrics_->failed = link_->outbox.failed() + link_->announcements.failed();
    // Wakes the loop when the pacer lets more out, or when distances that their rate held back are due.
    auto due = link_->outbox.due();
    for (const auto& other : {link_->announcements.due(), announcer_->due()})
      if (other) due = due ? std::min(*due, *other) : *other;
    timer_.arm(due);
  }

  std::string url_;
  LcmPoses allowed_poses_;
  std::shared_ptr<LcmLink> link_;
  LcmTimer timer_;
  FrameAssembler assembler_;
  LcmPoints points_;
  double distances_hz_;
  LcmClients clients_;
  PublisherLog changes_;  // frames of each client that change state
  int handed_in_ = 0;
  const engine::Scene* scene_ = nullptr;
  // Set by the loop's first call.
  RequestHandler* handler_ = nullptr;
  std::optional<LcmMetrics> metrics_;
  std::optional<LcmPoseIntake> intake_;
  std::optional<LcmAnnouncer> announcer_;
};

}  // namespace

std::unique_ptr<Transport> make_lcm_transport(const std::string& lcm_url, const LcmPoses& poses,
                                              std::uint64_t gateway_bytes) {
  const LcmAddress address = [&] {
    try {
      return parse_lcm_address(lcm_url);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(error.what());
    }
  }();
  return std::make_unique<LcmTransport>(address, poses, gateway_bytes);
}

}  // namespace clearance
