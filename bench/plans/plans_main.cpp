// clearance-plans SCENE PROBLEMS MARGIN ROUNDS: plans a robot's problems with one engine, whose obstacles change from
// problem to problem, and prints a line of CSV for each.
//
// PROBLEMS has a line `robot joint...`, and for each problem `problem NAME`, `start` and `goal` with positions, and lines
// `box NAME x y z POSE` or `cylinder NAME radius length POSE`. Times are processor time of this thread, in microseconds,
// the least of the rounds: of the whole call (check of start and goal, preparation, search) and of the search with
// shortcuts, too.
#include <time.h>

#include <algorithm>
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

void solve(Engine& engine, const std::vector<std::string>& names, const Problem& problem, double margin, int rounds) {
  for (const NewBody& body : problem.obstacles) engine.add_body(body);
  const Joints joints = joints_named(engine, names);
  const Query query{.margin = margin};
  double search = std::numeric_limits<double>::infinity(), shortened = search;
  PathPlan plan, shorter;
  for (int round = 0; round < rounds; ++round) {
    double begin = now_us();
    plan = clearance::plan(engine, joints, problem.start, problem.goal, query, {.shortcuts = 0});
    search = std::min(search, now_us() - begin);
    begin = now_us();
    shorter = clearance::plan(engine, joints, problem.start, problem.goal, query, {});
    shortened = std::min(shortened, now_us() - begin);
  }
  bool is_free = false;
  if (shorter.found()) {
    Query path = query;
    path.joints = joints.ids;
    path.positions = shorter.path;
    is_free = engine.check_path(path).ok();
  }
  std::printf("%s,%s,%.2f,%.2f,%lu,%lu,%zu,%zu,%d\n", problem.name.c_str(), word_of(plan.outcome), search, shortened,
              plan.iterations, plan.edges, plan.path.size() / joints.size(), shorter.path.size() / joints.size(),
              is_free);
  for (auto body = problem.obstacles.rbegin(); body != problem.obstacles.rend(); ++body) engine.remove_body(body->name);
}

int run(char** arguments) {
  std::vector<std::string> joints;
  const std::vector<Problem> problems = read(arguments[2], joints);
  Engine engine(Scene::load(arguments[1]), {.backend = "cpu", .threads = 1});
  engine.wait_covers();
  std::printf("problem,outcome,search_us,shortened_us,iterations,motions,waypoints,shortened_waypoints,proved\n");
  for (const Problem& problem : problems)
    solve(engine, joints, problem, std::stod(arguments[3]), std::stoi(arguments[4]));
  return 0;
}

}  // namespace
}  // namespace clearance

int main(int count, char** arguments) {
  try {
    if (count == 5) return clearance::run(arguments);
    std::fprintf(stderr, "usage: clearance-plans SCENE PROBLEMS MARGIN ROUNDS\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "clearance-plans: %s\n", error.what());
  }
  return 1;
}
