// A planner of one's own: RRT, whose every edge is proved free by a daemon.
//
//   rrt shm:///tmp/clearance.sock arm
//
// Turns the robot's first joint by 1.5 radians. In process, clearance::Engine has the same calls: plan() takes both.
#include <clearance/client.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <random>
#include <vector>

namespace {

using State = std::vector<double>;  // radians and metres
using Clock = std::chrono::steady_clock;

double distance(const State& a, const State& b) {
  double sum = 0;
  for (std::size_t j = 0; j < a.size(); ++j) sum += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(sum);
}

void append(State& rows, const State& row) {
  rows.insert(rows.end(), row.begin(), row.end());
}

/// Returns the rows of a path, or nothing.
template <class Queried>
State plan(Queried& front, const clearance::Joints& joints, const State& start, const State& goal, double margin) {
  constexpr double kStep = 0.5;
  clearance::Prepared edge = front.prepare(clearance::as_motions(
      {.joints = joints.ids, .reduce = clearance::Reduce::kAny, .fields = clearance::kFieldVerdict, .margin = margin}));
  const auto is_free = [&edge](const State& a, const State& b) {  // the whole motion
    State ends = a;
    append(ends, b);
    return edge.run(ends).all_free();
  };
  std::mt19937 random(0);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<State> nodes{start};
  std::vector<std::size_t> parents{0};
  for (int sample = 0; sample < 50'000; ++sample) {
    State next = goal;
    if (share(random) > 0.1)
      for (std::size_t j = 0; j < next.size(); ++j) {
        const double lower = std::max(joints.limits[j].lower, -3.1), upper = std::min(joints.limits[j].upper, 3.1);
        next[j] = lower + share(random) * (upper - lower);
      }
    const auto near = std::ranges::min_element(nodes, {}, [&next](const State& node) { return distance(node, next); });
    const double scale = std::min(1.0, kStep / distance(*near, next));
    for (std::size_t j = 0; j < next.size(); ++j) next[j] = (*near)[j] + scale * (next[j] - (*near)[j]);
    if (!is_free(*near, next)) continue;
    parents.push_back(static_cast<std::size_t>(near - nodes.begin()));
    nodes.push_back(next);
    if (distance(next, goal) > kStep || !is_free(next, goal)) continue;
    std::vector<std::size_t> branch{nodes.size() - 1};
    while (branch.back() != 0) branch.push_back(parents[branch.back()]);
    State path;
    for (auto node = branch.rbegin(); node != branch.rend(); ++node) append(path, nodes[*node]);
    append(path, goal);
    return path;
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) return std::fputs("rrt URL ROBOT\n", stderr), 2;
  constexpr double kMargin = 0.01;  // metres
  clearance::Client client = clearance::connect(argv[1]);
  const clearance::Joints joints = client.joints(argv[2]);
  client.wait_covers();  // so that the first edges are as fast as the others
  const clearance::JointsInfo now = client.joint_states();
  State start;
  for (const std::uint32_t id : joints.ids) start.push_back(now.joints[id].position);
  State goal = start, ends = start;
  goal[0] += 1.5;
  append(ends, goal);
  if (!client.check({.joints = joints.ids, .positions = ends, .margin = kMargin}))
    return std::fputs("the start or the goal is not free, or beyond limits\n", stderr), 1;
  const auto begin = Clock::now();
  const State path = plan(client, joints, start, goal, kMargin);
  const double ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
  std::printf("%zu waypoints in %.1f ms\n", path.size() / goal.size(), ms);
  if (path.empty()) return 1;
  return client.prepare_path({.joints = joints.ids, .margin = kMargin}).run(path).ok() ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "rrt: %s\n", error.what());
  return 1;
}
