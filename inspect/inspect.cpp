#include "inspect/inspect.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "engine/base/fp_environment.h"
#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/scene/body_ball.h"
#include "engine/scene/mesh_warning.h"
#include "inspect/timing.h"

namespace clearance {

namespace {

bool is_box(const ConvexPart& part) {
  if (part.vertices.size() != 8) return false;
  for (const Vec3d& v : part.vertices)
    for (int k = 0; k < 3; ++k)
      if (std::abs(v[k] - part.centre[k]) < part.half[k] * (1 - 1e-12)) return false;
  return part.half.x > 0 && part.half.y > 0 && part.half.z > 0;  // all eight corners are distinct
}

std::string form_of(const ConvexPart& part) {
  const bool rounded = part.radius > 0;
  if (part.surface) return std::string(rounded ? "rounded " : "") + (part.surface->is_solid() ? "solid" : "surface");
  if (part.primitive) return std::string(rounded ? "rounded " : "") + name_of(part.primitive->kind);
  if (part.vertices.size() == 1) return rounded ? "sphere" : "point";
  if (part.vertices.size() == 2) return rounded ? "capsule" : "segment";
  return std::string(rounded ? "rounded " : "") + (is_box(part) ? "box" : "hull");
}

std::uint64_t bytes_of(const ConvexPart& part) {
  return resident_bytes(part) + (part.surface ? part.surface->resident_bytes() : 0);
}

std::uint64_t display_bytes(const Body& body) {
  if (!body.display) return 0;
  return body.display->vertices.capacity() * sizeof(Vec3d) +
         body.display->triangles.capacity() * sizeof(body.display->triangles[0]);
}

BodyReport describe(const Body& body) {
  BodyReport r;
  r.parts = body.parts.size();
  r.model_error = body.model_error;
  r.hull_excess = body.hull_excess;
  if (!std::isnan(body.empty_share)) r.empty_share = body.empty_share;
  r.extent = extent_of(body);
  r.form = body.parts.empty() ? "frame" : form_of(*body.parts[0]);
  for (const ConvexPartPtr& part : body.parts) {
    if (form_of(*part) != r.form) r.form = "mixed";
    r.loaded += part->loaded_vertices;
    r.vertices += part->vertices.size();
    r.radius = std::max(r.radius, part->radius);
    r.bytes += bytes_of(*part);
  }
  r.triangles = triangle_count(body);
  r.display_bytes = display_bytes(body);
  if (body.display) r.faces = body.display->triangles.size();
  // A display mesh has the distinct vertices of a file, except for points and primitives.
  const bool from_file = std::ranges::any_of(
      kMeshAsWords, [&body](std::string_view how) { return body.source.ends_with("(" + std::string(how) + ")"); });
  if (r.loaded == r.vertices)
    r.inside = 0;
  else if (from_file && body.display && body.display->vertices.size() >= r.vertices)
    r.inside = body.display->vertices.size() - r.vertices;
  return r;
}

/// Counts partners and ignored bodies of each body without listing all pairs.
void count_partners(const engine::Scene& scene, SceneReport& report) {
  const auto& bodies = scene.bodies();
  std::uint64_t solid = 0, movable = 0;
  for (const Body& body : bodies) {
    solid += !body.parts.empty();
    movable += !body.parts.empty() && !body.is_static;
  }
  std::set<std::pair<std::uint32_t, std::uint32_t>> followers;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    report.bodies[i].partners = bodies[i].parts.empty() ? 0 : bodies[i].is_static ? movable : solid - 1;
    if (bodies[i].parent != kNone) followers.insert(std::minmax(i, bodies[i].parent));
  }
  const auto leave_out = [&](std::uint32_t a, std::uint32_t b) {
    if ((bodies[a].is_static && bodies[b].is_static) || bodies[a].parts.empty() || bodies[b].parts.empty()) return;
    --report.bodies[a].partners;
    --report.bodies[b].partners;
  };
  for (const auto& [a, b] : scene.ignored()) {
    ++report.bodies[a].ignored;
    ++report.bodies[b].ignored;
    if (!followers.contains({a, b})) leave_out(a, b);
  }
  for (const auto& [a, b] : followers) leave_out(a, b);
}

void count_sharing(const engine::Scene& scene, SceneReport& report) {
  std::map<const ConvexPart*, std::uint32_t> holders;
  std::set<const DisplayMesh*> displays;
  for (const Body& body : scene.bodies()) {
    std::set<const ConvexPart*> own;
    for (const ConvexPartPtr& part : body.parts) own.insert(part.get());
    for (const ConvexPart* part : own)
      if (++holders[part] == 1) report.bytes += bytes_of(*part);
    if (displays.insert(body.display.get()).second) report.display_bytes += display_bytes(body);
  }
  for (std::uint32_t i = 0; i < scene.bodies().size(); ++i)
    if (const auto& parts = scene.bodies()[i].parts; !parts.empty()) report.bodies[i].sharing = holders[parts[0].get()];
}

/// Times some pairs of each body through the engine.
void measure(const PairTimes& times, SceneReport& report) {
  double twice = 0;
  bool complete = true;
  for (std::uint32_t b = 0; b < report.bodies.size(); ++b) {
    BodyReport& body = report.bodies[b];
    const std::vector<BodyPair> pairs = times.sampled(b);
    if (pairs.empty()) {
      complete = complete && body.partners == 0;
      continue;
    }
    body.ns_per_pair = times.ns_per_pair(pairs);
    twice += *body.ns_per_pair * static_cast<double>(body.partners);
  }
  if (complete) report.ns_all_pairs = twice / 2;
}

}  // namespace

SceneReport inspect(const engine::Scene& scene, const InspectOptions& options) {
  const FpEnvironment environment;
  SceneReport report;
  for (const Body& body : scene.bodies()) report.bodies.push_back(describe(body));
  for (MeshWarning& warning : mesh_warnings(scene)) report.bodies[warning.body].warning = std::move(warning.text);
  count_partners(scene, report);
  count_sharing(scene, report);
  std::vector<std::uint64_t> partners;
  for (const BodyReport& body : report.bodies) partners.push_back(body.partners);
  for (const std::uint64_t count : partners) report.pairs += count;
  report.pairs /= 2;
  std::optional<PairTimes> times;
  if (options.measure) measure(times.emplace(scene), report);
  report.choices = choices_of(scene, times ? &*times : nullptr);
  report.models = models_of(scene, report.choices, options.margin);
  if (options.covers) report.covers = covers_of(scene);
  report.findings = find_redundancy(scene, partners, options.within);
  return report;
}

}  // namespace clearance
