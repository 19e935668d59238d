#include "client/python/bindings/pending.h"

#include <cstddef>
#include <cstring>
#include <memory>
#include <span>

#include "wire/layout.h"

namespace clearance::python {

namespace {

void copy_columns(const Result& reply, Answer& a) {
  const Layout layout = layout_of(a.fields, a.rows, a.joints);
  a.owner = plain_blocks().take(layout.bytes);
  a.base = static_cast<const std::byte*>(a.owner.get());
  a.bytes = layout.bytes;
  a.offset = layout.offset;
  for (std::size_t i = 0; i < kFieldCount; ++i) {
    if (!(a.fields >> i & 1u) || a.rows == 0) continue;
    const std::span<const std::byte> column = reply.bytes(static_cast<Field>(1u << i));
    std::memcpy(static_cast<std::byte*>(a.owner.get()) + layout.offset[i], column.data(), column.size());
  }
}

/// Views the frame, from its first column to the end of its last.
void view_columns(const ConnectionPtr& connection, Result reply, Answer& a) {
  const std::byte* first = nullptr;
  const std::byte* last = nullptr;
  a.offset.fill(-1);
  for (std::size_t i = 0; i < kFieldCount; ++i) {
    if (!(a.fields >> i & 1u)) continue;
    const std::span<const std::byte> column = reply.bytes(static_cast<Field>(1u << i));
    if (!first) first = column.data();
    last = column.data() + column.size();
    a.offset[i] = column.data() - first;
  }
  a.base = first;
  a.bytes = static_cast<std::uint64_t>(last - first);
  a.writable = false;
  auto* leased = new Result(std::move(reply));
  a.owner = std::shared_ptr<void>(leased, [connection](void* p) {
    auto* r = static_cast<Result*>(p);
    connection->discard(std::move(*r));
    delete r;
  });
}

}  // namespace

Answer answer_of(const ConnectionPtr& connection, Result reply, bool copy, bool beyond_limits) {
  Answer a;
  a.beyond_limits = beyond_limits;
  a.fields = reply.fields();
  a.rows = reply.rows();
  a.total = reply.total();
  a.configurations = reply.configurations();
  a.pairs = reply.pairs();
  a.joints = reply.joints();
  a.scene_revision = reply.scene_revision();
  a.snapshot_revision = reply.snapshot_revision();
  a.snapshot_stamp_ns = reply.snapshot_stamp_ns();
  a.snapshot_sequence = reply.snapshot_sequence();
  a.pose_age_ns = reply.pose_age_ns();
  a.engine_ns = reply.engine_ns();
  a.server_ns = reply.server_ns();
  a.backend = reply.backend();
  if (copy) {
    copy_columns(reply, a);
    connection->discard(std::move(reply));
  } else {
    view_columns(connection, std::move(reply), a);
  }
  return a;
}

}  // namespace clearance::python
