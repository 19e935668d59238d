// Complete answers.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <vector>

#include "engine/engine.h"

namespace clearance::test {

/// For tests that need no covers, whose thread of lowest priority delays the end of an engine on a busy machine.
inline const engine::Engine::Options kWithoutCovers{.covers = engine::Covers::kOff};

/// A reply with its own memory.
struct Answer {
  std::vector<std::byte> memory;
  ReplyView view;
  QuerySize size;
  ReplyInfo info;
};

/// Columns that each backend writes for configurations, in float64; gradient_joints is for joints.
inline constexpr std::uint32_t kAllFields =
    kKnownFields & ~(kFieldPoints32 | kFieldBounds | kFieldPairLower | kFieldGradientJoints | kMotionFields |
                     kFieldFreeScale | kFieldVerdict | kSecondOrderFields);
/// Bounds and points in float32.
inline constexpr std::uint32_t kFloat32 = kFieldBounds | kFieldPoints32;

/// A query of one pair, which outlives it.
inline QueryView query_of_pair(const BodyPair& pair) {
  QueryView query;
  query.pairs = {&pair, 1};
  query.all_pairs = false;
  return query;
}

/// The memory of a query's answer.
inline Answer empty_answer(const engine::Engine& engine, const QueryView& query) {
  Answer a;
  a.size = engine.size(query);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, a.size.rows, a.size.fields, &bytes, a.size.joints);
  a.memory.resize(bytes + 64);
  void* base = a.memory.data();
  std::size_t room = a.memory.size();
  std::align(64, bytes, base, room);
  a.view = reply_view_over(static_cast<std::byte*>(base), a.size.rows, a.size.fields, nullptr, a.size.joints);
  return a;
}

inline Answer evaluate(const engine::Engine& engine, const QueryView& query,
                       std::chrono::nanoseconds slice = std::chrono::nanoseconds::max()) {
  Answer a = empty_answer(engine, query);
  Job job = engine.start(query, a.view);
  while (!job.advance(slice)) {
  }
  a.info = job.info();
  return a;
}

}  // namespace clearance::test
