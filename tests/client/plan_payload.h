// The payload of a kPlan for tests of the wire and the seeds of the fuzzer.
#pragma once

#include <vector>

#include "wire/wire.h"

namespace clearance::wire {

/// Payload with two columns, poses and positions.
inline std::vector<std::byte> plan_payload() {
  PlanHeader h;
  h.plan = 3;
  h.memory_bytes = 1 << 21;
  h.positions_offset = 256;
  h.rows = 12;
  h.configurations = 2;
  h.pairs = 6;
  h.body_count = 2;
  h.joint_count = 5;
  h.fields = kFieldLower | kFieldGradientJoints;
  h.column_count = 2;
  std::vector<std::byte> payload;
  append(payload, h);
  append(payload, PlanColumnRecord{kFieldLower, 8, 384});
  append(payload, PlanColumnRecord{kFieldGradientJoints, 40, 512});
  return payload;
}

}  // namespace clearance::wire
