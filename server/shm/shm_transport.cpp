// Shared memory: a Unix socket where clients connect, and for each client a segment with its requests and replies.
// wire/shm_layout.h has the layout and the rules.
#include "server/shm/shm_transport.h"

#include <algorithm>
#include <cstring>
#include <new>

#include "server/shm/shm_sessions.h"

namespace clearance {
namespace {

constexpr int kMaxFramesPerPoll = 64;
constexpr int kMaxFramesPerClient = 8;
/// Requests are copied on the loop, up to this size in one poll.
constexpr std::uint64_t kMaxBytesPerPoll = std::uint64_t{4} << 20;
constexpr std::size_t kScratchKept = std::size_t{4} << 20;

class ShmTransport final : public Transport {
 public:
  ShmTransport(const std::string& path, const ShmLimits& limits, const Access& access)
      : path_(path), sessions_(path, limits, access) {}

  std::string url() const override { return "shm://" + path_; }
  std::vector<int> descriptors() const override { return {sessions_.get()}; }

  int poll(RequestHandler& handler) override {
    sessions_.attach(handler);
    int frames = 0;
    std::uint64_t bytes = 0;
    const auto& sessions = sessions_.all();
    const std::size_t count = sessions.size();
    ++polls_;  // each turn of the loop polls once
    for (const auto& session : sessions)
      for (const auto& segment : session->segments) segment->show_turns(polls_);
    for (const ServiceClass service : {ServiceClass::kControl, ServiceClass::kPlanning})
      for (std::size_t i = 0; i < count && frames < kMaxFramesPerPoll && bytes < kMaxBytesPerPoll; ++i)
        if (const auto& session = sessions[(first_ + i) % count]; class_of(session->rights) == service)
          serve_requests(session, handler, frames, bytes);
    ++first_;                // another client is first next time
    sessions_.poll(polls_);  // after the requests, whose clients wait
    return frames;
  }

  bool prepare_sleep() override {
    set_sleeping(true);
    for (const auto& session : sessions_.all())
      for (const auto& segment : session->segments)
        if (segment->has_request()) {
          finish_sleep();
          return true;
        }
    return false;
  }

  void finish_sleep() override {
    set_sleeping(false);
    sessions_.poll_sockets_soon();
  }

  void tick(RequestHandler& handler) override {
    sessions_.attach(handler);
    scratch_.trim(kScratchKept);
    sessions_.tick();
  }

 private:
  void set_sleeping(bool is_sleeping) {
    for (const auto& session : sessions_.all())
      for (const auto& segment : session->segments) segment->set_sleeping(is_sleeping);
  }

  /// @param frames taken in this poll
  /// @param bytes of them
  void serve_requests(const std::shared_ptr<ShmSession>& session, RequestHandler& handler, int& frames,
                      std::uint64_t& bytes) {
    const int most = frames + kMaxFramesPerClient;
    // By index, in case the handler changes the list.
    for (std::size_t i = 0; i < session->segments.size(); ++i) {
      if (!session->segments[i]->has_request()) continue;
      const std::shared_ptr<Segment> segment = session->segments[i];
      while (!session->gone && frames < most && bytes < kMaxBytesPerPoll) {
        if (frames > 0 && (!segment->has_request() || handler.has_enough())) break;
        Segment::Request request;
        try {
          const Segment::Take taken = segment->take(scratch_, request);
          if (taken == Segment::Take::kNothing) break;
          if (taken == Segment::Take::kViolation) {
            sessions_.violate(*session, segment->why());
            break;
          }
        } catch (const std::bad_alloc&) {
          sessions_.violate(*session, "no memory for its request");
          break;
        }
        ++frames;
        bytes += request.frame.size();
        wire::FrameHeader header;
        std::memcpy(&header, request.frame.data(), sizeof header);
        auto sink = std::make_unique<ShmSink>(session, segment, request.slot, request.generation);
        if (request.frame.size() == request.frame_bytes) {
          handler.on_frame(header, request.frame.subspan(sizeof header), std::move(sink));
        } else {
          const std::uint64_t payload = request.frame_bytes - sizeof header;
          handler.on_large_frame(
              header, payload, [segment, slot = request.slot, payload] { return segment->copy_payload(slot, payload); },
              std::move(sink));
        }
      }
    }
  }

  std::string path_;
  ShmSessions sessions_;
  ScratchBuffer scratch_;
  std::size_t first_ = 0;
  std::uint64_t polls_ = 0;
};

}  // namespace

std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path, const ShmLimits& limits,
                                              const Access& access) {
  return std::make_unique<ShmTransport>(socket_path, limits, access);
}

std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path) {
  return make_shm_transport(socket_path, ShmLimits{});
}

}  // namespace clearance
