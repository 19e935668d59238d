// Sizes and offsets of the wire's structs, for a test that compares them with clearance/wire.py.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>

#include "wire/protocol.h"

namespace clearance::python {

/// {"FrameHeader": (64, {"magic": (0, 4), ...}), ...}: bytes of each struct, offset and bytes of each member.
inline nanobind::dict wire_layout() {
  namespace nb = nanobind;
  using namespace wire;
  nb::dict records;
#define CLEARANCE_BEGIN(type) \
  {                           \
    using Record = type;      \
    nb::dict members;         \
    const char* name = #type
#define CLEARANCE_MEMBER(member) members[#member] = nb::make_tuple(offsetof(Record, member), sizeof(Record::member))
#define CLEARANCE_END                                      \
  records[name] = nb::make_tuple(sizeof(Record), members); \
  }
  CLEARANCE_BEGIN(FrameHeader);
  CLEARANCE_MEMBER(magic);
  CLEARANCE_MEMBER(version);
  CLEARANCE_MEMBER(type);
  CLEARANCE_MEMBER(request_id);
  CLEARANCE_MEMBER(payload_bytes);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(client_id);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(QueryHeader);
  CLEARANCE_MEMBER(max_distance);
  CLEARANCE_MEMBER(abs_tol);
  CLEARANCE_MEMBER(rel_tol);
  CLEARANCE_MEMBER(pair_count);
  CLEARANCE_MEMBER(body_count);
  CLEARANCE_MEMBER(configuration_count);
  CLEARANCE_MEMBER(fields);
  CLEARANCE_MEMBER(max_results);
  CLEARANCE_MEMBER(max_pose_age_ns);
  CLEARANCE_MEMBER(all_pairs);
  CLEARANCE_MEMBER(precision);
  CLEARANCE_MEMBER(signed_distance);
  CLEARANCE_MEMBER(reduce);
  CLEARANCE_MEMBER(format);
  CLEARANCE_MEMBER(warm);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(min_pose_stamp_ns);
  CLEARANCE_MEMBER(pose_wait_ns);
  CLEARANCE_MEMBER(wait_for);
  CLEARANCE_MEMBER(padding2);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(ReplyHeader);
  CLEARANCE_MEMBER(rows);
  CLEARANCE_MEMBER(total);
  CLEARANCE_MEMBER(configurations);
  CLEARANCE_MEMBER(pairs);
  CLEARANCE_MEMBER(fields);
  CLEARANCE_MEMBER(reduce);
  CLEARANCE_MEMBER(format);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(snapshot_revision);
  CLEARANCE_MEMBER(snapshot_stamp_ns);
  CLEARANCE_MEMBER(oldest_receipt_ns);
  CLEARANCE_MEMBER(pairs_evaluated);
  CLEARANCE_MEMBER(engine_ns);
  CLEARANCE_MEMBER(server_ns);
  CLEARANCE_MEMBER(backend);
  CLEARANCE_MEMBER(snapshot_sequence);
  CLEARANCE_MEMBER(pose_age_ns);
  CLEARANCE_END
  CLEARANCE_BEGIN(PosesHeader);
  CLEARANCE_MEMBER(count);
  CLEARANCE_MEMBER(stamp_ns);
  CLEARANCE_MEMBER(sequence);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(PoseRecord);
  CLEARANCE_MEMBER(body);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(pose);
  CLEARANCE_END
  CLEARANCE_BEGIN(AttachRecord);
  CLEARANCE_MEMBER(child);
  CLEARANCE_MEMBER(parent);
  CLEARANCE_MEMBER(has_pose);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(pose);
  CLEARANCE_END
  CLEARANCE_BEGIN(PosesResult);
  CLEARANCE_MEMBER(revision);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(applied);
  CLEARANCE_MEMBER(bad);
  CLEARANCE_MEMBER(unknown);
  CLEARANCE_MEMBER(fixed);
  CLEARANCE_END
  CLEARANCE_BEGIN(SceneHeader);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(body_count);
  CLEARANCE_MEMBER(group_count);
  CLEARANCE_MEMBER(member_count);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(pair_count);
  CLEARANCE_MEMBER(backend);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(BodyRecord);
  CLEARANCE_MEMBER(name);
  CLEARANCE_MEMBER(parent);
  CLEARANCE_MEMBER(is_static);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(piece_count);
  CLEARANCE_MEMBER(padding2);
  CLEARANCE_MEMBER(vertex_count);
  CLEARANCE_MEMBER(model_error);
  CLEARANCE_MEMBER(extent);
  CLEARANCE_MEMBER(hull_excess);
  CLEARANCE_MEMBER(empty_share);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(GroupRecord);
  CLEARANCE_MEMBER(name);
  CLEARANCE_MEMBER(first_member);
  CLEARANCE_MEMBER(member_count);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(PairsHeader);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(count);
  CLEARANCE_END
  CLEARANCE_BEGIN(StatesHeader);
  CLEARANCE_MEMBER(count);
  CLEARANCE_MEMBER(revision);
  CLEARANCE_MEMBER(now_ns);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(BodyStateRecord);
  CLEARANCE_MEMBER(pose);
  CLEARANCE_MEMBER(stamp_ns);
  CLEARANCE_MEMBER(receipt_ns);
  CLEARANCE_MEMBER(parent);
  CLEARANCE_MEMBER(status);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(NewBodyRecord);
  CLEARANCE_MEMBER(name);
  CLEARANCE_MEMBER(parent);
  CLEARANCE_MEMBER(shape);
  CLEARANCE_MEMBER(is_static);
  CLEARANCE_MEMBER(has_pose);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(size);
  CLEARANCE_MEMBER(radius);
  CLEARANCE_MEMBER(pose);
  CLEARANCE_MEMBER(vertex_count);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(VertexRecord);
  CLEARANCE_MEMBER(xyz);
  CLEARANCE_END
  CLEARANCE_BEGIN(RemoveBodyRecord);
  CLEARANCE_MEMBER(name);
  CLEARANCE_END
  CLEARANCE_BEGIN(SceneChange);
  CLEARANCE_MEMBER(scene_revision);
  CLEARANCE_MEMBER(body_count);
  CLEARANCE_MEMBER(body);
  CLEARANCE_MEMBER(seconds);
  CLEARANCE_MEMBER(reserved);
  CLEARANCE_END
  CLEARANCE_BEGIN(CounterRecord);
  CLEARANCE_MEMBER(name);
  CLEARANCE_MEMBER(value);
  CLEARANCE_END
  CLEARANCE_BEGIN(ErrorHeader);
  CLEARANCE_MEMBER(code);
  CLEARANCE_MEMBER(padding);
  CLEARANCE_MEMBER(text_bytes);
  CLEARANCE_MEMBER(needed_bytes);
  CLEARANCE_END
#undef CLEARANCE_BEGIN
#undef CLEARANCE_MEMBER
#undef CLEARANCE_END
  return records;
}

}  // namespace clearance::python
