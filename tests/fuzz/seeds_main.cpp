// clearance-fuzz-seeds FOLDER: writes the seeds of the fuzz targets, one folder each. To be repeated if the wire, a
// message or a file format changes; its output is tests/fuzz/corpus.

#include <cstdio>
#include <filesystem>

#include "clearance_lcm/frame_t.hpp"
#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "server/gateway/link.h"
#include "tests/client/plan_payload.h"
#include "tests/fuzz/frames.h"
#include "tests/fuzz/seeds.h"
#include "tests/lcm/sample_query.h"
#include "tests/server/conversation.h"
#include "tests/server/sample_requests.h"
#include "tests/server/test_scene.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/shm_layout.h"

namespace clearance::fuzz {
namespace {

// --- frames

void save_requests_and_replies() {
  Conversation daemon(small_scene());
  Data conversation;
  for (const auto& [name, frame] : sample_requests()) {
    Data request, reply;
    append_frame(request, kMendHeader, frame);
    save("request", "good_" + name, request);
    append_frame(conversation, 0, frame);
    append_frame(reply, kMendHeader, daemon.reply_to(frame));
    save("reply", "good_" + name, reply);
  }
  save("request", "good_conversation", conversation);
  // A body that is added, queried and removed.
  Data come_and_go;
  for (const auto& [name, frame] : sample_requests())
    if (name == "add_capsule" || name == "query_all_pairs") append_frame(come_and_go, kMendHeader, frame);
  wire::RemoveBodyRecord gone;
  wire::set_name(gone.name, "capsule");
  const Data remove = simple_frame(wire::FrameType::kRemoveBody, 30, std::as_bytes(std::span(&gone, 1)));
  append_frame(come_and_go, kMendHeader, remove);
  save("request", "good_come_and_go", come_and_go);
  Data rejected;
  append_frame(rejected, kMendHeader, simple_frame(wire::FrameType::kQuery, 1));
  save("request", "bad_empty_query", rejected);
  // Device queries, for which this daemon has no GPU.
  Data plans;
  TestQuery plan;
  plan.bodies = {1};
  plan.plan_configurations = 3;
  append_frame(plans, kMendHeader, plan.frame(1, wire::FrameType::kOpenPlan));
  const wire::PlanRecord one{1, 0};
  for (const auto type : {wire::FrameType::kRunPlan, wire::FrameType::kClosePlan})
    append_frame(plans, kMendHeader, simple_frame(type, 2, std::as_bytes(std::span(&one, 1))));
  save("request", "bad_plans", plans);
  Data opened, done;
  append_frame(opened, kMendHeader, simple_frame(wire::FrameType::kPlan, 1, wire::plan_payload()));
  save("reply", "good_plan", opened);
  const wire::PlanResult result{1, 5, 100'000, {}};
  append_frame(done, kMendHeader, simple_frame(wire::FrameType::kPlanDone, 1, std::as_bytes(std::span(&result, 1))));
  save("reply", "good_plan_done", done);
  Data error;
  wire::ErrorHeader why;
  why.code = static_cast<std::uint16_t>(wire::ErrorCode::kBusy);
  why.text_bytes = 4;
  Data payload;
  add(payload, why);
  wire::append_bytes(payload, "busy", 4);
  append_frame(error, kMendHeader, simple_frame(wire::FrameType::kError, 1, payload));
  save("reply", "good_error", error);
}

// --- ZeroMQ

void save_zmq() {
  const std::uint8_t no_name = 0, frame = 0, parts = 1, noise = 2, same_name = 3;
  const auto all = sample_requests();
  Data every, named, odd, strangers, twice;
  add(every, no_name);
  for (const auto& [name, request] : all)
    if (name == "ping" || name == "query_pairs" || name == "query_with_a_deadline" || name == "stats") {
      add(every, frame);
      append_frame(every, kMendHeader, request);
    }
  save("zmq_server", "good_requests", every);
  add(named, std::uint8_t{7});
  wire::append_bytes(named, "planner", 7);
  twice = named;
  add(named, frame);
  append_frame(named, kMendHeader, all[0].second);
  save("zmq_server", "good_name", named);
  add(odd, no_name, parts, std::uint8_t{0}, std::uint16_t{0}, parts, std::uint8_t{2}, std::uint16_t{3});
  wire::append_bytes(odd, "abc", 3);
  add(odd, std::uint16_t{0}, std::uint16_t{0});
  save("zmq_server", "bad_parts", odd);
  add(strangers, no_name, noise, std::uint16_t{10}, std::uint64_t{0xFF}, std::uint16_t{0x037F}, noise,
      std::uint16_t{3});
  wire::append_bytes(strangers, "GET", 3);
  save("zmq_server", "bad_strangers", strangers);
  add(twice, same_name);
  append_frame(twice, kMendHeader, all[0].second);
  save("zmq_server", "bad_same_name", twice);
}

// --- shared memory

void add_post(Data& steps, std::uint8_t slot, const Data& frame) {
  add(steps, std::uint8_t{5}, slot);
  append_frame(steps, kMendHeader, frame);
}

void save_shm() {
  const std::uint8_t receive = 0, hello = 1, message = 2, raw = 3, scribble = 4, turn = 6, anew = 7;
  auto all = sample_requests();
  std::erase_if(all, [](const auto& request) {  // a request that waits for poses occupies its slot meanwhile
    return request.first.starts_with("add_") || request.first == "reload" || request.first == "query_waits_for_poses";
  });
  Data one, many, grown, hostile, garbage, again;
  add(one, hello, receive);
  add_post(one, 0, all[0].second);
  save("shm_server", "good_query", one);
  add(many, hello, receive);
  for (std::size_t i = 0; i < all.size(); ++i) {
    add_post(many, static_cast<std::uint8_t>(i % 4), all[i].second);
    if (i % 4 == 3) add(many, receive);
  }
  save("shm_server", "good_every_request", many);
  add(grown, hello, receive, message, std::uint8_t{2}, std::uint32_t{0}, std::uint64_t{20000}, std::uint64_t{40000},
      receive, message, std::uint8_t{3}, std::uint32_t{0}, std::uint64_t{0}, std::uint64_t{0}, turn);
  add_post(grown, 1, all[1].second);
  save("shm_server", "good_grow_and_retire", grown);
  add(hostile, hello, receive);
  add_post(hostile, 0, all[0].second);
  add(hostile, scribble, std::uint32_t{128}, std::uint16_t{4}, std::uint32_t{0xFFFFFFFF}, turn);
  save("shm_server", "bad_head_runs_ahead", hostile);
  add(garbage, raw, std::uint16_t{16}, std::uint64_t{1}, std::uint64_t{2}, turn);
  save("shm_server", "bad_greeting", garbage);
  add(again, hello, receive, anew, hello, hello, receive);
  save("shm_server", "bad_hello_twice", again);

  // The daemon's side. Requests use slot 0, with increasing generations.
  const auto daemon = [](std::uint64_t request_id, std::uint8_t generation) {
    Data said;
    add(said, std::uint8_t{1}, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0});  // one regular greeting
    for (std::uint8_t id = 0; id < 2; ++id) {
      add(said, std::uint8_t{1}, std::uint8_t{0}, static_cast<std::uint8_t>(generation + id));
      append_frame(said, kMendHeader,
                   simple_frame(wire::FrameType::kPong, request_id + id, data_of("0123456789abcdef")));
    }
    return said;
  };
  save("shm_client", "good_two_answers", daemon(1, 1));
  save("shm_client", "bad_answers_to_others", daemon(100, 1));
  save("shm_client", "bad_generation", daemon(1, 7));
  Data needs_room;
  add(needs_room, std::uint8_t{2}, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0},
      std::uint8_t{0});
  wire::ErrorHeader error;
  error.code = static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge);
  error.needed_bytes = 5000;
  add(needs_room, std::uint8_t{1}, std::uint8_t{0}, std::uint8_t{1});
  append_frame(needs_room, kMendHeader, simple_frame(wire::FrameType::kError, 1, std::as_bytes(std::span(&error, 1))));
  save("shm_client", "bad_needs_more_room", needs_room);
  Data rejected;
  add(rejected, std::uint8_t{1}, std::uint8_t{1 | 2 | 8}, std::uint8_t{64}, std::uint8_t{4});
  wire::append_bytes(rejected, "busy", 4);
  save("shm_client", "bad_refused", rejected);
}

// --- LCM

void save_lcm() {
  clearance_lcm::pose_update_t poses{};
  poses.publisher_id = 5;
  poses.sequence = 1;
  poses.count = 2;
  poses.names = {"cup", "link2"};
  poses.poses.assign(2, {0.1, 0.2, 0.3, 1, 0, 0, 0});
  clearance_lcm::joint_update_t joints{};
  joints.publisher_id = 6;
  joints.sequence = 1;
  joints.count = 2;
  joints.names = {"arm/joint1", "arm/joint2"};
  joints.positions = {0.5, -0.5};
  TestQuery large;
  wire::append_record(large.records, 500, 0, data_of("passed over"));
  large.bodies = {1};
  large.configurations.assign(900, {0, 0, 1, 1, 0, 0, 0});
  const Data frame = large.frame(3);
  std::vector<Data> parts;
  for (std::uint64_t i = 0; i < frame_part_count(frame.size()); ++i) {
    auto part = frame_part(frame, i);
    part.client_id = 9;
    part.request_id = 3;
    part.sequence = 1;
    parts.push_back(encode(part));
  }
  const auto packet = [](std::uint8_t type, const Data& bytes) {
    Data out;
    add(out, type, static_cast<std::uint16_t>(bytes.size()));
    wire::append_bytes(out, bytes.data(), bytes.size());
    return out;
  };
  const auto message = [](std::uint8_t channel, const Data& bytes) {
    Data out;
    add(out, std::uint8_t{1}, channel, static_cast<std::uint16_t>(bytes.size()));
    wire::append_bytes(out, bytes.data(), bytes.size());
    return out;
  };
  const std::pair<const char*, Data> kinds[] = {
      {"poses", encode(poses)}, {"joints", encode(joints)}, {"query", encode(sample_lcm_query())}};
  for (std::uint8_t type = 0; type < 3; ++type) {
    save("lcm_packet", std::string("good_") + kinds[type].first, packet(type, kinds[type].second));
    save("lcm_udp", std::string("good_") + kinds[type].first, message(type, kinds[type].second));
  }
  Data packets, messages;
  for (const Data& part : parts) {
    const Data a = packet(3, part), b = message(3, part);
    packets.insert(packets.end(), a.begin(), a.end());
    messages.insert(messages.end(), b.begin(), b.end());
  }
  save("lcm_packet", "good_frame_in_parts", packets);
  save("lcm_udp", "good_frame_in_parts", messages);
  Data fragment;
  add(fragment, std::uint8_t{2}, std::uint32_t{1}, std::uint32_t{400}, std::uint32_t{0}, std::uint32_t{2},
      std::uint16_t{64});
  wire::append_bytes(fragment, kinds[0].second.data(), 64);
  save("lcm_udp", "bad_fragment", fragment);
}

// --- the link to a gateway process

void save_link() {
  using gateway::Kind;
  // [corrected 1 B | size 2 B | a datagram] with a part of `body`, from `offset` on.
  const auto say = [](Data& said, Kind kind, const std::string& name, const std::string& extra, const std::string& body,
                      std::size_t offset, std::size_t part) {
    const gateway::Head head{static_cast<std::uint32_t>(kind),
                             static_cast<std::uint16_t>(name.size()),
                             static_cast<std::uint16_t>(extra.size()),
                             7,
                             body.size(),
                             offset};
    add(said, std::uint8_t{0}, static_cast<std::uint16_t>(sizeof head + name.size() + extra.size() + part), head);
    for (const std::string& text : {name, extra, body.substr(offset, part)})
      wire::append_bytes(said, text.data(), text.size());
  };
  const std::string header(sizeof(wire::FrameHeader), 'h'), key(40, 'k'), body(300, 'b');
  Data frame, parts, told, mixed, torn;
  say(frame, Kind::kFrame, "client", header + key, body, 0, body.size());
  save("gateway_link", "good_frame", frame);
  for (const std::size_t offset : {0, 100, 200})
    for (const char* client : {"one", "two"}) say(parts, Kind::kReply, client, header, body, offset, 100);
  save("gateway_link", "good_parts_of_two_clients", parts);
  for (const Kind kind :
       {Kind::kReady, Kind::kAlive, Kind::kReplyReleased, Kind::kGone, Kind::kAuthenticate, Kind::kAuthenticated})
    say(told, kind, "127.0.0.1", key, "", 0, 0);
  save("gateway_link", "good_short_words", told);
  say(mixed, Kind::kReply, "one", header, body, 0, 100);
  say(mixed, Kind::kReply, "one", header, body, 200, 100);
  save("gateway_link", "bad_parts_mixed_up", mixed);
  say(torn, Kind::kStart, "tcp://*:7", "", body, 0, body.size());
  torn[3 + offsetof(gateway::Head, body_bytes)] = std::byte{255};
  save("gateway_link", "bad_body_that_does_not_end", torn);
}

}  // namespace
}  // namespace clearance::fuzz

int main(int argc, char** argv) {
  using namespace clearance::fuzz;
  if (argc != 2) {
    std::fprintf(stderr, "usage: clearance-fuzz-seeds FOLDER\n");
    return 2;
  }
  seeds_folder() = argv[1];
  std::filesystem::create_directories(seeds_folder());
  save_requests_and_replies();
  save_shm();
  save_zmq();
  save_lcm();
  save_link();
  save_files();
}
