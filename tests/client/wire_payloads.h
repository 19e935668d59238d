// Payloads of every kind for tests of the wire, with parsers.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/client/plan_payload.h"
#include "wire/wire.h"

namespace clearance::wire {

using Bytes = std::vector<std::byte>;

template <class T>
void put(Bytes& bytes, const T& record) {
  const auto* begin = reinterpret_cast<const std::byte*>(&record);
  bytes.insert(bytes.end(), begin, begin + sizeof record);
}

template <class T>
void overwrite(Bytes& bytes, std::size_t at, const T& value) {
  ASSERT_LE(at + sizeof value, bytes.size());
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

inline Bytes query_payload(std::uint32_t pairs, std::uint32_t bodies, std::uint32_t configurations,
                           bool is_pairs = false) {
  QueryHeader q;
  q.max_distance = std::numeric_limits<double>::infinity();
  q.all_pairs = pairs == 0;
  q.pair_count = pairs;
  q.body_count = bodies;
  q.configuration_count = configurations;
  std::vector<std::uint32_t> pair_ids(2 * pairs), body_ids(bodies);
  for (std::size_t i = 0; i < pair_ids.size(); ++i) pair_ids[i] = 100 + i;
  for (std::size_t i = 0; i < body_ids.size(); ++i) body_ids[i] = 200 + i;
  std::vector<double> poses(std::size_t{configurations} * bodies * 7);
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = 0.5 * i;
  const std::uint64_t payload = query_payload_bytes(pairs, bodies, is_pairs ? 0 : configurations);
  Bytes frame(sizeof(FrameHeader) + payload);
  write_query(frame.data(), make_header(is_pairs ? FrameType::kPairs : FrameType::kQuery, 7, payload), q,
              pair_ids.data(), body_ids.data(), poses.data());
  return Bytes(frame.begin() + sizeof(FrameHeader), frame.end());
}

inline Bytes scene_payload() {
  Bytes payload;
  SceneHeader h;
  h.body_count = 3;
  h.group_count = 2;
  h.member_count = 3;
  set_name(h.backend, "cpu");
  put(payload, h);
  for (const char* name : {"base", "link", "cup"}) {
    BodyRecord body;
    set_name(body.name, name);
    put(payload, body);
  }
  GroupRecord group;
  set_name(group.name, "arm");
  group.member_count = 2;
  put(payload, group);
  set_name(group.name, "hand");
  group.first_member = 2;
  group.member_count = 1;
  put(payload, group);
  for (std::uint32_t member : {0u, 1u, 2u}) put(payload, member);
  return payload;
}

inline Bytes reply_payload(std::uint64_t rows, std::uint32_t fields) {
  Bytes payload;
  ReplyHeader h;
  h.rows = rows;
  h.fields = fields;
  set_name(h.backend, "cpu");
  put(payload, h);
  payload.resize(payload.size() + columns_bytes(rows, fields));
  return payload;
}

// The records of a reply whose rows have this many numbers by joints.
inline Bytes joints_record(std::uint32_t joints) {
  Bytes records;
  append_record(records, static_cast<std::uint16_t>(ReplyRecord::kJoints), 0, std::as_bytes(std::span(&joints, 1)));
  return records;
}

inline Bytes poses_payload(std::uint64_t count) {
  Bytes payload;
  PosesHeader h;
  h.count = count;
  put(payload, h);
  for (std::uint64_t i = 0; i < count; ++i)
    put(payload, PoseRecord{static_cast<std::uint32_t>(i), 0, {1, 2, 3, 1, 0, 0, 0}});
  return payload;
}

template <class T>
Bytes single(const T& record) {
  Bytes payload;
  put(payload, record);
  return payload;
}

/// Sums bytes, so that every record accepted by a parser is read (and checked by the address sanitizer).
inline std::uint64_t drain_bytes(const void* data, std::size_t size) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < size; ++i) sum += static_cast<const unsigned char*>(data)[i];
  return sum;
}
template <class T>
std::uint64_t drain(const Records<T>& records) {
  std::uint64_t sum = 0;
  for (std::uint64_t i = 0; i < records.size(); ++i) {
    const T record = records[i];
    sum += drain_bytes(&record, sizeof record);
  }
  return sum;
}

/// A kind of payload: a valid example, and a parser that reads everything it accepts.
struct Kind {
  Bytes good;
  std::function<std::uint64_t(std::span<const std::byte>)> read;
  bool any_multiple_is_good = false;  ///< a shorter payload may be valid as well (kStats)
};

inline std::map<std::string, Kind> kinds() {
  Bytes stats;
  for (const std::string& name : {std::string("frames"), std::string(55, 'q')}) {  // the second fills its field
    CounterRecord counter;
    set_name(counter.name, name);
    put(stats, counter);
  }
  Bytes states;
  StatesHeader states_header;
  states_header.count = 2;
  put(states, states_header);
  put(states, BodyStateRecord{});
  put(states, BodyStateRecord{});
  Bytes table;
  put(table, PairsHeader{1, 3});
  for (std::uint32_t i = 0; i < 3; ++i) put(table, PairRecord{i, i + 1});
  Bytes error;
  put(error, ErrorHeader{3, 0, 5, 0});
  for (char c : {'w', 'r', 'o', 'n', 'g'}) put(error, c);

  const auto read_query = [](bool configurations) {
    return [configurations](std::span<const std::byte> payload) {
      const auto parts = parse_query(payload, configurations);
      return drain(parts.pairs) + drain(parts.bodies) + drain(parts.configurations);
    };
  };
  return {
      {"query", {query_payload(3, 3, 2), read_query(true)}},
      {"pairs", {query_payload(2, 1, 4, true), read_query(false)}},
      {"reply",
       {reply_payload(5, kDefaultFields | kFieldPoints | kFieldPair),
        [](std::span<const std::byte> payload) {
          const auto h = parse_reply(payload);
          std::uint64_t sum = 0;
          for (int f = 0; f < kFieldCount; ++f)
            if (h.fields >> f & 1)
              sum += drain_bytes(payload.data() + sizeof h + column_offset(h.rows, h.fields, Field(1u << f)),
                                 h.rows * kFieldBytes[f]);
          return sum;
        }}},
      {"poses", {poses_payload(3), [](auto payload) { return drain(parse_poses(payload).poses); }}},
      {"attach",
       {single(AttachRecord{}), [](auto payload) { return std::uint64_t{parse_attach(payload).record.child}; }}},
      {"allow", {single(AllowRecord{}), [](auto payload) { return std::uint64_t{parse_allow(payload).allow}; }}},
      {"new body", {single(NewBodyRecord{}), [](auto payload) { return parse_new_body(payload).vertices.size(); }}},
      {"remove body",
       {single(RemoveBodyRecord{}), [](auto payload) { return std::uint64_t(parse_remove_body(payload).name[0]); }}},
      {"scene changed",
       {single(SceneChange{}), [](auto payload) { return parse_scene_changed(payload).scene_revision; }}},
      {"plan",
       {plan_payload(),
        [](auto payload) {
          const auto parts = parse_plan(payload);
          for (std::uint64_t i = 0; i < parts.columns.size(); ++i) {
            const PlanColumnRecord column = parts.columns[i];
            EXPECT_LE(column.offset + static_cast<unsigned __int128>(parts.header.rows) * column.row_bytes,
                      parts.header.memory_bytes);
          }
          return drain(parts.columns);
        }}},
      {"plan request", {single(PlanRecord{7, 0}), [](auto payload) { return parse_plan_request(payload).plan; }}},
      {"plan done", {single(PlanResult{7, 1, 2, {}}), [](auto payload) { return parse_plan_done(payload).plan; }}},
      {"open plan", {query_payload(2, 1, 4, true), read_query(false)}},
      {"poses done", {single(PosesResult{}), [](auto payload) { return parse_poses_done(payload).revision; }}},
      {"scene",
       {scene_payload(),
        [](auto payload) {
          const auto parts = parse_scene(payload);
          for (std::uint64_t g = 0; g < parts.groups.size(); ++g)
            for (std::uint32_t m = 0; m < parts.groups[g].member_count; ++m)
              EXPECT_LT(parts.members[parts.groups[g].first_member + m], parts.bodies.size());
          return drain(parts.bodies) + drain(parts.groups) + drain(parts.members);
        }}},
      {"pair table", {table, [](auto payload) { return drain(parse_pair_table(payload).pairs); }}},
      {"body states", {states, [](auto payload) { return drain(parse_states(payload).states); }}},
      {"stats", {stats, [](auto payload) { return drain(parse_stats(payload)); }, true}},
      {"error", {error, [](auto payload) { return std::uint64_t{parse_error(payload).text.size()}; }}},
  };
}

/// Reads a copy that ends where its allocation ends, so that the sanitizer detects reads beyond it.
inline std::uint64_t read_exact(const Kind& kind, const Bytes& bytes) {
  const std::unique_ptr<std::byte[]> copy(new std::byte[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), copy.get());
  return kind.read({copy.get(), bytes.size()});
}

inline std::string error_of(const std::function<void()>& call, ErrorCode expected) {
  try {
    call();
  } catch (const WireError& error) {
    EXPECT_EQ(error.code, expected) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

}  // namespace clearance::wire
