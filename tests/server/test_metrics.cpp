// Counters and errors as those read them who watch the daemon.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <thread>

#include "bad_requests.h"
#include "client/client.h"
#include "daemon_fixture.h"
#include "loop_fixture.h"
#include "server/error_log.h"
#include "tests/patience.h"
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

TEST_F(LoopTest, FiguresAreReadFromAnotherThread) {
  start(small_scene());
  EXPECT_FALSE(loop_->read_figures(1ms)) << "nobody turns the loop";
  std::thread serving([&] { loop_->run(); });
  const auto figures = loop_->read_figures(30s);
  loop_->stop();
  serving.join();
  ASSERT_TRUE(figures);
  std::uint64_t bodies = 0;
  for (const auto& [name, value] : figures->counters) bodies += name == "engine.bodies" ? value : 0;
  EXPECT_EQ(bodies, 4u);
  EXPECT_TRUE(figures->errors.empty());
}

TEST_F(LoopTest, RefusalsAreAmongTheFigures) {
  start(small_scene());
  for (const auto& bad : bad_requests(engine_->scene_revision())) {
    std::vector<std::byte> frame(sizeof bad.header);
    std::memcpy(frame.data(), &bad.header, sizeof bad.header);
    frame.insert(frame.end(), bad.payload.begin(), bad.payload.end());
    transport_->send(a_, frame);
    turn_until_idle();
  }
  std::thread reading;
  std::optional<Stats::Figures> figures;
  reading = std::thread([&] { figures = loop_->read_figures(30s); });
  std::atomic<bool> there{false};
  std::thread watching([&] {
    reading.join();
    there = true;
  });
  while (!there) loop_->turn();
  watching.join();
  ASSERT_TRUE(figures);
  EXPECT_GT(figures->errors.size(), 10u);
  std::uint64_t sum = 0;
  for (const auto& entry : figures->errors) sum += entry.count;
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
std::string ask_http(const Where& where, const std::string& request) {
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

  const std::string reply = ask_http(path, kGet), text = body_of(reply);
  EXPECT_EQ(
      reply.rfind("HTTP/1.0 200 OK\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: " +
                      std::to_string(text.size()) + "\r\n",
                  0),
      0u)
      << reply;
  EXPECT_TRUE(has(text, "\nclearance_queries_answered 3\n")) << text;
  EXPECT_TRUE(has(text, "\nclearance_errors 1\n")) << text;
  EXPECT_TRUE(has(text, "clearance_engine_bodies 4\n")) << text;
  EXPECT_TRUE(has(text, "clearance_latency_seconds_bucket{le=\"+Inf\"} 3\nclearance_latency_seconds_count 3\n"))
      << text;
  const std::string errors = body_of(ask_http(path, "GET /errors HTTP/1.0\r\n\r\n"));
  EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << errors;
  EXPECT_EQ(errors.rfind("1\t20", 0), 0u) << errors;
  EXPECT_TRUE(has(errors, "\tbad_query\t")) << errors;

  EXPECT_EQ(ask_http(path, "GET / HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 404 Not Found\r\n", 0), 0u);
  EXPECT_EQ(ask_http(path, "GET /../../etc/passwd HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 404 Not Found\r\n", 0), 0u);
  EXPECT_EQ(ask_http(path, "POST /metrics HTTP/1.0\r\n\r\n").rfind("HTTP/1.0 405 ", 0), 0u);
  for (const char* rubbish : {"\r\n\r\n", "GET\r\n\r\n", "GET /metrics\r\n\r\n", "GET /metrics SMTP/1\n\n"})
    EXPECT_EQ(ask_http(path, rubbish).rfind("HTTP/1.0 400 ", 0), 0u) << rubbish;
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
  EXPECT_NE(stat(path.c_str(), &info), 0) << "the socket is removed";
}

TEST_F(Metrics, OnTheLoopback) {
  Daemon daemon(options("127.0.0.1:0"));
  const std::string log = daemon.log(), key = "event=metrics url=http://127.0.0.1:";
  ASSERT_TRUE(has(log, key)) << log;
  const int port = std::stoi(log.substr(log.find(key) + key.size()));
  EXPECT_TRUE(has(ask_http(port, kGet), "clearance_uptime_s "));
}

TEST_F(Metrics, WhoIsSlowOrGoesKeepsNobodyFromAnAnswer) {
  const std::string path = folder_ / "metrics.sock";
  Daemon daemon(options(path));
  Client client = patient(daemon.url());
  {
    const shm::UniqueFd silent = connect_to(path), slow = connect_to(path), gone = connect_to(path);
    EXPECT_EQ(::send(slow.get(), "GET ", 4, MSG_NOSIGNAL), 4);
    EXPECT_EQ(::send(gone.get(), kGet.data(), kGet.size(), MSG_NOSIGNAL), static_cast<ssize_t>(kGet.size()));
    ::shutdown(gone.get(), SHUT_RDWR);
    client.distances();
    EXPECT_TRUE(has(ask_http(path, kGet), "HTTP/1.0 200 OK")) << "once those before it have had their second";
    EXPECT_EQ(read_to_end(silent.get()) + read_to_end(slow.get()), "") << "they were hung up on";
  }
  const std::string endless(1 << 20, 'x');
  const shm::UniqueFd greedy = connect_to(path);
  (void)::send(greedy.get(), endless.data(), endless.size(), MSG_NOSIGNAL);
  EXPECT_EQ(read_to_end(greedy.get()), "");
  EXPECT_TRUE(has(ask_http(path, kGet), "clearance_queries_answered 1\n"));
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
  // Idle it wakes ten times a second for its tick, and a few times for each of our looks, of which there are fifty:
  // fewer on a busy machine.
  const auto expect_sleep = [&](const char* after) {
    for (auto uptime = counter("uptime_s"); counter("uptime_s") == uptime;) std::this_thread::sleep_for(20ms);
    const std::uint64_t sleeps = counter("loop.sleeps"), uptime = counter("uptime_s");
    while (counter("uptime_s") == uptime) std::this_thread::sleep_for(20ms);
    const std::uint64_t seconds = counter("uptime_s") - uptime;
    EXPECT_LE(counter("loop.sleeps") - sleeps, 1000 * seconds) << "after " << after;
  };
  EXPECT_TRUE(has(ask_http(path, kGet), "HTTP/1.0 200 OK"));
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
  EXPECT_TRUE(has(said("0.0.0.0:0"), "--metrics 0.0.0.0:0: it is for the loopback alone"));
  EXPECT_TRUE(has(said("[::]:0"), "it is for the loopback alone"));
  EXPECT_TRUE(has(said("9464"), "--metrics 9464: expected 127.0.0.1:PORT"));
  EXPECT_TRUE(has(said("localhost:x"), "expected 127.0.0.1:PORT"));
  EXPECT_TRUE(has(said(folder_ / "none/m.sock"), "there is no folder " + (folder_ / "none")));
}

}  // namespace
}  // namespace clearance
