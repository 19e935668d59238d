// clearance-plans SCENE PROBLEMS MARGIN ROUNDS SEEDS: plans a robot's problems with one engine, whose obstacles change from
// problem to problem, and prints a line of CSV for each.
//
// PROBLEMS has a line `robot joint...`, and for each problem `problem NAME`, `start` and `goal` with positions, and lines
// `box NAME x y z POSE` or `cylinder NAME radius length POSE`. Times are processor time of this thread, in microseconds,
// the least of the rounds, each of a whole call (preparation, check of start and goal, search): of the first one after
// the obstacles have changed, of the next one, and of another with shortcuts.
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "planner/planner.h"

namespace clearance {
namespace {

struct Problem {
  std::string name;
  std::vector<double> start, goal;
  std::vector<NewBody> obstacles;
};

std::vector<double> numbers(std::istream& line) {
  std::vector<double> found;
  for (double number; line >> number;) found.push_back(number);
  return found;
}

NewBody obstacle(const std::string& shape, std::istream& line) {
  NewBody body;
  line >> body.name;
  body.is_static = true;
  if (shape == "box") {
    auto& edges = body.box.emplace();
    for (double& edge : edges) line >> edge;
  } else if (shape == "cylinder") {
    auto& sizes = body.cylinder.emplace();
    line >> sizes[0] >> sizes[1];
  } else {
    line >> body.sphere.emplace();
  }
  for (double& number : body.pose.emplace()) line >> number;
  return body;
}

/// Reads the joints' names and the problems.
std::vector<Problem> read(const char* path, std::vector<std::string>& joints) {
  std::ifstream file(path);
  std::vector<Problem> problems;
  for (std::string text; std::getline(file, text);) {
    std::istringstream line(text);
    std::string word;
    line >> word;
    if (word == "robot")
      for (std::string name; line >> name;) joints.push_back(name);
    else if (word == "problem")
      line >> problems.emplace_back().name;
    else if (word == "start")
      problems.back().start = numbers(line);
    else if (word == "goal")
      problems.back().goal = numbers(line);
    else if (!word.empty())
      problems.back().obstacles.push_back(obstacle(word, line));
  }
  return problems;
}

Joints joints_named(const Engine& engine, const std::vector<std::string>& names) {
  const Joints all = engine.joints("*");
  Joints found;
  for (const std::string& name : names) {
    const auto at = std::find(all.names.begin(), all.names.end(), name) - all.names.begin();
    found.names.push_back(name);
    found.ids.push_back(all.ids.at(static_cast<std::size_t>(at)));
    found.limits.push_back(all.limits.at(static_cast<std::size_t>(at)));
  }
  return found;
}

double now_us() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

const char* word_of(PlanOutcome outcome) {
  switch (outcome) {
    case PlanOutcome::kFound:
      return "found";
    case PlanOutcome::kStartNotFree:
      return "start";
    case PlanOutcome::kGoalNotFree:
      return "goal";
    case PlanOutcome::kBeyondLimits:
      return "limits";
    case PlanOutcome::kOutOfIterations:
      return "iterations";
  }
  return "";
}

/// Sum of the lengths of a path's motions, Euclidean in joint space.
double length_of(const std::vector<double>& path, std::size_t joints) {
  double sum = 0;
  for (std::size_t i = joints; i < path.size(); i += joints) {
    double square = 0;
    for (std::size_t j = i; j < i + joints; ++j) square += (path[j] - path[j - joints]) * (path[j] - path[j - joints]);
    sum += std::sqrt(square);
  }
  return sum;
}

void add_obstacles(Engine& engine, const Problem& problem) {
  for (const NewBody& body : problem.obstacles) engine.add_body(body);
}
void remove_obstacles(Engine& engine, const Problem& problem) {
  for (auto body = problem.obstacles.rbegin(); body != problem.obstacles.rend(); ++body) engine.remove_body(body->name);
}

void solve(Engine& engine, const std::vector<std::string>& names, const Problem& problem, double margin, int rounds,
           std::uint64_t seed) {
  add_obstacles(engine, problem);
  const Joints joints = joints_named(engine, names);
  const Query query{.margin = margin};
  PathPlan plan, shorter;
  const auto timed = [&](PathPlan& made, std::uint32_t shortcuts, double& least) {
    const double begin = now_us();
    made = clearance::plan(engine, joints, problem.start, problem.goal, query, {.shortcuts = shortcuts, .seed = seed});
    least = std::min(least, now_us() - begin);
  };
  double first = std::numeric_limits<double>::infinity(), search = first, shortened = first;
  for (int round = 0; round < rounds; ++round) {
    if (round > 0) remove_obstacles(engine, problem), add_obstacles(engine, problem);
    timed(plan, 0, first);
    if (!plan.found()) break;
    timed(plan, 0, search);
    timed(shorter, PlanOptions().shortcuts, shortened);
  }
  bool is_free = false;
  if (shorter.found()) {
    Query path = query;
    path.joints = joints.ids;
    path.positions = shorter.path;
    is_free = engine.check_path(path).ok();
  }
  std::printf("%s,%lu,%s,%.2f,%.2f,%.2f,%lu,%lu,%.3f,%.3f,%d\n", problem.name.c_str(), seed, word_of(plan.outcome),
              first, search, shortened, plan.iterations, plan.edges, length_of(plan.path, joints.size()),
              length_of(shorter.path, joints.size()), is_free);
  remove_obstacles(engine, problem);
}

int run(char** arguments) {
  std::vector<std::string> joints;
  const std::vector<Problem> problems = read(arguments[2], joints);
  Engine engine(Scene::load(arguments[1]), {.backend = "cpu", .threads = 1});
  engine.wait_covers();
  std::printf(
      "problem,seed,outcome,first_us,search_us,shortened_us,iterations,motions,length,shortened_length,proved\n");
  for (const Problem& problem : problems)
    for (std::uint64_t seed = 0; seed < std::stoull(arguments[5]); ++seed)
      solve(engine, joints, problem, std::stod(arguments[3]), std::stoi(arguments[4]), seed);
  return 0;
}

}  // namespace
}  // namespace clearance

int main(int count, char** arguments) {
  try {
    if (count == 6) return clearance::run(arguments);
    std::fprintf(stderr, "usage: clearance-plans SCENE PROBLEMS MARGIN ROUNDS SEEDS\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "clearance-plans: %s\n", error.what());
  }
  return 1;
}
