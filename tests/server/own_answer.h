// What the engine in this process answers, to compare a daemon's answers with.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "engine/engine.h"

namespace clearance {

/// The engine's own answer in its own memory.
struct Own {
  std::vector<std::byte> memory;
  ReplyView view;
  QuerySize size;
  ReplyInfo info;
};
inline Own ask(const Engine& engine, const QueryView& query) {
  Own own;
  own.size = engine.size(query);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, own.size.rows, own.size.fields, &bytes);
  own.memory.resize(bytes + 64);
  void* base = own.memory.data();
  std::size_t room = own.memory.size();
  std::align(64, bytes, base, room);
  own.view = reply_view_over(static_cast<std::byte*>(base), own.size.rows, own.size.fields);
  Job job = engine.start(query, own.view);
  while (!job.advance()) {
  }
  own.info = job.info();
  return own;
}

}  // namespace clearance
