#include <algorithm>
#include <cstring>

#include "client/channel/channel.h"
#include "client/client.h"
#include "wire/wire.h"

namespace clearance {

Result result_of(std::unique_ptr<Frame> frame) {
  try {
    std::uint32_t joints = 0;
    const wire::PayloadParts parts = wire::split_payload(frame->header(), frame->payload());
    const wire::ReplyHeader header = wire::parse_reply(parts.body, parts.records, &joints);
    ResultInfo info{.rows = header.rows,
                    .total = header.total,
                    .configurations = header.configurations,
                    .pairs = header.pairs,
                    .fields = header.fields,
                    .joints = joints,
                    .epoch = wire::epoch_of(frame->header(), frame->payload()),
                    .scene_revision = header.scene_revision,
                    .snapshot_revision = header.snapshot_revision,
                    .snapshot_stamp_ns = header.snapshot_stamp_ns,
                    .snapshot_sequence = header.snapshot_sequence,
                    .pose_age_ns = header.pose_age_ns,
                    .engine_ns = header.engine_ns,
                    .server_ns = header.server_ns,
                    .backend = {}};
    std::copy(std::begin(header.backend), std::end(header.backend), info.backend.begin());
    const std::byte* const columns = frame->payload().data() + sizeof(wire::ReplyHeader);
    return {info, columns, header.rows, std::shared_ptr<const Frame>(std::move(frame))};
  } catch (const wire::WireError& error) {
    throw ConnectionError(std::string("the daemon sent a malformed frame: ") + error.what());
  }
}

}  // namespace clearance
