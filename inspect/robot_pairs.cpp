#include "inspect/robot_pairs.h"

#include <algorithm>
#include <cmath>
#include <pugixml.hpp>
#include <sstream>

#include "engine/engine.h"
#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

// Queries one pair of bodies.
class Asker {
 public:
  explicit Asker(engine::Scene scene) : engine_(std::move(scene), one_thread()) {
    for (std::uint32_t j = 0; j < engine_.scene().joints().size(); ++j) joints_.push_back(j);
  }

  const engine::Scene& scene() const { return engine_.scene(); }

  void evaluate(BodyPair pair, std::span<const double> positions, std::span<SignedBounds> bounds) {
    QueryView query;
    query.pairs = {&pair, 1};
    query.all_pairs = false;
    query.configuration_count = static_cast<std::uint32_t>(bounds.size());
    query.joints = joints_;
    query.positions = positions;
    query.signed_distance = true;
    query.abs_tol = 1e-4;  // overlap matters here, not the exact distance
    query.rel_tol = 1e-2;
    query.fields = kFieldLower | kFieldUpper | kFieldStatus;
    lower_.resize(bounds.size());
    upper_.resize(bounds.size());
    status_.resize(bounds.size());
    ReplyView reply;
    reply.rows = bounds.size();
    reply.lower = lower_.data();
    reply.upper = upper_.data();
    reply.status = status_.data();
    Job job = engine_.start(query, reply);
    while (!job.advance()) {
    }
    for (std::size_t k = 0; k < bounds.size(); ++k) bounds[k] = {lower_[k], upper_[k]};
  }

 private:
  static engine::Engine::Options one_thread() {
    engine::Engine::Options options;
    options.backend = "cpu";
    options.threads = 1;
    return options;
  }

  engine::Engine engine_;
  std::vector<std::uint32_t> joints_;
  std::vector<double> lower_, upper_;
  std::vector<std::uint8_t> status_;
};

std::string words_of(PairFinding finding) {
  switch (finding) {
    case PairFinding::kAdjacent:
      return "Adjacent";
    case PairFinding::kNever:
      return "Never: proved";
    case PairFinding::kAlways:
      return "Always: proved";
    case PairFinding::kNeverSeen:
      return "Never seen in ";
    case PairFinding::kAlwaysSeen:
      return "Always seen in ";
    case PairFinding::kSometimes:
      break;
  }
  return "";
}

}  // namespace

std::vector<RobotPair> find_robot_pairs(const engine::RobotOptions& robot, const FindingOptions& options) {
  engine::RobotOptions alone = robot;
  alone.srdf.clear();
  alone.home.emplace();  // any position will do, within the limits
  for (const RobotColumn& column : read_urdf(robot.urdf).columns)
    (*alone.home)[column.name] = std::clamp(0.0, column.lower, column.upper);
  engine::Scene scene;
  scene.add_robot("robot", alone);
  Asker asker(std::move(scene));
  const SceneRobot& placed = *asker.scene().robots()[0];
  std::vector<RobotPair> pairs;
  const auto links = static_cast<std::uint32_t>(placed.model.links.size());
  const auto body_of = [&](std::uint32_t link) -> const Body& { return asker.scene().bodies()[placed.bodies[link]]; };
  for (std::uint32_t a = 0; a < links; ++a)
    for (std::uint32_t b = a + 1; b < links; ++b) {
      if (body_of(a).parts.empty() || body_of(b).parts.empty()) continue;
      const BodyPair bodies{std::min(placed.bodies[a], placed.bodies[b]), std::max(placed.bodies[a], placed.bodies[b])};
      const LinkBall ball_a = ball_around(body_of(a)), ball_b = ball_around(body_of(b));
      const PairDistances distances = [&](std::span<const double> positions, std::span<SignedBounds> bounds) {
        asker.evaluate(bodies, positions, bounds);
      };
      const LinkPair pair{a, b, ball_a, ball_b};
      pairs.push_back({placed.model.links[a].name, placed.model.links[b].name,
                       find_pair(placed.model, placed.kinematics, pair, distances, options)});
    }
  return pairs;
}

std::string srdf_of(const std::string& robot, const std::vector<RobotPair>& pairs, const FindingOptions& options,
                    bool seen) {
  pugi::xml_document document;
  pugi::xml_node root = document.append_child("robot");
  root.append_attribute("name") = robot.c_str();
  for (const RobotPair& pair : pairs) {
    const PairFinding finding = pair.found.finding;
    const bool only_seen = finding == PairFinding::kNeverSeen || finding == PairFinding::kAlwaysSeen;
    const bool always = finding == PairFinding::kAlways || finding == PairFinding::kAlwaysSeen;
    if (finding == PairFinding::kSometimes || (only_seen && !seen) || (always && options.margin > 0)) continue;
    std::ostringstream reason;
    reason << words_of(finding);
    if (only_seen) reason << options.samples << " samples";
    if (options.margin > 0 && finding != PairFinding::kAdjacent) reason << ", within " << options.margin << " m";
    pugi::xml_node entry = root.append_child("disable_collisions");
    entry.append_attribute("link1") = pair.a.c_str();
    entry.append_attribute("link2") = pair.b.c_str();
    entry.append_attribute("reason") = reason.str().c_str();
  }
  std::ostringstream text;
  document.save(text, "  ");
  return text.str();
}

}  // namespace clearance
