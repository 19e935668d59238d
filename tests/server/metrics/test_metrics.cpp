// Counters and errors as seen by monitoring systems.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <thread>

#include "client/client.h"
#include "server/base/error_log.h"
#include "tests/patience.h"
#include "tests/server/bad_requests.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/daemon_fixture.h"
#include "wire/prometheus.h"
#include "wire/shm_os.h"

namespace clearance {
namespace {

using wire::ErrorCode;

TEST(ErrorLog, CountsKindsAndForgetsTheOldest) {
  using std::chrono::seconds;
  ErrorLog log;
  const ErrorLog::Clock::time_point begin{seconds(1'000'000'000)};
  log.note("busy", "64 queries under way", begin);
  log.note("busy", "7 queries under way", begin + seconds(5));
  log.note("too_large", "64 queries under way", begin + seconds(1));
  auto entries = log.entries();
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].text, "7 queries under way");
  EXPECT_EQ(entries[0].count, 2u);
  EXPECT_EQ(error_text(entries),
            "2\t2001-09-09T01:46:40Z\t2001-09-09T01:46:45Z\tbusy\t7 queries under way\n"
            "1\t2001-09-09T01:46:41Z\t2001-09-09T01:46:41Z\ttoo_large\t64 queries under way\n");
  for (std::size_t i = 0; i < ErrorLog::kMaxKinds; ++i)
    log.note("bad_query", "kind " + std::string(i + 1, 'x'), begin + seconds(10 + static_cast<int>(i)));
  entries = log.entries();
  EXPECT_EQ(entries.size(), ErrorLog::kMaxKinds);
  for (const auto& entry : entries) EXPECT_EQ(entry.code, "bad_query") << "the older ones are gone";
  log.note("bad_frame", "a\nb\t" + std::string(5000, 'y'), begin + seconds(100));
  EXPECT_EQ(log.entries()[0].text.size(), ErrorLog::kMaxText);
  EXPECT_EQ(error_text({log.entries()[0]}).find("a\nb"), std::string::npos);
}

TEST_F(LoopTest, MetricsAreReadFromAnotherThread) {
  start(small_scene());
  EXPECT_FALSE(loop_->read_metrics(1ms)) << "nobody turns the loop";
  std::thread serving([&] { loop_->run(); });
  const auto metrics = loop_->read_metrics(30s);
  loop_->stop();
  serving.join();
  ASSERT_TRUE(metrics);
  std::uint64_t bodies = 0;
  for (const auto& [name, value] : metrics->counters) bodies += name == "engine.bodies" ? value : 0;
  EXPECT_EQ(bodies, 4u);
  EXPECT_TRUE(metrics->errors.empty());
}

TEST_F(LoopTest, RejectionsAreAmongTheMetrics) {
  start(small_scene());
  for (const auto& bad : bad_requests(engine_->scene_revision())) {
    std::vector<std::byte> frame(sizeof bad.header);
    std::memcpy(frame.data(), &bad.header, sizeof bad.header);
    frame.insert(frame.end(), bad.payload.begin(), bad.payload.end());
    transport_->send(a_, frame);
    turn_until_idle();
  }
  std::thread reading;
  std::optional<Stats::MetricsSnapshot> metrics;
  reading = std::thread([&] { metrics = loop_->read_metrics(30s); });
  std::atomic<bool> there{false};
  std::thread watching([&] {
    reading.join();
    there = true;
  });
  while (!there) loop_->turn();
  watching.join();
  ASSERT_TRUE(metrics);
  EXPECT_GT(metrics->errors.size(), 10u);
  std::uint64_t sum = 0;
  for (const auto& entry : metrics->errors) sum += entry.count;
  EXPECT_EQ(sum, loop_->counter("errors")) << "each is counted once";
}

// --- over HTTP

/// A connection to the daemon's endpoint: a Unix socket's path, or a port.
shm::UniqueFd connect_to(const std::string& path) {
  sockaddr_un address;
  EXPECT_TRUE(shm::socket_address(path.c_str(), address));
  shm::UniqueFd socket(::socket(AF_UNIX, SOCK_STREAM, 0));
  EXPECT_EQ(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return socket;
}
shm::UniqueFd connect_to(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  shm::UniqueFd socket(::socket(AF_INET, SOCK_STREAM, 0));
  EXPECT_EQ(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return socket;
}
std::string read_to_end(int socket) {
  std::string text;
  char buffer[4096];
  for (ssize_t got; (got = ::recv(socket, buffer, sizeof buffer, 0)) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  return text;
}
template <class Where>
std::string request_http(const Where& where, const std::string& request) {
  const shm::UniqueFd socket = connect_to(where);
  EXPECT_EQ(::send(socket.get(), request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
  return read_to_end(socket.get());
}
std::string body_of(const std::string& reply) {
  const std::size_t blank = reply.find("\r\n\r\n");
  return blank == std::string::npos ? "" : reply.substr(blank + 4);
}
bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}
const std::string kGet = "GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n";

// --- the text format

bool is_name(const std::string& text) {
  const auto is_allowed = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == ':'; };
  return !text.empty() && !std::isdigit(static_cast<unsigned char>(text[0])) && std::ranges::all_of(text, is_allowed);
}

/// Errors that a strict reader of Prometheus' text format finds; empty if there are none. All labels here are `le`.
class FormatReader {
 public:
  std::string problem(const std::string& text) {
    if (!text.ends_with('\n')) return "the last line does not end";
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);)
      if (const std::string wrong = take(line); !wrong.empty()) return wrong + ": " + line;
    return end_metric();
  }
  std::map<std::string, double> values;  ///< by name, without those of histograms
  std::map<std::string, std::string> types;

 private:
  std::string take(const std::string& line) {
    std::istringstream words(line);
    std::string hash, what, name, rest;
    if (line.starts_with("# HELP ")) {
      words >> hash >> what >> name;
      std::getline(words >> std::ws, rest);
      if (const std::string wrong = end_metric(); !wrong.empty()) return wrong;
      if (!is_name(name) || rest.empty()) return "HELP has no name or no text";
      if (types.contains(name)) return "the metric comes twice";
      metric_ = name;
      type_ = "";
      return "";
    }
    if (line.starts_with("# TYPE ")) {
      words >> hash >> what >> name >> type_ >> rest;
      if (name != metric_ || !rest.empty()) return "TYPE does not follow its HELP";
      if (type_ != "counter" && type_ != "gauge" && type_ != "histogram") return "no such type";
      if ((type_ == "counter") != name.ends_with("_total")) return "counters, and they alone, end in _total";
      types[name] = type_;
      return "";
    }
    return sample(line);
  }
  std::string sample(const std::string& line) {
    const std::size_t space = line.rfind(' '), brace = line.find('{');
    if (space == std::string::npos || type_.empty()) return "neither a comment nor a sample of a metric";
    const std::string name = line.substr(0, std::min(space, brace));
    std::size_t used = 0;
    const double value = std::stod(line.substr(space + 1), &used);
    if (used != line.size() - space - 1) return "no number";
    if (type_ != "histogram") {
      if (name != metric_ || brace != std::string::npos) return "not of the metric";
      if (type_ == "counter" && value < 0) return "a counter below 0";
      return values.emplace(name, value).second ? "" : "comes twice";
    }
    if (name == metric_ + "_sum") return sums_++ == 0 ? "" : "a second sum";
    if (name == metric_ + "_count") return (counts_.push_back(value), "");
    const std::string label = line.substr(0, space), begin = metric_ + "_bucket{le=\"";
    if (!label.starts_with(begin) || !label.ends_with("\"}")) return "no bucket";
    const double bound = std::stod(label.substr(begin.size()));
    if (!buckets_.empty() && (bound <= buckets_.back().first || value < buckets_.back().second))
      return "buckets do not ascend";
    buckets_.emplace_back(bound, value);
    return "";
  }
  std::string end_metric() {
    if (metric_.empty()) return "";
    if (type_.empty()) return metric_ + " has no TYPE";
    if (type_ != "histogram") return values.contains(metric_) ? "" : metric_ + " has no sample";
    if (sums_ != 1 || counts_.size() != 1 || buckets_.empty()) return metric_ + " lacks _sum, _count or buckets";
    if (!std::isinf(buckets_.back().first) || buckets_.back().second != counts_[0])
      return metric_ + ": its last bucket is not the count";
    return "";
  }
  std::string metric_, type_;
  int sums_ = 0;
  std::vector<double> counts_;
  std::vector<std::pair<double, double>> buckets_;
};

std::string format_problem(const std::string& text) {
  return FormatReader().problem(text);
}

TEST(Prometheus, TheStrictReaderFindsWhatIsWrong) {
  const std::string good = "# HELP a_total A.\n# TYPE a_total counter\na_total 1\n";
  EXPECT_EQ(format_problem(good), "");
  EXPECT_NE(format_problem(good + good), "");
  for (const char* bad :
       {"a_total 1\n", "# HELP a_total A.\na_total 1\n", "# HELP a A.\n# TYPE a counter\na 1\n",
        "# HELP a_total A.\n# TYPE a_total gauge\na_total 1\n", "# HELP a A.\n# TYPE a gauge\n",
        "# HELP a A.\n# TYPE a gauge\nb 1\n", "# HELP a A.\n# TYPE a gauge\na 1",
        "# HELP a.b A.\n# TYPE a.b gauge\na.b 1\n", "# HELP a\n# TYPE a gauge\na 1\n",
        "# HELP a A.\n# TYPE a gauge\na 1x\n", "# HELP a A.\n# TYPE a histogram\na_bucket{le=\"+Inf\"} 1\na_count 1\n",
        "# HELP a A.\n# TYPE a histogram\na_bucket{le=\"1\"} 1\na_sum 1\na_count 1\n",
        "# HELP a A.\n# TYPE a histogram\na_bucket{le=\"2\"} 1\na_bucket{le=\"1\"} 1\na_bucket{le=\"+Inf\"} 1\na_sum "
        "1\n"
        "a_count 1\n"})
    EXPECT_NE(format_problem(bad), "") << bad;
}

TEST(Prometheus, CountersGaugesAgesAndTheHistogramAreWrittenExactly) {
  EXPECT_EQ(prometheus_text({{"queries.answered", 3},
                             {"errors.bad_query", 1},
                             {"uptime_s", 5},
                             {"engine.oldest_pose_age_ns", 1'500'000'001},
                             {"cuda.1.scene_bytes", 7},
                             {"new.count", 2},
                             {"latency_us.more", 1},
                             {"latency_us.1", 0},
                             {"latency_us.4194304", 2},
                             {"queries.latency_sum_ns", 20'000'000'007}}),
            "# HELP clearance_queries_answered_total Queries answered.\n"
            "# TYPE clearance_queries_answered_total counter\n"
            "clearance_queries_answered_total 3\n"
            "# HELP clearance_errors_bad_query_total Requests rejected with this error code.\n"
            "# TYPE clearance_errors_bad_query_total counter\n"
            "clearance_errors_bad_query_total 1\n"
            "# HELP clearance_uptime_s Seconds since the daemon started.\n"
            "# TYPE clearance_uptime_s gauge\n"
            "clearance_uptime_s 5\n"
            "# HELP clearance_engine_oldest_pose_age_seconds Age of the oldest pose among the movable bodies that "
            "received one. In seconds.\n"
            "# TYPE clearance_engine_oldest_pose_age_seconds gauge\n"
            "clearance_engine_oldest_pose_age_seconds 1.500000001\n"
            "# HELP clearance_cuda_1_scene_bytes A metric of the daemon that has no description.\n"
            "# TYPE clearance_cuda_1_scene_bytes gauge\n"
            "clearance_cuda_1_scene_bytes 7\n"
            "# HELP clearance_new_count_total A counter of the daemon that has no description.\n"
            "# TYPE clearance_new_count_total counter\n"
            "clearance_new_count_total 2\n"
            "# HELP clearance_latency_seconds From a query's arrival to its reply.\n"
            "# TYPE clearance_latency_seconds histogram\n"
            "clearance_latency_seconds_bucket{le=\"0.000001000\"} 0\n"
            "clearance_latency_seconds_bucket{le=\"4.194304000\"} 2\n"
            "clearance_latency_seconds_bucket{le=\"+Inf\"} 3\n"
            "clearance_latency_seconds_sum 20.000000007\n"
            "clearance_latency_seconds_count 3\n");
  EXPECT_EQ(format_problem(prometheus_text({})), "") << "an empty histogram is one";
}

class Metrics : public testing::Test {
 protected:
  std::vector<std::string> options(const std::string& endpoint) {
    return {"--scene",   folder_.write("scene.yaml", kSmallSceneYaml),
            "--zmq",     "ipc://" + (folder_ / "c.ipc"),
            "--metrics", endpoint};
  }
  TestFolder folder_;
};

TEST_F(Metrics, OnAUnixSocket) {
  const std::string path = folder_ / "metrics.sock";
  Daemon daemon(options(path));
  struct stat info{};
  ASSERT_EQ(stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  Client client = patient(daemon.url());
  for (int i = 0; i < 3; ++i) client.distances();
  const IdPair nobody{kGroupBit | 7, 0};
  Query bad;
  bad.pairs = std::span(&nobody, 1);
  EXPECT_THROW(client.distances(bad), RequestError);

  const std::string reply = request_http(path, kGet), text = body_of(reply);
  EXPECT_EQ(
      reply.rfind("HTTP/1.0 200 OK\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: " +
                      std::to_string(text.size()) + "\r\n",
                  0),
      0u)
      << reply;
  EXPECT_TRUE(has(text, "\nclearance_queries_answered_total 3\n")) << text;
  EXPECT_TRUE(has(text, "\nclearance_errors_total 1\n")) << text;
  EXPECT_TRUE(has(text, "clearance_engine_bodies 4\n")) << text;
  EXPECT_TRUE(has(text, "clearance_latency_seconds_bucket{le=\"+Inf\"} 3\nclearance_latency_seconds_sum ")) << text;
  EXPECT_TRUE(has(text, "\nclearance_latency_seconds_count 3\n")) << text;
  const std::string errors = body_of(request_http(path, "GET /errors HTTP/1.0\r\n\r\n"));
  EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << errors;
  EXPECT_EQ(errors.rfind("1\t20", 0), 0u) << errors;
  EXPECT_TRUE(has(errors, "\tbad_query\t")) << errors;

  EXPECT_EQ(request_http(path, "GET / HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 404 Not Found\r\n", 0), 0u);
  EXPECT_EQ(request_http(path, "GET /../../etc/passwd HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 404 Not Found\r\n", 0), 0u);
  EXPECT_EQ(request_http(path, "POST /metrics HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 405 ", 0), 0u);
  for (const char* rubbish : {"\r\n\r\n", "GET\r\n\r\n", "GET /metrics\r\n\r\n", "GET /metrics SMTP/1\n\n"})
    EXPECT_EQ(request_http(path, rubbish).rfind("HTTP/1.0 400 ", 0), 0u) << rubbish;
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
  EXPECT_NE(stat(path.c_str(), &info), 0) << "the socket is removed";
}

TEST_F(Metrics, AreInTheFormatWithAnAgeOfThePoses) {
  const std::string path = folder_ / "metrics.sock";
  auto all = options(path);
  all.insert(all.end(), {"--shm", folder_ / "c.sock"});
  Daemon daemon(all);
  Client client = patient(daemon.url());
  const auto read = [&] {
    FormatReader reader;
    const std::string text = body_of(request_http(path, kGet));
    EXPECT_EQ(reader.problem(text), "");
    EXPECT_FALSE(has(text, "no description")) << text;
    return reader;
  };
  FormatReader first = read();
  EXPECT_EQ(first.types.at("clearance_latency_seconds"), "histogram");
  EXPECT_EQ(first.types.at("clearance_frames_total"), "counter");
  EXPECT_EQ(first.types.at("clearance_requests_waiting"), "gauge");
  EXPECT_EQ(first.values.at("clearance_engine_bodies_without_pose"), 1) << "link2";
  EXPECT_FALSE(first.values.contains("clearance_engine_oldest_pose_age_seconds")) << "none was received";

  client.set_poses({{"cup", {0, 0, 1, 1, 0, 0, 0}}});
  const auto before = std::chrono::steady_clock::now();
  client.set_poses({{"link2", {0, 0, 3, 1, 0, 0, 0}}, {"link1", {0, 0, NAN, 1, 0, 0, 0}}});
  FormatReader second = read();
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - before;
  const double newest = second.values.at("clearance_engine_newest_pose_age_seconds");
  EXPECT_GE(second.values.at("clearance_engine_oldest_pose_age_seconds"), newest);
  EXPECT_GE(newest, 0);
  EXPECT_LE(newest, passed.count());
  EXPECT_EQ(second.values.at("clearance_engine_bodies_without_pose"), 0);
  EXPECT_GE(second.values.at("clearance_engine_bodies_with_bad_pose"), 1);
  EXPECT_EQ(second.values.at("clearance_poses_bad_total"), 1);
}

TEST_F(Metrics, OnTheLoopback) {
  Daemon daemon(options("127.0.0.1:0"));
  const std::string log = daemon.log(), key = "event=metrics url=http://127.0.0.1:";
  ASSERT_TRUE(has(log, key)) << log;
  const int port = std::stoi(log.substr(log.find(key) + key.size()));
  EXPECT_TRUE(has(request_http(port, kGet), "clearance_uptime_s "));
}

TEST_F(Metrics, SlowOrLeavingReadersBlockNoOthers) {
  const std::string path = folder_ / "metrics.sock";
  Daemon daemon(options(path));
  Client client = patient(daemon.url());
  {
    const shm::UniqueFd silent = connect_to(path), slow = connect_to(path), gone = connect_to(path);
    EXPECT_EQ(::send(slow.get(), "GET ", 4, MSG_NOSIGNAL), 4);
    EXPECT_EQ(::send(gone.get(), kGet.data(), kGet.size(), MSG_NOSIGNAL), static_cast<ssize_t>(kGet.size()));
    ::shutdown(gone.get(), SHUT_RDWR);
    client.distances();
    EXPECT_TRUE(has(request_http(path, kGet), "HTTP/1.0 200 OK")) << "once those before it have had their second";
    EXPECT_EQ(read_to_end(silent.get()) + read_to_end(slow.get()), "") << "they were hung up on";
  }
  const std::string endless(1 << 20, 'x');
  const shm::UniqueFd greedy = connect_to(path);
  (void)::send(greedy.get(), endless.data(), endless.size(), MSG_NOSIGNAL);
  EXPECT_EQ(read_to_end(greedy.get()), "");
  EXPECT_TRUE(has(request_http(path, kGet), "clearance_queries_answered_total 1\n"));
}

TEST_F(Metrics, WhatWakesTheDaemonLetsItSleepAgain) {
  const std::string path = folder_ / "metrics.sock";
  auto all = options(path);
  all.insert(all.end(), {"--shm", folder_ / "c.sock"});
  Daemon daemon(all);
  Client watching = connect(daemon.url());
  const auto counter = [&](const std::string& name) {
    for (const auto& [key, value] : watching.stats())
      if (key == name) return value;
    return std::uint64_t{0};
  };
  // Idle, it wakes ten times a second for its tick, and a few times for each of our fifty polls; less often on a busy
  // machine.
  const auto expect_sleep = [&](const char* after) {
    for (auto uptime = counter("uptime_s"); counter("uptime_s") == uptime;) std::this_thread::sleep_for(20ms);
    const std::uint64_t sleeps = counter("loop.sleeps"), uptime = counter("uptime_s");
    while (counter("uptime_s") == uptime) std::this_thread::sleep_for(20ms);
    const std::uint64_t seconds = counter("uptime_s") - uptime;
    EXPECT_LE(counter("loop.sleeps") - sleeps, 1000 * seconds) << "after " << after;
  };
  EXPECT_TRUE(has(request_http(path, kGet), "HTTP/1.0 200 OK"));
  expect_sleep("a look at its figures");
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  while (counter("reloads") == 0) std::this_thread::sleep_for(1ms);
  watching.add_body({.name = "ball", .sphere = 0.1});
  for (const std::string& url : daemon.urls()) connect(url).ping();
  expect_sleep("a reload, a body and clients that came and went");
}

TEST_F(Metrics, EndpointsThatWillNotDoEndWith4) {
  const auto said = [&](const std::string& endpoint) {
    auto all = options(endpoint);
    all.insert(all.begin(), program("clearanced"));
    const Finished ended = run(all);
    EXPECT_EQ(ended.code, 4) << endpoint;
    return ended.err;
  };
  EXPECT_TRUE(has(said("0.0.0.0:0"), "--metrics 0.0.0.0:0: it is for the loopback only"));
  EXPECT_TRUE(has(said("[::]:0"), "it is for the loopback only"));
  EXPECT_TRUE(has(said("9464"), "--metrics 9464: expected 127.0.0.1:PORT"));
  EXPECT_TRUE(has(said("localhost:x"), "expected 127.0.0.1:PORT"));
  EXPECT_TRUE(has(said(folder_ / "none/m.sock"), "there is no folder " + (folder_ / "none")));
}

}  // namespace
}  // namespace clearance
