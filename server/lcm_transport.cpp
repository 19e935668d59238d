// The daemon on an LCM network: poses and queries in; answers, the scene, distances and counters out (lcmtypes/).
//
// liblcm's thread reads the socket and queues; all of this runs on the loop's thread. Requests become frames for the
// loop and its answers become messages again. What the daemon publishes on its own it asks the loop for in the same
// way, so that there is one source for each number.
#include <spdlog/spdlog.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <unordered_map>

#include "server/lcm_link.h"
#include "server/lcm_publishers.h"
#include "server/lcm_translate.h"
#include "server/log_text.h"
#include "server/transport.h"
#include "wire/lcm_bus.h"
#include "wire/lcm_check.h"
#include "wire/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using Clock = std::chrono::steady_clock;
using clearance_lcm::frame_t;
using clearance_lcm::named_pose_update_t;
using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;

constexpr int kMessagesPerPoll = 64;
/// Messages that liblcm keeps between two polls, per channel.
constexpr int kQueue = 512;
constexpr std::uint64_t kMaxRequestBytes = std::uint64_t{16} << 20;
constexpr std::chrono::seconds kPeriod{1};
constexpr std::chrono::seconds kSayAgain{5};
constexpr std::size_t kMaxClients = 4096;

/// Numbers that others can read, in the daemon's own table.
struct Counters {
  explicit Counters(Inbox& inbox)
      : messages(inbox.counter("lcm.messages")),
        bad(inbox.counter("lcm.bad_messages")),
        poses(inbox.counter("lcm.pose_messages")),
        wrong_scene(inbox.counter("lcm.wrong_scene")),
        unknown(inbox.counter("lcm.unknown_bodies")),
        gaps(inbox.counter("lcm.gaps")),
        reordered(inbox.counter("lcm.reordered")),
        repeated(inbox.counter("lcm.repeated")),
        restarts(inbox.counter("lcm.restarts")),
        contested(inbox.counter("lcm.contested")),
        bad_stamps(inbox.counter("lcm.bad_stamps")),
        not_allowed(inbox.counter("lcm.poses_not_allowed")),
        publishers(inbox.counter("lcm.publishers")),
        queries(inbox.counter("lcm.queries")),
        frames(inbox.counter("lcm.frames")),
        given_up(inbox.counter("lcm.frames_given_up")),
        replies(inbox.counter("lcm.replies")),
        dropped(inbox.counter("lcm.replies_dropped")),
        sent(inbox.counter("lcm.sent")),
        failed(inbox.counter("lcm.send_errors")),
        other_daemons(inbox.counter("lcm.other_daemons")) {}
  std::uint64_t &messages, &bad, &poses, &wrong_scene, &unknown, &gaps, &reordered, &repeated, &restarts, &contested,
      &bad_stamps, &not_allowed, &publishers, &queries, &frames, &given_up, &replies, &dropped, &sent, &failed,
      &other_daemons;
};

/// A log line at most every few seconds for each kind of trouble; `more` counts those not said since the last.
class Complaints {
 public:
  void say(const char* kind, const std::string& what) {
    Entry& entry = entries_[kind];
    ++entry.times;
    const auto now = Clock::now();
    if (entry.times > 1 && now - entry.last < kSayAgain) return;
    const std::uint64_t unsaid = entry.times - entry.said - 1;
    spdlog::warn("event=lcm_{} more={} text=\"{}\"", kind, unsaid, log_text(what));
    entry.last = now;
    entry.said = entry.times;
  }

 private:
  struct Entry {
    std::uint64_t times = 0, said = 0;
    Clock::time_point last;
  };
  std::unordered_map<std::string, Entry> entries_;
};

class LcmTransport final : public Transport {
 public:
  LcmTransport(const LcmAddress& address, const LcmPoses& allowed_poses)
      : allowed_poses_(allowed_poses),
        link_(std::make_shared<LcmLink>(address)),
        timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)),
        assembler_({.frame_bytes = kMaxRequestBytes, .total_bytes = 4 * kMaxRequestBytes, .frames = 256}),
        distances_hz_(std::max(0.0, address.distances_hz)) {
    if (timer_ < 0) throw std::runtime_error(std::string("LCM: no timer: ") + std::strerror(errno));
    if (!allowed_poses.any) link_->rights &= ~kMayPose;  // by frames, too, which name no body before they are read
    const auto listen = [this](const char* name, auto method) {
      link_->bus.subscribe(name, kQueue,
                           [this, method](std::span<const std::byte> packet) { (this->*method)(packet); });
    };
    listen("CLEARANCE_POSES", &LcmTransport::on_poses);
    listen("CLEARANCE_POSES_NAMED", &LcmTransport::on_named_poses);
    listen("CLEARANCE_QUERY", &LcmTransport::on_query);
    listen("CLEARANCE_FRAME_IN", &LcmTransport::on_frame);
    listen("CLEARANCE_STATUS", &LcmTransport::on_status);
  }
  ~LcmTransport() override { ::close(timer_); }

  std::string url() const override { return link_->bus.address().url(); }

  std::vector<int> descriptors() const override { return {link_->bus.descriptor(), timer_}; }

  bool polls_by_system_call() const override { return true; }

  int poll(Inbox& inbox) override {
    meet(inbox);
    if (armed_) {
      std::uint64_t expirations = 0;
      [[maybe_unused]] const auto ignored = ::read(timer_, &expirations, sizeof expirations);
    }
    handed_in_ = 0;
    for (int i = 0; i < kMessagesPerPoll && link_->bus.handle(); ++i) ++counters_->messages;
    serve();
    return handed_in_;
  }

  void tick(Inbox& inbox) override {
    meet(inbox);
    assembler_.expire(Clock::now());
    serve();
  }

 private:
  /// The loop may only be known from its first call on.
  void meet(Inbox& inbox) {
    inbox_ = &inbox;
    if (!counters_) counters_.emplace(inbox);
    const Scene* scene = &inbox.engine().scene();
    if (scene == scene_) return;
    scene_ = scene;  // one that was loaded anew may have other bodies
    owners_.emplace(scene->bodies().size());
    find_allowed(*scene);
  }

  void find_allowed(const Scene& scene) {
    allowed_.assign(scene.bodies().size(), allowed_poses_.any);
    for (const std::string& name : allowed_poses_.allowed) {
      const std::uint32_t body = scene.find_body(name), group = scene.find_group(name);
      if (body != kNone) allowed_[body] = true;
      if (group != kNone)
        for (const std::uint32_t member : scene.groups()[group].bodies) allowed_[member] = true;
      if (body == kNone && group == kNone) spdlog::warn("event=lcm_allow_unknown name=\"{}\"", log_text(name));
    }
  }

  template <class Message>
  bool decode(std::span<const std::byte> packet, Message& message) {
    return accept(decode_checked(packet, message));
  }
  bool accept(const std::string& problem) {
    if (problem.empty()) return true;
    ++counters_->bad;
    complaints_.say("bad", "message refused: " + problem);
    return false;
  }

  // --- poses

  void on_poses(std::span<const std::byte> packet) {
    pose_update_t update;
    if (!decode(packet, update)) return;
    const auto revision = static_cast<std::int64_t>(inbox_->engine().scene_revision());
    static_assert(sizeof update.bodies[0] == sizeof(std::uint32_t));
    const std::span ids(reinterpret_cast<const std::uint32_t*>(update.bodies.data()), update.bodies.size());
    if (update.scene_revision != 0 &&
        !inbox_->engine().still_means(static_cast<std::uint64_t>(update.scene_revision), ids, true)) {
      ++counters_->wrong_scene;
      complaints_.say("scene", "poses for scene " + std::to_string(update.scene_revision) + " refused, this is " +
                                   std::to_string(revision));
      return;
    }
    poses_.clear();
    for (std::int32_t i = 0; i < update.count; ++i)
      add_pose(static_cast<std::uint32_t>(update.bodies[i]), update.poses[i]);
    apply("CLEARANCE_POSES", 0, update.publisher_id, update.sequence, update.stamp_ns);
  }

  void on_named_poses(std::span<const std::byte> packet) {
    named_pose_update_t update;
    if (!decode(packet, update)) return;
    const Scene& scene = inbox_->engine().scene();
    poses_.clear();
    for (std::int32_t i = 0; i < update.count; ++i) {
      const std::uint32_t body = scene.find_body(update.names[i]);
      if (body == kNone) {
        ++counters_->unknown;
        complaints_.say("name", "a pose for '" + update.names[i] + "', which is no body of this scene");
        continue;
      }
      add_pose(body, update.poses[i]);
    }
    apply("CLEARANCE_POSES_NAMED", 1, update.publisher_id, update.sequence, update.stamp_ns);
  }

  void add_pose(std::uint32_t body, const std::vector<double>& pose) {
    if (body < allowed_.size() && !allowed_[body]) {
      ++counters_->not_allowed;
      complaints_.say("not_allowed", "a pose for '" + inbox_->engine().scene().bodies()[body].name +
                                         "', whose poses are not taken from LCM (--lcm-poses)");
      return;
    }
    poses_.push_back({body, {{pose[0], pose[1], pose[2]}, pose[3], pose[4], pose[5], pose[6]}});
  }

  void apply(const char* channel, int channel_number, std::int64_t publisher, std::int64_t sequence,
             std::int64_t stamp_ns) {
    if (publisher == 0) {
      accept(std::string(channel) + ": publisher_id is 0; draw one at random");
      return;
    }
    const std::string who = "publisher " + std::to_string(publisher) + " on " + channel;
    const auto with_good_stamp = [&](auto&& use) {
      try {
        use();
        return true;
      } catch (const QueryError& error) {
        ++counters_->bad_stamps;
        complaints_.say("stamp", who + ": left out: " + error.what());
        return false;
      }
    };
    // First: a publisher is not known by what is no time.
    if (!with_good_stamp([&] { inbox_->engine().check_stamp(stamp_ns); })) return;
    const auto now = Clock::now();
    const PublisherLog::Note note = publishers_.note(channel_number, publisher, sequence, stamp_ns, now);
    switch (note.verdict) {
      case PublisherLog::Verdict::kNew:
        spdlog::info("event=lcm_publisher channel={} id={}", channel, publisher);
        break;
      case PublisherLog::Verdict::kNext:
        break;
      case PublisherLog::Verdict::kGap:
        counters_->gaps += note.missing;
        complaints_.say(
            "gap", who + ": " + std::to_string(note.missing) + " messages missing before " + std::to_string(sequence));
        break;
      case PublisherLog::Verdict::kRestart:
        ++counters_->restarts;
        complaints_.say("restart", who + " counts anew, from " + std::to_string(sequence));
        break;
      case PublisherLog::Verdict::kRepeated:
        ++counters_->repeated;
        complaints_.say("repeated", who + ": sequence " + std::to_string(sequence) + " came again, left out");
        break;
      case PublisherLog::Verdict::kOld:
        ++counters_->reordered;
        complaints_.say("old", who + ": sequence " + std::to_string(sequence) + " is older than the last, left out");
        break;
    }
    if (!note.use()) return;
    const auto contested = owners_->note(publisher, poses_, now);
    if (!contested.empty()) {
      counters_->contested += contested.size();
      complaints_.say("contested", "two publishers move body '" +
                                       inbox_->engine().scene().bodies()[contested.front()].name +
                                       "' in turns; one is " + std::to_string(publisher));
    }
    if (poses_.empty() && !allowed_poses_.any) return;  // nothing that would be taken
    ++counters_->poses;
    ++handed_in_;
    with_good_stamp(
        [&] { counters_->unknown += inbox_->on_poses(poses_, stamp_ns, sequence, client_number(publisher)).unknown; });
  }

  // --- requests

  void on_query(std::span<const std::byte> packet) {
    query_t query;
    if (!decode(packet, query)) return;
    if (query.client_id == 0) {
      accept("query_t: client_id is 0; draw one at random");
      return;
    }
    ++counters_->queries;
    auto sink = std::make_unique<LcmReplySink>(link_, client_number(query.client_id), query.client_id);
    hand_in(query_frame_of(query), std::move(sink));
  }

  void on_frame(std::span<const std::byte> packet) {
    frame_t part;
    if (!decode(packet, part)) return;
    if (part.client_id == 0) {
      accept("frame_t: client_id is 0; draw one at random");
      return;
    }
    const std::uint64_t bad = assembler_.counts().bad;
    auto whole = assembler_.add(part, Clock::now());
    if (assembler_.counts().bad != bad) accept("frame_t: its part and sizes do not fit together");
    if (!whole || !is_in_order(*whole, part.sequence)) return;
    ++counters_->frames;
    auto sink =
        std::make_unique<LcmFrameSink>(link_, client_number(whole->client_id), whole->client_id, whole->request_id);
    hand_in(whole->frame.span(), std::move(sink));
  }

  /// Whether a frame that changes something is newer than its client's last such frame. One that came late or once more
  /// would put bodies back to where they were.
  bool is_in_order(const FrameAssembler::Whole& whole, std::int64_t sequence) {
    wire::FrameHeader header;
    std::memcpy(&header, whole.frame.bytes.get(), sizeof header);
    if ((right_for(static_cast<wire::FrameType>(header.type)) & ~kMayQuery) == 0) return true;
    const auto note = changes_.note(0, whole.client_id, sequence, 0, Clock::now());
    if (note.use()) return true;
    ++(note.verdict == PublisherLog::Verdict::kRepeated ? counters_->repeated : counters_->reordered);
    complaints_.say("old", "client " + std::to_string(whole.client_id) + ": frame " + std::to_string(sequence) +
                               " is not newer than its last that changed something, left out");
    return false;
  }

  void hand_in(std::span<const std::byte> frame, std::unique_ptr<ReplySink> sink) {
    wire::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    ++handed_in_;
    inbox_->on_frame(header, frame.subspan(sizeof header), std::move(sink));
  }

  void on_status(std::span<const std::byte> packet) {
    // The type's hash, then server_id, big-endian: enough to know our own.
    if (packet.size() < 16) return;
    std::uint64_t id = 0;
    for (int i = 8; i < 16; ++i) id = id << 8 | std::to_integer<std::uint64_t>(packet[i]);
    if (static_cast<std::int64_t>(id) == link_->server_id) return;
    ++counters_->other_daemons;
    complaints_.say("other", "another clearanced publishes under the same channels; give one of them a prefix");
  }

  /// The loop's number for a client that drew its own.
  std::uint64_t client_number(std::int64_t lcm_client) {
    if (clients_.size() >= kMaxClients && !clients_.contains(lcm_client)) clients_.clear();
    std::uint64_t& number = clients_[lcm_client];
    if (number == 0) number = next_client_id();
    return number;
  }

  // --- what the daemon publishes by itself

  void serve() {
    const auto now = Clock::now();
    const std::uint64_t revision = inbox_->engine().scene_revision();
    if (now >= next_period_ || revision != scene_revision_) {
      scene_revision_ = revision;
      ask_scene();
      if (now >= next_period_) ask_states(), ask_status();
      next_period_ = now + kPeriod;
    }
    // An answer that never came (its job was dropped) must not end them for good.
    if (asked_distances_ && now - asked_at_ > kSayAgain) asked_distances_ = false;
    if (distances_wanted() && now >= next_distances_) {
      pose_revision_ = inbox_->engine().pose_revision();
      next_distances_ = now + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / distances_hz_));
      ask_distances();
    }
    link_->outbox.flush(Clock::now());
    link_->announcements.flush(Clock::now());
    counters_->publishers = publishers_.size();
    counters_->given_up = assembler_.counts().given_up;
    counters_->replies = link_->replies;
    counters_->dropped = link_->dropped;
    counters_->sent = link_->outbox.sent() + link_->announcements.sent();
    counters_->failed = link_->outbox.failed() + link_->announcements.failed();
    arm_timer();
  }

  void ask(wire::FrameType type, LcmOwnSink::Take take) {
    const wire::FrameHeader header = wire::make_header(type, 0, 0);
    hand_in(std::as_bytes(std::span(&header, 1)),
            std::make_unique<LcmOwnSink>(link_, own_client_, guarded(std::move(take))));
  }

  /// A frame of our own that is an error or damaged must not end the loop.
  LcmOwnSink::Take guarded(LcmOwnSink::Take take) {
    return [this, take = std::move(take)](LcmLink& link, std::span<const std::byte> frame) {
      try {
        take(link, frame);
      } catch (const wire::WireError& error) {
        complaints_.say("own", std::string("cannot publish: ") + error.what());
      }
    };
  }

  void ask_scene() {
    ask(wire::FrameType::kDescribe, [this](LcmLink& link, std::span<const std::byte> frame) {
      auto messages = scene_messages(frame, link.server_id);
      backend_ = messages.front().backend;
      link.push_all(link.announcements, "CLEARANCE_SCENE", std::move(messages));
    });
  }

  void ask_states() {
    ask(wire::FrameType::kGetStates, [this](LcmLink& link, std::span<const std::byte> frame) {
      link.push_all(link.announcements, "CLEARANCE_STATES",
                    states_messages(frame, link.server_id, ++states_sequence_, scene_revision_));
    });
  }

  void ask_status() {
    ask(wire::FrameType::kGetStats, [this](LcmLink& link, std::span<const std::byte> frame) {
      auto message = status_message(frame, link.server_id);
      message.sequence = ++status_sequence_;
      message.uptime_ns = (Clock::now() - opened_).count();
      message.scene_revision = static_cast<std::int64_t>(scene_revision_);
      message.backend = backend_;
      link.push_all(link.announcements, "CLEARANCE_STATUS", std::vector{std::move(message)});
    });
  }

  bool distances_wanted() const {
    return distances_hz_ > 0 && !asked_distances_ && inbox_->engine().pose_revision() != pose_revision_;
  }

  void ask_distances() {
    asked_distances_ = true;
    asked_at_ = Clock::now();
    const auto take = guarded([this](LcmLink& link, std::span<const std::byte> frame) {
      asked_distances_ = false;
      link.push_all(link.outbox, "CLEARANCE_DISTANCES",
                    distances_messages(frame, link.server_id, ++distances_sequence_));
    });
    hand_in(nearest_query_frame(), std::make_unique<LcmOwnSink>(link_, own_client_, take));
  }

  /// Wakes the loop when the pacer lets more out, or when distances were held back by their rate.
  void arm_timer() {
    const auto now = Clock::now();
    auto due = link_->outbox.due();
    if (const auto other = link_->announcements.due()) due = due ? std::min(*due, *other) : *other;
    if (distances_wanted()) {
      due = due ? std::min(*due, next_distances_) : next_distances_;
    }
    if (!due && !armed_) return;
    armed_ = due.has_value();
    itimerspec spec{};
    if (due) {
      const auto wait = std::max(*due - now, Clock::duration(std::chrono::microseconds(50)));
      spec.it_value.tv_sec = std::chrono::duration_cast<std::chrono::seconds>(wait).count();
      spec.it_value.tv_nsec = (wait % std::chrono::seconds(1)).count();
    }
    ::timerfd_settime(timer_, 0, &spec, nullptr);
  }

  LcmPoses allowed_poses_;
  std::vector<bool> allowed_;  // by body
  std::shared_ptr<LcmLink> link_;
  int timer_;
  FrameAssembler assembler_;
  double distances_hz_;
  Inbox* inbox_ = nullptr;
  std::optional<Counters> counters_;
  Complaints complaints_;
  PublisherLog publishers_;
  PublisherLog changes_;  // frames that change something, of each client
  std::optional<OwnerLog> owners_;
  const Scene* scene_ = nullptr;
  std::vector<BodyPose> poses_;
  std::unordered_map<std::int64_t, std::uint64_t> clients_;
  std::uint64_t own_client_ = next_client_id();
  int handed_in_ = 0;
  std::uint64_t scene_revision_ = 0;
  std::uint64_t pose_revision_ = 0;
  bool asked_distances_ = false, armed_ = false;
  std::int64_t states_sequence_ = 0, status_sequence_ = 0, distances_sequence_ = 0;
  std::string backend_;
  Clock::time_point opened_ = Clock::now();
  Clock::time_point next_period_{}, next_distances_{}, asked_at_{};
};

}  // namespace

std::unique_ptr<Transport> make_lcm_transport(const std::string& lcm_url, const std::string& channel_prefix,
                                              const LcmPoses& poses) {
  LcmAddress address = [&] {
    try {
      return parse_lcm_address(lcm_url);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(error.what());
    }
  }();
  if (!channel_prefix.empty()) address.prefix = channel_prefix;
  return std::make_unique<LcmTransport>(address, poses);
}

}  // namespace clearance
