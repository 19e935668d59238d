// A planner that uses LCM alone: liblcm and the message types of lcmtypes/, nothing else of Clearance.
//
//   clearanced --scene scenes/nineteen/scene.yaml --lcm "udpm://239.255.76.67:7667?ttl=0" &
//   build/examples/lcm_planner "udpm://239.255.76.67:7667?ttl=0" [PREFIX] [CONFIGURATIONS]
//
// It waits for the scene, publishes the bodies' poses (repeated every second, for late joiners and losses), then
// queries a batch of configurations of the first movable body, at these poses or newer ones, and prints, for each, the
// nearest pair with its bounds.
#include <chrono>
#include <clearance_lcm/pose_update_t.hpp>
#include <clearance_lcm/query_t.hpp>
#include <clearance_lcm/reply_t.hpp>
#include <clearance_lcm/scene_t.hpp>
#include <clearance_lcm/states_t.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;
using clearance_lcm::reply_t;
using clearance_lcm::scene_t;
using clearance_lcm::states_t;
using Clock = std::chrono::steady_clock;
using Pose = std::vector<double>;  // x, y, z [m], qw, qx, qy, qz

namespace {

const char* const kStatus[] = {"ok",          "overlap",  "contact", "beyond",
                               "unconverged", "bad pose", "no pose", "unknown body"};

/// Messages in parts, by the key that their parts share.
template <class Message>
struct Parts {
  std::map<std::pair<std::int64_t, std::int64_t>, std::map<int, Message>> by_key;
  void keep(std::int64_t server, std::int64_t key, const Message& part) { by_key[{server, key}][part.part] = part; }
  /// The newest message with all parts, or null.
  const std::map<int, Message>* whole() const {
    for (auto it = by_key.rbegin(); it != by_key.rend(); ++it) {
      if (static_cast<int>(it->second.size()) == it->second.begin()->second.parts) return &it->second;
    }
    return nullptr;
  }
};

class Planner {
 public:
  Planner(const std::string& url, std::string prefix) : lcm_(url), prefix_(std::move(prefix)) {
    if (!lcm_.good()) give_up("cannot open " + url);
    std::random_device random;
    id_ = static_cast<std::int64_t>((std::uint64_t{random()} << 31 ^ random()) | 1);  // as publisher and as client
    listen("CLEARANCE_SCENE", &Planner::on_scene);
    listen("CLEARANCE_STATES", &Planner::on_states);
    listen("CLEARANCE_REPLY", &Planner::on_reply);
  }

  /// Takes over the bodies and their poses; bodies without a pose are placed side by side.
  void learn_scene() {
    wait([this] { return scene_.whole() != nullptr && states_.whole() != nullptr; }, "the scene");
    for (const auto& [number, part] : *scene_.whole()) {
      revision_ = part.revision;
      for (int i = 0; i < part.body_count; ++i) {
        names_[part.ids[i]] = part.names[i];
        if (!part.is_static[i] && part.parents[i] == scene_t::NONE)
          poses_[part.ids[i]] = {1.0 * part.ids[i], 0, 0, 1, 0, 0, 0};
      }
    }
    for (const auto& [number, part] : *states_.whole()) {
      for (int i = 0; i < part.count; ++i) {
        if (poses_.count(part.ids[i]) && part.status[i] == reply_t::STATUS_OK) poses_[part.ids[i]] = part.poses[i];
      }
    }
    if (poses_.empty()) give_up("nothing in this scene can be moved");
    std::printf("scene %lld: %zu bodies, %zu of them can be moved\n", static_cast<long long>(revision_), names_.size(),
                poses_.size());
  }

  void publish_poses() {
    stamp_ns_ = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
    for (auto it = poses_.begin(); it != poses_.end();) {
      pose_update_t message{};
      message.publisher_id = id_;
      message.sequence = ++sequence_;
      message.stamp_ns = stamp_ns_;
      for (; it != poses_.end() && message.count < 390; ++it, ++message.count) {  // under 48 KB
        message.names.push_back(names_.at(it->first));
        message.poses.push_back(it->second);
      }
      lcm_.publish(prefix_ + "CLEARANCE_POSES", &message);
    }
    published_ = Clock::now();
  }

  /// The parts of the answer, in order. Repeats the query if a part or poses are lost.
  const std::map<int, reply_t>& ask(query_t question) {
    question.deadline_ns = 500'000'000;
    question.wait_for_one = true;
    question.wait_for = poses_.rbegin()->first;  // the last body published: a message applies as a whole
    std::string why = "no answer";
    for (int attempt = 0; attempt < 5; ++attempt) {
      question.client_id = id_;
      question.request_id = ++request_;
      question.scene_revision = revision_;
      question.min_pose_stamp_ns = stamp_ns_;
      replies_.by_key.clear();
      lcm_.publish(prefix_ + "CLEARANCE_QUERY", &question);
      const auto deadline = Clock::now() + std::chrono::seconds(1);
      while (replies_.whole() == nullptr && Clock::now() < deadline) spin();
      if (const auto* parts = replies_.whole()) {
        const reply_t& first = parts->begin()->second;
        if (first.error_code == 0) return *parts;
        why = "the daemon rejected the query: " + first.error_text;
        if (first.error_code != reply_t::ERROR_POSES_LATE) break;
        publish_poses();
      }
    }
    give_up(why);
  }

  const std::map<std::int32_t, Pose>& poses() const { return poses_; }
  std::string name(std::int32_t body) const { return names_.count(body) ? names_.at(body) : "none"; }

 private:
  [[noreturn]] static void give_up(const std::string& why) {
    std::fprintf(stderr, "lcm_planner: %s\n", why.c_str());
    std::exit(1);
  }

  template <class Message>
  void listen(const char* channel,
              void (Planner::*handler)(const lcm::ReceiveBuffer*, const std::string&, const Message*)) {
    auto* subscription = lcm_.subscribe(prefix_ + channel, handler, this);
    if (subscription == nullptr) give_up(std::string("cannot listen to ") + channel);
    subscription->setQueueCapacity(1000);  // a long answer is many messages; 30 would be kept otherwise
  }
  /// There must be one daemon: each one of the network has its own poses, and answers every query.
  void check_daemon(std::int64_t server) {
    if (server_ == 0) server_ = server;
    if (server != server_)
      give_up("daemons " + std::to_string(server_) + " and " + std::to_string(server) +
              " publish under the same channels, or one was restarted; give each a prefix of its own");
  }
  void on_scene(const lcm::ReceiveBuffer*, const std::string&, const scene_t* m) {
    check_daemon(m->server_id);
    scene_.keep(m->server_id, m->revision, *m);
  }
  void on_states(const lcm::ReceiveBuffer*, const std::string&, const states_t* m) {
    check_daemon(m->server_id);
    states_.keep(m->server_id, m->scene_revision, *m);
  }
  void on_reply(const lcm::ReceiveBuffer*, const std::string&, const reply_t* m) {
    // Parts of one answer share a sequence; those of different answers never mix.
    check_daemon(m->server_id);
    if (m->client_id == id_ && m->request_id == request_) replies_.keep(m->server_id, m->sequence, *m);
  }

  void spin() {
    if (sequence_ > 0 && Clock::now() - published_ > std::chrono::seconds(1)) publish_poses();
    lcm_.handleTimeout(50);
  }
  template <class Done>
  void wait(Done done, const std::string& what) {
    const auto deadline = Clock::now() + std::chrono::seconds(5);
    while (!done()) {
      if (Clock::now() > deadline)
        give_up(what + " did not come within 5 s; is clearanced running with this --lcm url?");
      spin();
    }
  }

  lcm::LCM lcm_;
  std::string prefix_;
  std::int64_t server_ = 0;  // of the first daemon received
  std::int64_t id_ = 0, sequence_ = 0, stamp_ns_ = 0, request_ = 0, revision_ = 0;
  Clock::time_point published_;
  std::map<std::int32_t, std::string> names_;
  std::map<std::int32_t, Pose> poses_;
  Parts<scene_t> scene_;
  Parts<states_t> states_;
  Parts<reply_t> replies_;
};

}  // namespace

int main(int argc, char** argv) {
  Planner planner(argc > 1 ? argv[1] : "udpm://239.255.76.67:7667?ttl=0", argc > 2 ? argv[2] : "");
  const int count = argc > 3 ? std::atoi(argv[3]) : 12;
  planner.learn_scene();
  planner.publish_poses();

  const auto& [body, start] = *planner.poses().begin();
  query_t query{};  // fields left at zero have their defaults
  query.body_count = 1;
  query.bodies = {body};
  query.configuration_count = count;
  for (int k = 0; k < count; ++k) {  // a circle around its position
    const double a = 2 * 3.14159265358979 * k / count;
    query.configurations.push_back({{start[0] + 0.5 * std::cos(a), start[1] + 0.5 * std::sin(a), start[2],
                                     std::cos(a / 2), 0, 0, std::sin(a / 2)}});
  }
  query.reduce = query_t::REDUCE_MIN;  // for each configuration the nearest pair with this body

  std::printf("\n%13s  %-32s %12s %12s %12s  %s\n", "configuration", "nearest pair", "distance", "lower", "upper",
              "status");
  for (const auto& [number, part] : planner.ask(query)) {
    for (int i = 0; i < part.pair_count; ++i) {
      const std::string pair = planner.name(part.pair[i][0]) + " - " + planner.name(part.pair[i][1]);
      std::printf("%13lld  %-32s %12.6f %12.6f %12.6f  %s\n", static_cast<long long>(part.first_row + i), pair.c_str(),
                  part.distance[i], part.lower[i], part.upper[i], kStatus[part.status[i]]);
    }
  }
}
