#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "client/record_list.h"
#include "tests/client/wire_payloads.h"
#include "wire/wire.h"

namespace clearance::wire {
namespace {

TEST(Wire, GoodPayloadsAreRead) {
  for (const auto& [name, kind] : kinds()) EXPECT_NO_THROW(read_exact(kind, kind.good)) << name;
}

TEST(Wire, EveryTruncationIsRefused) {
  for (const auto& [name, kind] : kinds()) {
    for (std::size_t size = 0; size < kind.good.size(); ++size) {
      const Bytes part(kind.good.begin(), kind.good.begin() + size);
      if (kind.any_multiple_is_good && size % sizeof(CounterRecord) == 0)
        EXPECT_NO_THROW(read_exact(kind, part)) << name << " " << size;
      else
        EXPECT_THROW(read_exact(kind, part), WireError) << name << " " << size;
    }
  }
}

TEST(Wire, OneByteTooManyIsRefused) {
  for (const auto& [name, kind] : kinds()) {
    Bytes longer = kind.good;
    longer.push_back(std::byte{0});
    EXPECT_THROW(read_exact(kind, longer), WireError) << name;
  }
}

TEST(Wire, FlippedBitsNeverReadOutside) {
  std::mt19937 random(20);
  for (const auto& [name, kind] : kinds()) {
    int rejected = 0, accepted = 0;
    for (int round = 0; round < 3000; ++round) {
      Bytes bytes = kind.good;
      const int flips = 1 + static_cast<int>(random() % 4);
      // Half of the flips go to headers, which have the sizes and counts.
      for (int i = 0; i < flips; ++i) {
        const std::size_t span = random() % 2 ? std::min<std::size_t>(bytes.size(), 128) : bytes.size();
        bytes[random() % span] ^= std::byte(1 << random() % 8);
      }
      try {
        read_exact(kind, bytes);
        ++accepted;
      } catch (const WireError&) {
        ++rejected;
      }
    }
    // A payload that is one struct without invalid values cannot be rejected for its contents.
    EXPECT_EQ(rejected > 0, name != "poses done" && name != "remove body") << name;
    EXPECT_GT(accepted, 0) << name;
  }
}

TEST(Wire, RandomBytesNeverReadOutside) {
  std::mt19937 random(21);
  for (const auto& [name, kind] : kinds()) {
    int rejected = 0;
    for (int round = 0; round < 500; ++round) {
      Bytes bytes(round % 2 ? kind.good.size() : random() % 400);  // the size of a valid one passes the first check
      for (auto& byte : bytes) byte = std::byte(random());
      try {
        read_exact(kind, bytes);
      } catch (const WireError&) {
        ++rejected;
      }
    }
    EXPECT_GT(rejected, 200) << name;
  }
}

TEST(Wire, AbsurdCountsDoNotOverflow) {
  Bytes query = query_payload(0, 1, 1);
  for (std::size_t at : {offsetof(QueryHeader, body_count), offsetof(QueryHeader, configuration_count)})
    overwrite(query, at, std::uint32_t{0xFFFFFFFF});
  EXPECT_EQ(error_of([&] { parse_query(query); }, ErrorCode::kBadFrame),
            "query: 0 pairs, 4294967295 bodies and 4294967295 configurations need a payload of more than 2^64 bytes, "
            "got 192");

  // 2^58 records of 64 bytes are 2^64 bytes: a 64-bit product would be 0, and fit.
  Bytes poses = poses_payload(0);
  overwrite(poses, offsetof(PosesHeader, count), std::uint64_t{1} << 58);
  EXPECT_EQ(error_of([&] { parse_poses(poses); }, ErrorCode::kBadFrame),
            "poses: 288230376151711744 poses need a payload of more than 2^64 bytes, got 32");

  Bytes table = single(PairsHeader{0, std::uint64_t{1} << 61});
  EXPECT_THROW(parse_pair_table(table), WireError);
  Bytes reply = reply_payload(0, kFieldDistance);
  overwrite(reply, offsetof(ReplyHeader, rows), std::uint64_t{1} << 61);
  EXPECT_THROW(parse_reply(reply), WireError);
}

TEST(Wire, VelocitiesOfAnUpdateAreARecordOfThePosesSize) {
  const Bytes poses = poses_payload(2);
  const std::vector<double> twelve{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  const auto records = [&](std::size_t count) {
    return velocity_records(std::as_bytes(std::span(twelve).first(count)));
  };
  const Bytes all = records(12), few = records(3);  // the parts are views of them
  const PosesParts parts = parse_poses(poses, all);
  ASSERT_EQ(parts.extras.velocities.size(), 12u);
  EXPECT_EQ(parts.extras.velocities[11], 12);
  EXPECT_EQ(parse_poses(poses).extras.velocities.size(), 0u);
  EXPECT_EQ(error_of([&] { parse_poses(poses, records(11)); }, ErrorCode::kBadFrame),
            "poses: velocities (record 1): 2 times 6 numbers need a payload of 96 bytes, got 88");
  PosesHeader header;
  header.count = 3;
  Bytes joints = single(header);
  for (std::uint32_t j = 0; j < 3; ++j) put(joints, JointRecord{j, 0, 0.5});
  EXPECT_EQ(parse_joint_update(joints, few).extras.velocities[2], 3);
  EXPECT_EQ(error_of([&] { parse_joint_update(joints, records(12)); }, ErrorCode::kBadFrame),
            "joints: velocities (record 1): 3 times 1 numbers need a payload of 24 bytes, got 96");
}

TEST(Wire, BadQueryValuesAreNamed) {
  struct Case {
    std::size_t at;
    Bytes value;
    const char* text;
  };
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const Case cases[] = {
      {offsetof(QueryHeader, max_distance), single(nan),
       "query: max_distance must be a number of metres >= 0, got nan"},
      {offsetof(QueryHeader, max_distance), single(-1.5),
       "query: max_distance must be a number of metres >= 0, got -1.5"},
      {offsetof(QueryHeader, abs_tol), single(nan), "query: abs_tol must be a finite number of metres >= 0, got nan"},
      {offsetof(QueryHeader, abs_tol), single(inf), "query: abs_tol must be a finite number of metres >= 0, got inf"},
      {offsetof(QueryHeader, rel_tol), single(nan), "query: rel_tol must be finite, got nan"},
      {offsetof(QueryHeader, all_pairs), single(std::uint8_t{2}), "query: all_pairs 2 is not one of 0 to 1"},
      {offsetof(QueryHeader, precision), single(std::uint8_t{2}), "query: precision 2 is not one of 0 to 1"},
      {offsetof(QueryHeader, signed_distance), single(std::uint8_t{9}),
       "query: signed_distance 9 is not one of 0 to 1"},
      {offsetof(QueryHeader, reduce), single(std::uint8_t{5}), "query: reduce 5 is not one of 0 to 4"},
      {offsetof(QueryHeader, fields), single(std::uint32_t{1u << 26}), "query: fields has unknown bits: 67108864"},
      {offsetof(QueryHeader, max_pose_age_ns), single(std::int64_t{-1}), "query: max_pose_age_ns must be >= 0, got -1"},
      {offsetof(QueryHeader, min_pose_stamp_ns), single(std::int64_t{-2}),
       "query: min_pose_stamp_ns must be >= 0, got -2"},
      {offsetof(QueryHeader, deadline_ns), single(std::int64_t{3'600'000'000'001}),
       "query: deadline_ns must be 0 to 3600000000000, got 3600000000001"},
      {offsetof(QueryHeader, all_pairs), single(std::uint8_t{1}), "query: all_pairs is set, yet 2 pairs are named"},
  };
  for (const Case& c : cases) {
    Bytes query = query_payload(2, 1, 1);
    std::copy(c.value.begin(), c.value.end(), query.begin() + c.at);
    EXPECT_EQ(error_of([&] { parse_query(query); }, ErrorCode::kBadQuery), c.text);
  }
  Bytes query = query_payload(2, 0, 0);
  overwrite(query, offsetof(QueryHeader, configuration_count), std::uint32_t{3});
  EXPECT_EQ(error_of([&] { parse_query(query); }, ErrorCode::kBadQuery),
            "query: 3 configurations of no bodies and no joints");
  query = query_payload(2, 0, 0);
  overwrite(query, offsetof(QueryHeader, reserved) + 8, std::uint64_t{1});
  EXPECT_EQ(error_of([&] { parse_query(query); }, ErrorCode::kBadFrame), "query: reserved words must be 0");
}

TEST(Wire, ARecordListWritesTheBytesOfEncodedRecords) {
  const std::uint32_t joints[] = {3, 4, 5};  // 12 bytes, which records pad
  const double positions[] = {1, 2, 3, 4, 5, 6}, velocities[] = {7, 8, 9, 10, 11, 12};
  QueryOptions options;
  options.margin = 0.25;
  options.min_pose_stamp_ns = 77;
  for (const bool with_joints : {false, true}) {
    const Bytes encoded = option_records(options);
    ASSERT_FALSE(encoded.empty());
    Bytes expected = encoded, epoch;
    if (with_joints) insert_inputs(expected, {.joints = joints, .positions = positions, .velocities = velocities});
    const std::uint64_t rows[] = {9};
    insert_record(expected, static_cast<std::uint16_t>(QueryRecord::kRows), kRecordRequired,
                  std::as_bytes(std::span(rows)));
    append_epoch(epoch, 5, kRecordRequired);
    expected.insert(expected.end(), epoch.begin(), epoch.end());

    RecordList list(encoded);
    if (with_joints) {
      list.insert(QueryRecord::kVelocities, std::as_bytes(std::span(velocities)));
      list.insert(QueryRecord::kJoints, std::as_bytes(std::span(joints)));
      list.insert(QueryRecord::kPositions, std::as_bytes(std::span(positions)));
    }
    list.insert(QueryRecord::kRows, std::as_bytes(std::span(rows)));
    list.append(epoch);
    ASSERT_EQ(list.bytes(), expected.size());
    Bytes written(expected.size(), std::byte{0xEE});
    list.write(written.data());
    EXPECT_EQ(written, expected);
  }
}

TEST(Wire, ThereIsAVelocityForEachPosition) {
  Bytes query = query_payload(2, 0, 0);
  overwrite(query, offsetof(QueryHeader, configuration_count), std::uint32_t{1});
  const std::uint32_t joints[] = {3, 4};
  const double numbers[] = {0.5, 0.25, 1, 2, 3, 4};
  const std::span<const double> positions(numbers, 2);
  const auto records_with = [&](std::span<const double> velocities, std::span<const double> twists) {
    Bytes records;
    insert_inputs(records, {.joints = joints, .positions = positions, .velocities = velocities, .twists = twists});
    return records;
  };
  const Bytes right = records_with(positions, {}), few = records_with(positions.first(1), {}),
              alone = records_with({}, numbers);
  const QueryParts parts = parse_query(query, true, right);
  EXPECT_EQ(parts.velocities.size(), 2u);
  EXPECT_EQ(parts.velocities[1], 0.25);
  EXPECT_EQ(error_of([&] { parse_query(query, true, few); }, ErrorCode::kBadQuery),
            "query: velocities (record 18) has 1 numbers, expected 2");
  EXPECT_EQ(error_of([&] { parse_query(query, true, alone); }, ErrorCode::kBadQuery),
            "query: twists (record 19) has 6 numbers, expected 0");
}

TEST(Wire, AnOptionTravelsInTheHeaderOrInARecord) {
  std::uint16_t last = 0;
  int in_header = 0;
  for_each_query_option([&](const QueryOption& option, auto member) {
    const bool has_place = requires(QueryHeader& header) { member(header); };
    EXPECT_EQ(option.tag == 0, has_place) << option.name;
    in_header += has_place;
    if (!option.tag) return;
    EXPECT_GT(option.tag, std::exchange(last, option.tag)) << option.name << ": tags are given out one after another";
  });
  EXPECT_EQ(in_header, 12);
  EXPECT_GE(last, 1);
}

TEST(Wire, OptionsInRecordsArriveAsTheyWereSent) {
  QueryOptions options;
  EXPECT_TRUE(option_records(options).empty()) << "defaults need none";
  options.margin = 0.25;
  options.reduce = Reduce::kMin;  // has a field of its own in the header
  const Bytes records = option_records(options);
  ASSERT_EQ(records.size(), sizeof(RecordHeader) + 8);
  Bytes payload = query_payload(3, 3, 2);
  const std::size_t body = payload.size();
  payload.insert(payload.end(), records.begin(), records.end());
  const FrameHeader header = with_records(make_header(FrameType::kQuery, 7, body), records.size());
  EXPECT_EQ(header.payload_bytes, payload.size());
  EXPECT_NO_THROW(check_header(header, payload.size()));
  const auto parts = parse_query(header, payload);
  EXPECT_EQ(parts.options.margin, 0.25);
  EXPECT_EQ(parts.options.reduce, Reduce::kNone);
  EXPECT_EQ(parts.configurations.size(), 6u);
  // A record that is truncated anywhere, with a header that agrees.
  for (std::size_t left = 1; left < records.size(); ++left) {
    const std::span<const std::byte> cut(payload.data() + body, left);
    EXPECT_EQ(
        error_of([&] { parse_query(std::span(payload).first(body), true, cut); }, ErrorCode::kBadFrame).substr(0, 6),
        "query:");
  }
}

TEST(Wire, RecordsAreInsertedWhereTheirTagsRise) {
  Bytes inserted, expected;
  const auto bytes = [](int n) { return Bytes(static_cast<std::size_t>(n), std::byte{9}); };
  for (const std::uint16_t tag : {10, 8, 12, 9, 1}) insert_record(inserted, tag, kRecordRequired, bytes(3 * tag));
  for (const std::uint16_t tag : {1, 8, 9, 10, 12}) append_record(expected, tag, kRecordRequired, bytes(3 * tag));
  EXPECT_EQ(inserted, expected);
}

TEST(Wire, ARecordMayHoldAnArray) {
  const std::vector<double> joints{0.5, -1, 2};
  Bytes records;
  append_record(records, 3, 0, std::as_bytes(std::span(joints)));
  append_record(records, 8, 0, std::as_bytes(std::span("abc", 3)));
  EXPECT_EQ(records.size(), 8u + 24 + 8 + 8);
  std::vector<double> arrived;
  PassedOver passed_over;
  read_records("query", records, passed_over, [&](const RecordView& record) {
    if (record.tag != 3) return false;
    arrived.resize(record.bytes.size() / 8);
    std::memcpy(arrived.data(), record.bytes.data(), record.bytes.size());
    return true;
  });
  EXPECT_EQ(arrived, joints);
  EXPECT_EQ(passed_over, (PassedOver{8}));
}

TEST(Wire, QueryRoundTrip) {
  const Bytes payload = query_payload(3, 3, 2);
  const auto parts = parse_query(payload);
  ASSERT_EQ(parts.pairs.size(), 3u);
  EXPECT_EQ(parts.pairs[2].a, 104u);
  EXPECT_EQ(parts.pairs[2].b, 105u);
  ASSERT_EQ(parts.bodies.size(), 3u);
  EXPECT_EQ(parts.bodies[2], 202u);
  ASSERT_EQ(parts.configurations.size(), 6u);
  EXPECT_EQ(parts.configurations[5].pose[6], 0.5 * 41);
  // An odd number of bodies is padded, so that the poses start at a multiple of 8.
  EXPECT_EQ((parts.configurations.data() - payload.data()) % 8, 0);
}

TEST(Wire, ColumnsLieInTheOrderOfFieldsOn64Bytes) {
  const std::uint32_t fields = kFieldDistance | kFieldStatus | kFieldFlags | kFieldPair;
  EXPECT_EQ(column_offset(5, fields, kFieldDistance), 0u);
  EXPECT_EQ(column_offset(5, fields, kFieldStatus), 64u);
  EXPECT_EQ(column_offset(5, fields, kFieldFlags), 128u);
  EXPECT_EQ(column_offset(5, fields, kFieldPair), 192u);
  EXPECT_EQ(columns_bytes(5, fields), 256u);
  EXPECT_EQ(columns_bytes(0, fields), 0u);
  EXPECT_EQ(columns_bytes(9, kFieldDistance), 128u);
  const std::uint32_t wide = kFieldStatus | kFieldGradientJoints | kFieldPairLower;
  EXPECT_EQ(column_offset(5, wide, kFieldGradientJoints, 7), 64u);
  EXPECT_EQ(column_offset(5, wide, kFieldPairLower, 7), 64u + 320) << "5 rows of 7 numbers";
  EXPECT_EQ(columns_bytes(5, wide, 7), 64u + 320 + 64);
  EXPECT_EQ(error_of([] { columns_bytes(std::uint64_t{1} << 31, kFieldDistance); }, ErrorCode::kTooLarge),
            "reply: 2147483648 rows need 17179869184 bytes, more than a frame may have (2147483648)");
}

TEST(Wire, BadHeadersAreNamed) {
  const FrameHeader good = make_header(FrameType::kPing, 1, 24);
  EXPECT_NO_THROW(check_header(good, 24));
  FrameHeader h = good;
  h.magic = 0x46504c47;
  EXPECT_EQ(error_of([&] { check_header(h, 24); }, ErrorCode::kBadFrame),
            "frame: magic is 0x46504c47, expected 0x31524c43");
  h = good;
  h.version = 9;
  EXPECT_EQ(error_of([&] { check_header(h, 24); }, ErrorCode::kWrongVersion),
            "frame: version 9, this side speaks version 1");
  EXPECT_EQ(error_of([&] { check_header(good, 16); }, ErrorCode::kBadFrame),
            "frame: the header announces a payload of 24 bytes, 16 came");
  h = good;
  h.payload_bytes = ~std::uint64_t{0};
  EXPECT_EQ(error_of([&] { check_header(h, 24); }, ErrorCode::kBadFrame),
            "frame: a payload of 18446744073709551615 bytes is more than the 2147483584 allowed");
  h = good;
  h.flags = 6;
  EXPECT_EQ(error_of([&] { check_header(h, 24); }, ErrorCode::kBadFrame), "frame: flags has unknown bits: 6");
  h = good;
  h.reserved[0] = 1;
  EXPECT_EQ(error_of([&] { check_header(h, 24); }, ErrorCode::kBadFrame), "frame: reserved words must be 0");
  FrameHeader out;
  EXPECT_EQ(error_of([&] { split_frame(Bytes(63), out); }, ErrorCode::kBadFrame),
            "frame: 63 bytes, fewer than a header of 64");
}

TEST(Wire, SceneContentsAreChecked) {
  Bytes scene = scene_payload();
  const std::size_t groups = sizeof(SceneHeader) + 3 * sizeof(BodyRecord), members = groups + 2 * sizeof(GroupRecord);
  overwrite(scene, groups + offsetof(GroupRecord, first_member), std::uint32_t{0xFFFFFFFF});
  EXPECT_EQ(error_of([&] { parse_scene(scene); }, ErrorCode::kBadFrame),
            "scene: groups[0]: its members go past the end of the list");
  scene = scene_payload();
  overwrite(scene, members + 4, std::uint32_t{3});
  EXPECT_EQ(error_of([&] { parse_scene(scene); }, ErrorCode::kBadFrame), "scene: members[1] is no body");
  scene = scene_payload();
  std::fill_n(scene.begin() + sizeof(SceneHeader) + sizeof(BodyRecord), 64, std::byte{'x'});
  EXPECT_EQ(error_of([&] { parse_scene(scene); }, ErrorCode::kBadFrame), "scene: bodies[1]: the name does not end");
}

TEST(Wire, APlansPartsLieInItsMemory) {
  const auto rejection = [](auto change) {
    Bytes payload = plan_payload();
    PlanHeader h;
    PlanColumnRecord columns[2];
    std::memcpy(&h, payload.data(), sizeof h);
    std::memcpy(columns, payload.data() + sizeof h, sizeof columns);
    change(h, columns);
    std::memcpy(payload.data(), &h, sizeof h);
    std::memcpy(payload.data() + sizeof h, columns, sizeof columns);
    return error_of([&] { parse_plan(payload); }, ErrorCode::kBadFrame);
  };
  EXPECT_EQ(rejection([](auto& h, auto&) { h.plan = 0; }), "plan: its number is 0");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.positions_offset = 200; }),
            "plan: positions are 80 bytes from 200 on, expected them from 224 on in a memory of 2097152");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.poses_offset = ~std::uint64_t{0}; }),
            "plan: poses are 224 bytes from 18446744073709551615 on, expected them from 0 on in a memory of 2097152");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.configurations = ~std::uint64_t{0}; }).substr(0, 30),
            "plan: poses are more than 2^64");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.memory_bytes = 800; }),
            "plan: columns[1] are 480 bytes from 512 on, expected them from 480 on in a memory of 800");
  EXPECT_EQ(rejection([](auto&, auto& c) { c[0].offset = 388; }),
            "plan: columns[0] begins at 388, expected a multiple of 64");
  EXPECT_EQ(rejection([](auto&, auto& c) { c[1].offset = 384; }),
            "plan: columns[1] are 480 bytes from 384 on, expected them from 480 on in a memory of 2097152");
  EXPECT_EQ(rejection([](auto&, auto& c) { c[1].row_bytes = 8; }),
            "plan: columns[1] is none of 40 bytes a row of the field 8192");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.fields |= kFieldUpper; }),
            "plan: columns[1] is none of 8 bytes a row of the field " + std::to_string(kFieldUpper));
  EXPECT_EQ(rejection([](auto& h, auto&) { h.fields = kFieldLower; }), "plan: 2 columns, and fields of 1");
  EXPECT_EQ(rejection([](auto& h, auto&) { h.fields |= 1u << 31; }), "plan: fields has unknown bits: 2147483648");
  const auto wide = [](auto& h, auto&) {
    h.fields = kFieldHessianJoints;
    h.joint_count = 1u << 31;
  };
  EXPECT_EQ(rejection(wide), "plan: a row of 2147483648 x 2147483648 numbers is too large");
}

TEST(Wire, TooLargeQueriesAreRefusedBeforeTheyAreBuilt) {
  EXPECT_EQ(query_payload_bytes(1, 1, 1), 128u + 8 + 8 + 56);
  EXPECT_EQ(error_of([] { query_payload_bytes(0, 1000, 100000); }, ErrorCode::kTooLarge),
            "query: 0 pairs and 100000 configurations of 1000 bodies do not fit into a frame");
  EXPECT_THROW(query_payload_bytes(std::uint64_t{1} << 62, 0, 0), WireError);
  EXPECT_THROW(query_payload_bytes(0, 0xFFFFFFFF, 0xFFFFFFFF), WireError);
}

TEST(Wire, BuilderWritesThePayloadsSize) {
  FrameHeader header;
  const Bytes frame = FrameBuilder(make_header(FrameType::kError, 5, 0)).add(ErrorHeader{}).add_bytes("abc", 3).take();
  EXPECT_EQ(split_frame(frame, header).size(), sizeof(ErrorHeader) + 3);
  EXPECT_EQ(header.request_id, 5u);
}

TEST(Wire, NamesAreCutToFit) {
  char field[8];
  set_name(field, "a name too long");
  EXPECT_EQ(name_of(field), "a name ");
}

TEST(Wire, AColumnThatDependsOnTheQuerySaysHowWideItIs) {
  constexpr std::uint32_t kFields = kFieldLower | kFieldGradientJoints;
  Bytes payload;
  ReplyHeader h;
  h.rows = 5;
  h.fields = kFields;
  set_name(h.backend, "cpu");
  put(payload, h);
  payload.resize(payload.size() + columns_bytes(5, kFields, 7));
  std::uint32_t joints = 0;
  EXPECT_EQ(parse_reply(payload, joints_record(7), &joints).rows, 5u);
  EXPECT_EQ(joints, 7u);
  for (const std::uint32_t other : {0u, 6u, 9u, ~0u})
    EXPECT_THROW(parse_reply(payload, joints_record(other), &joints), WireError) << other;
  EXPECT_THROW(parse_reply(payload), WireError) << "nobody says how wide";
  EXPECT_THROW(parse_reply(reply_payload(5, kFieldLower), joints_record(7)), WireError) << "of what?";
  Bytes half;
  const std::uint16_t tag = static_cast<std::uint16_t>(ReplyRecord::kJoints);
  append_record(half, tag, 0, std::as_bytes(std::span(&tag, 1)));
  EXPECT_THROW(parse_reply(payload, half), WireError);
}

TEST(Wire, ARowByPairsOfJointsFitsAFrame) {
  // 8 * 2^31 * 2^31 is 0 in 64 bits.
  for (const std::uint64_t rows : {5, 0}) {
    Bytes payload = reply_payload(0, kFieldHessianJoints);
    overwrite(payload, offsetof(ReplyHeader, rows), rows);
    for (const std::uint32_t joints : {1u << 31, ~0u, 1u << 14})
      EXPECT_NE(error_of([&] { parse_reply(payload, joints_record(joints)); }, ErrorCode::kBadFrame).find("too large"),
                std::string::npos)
          << joints;
  }
  EXPECT_EQ(parse_reply(reply_payload(0, kFieldHessianJoints), joints_record(1u << 13)).rows, 0u);
}

}  // namespace
}  // namespace clearance::wire
