// Queries of a client that are under way.
#include "client/client_impl.h"

namespace clearance {

using wire::FrameType;

struct Client::Impl::Request final : Pending::Request {
  Request(std::shared_ptr<Impl> of, std::uint64_t request_id, WhenDone call)
      : client(std::move(of)), id(request_id), when_done(std::move(call)) {}

  ~Request() override {
    if (is_over || frame || client->connection.forked()) return;
    try {
      client->connection.forget(id);
    } catch (const std::exception&) {
      // The connection and its reply are lost.
    }
  }

  bool wait_for(std::chrono::nanoseconds timeout) override {
    if (frame) return true;
    // Not interpreted here, so that get() throws the error of an error frame.
    frame = client->connection.await(id, deadline_in(timeout));
    if (frame && when_done) std::exchange(when_done, nullptr)();
    return frame != nullptr;
  }

  Result get() override {
    is_over = true;
    std::unique_ptr<Frame> reply =
        frame ? client->interpret(std::move(frame), FrameType::kReply) : client->receive(id, FrameType::kReply);
    if (when_done) std::exchange(when_done, nullptr)();
    return result_of(std::move(reply));
  }

  const std::shared_ptr<Impl> client;  // keeps the connection open
  const std::uint64_t id;
  WhenDone when_done;
  std::unique_ptr<Frame> frame;  // arrived, not yet fetched
  bool is_over = false;
};

Pending Client::Impl::submit(const std::shared_ptr<Impl>& self, const Query& query, WhenDone when_done,
                             const QueryExtras& extras) {
  const std::uint64_t id = self->send_query(FrameType::kQuery, query, extras);
  return Pending(std::make_unique<Request>(self, id, std::move(when_done)));
}

Pending Client::submit(const Query& query, WhenDone when_done) {
  impl();  // throws if moved from
  return Impl::submit(impl_, query, std::move(when_done));
}

}  // namespace clearance
