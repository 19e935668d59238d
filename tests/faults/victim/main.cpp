// fault_victim WHAT URL SEED [POINT SIGNAL]: a client that is harmed, or harms.
//   talk URL SEED POINT SIGNAL   communicates with the daemon step by step and raises the signal at the point
//   query URL SEED               sends requests through the client library until it is killed
//   scribble URL SEED            overwrites the memory that it shares with the daemon until it is killed
// Exit code 0 if the communication was completed.
#include <sys/prctl.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "client/client.h"
#include "tests/faults/victim/victim.h"
#include "wire/wire.h"

namespace clearance::faults {

std::vector<std::byte> large_request(std::uint64_t id) {
  wire::QueryHeader query;
  query.max_distance = std::numeric_limits<double>::infinity();
  query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
  const std::uint64_t bytes = wire::query_payload_bytes(0, 0, 0);
  std::vector<std::byte> frame(sizeof(wire::FrameHeader) + bytes);
  wire::write_query(frame.data(), wire::make_header(wire::FrameType::kQuery, id, bytes), query, nullptr, nullptr,
                    nullptr);
  return frame;
}

std::vector<std::byte> request_of(std::uint64_t id, std::uint32_t configurations, std::mt19937_64& random) {
  wire::QueryHeader query;
  query.max_distance = 10;
  query.body_count = 1;
  query.configuration_count = configurations;
  const std::uint32_t body = 1;
  std::vector<Pose7> poses(configurations);
  for (Pose7& pose : poses)
    pose = {static_cast<double>(random() % 28), static_cast<double>(random() % 28), 5, 1, 0, 0, 0};
  const std::uint64_t bytes = wire::query_payload_bytes(0, 1, configurations);
  std::vector<std::byte> frame(sizeof(wire::FrameHeader) + bytes);
  wire::write_query(frame.data(), wire::make_header(wire::FrameType::kQuery, id, bytes), query, nullptr, &body,
                    poses.data());
  return frame;
}

void request_without_end(const std::string& url, std::mt19937_64& random) {
  for (;;) {
    try {
      Client client = connect(url);
      for (;;) {
        std::vector<Pending> pending;
        Query query;
        query.fields = kDefaultFields | kFieldPoints;
        const std::uint32_t body = 1;
        const std::vector<Pose7> poses(1 + random() % 50, Pose7{static_cast<double>(random() % 28), 3, 5, 1, 0, 0, 0});
        if (random() % 2) {
          query.bodies = {&body, 1};
          query.configurations = poses;
        }
        const std::uint64_t count = 1 + random() % 4;
        for (std::uint64_t i = 0; i < count; ++i) pending.push_back(client.submit(query));
        if (random() % 8)  // otherwise abandoned
          for (Pending& p : pending) p.get();
      }
    } catch (const std::runtime_error&) {
      // The daemon was killed, or has no capacity: repeat.
    }
  }
}

namespace {

std::string path_of(const std::string& url) {
  return url.substr(url.find("://") + 3);
}

int main_of(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (argc < 4 || (what == "talk" && argc < 6)) {
    std::fprintf(stderr, "fault_victim talk|ask|scribble URL SEED [POINT SIGNAL]\n");
    return 2;
  }
  const std::string url = argv[2];
  std::mt19937_64 random(std::strtoull(argv[3], nullptr, 10));
  if (what == "query") request_without_end(url, random);
  if (what == "scribble") scribble(path_of(url), random);
  const Fate fate(argv[4], std::atoi(argv[5]));
  if (url.rfind("shm://", 0) == 0) talk_shm(path_of(url), fate, random);
  if (url.rfind("ipc://", 0) == 0) talk_zmq(path_of(url), fate, random);
  if (url.rfind("udpm://", 0) == 0) talk_lcm(url, fate, random);
  return 0;
}

}  // namespace
}  // namespace clearance::faults

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  try {
    return clearance::faults::main_of(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fault_victim: %s\n", error.what());
    return 1;
  }
}
