#include "server/requests/reply_writer.h"

#include <cstring>
#include <new>
#include <random>
#include <string>

#include "engine/narrow/work_meter.h"
#include "server/base/log.h"
#include "server/base/log_text.h"
#include "server/requests/error_frame.h"

namespace clearance {

using wire::ErrorCode;
using wire::FrameHeader;

namespace {

std::uint64_t draw_epoch() {
  std::random_device device;
  std::uint64_t epoch = 0;
  while (epoch == 0) epoch = std::uint64_t{device()} << 32 | device();
  return epoch;
}

}  // namespace

ReplyWriter::ReplyWriter(Stats& stats, const std::shared_ptr<engine::Engine>& engine, bool require_epoch)
    : stats_(stats), engine_(engine), epoch_(draw_epoch()), require_epoch_(require_epoch) {
  wire::append_epoch(epoch_record_, epoch_);
}

void ReplyWriter::check_epoch(const FrameHeader& request, std::uint64_t named) const {
  if (named == epoch_) return;
  if (named)
    throw RejectedRequest{
        ErrorCode::kNewEpoch,
        "the daemon was restarted or replaced since this client's first contact: poses, "
        "attachments and bodies that clients had sent are gone; acknowledge its epoch, and send them again"};
  using wire::FrameType;
  const auto type = static_cast<FrameType>(request.type);
  const bool is_harmless = type == FrameType::kPing || type == FrameType::kDescribe || type == FrameType::kGetStats;
  if (require_epoch_ && !is_harmless)
    throw RejectedRequest{ErrorCode::kNewEpoch, wire::type_name(request.type) + " has no epoch (--require-epoch)"};
}

std::vector<std::byte> ReplyWriter::records(const wire::PassedOver& passed_over, std::size_t joints) const {
  std::vector<std::byte> records;
  if (!passed_over.empty())
    wire::append_record(records, static_cast<std::uint16_t>(wire::ReplyRecord::kIgnored), 0,
                        std::as_bytes(std::span(passed_over)));
  if (const auto width = static_cast<std::uint32_t>(joints))
    wire::append_record(records, static_cast<std::uint16_t>(wire::ReplyRecord::kJoints), 0,
                        std::as_bytes(std::span(&width, 1)));
  records.insert(records.end(), epoch_record_.begin(), epoch_record_.end());
  return records;
}

void ReplyWriter::reply(ReplySink& sink, const FrameHeader& request, wire::FrameType type,
                        std::span<const std::byte> payload) {
  std::byte* frame = reserve(sink, payload.size());
  count_copied(payload.size());
  if (!payload.empty()) std::memcpy(frame + sizeof(FrameHeader), payload.data(), payload.size());
  publish(sink, request, type, frame, payload.size());
}

std::byte* ReplyWriter::reserve(ReplySink& sink, std::uint64_t payload_bytes) {
  const std::uint64_t bytes = sizeof(FrameHeader) + payload_bytes + epoch_record_.size();
  const auto too_large = [bytes](const char* room) {
    return RejectedRequest{ErrorCode::kTooLarge,
                           "the reply needs " + std::to_string(bytes) + " bytes, more than " + room, bytes};
  };
  if (bytes > wire::kMaxFrameBytes) throw too_large("a frame may have");
  std::byte* frame = sink.reserve(bytes);
  if (!frame) throw too_large("this client has room for");
  return frame;
}

void ReplyWriter::publish(ReplySink& sink, const FrameHeader& request, wire::FrameType type, std::byte* frame,
                          std::uint64_t payload_bytes) {
  const auto header = wire::with_records(
      wire::make_reply_header(request, type, payload_bytes, engine_->scene_revision()), epoch_record_.size());
  std::memcpy(frame, &header, sizeof header);
  std::memcpy(frame + sizeof header + payload_bytes, epoch_record_.data(), epoch_record_.size());
  sink.publish(sizeof header + header.payload_bytes);
  ++stats_.replies;
}

void ReplyWriter::count_query(std::uint64_t server_ns, std::uint64_t rows) {
  ++stats_.replies;
  ++stats_.answered;
  stats_.count_latency(server_ns);
  stats_.rows += rows;
}

void ReplyWriter::reject(ReplySink& sink, const FrameHeader& request, const RejectedRequest& rejection) {
  stats_.count_error(std::string(wire::error_name(rejection.code)), rejection.text);
  log::debug("event=rejected client={} request={} error=\"{}\"", sink.client(), wire::type_name(request.type),
             log_text(rejection.text));
  try {
    if (!send_error(sink, request, engine_->scene_revision(), rejection.code, rejection.text, rejection.needed_bytes,
                    epoch_record_))
      ++stats_["errors.unsent"];
  } catch (const std::exception& failure) {
    ++stats_["errors.unsent"];
    log::warn("event=error_unsent error=\"{}\" cause=\"{}\"", log_text(rejection.text), log_text(failure.what()));
  }
}

RejectedRequest ReplyWriter::rejection_of_caught(const FrameHeader& request) {
  try {
    throw;
  } catch (const RejectedRequest& rejection) {
    return rejection;
  } catch (const wire::WireError& error) {
    return {error.code, error.what()};
  } catch (const engine::QueryError& error) {
    return {code_of(error.code), error.what()};
  } catch (const std::bad_alloc&) {
    return {ErrorCode::kTooLarge, "the daemon has no memory for this request"};
  } catch (const std::exception& error) {
    log::error("event=internal_error request={} error=\"{}\"", wire::type_name(request.type), log_text(error.what()));
    return {ErrorCode::kInternal, std::string("internal error of the daemon: ") + error.what()};
  }
}

}  // namespace clearance
