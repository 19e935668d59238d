// clearance bench and a daemon: its output, the rows that it appends, and the end of its echo process.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << part << "\" is not in:\n" << text;
}

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

/// One row of CSV by column name. Quoted fields contain no quotes here.
std::map<std::string, std::string> row_of(const std::string& names, const std::string& values) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields(1);
    bool quoted = false;
    for (const char c : line) {
      if (c == '"')
        quoted = !quoted;
      else if (c == ',' && !quoted)
        fields.emplace_back();
      else
        fields.back() += c;
    }
    return fields;
  };
  const auto keys = split(names), cells = split(values);
  std::map<std::string, std::string> row;
  EXPECT_EQ(keys.size(), cells.size());
  for (std::size_t i = 0; i < std::min(keys.size(), cells.size()); ++i) row[keys[i]] = cells[i];
  return row;
}

/// Processes on this machine that run `clearance bench-echo`.
int echo_processes() {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "cmdline");
    std::stringstream text;
    text << file.rdbuf();
    count += text.str().find(std::string("bench-echo") + '\0' + std::to_string(::getpid())) != std::string::npos;
  }
  return count;
}

class Bench : public testing::Test {
 protected:
  Finished bench(std::vector<std::string> options) {
    options.insert(options.begin(), {program("clearance"), "bench", "--seconds", "0.3", "--warmup", "0.05"});
    return run(options);
  }

  TestFolder folder_;
  std::string scene_ = folder_.write("scene.yaml", R"(bodies:
  - {name: a, box: [1, 1, 1], pose: [0, 0, 0, 1, 0, 0, 0]}
  - {name: b, sphere: 0.5, pose: [2, 0, 0, 1, 0, 0, 0]}
  - {name: c, capsule: [0.2, 1], pose: [0, 2, 0, 1, 0, 0, 0]}
  - {name: d, box: [5, 5, 0.1], static: true, pose: [0, 0, -2, 1, 0, 0, 0]}
)");
  std::string csv_ = folder_ / "latency.csv";
  Daemon daemon_{{"--scene", scene_, "--shm", folder_ / "c.sock", "--zmq", "ipc://" + (folder_ / "c.ipc")}};
};

TEST_F(Bench, EachTransportIsMeasuredWithItsFloor) {
  const std::pair<std::string, std::string> transports[] = {{"shm", daemon_.urls().at(0)},
                                                            {"zmq-ipc", daemon_.urls().at(1)}};
  for (const auto& [name, url] : transports) {
    const Finished done = bench({"--connect", url, "--csv", csv_, "--pairs", "4"});
    ASSERT_EQ(done.code, 0) << done.err;
    for (const char* part :
         {"closed loop", "p50", "p99.9", "latency", "server", "engine", "transport / floor", "floor: the same bytes"})
      EXPECT_TRUE(contains(done.out, part));
    const auto lines = lines_of(csv_);
    const auto row = row_of(lines.front(), lines.back());
    EXPECT_EQ(row.at("transport"), name);
    EXPECT_EQ(row.at("pairs"), "4");
    EXPECT_EQ(row.at("configs"), "0");
    EXPECT_EQ(row.at("mode"), "closed");
    EXPECT_EQ(row.at("request_bytes"), std::to_string(64 + 128 + 4 * 8));
    EXPECT_EQ(row.at("reply_bytes"), std::to_string(64 + 128 + 4 * 64));
    EXPECT_EQ(row.at("lost"), "0");
    EXPECT_GT(std::stoull(row.at("samples")), 0u);
    EXPECT_GT(std::stod(row.at("floor_p50_us")), 0);
    EXPECT_GT(std::stod(row.at("engine_p50_us")), 0);
    EXPECT_GE(std::stod(row.at("server_p50_us")), std::stod(row.at("engine_p50_us")));
    EXPECT_GT(std::stod(row.at("p50_us")), std::stod(row.at("server_p50_us")));
    EXPECT_LE(std::stod(row.at("p50_us")), std::stod(row.at("p99_us")));
    EXPECT_LE(std::stod(row.at("p99_us")), std::stod(row.at("max_us")));
    EXPECT_NEAR(std::stod(row.at("transport_to_floor_p50")),
                std::stod(row.at("transport_p50_us")) / std::stod(row.at("floor_p50_us")),
                0.01 * std::stod(row.at("transport_to_floor_p50")));
    // The values compared with the targets follow from the row.
    const auto of = [&](const char* column) { return std::stod(row.at(column)); };
    EXPECT_NEAR(of("added_p50_us"), of("p50_us") - of("floor_p50_us") - of("engine_p50_us"), 1e-3 * of("p50_us"));
    EXPECT_GE(of("held_floor_p50_us"), of("engine_p50_us") / 2)
        << "the echo holds the request back as long as the engine";
    EXPECT_NEAR(of("p99.9_bar"), of("p99.9_us") / of("held_floor_p99.9_us"), 0.01 * of("p99.9_bar"));
    const bool in_memory = name == std::string("shm");
    EXPECT_NEAR(of("p50_bar"),
                in_memory ? of("added_p50_us") : (of("p50_us") - of("engine_p50_us")) / of("floor_p50_us"),
                0.01 * of("p50_us"));
    EXPECT_EQ(of("p50_bar_limit"), in_memory ? 0.5 : 1.2);
    for (const std::string bar : {"p50_bar", "p99.9_bar"})
      EXPECT_EQ(row.at(bar + "_met"), of(bar.c_str()) <= of((bar + "_limit").c_str()) ? "yes" : "no");
    EXPECT_TRUE(contains(done.out, "medians: floor "));
    EXPECT_TRUE(contains(row.at("command"), "clearance bench --connect " + url + " --pairs 4"));
  }
  const auto lines = lines_of(csv_);
  ASSERT_EQ(lines.size(), 3u) << "one line of names, two rows";
  EXPECT_EQ(lines[0].rfind("machine,date,transport,", 0), 0u);
  EXPECT_EQ(echo_processes(), 0);
}

TEST_F(Bench, ConfigurationsReductionsAndRates) {
  const std::string& url = daemon_.urls().at(0);
  const Finished done = bench({"--connect", url, "--csv", csv_, "--configs", "50", "--moved", "2", "--reduce", "min",
                               "--precision", "f32", "--rate", "100", "--json"});
  ASSERT_EQ(done.code, 0) << done.err;
  EXPECT_TRUE(contains(done.out, "\"configs\": 50"));
  const auto lines = lines_of(csv_);
  const auto row = row_of(lines.front(), lines.back());
  EXPECT_EQ(row.at("configs"), "50");
  EXPECT_EQ(row.at("moved"), "2");
  EXPECT_EQ(row.at("reduce"), "min");
  EXPECT_EQ(row.at("precision"), "f32");
  EXPECT_EQ(row.at("mode"), "100");
  EXPECT_EQ(row.at("pairs"), "5") << "all but that of the unmoved body and the static one";
  EXPECT_EQ(row.at("request_bytes"), std::to_string(64 + 128 + 8 + 50 * 2 * 56));
  // Five rounds of 60 ms at 100 Hz: six requests each, sent or at least counted.
  EXPECT_EQ(std::stoull(row.at("samples")) + std::stoull(row.at("unsent")), 30u);
  // Pinning is part of the command.
  const Finished pinned = run({"/usr/bin/env", "taskset", "-c", "0", "nice", "-n", "3", program("clearance"), "bench",
                               "--seconds", "0.1", "--warmup", "0", "--pairs", "1", "--connect", url, "--json"});
  ASSERT_EQ(pinned.code, 0) << pinned.err;
  if (::sysconf(_SC_NPROCESSORS_ONLN) > 1) {
    const int niceness = std::min(19, ::getpriority(PRIO_PROCESS, 0) + 3);
    EXPECT_TRUE(contains(pinned.out, "nice -n " + std::to_string(niceness) + " taskset -c 0 clearance bench "));
  }
  const Finished again = bench({"--connect", url, "--pairs", "3", "--configs", "10", "--moved", "1"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_TRUE(contains(again.out, "3 pairs in each of 10 configurations of 1 bodies"));
}

TEST_F(Bench, ThroughputOfSeveralClientsAndOfLargeReplies) {
  const std::vector<std::string> throughput = {
      program("clearance"), "bench", "throughput", "--connect", daemon_.urls().at(0),
      "--seconds",          "0.2",   "--csv",      csv_};
  const auto measure = [&](std::vector<std::string> options) {
    options.insert(options.begin(), throughput.begin(), throughput.end());
    const Finished done = run(options);
    EXPECT_EQ(done.code, 0) << done.err;
    const auto lines = lines_of(csv_);
    return row_of(lines.front(), lines.back());
  };
  auto row = measure({"--pairs", "1", "--clients", "3"});
  EXPECT_EQ(row.at("clients"), "3");
  EXPECT_GT(std::stoull(row.at("least_of_a_client")), 0u);
  EXPECT_LE(std::stoull(row.at("least_of_a_client")), std::stoull(row.at("most_of_a_client")));
  EXPECT_EQ(row.at("memcpy_p50_us"), "nan") << "with several clients it would be in their way";
  row = measure({"--pairs", "1", "--depth", "4"});
  EXPECT_EQ(row.at("depth"), "4");
  EXPECT_GT(std::stod(row.at("queries_per_s")), 0);
  row = measure({"--configs", "20000", "--moved", "2"});
  EXPECT_EQ(row.at("reply_bytes"), std::to_string(64 + 128 + 3 * 100'000 * 8 + 100'032))
      << "five pairs in each: three doubles, and a byte in a column of whole 64 bytes";
  EXPECT_GT(std::stod(row.at("memcpy_p50_us")), 0);
  EXPECT_NEAR(std::stod(row.at("outside_engine_p50_us")),
              std::stod(row.at("p50_us")) - std::stod(row.at("engine_p50_us")), 0.01 * std::stod(row.at("p50_us")));
}

TEST_F(Bench, WhatCannotBeMeasuredIsReported) {
  const std::string& url = daemon_.urls().at(0);
  struct Case {
    std::vector<std::string> options;
    int code;
    std::string text;
  };
  const std::string other = folder_.write("other.csv", "a,b\n1,2\n");
  const std::vector<Case> cases = {
      {{"--rate", "fast"}, 2, "--rate: expected \"closed\" or requests a second up to 1000000, got \"fast\""},
      {{"--rate", "-5"}, 2, "--rate: expected"},
      {{"--rate", "10x"}, 2, "--rate: expected"},
      {{"--pairs", "7"}, 2, "--pairs: the scene has 6 enabled pairs; 0 asks for all of them"},
      {{"--pairs", "7", "--configs", "1", "--moved", "1"},
       2,
       "--pairs: the scene has 3 enabled pairs with a moved body"},
      {{"--seconds", "0"}, 2, "--seconds"},
      {{"--connect", daemon_.urls().at(1), "--spin-us", "5"}, 2, "--spin-us: only for shared memory"},
      {{"--csv", other}, 1, "its columns are not those of this benchmark"},
      {{"--csv", folder_ / "none/x.csv"}, 1, "cannot write"},
      {{"--connect", "shm://" + (folder_ / "none")}, 3, "there is no socket: is clearanced running?"},
  };
  for (const Case& c : cases) {
    std::vector<std::string> options = c.options;
    if (options[0] != "--connect") options.insert(options.end(), {"--connect", url});
    const Finished done = bench(options);
    EXPECT_EQ(done.code, c.code) << c.text;
    EXPECT_TRUE(contains(done.err, c.text));
  }
  EXPECT_EQ(lines_of(other).size(), 2u);
}

TEST_F(Bench, ADaemonThatIsGoneIsReported) {
  daemon_.stop(SIGKILL);
  const Finished done = bench({"--connect", daemon_.urls().at(0)});
  EXPECT_EQ(done.code, 3);
  EXPECT_TRUE(contains(done.err, "the daemon is gone"));
}

}  // namespace
}  // namespace clearance
