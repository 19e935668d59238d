#include "bench/tradeoff/truth.h"

#include <algorithm>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

#include "bench/timing.h"
#include "tests/oracle/exact/exact_distance.h"

namespace clearance::tradeoff {

namespace {

constexpr std::size_t kOracleVertices = 4000;  // of a body; more take the oracle too long
constexpr std::size_t kOraclePartPairs = 50;

/// The least exact distance over the pairs of parts; unset if the bodies are too large for the oracle.
std::optional<exact::Value> exact_answer(const MovingScene& scene, const engine::Engine& engine, BodyPair pair) {
  const Body &a = scene.scene.bodies()[pair.a], &b = scene.scene.bodies()[pair.b];
  for (const Body* body : {&a, &b}) {
    std::size_t vertices = 0;
    for (const ConvexPartPtr& part : body->parts) vertices += part->vertices.size();
    if (vertices > kOracleVertices || body->parent != kNone) return {};  // a child's pose is composed, with rounding
  }
  if (a.parts.size() * b.parts.size() > kOraclePartPairs) return {};
  const BodyState at_a = engine.body_state(pair.a), at_b = engine.body_state(pair.b);
  if (at_a.status != Status::kOk || at_b.status != Status::kOk) return {};
  std::optional<exact::Value> least;
  for (const ConvexPartPtr& p : a.parts)
    for (const ConvexPartPtr& q : b.parts) {
      const exact::Value v =
          exact::exact_distance({p->vertices, p->radius}, at_a.X_wb, {q->vertices, q->radius}, at_b.X_wb, false)
              .distance;
      if (!least || v.lower() < least->lower()) least = v;
    }
  return least;
}

}  // namespace

ReplyView Answers::view() {
  ReplyView v;
  v.rows = distance.size();
  v.distance = distance.data();
  v.lower = lower.data();
  v.upper = upper.data();
  v.status = status.data();
  return v;
}

ExactDistances find_exact_distances(const MovingScene& scene, std::size_t checked) {
  engine::Engine::Options options;
  options.backend = "reference";
  engine::Engine engine(scene.scene, options);
  QueryView query;
  query.all_pairs = false;
  query.pairs = scene.pairs;
  query.rel_tol = 0;
  query.fields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;

  ExactDistances exact_value;
  std::vector<double> distances;
  for (const std::vector<BodyPose>& poses : scene.steps) {
    engine.set_poses(poses);
    Answers answers(scene.pairs.size());
    Job job = engine.start(query, answers.view());
    job.advance();
    std::vector<Interval>& exact = exact_value.exact.emplace_back();
    for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
      exact.push_back({answers.lower[i], answers.upper[i]});
      distances.push_back(answers.upper[i]);
    }
    if (exact_value.exact.size() > 1) continue;
    const std::size_t stride = std::max<std::size_t>(1, scene.pairs.size() / std::max<std::size_t>(1, checked));
    for (std::size_t i = 0; i < scene.pairs.size() && exact_value.checked < checked; i += stride)
      if (const auto value = exact_answer(scene, engine, scene.pairs[i])) {
        ++exact_value.checked;
        // Clipped at 0, like the answers.
        if (std::max(value->upper(), 0.0) < exact[i].lower || std::max(value->lower(), 0.0) > exact[i].upper) {
          char text[200];
          std::snprintf(text, sizeof text, "%s: the reference backend says [%.17g, %.17g] m, the exact judge %.17g m",
                        (scene.name + ", pair " + std::to_string(i)).c_str(), exact[i].lower, exact[i].upper,
                        value->lower());
          throw std::logic_error(text);
        }
      }
  }
  exact_value.median = bench::median(std::move(distances));
  return exact_value;
}

}  // namespace clearance::tradeoff
