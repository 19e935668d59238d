// Covers of an engine's bodies.
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "engine/base/digest.h"
#include "engine/cover/cover_record.h"
#include "engine/engine_impl.h"

namespace clearance::engine {

namespace {

/// Limit on the shapes of bodies other than links that get a cover.
constexpr std::size_t kMostOtherShapes = 64;

}  // namespace

Covers covers_named(std::string_view name) {
  if (name == "background") return Covers::kBackground;
  if (name == "off") return Covers::kOff;
  throw std::invalid_argument("covers: expected background or off, got '" + std::string(name) + "'");
}

std::vector<std::uint32_t> bodies_to_cover(const Scene& scene) {
  const std::vector<Body>& bodies = scene.bodies();
  std::vector<std::uint32_t> chosen;
  std::unordered_set<std::uint64_t> seen;
  const auto add = [&](std::uint32_t id) {
    Digest digest;
    for (const ConvexPartPtr& part : bodies[id].parts) digest.add(part->digest);
    const bool has_shape = !is_cloud(bodies[id]) || bodies[id].cloud == CloudState::kPoints;
    if (has_shape && may_have_cover(bodies[id].parts) && seen.insert(digest.value()).second) chosen.push_back(id);
  };
  for (std::uint32_t id = 0; id < bodies.size(); ++id)
    if (bodies[id].robot != kNone) add(id);
  const std::size_t most = chosen.size() + kMostOtherShapes;
  for (std::uint32_t id = 0; id < bodies.size() && chosen.size() < most; ++id)
    if (bodies[id].robot == kNone && !bodies[id].is_static) add(id);
  // Convex bodies and clouds that stay where they are need none.
  for (std::uint32_t id = 0; id < bodies.size() && chosen.size() < most; ++id)
    if (bodies[id].is_static && has_surface(bodies[id]) && !is_cloud(bodies[id])) add(id);
  return chosen;
}

void Engine::Impl::request_covers() const {
  std::vector<CoverStore::Parts> shapes;
  for (const std::uint32_t id : bodies_to_cover(scene)) shapes.push_back(scene.bodies()[id].parts);
  covers->request(std::move(shapes), owner);
  tables->request(scene, owner);
}

void Engine::Impl::request_cover_of_points(std::uint32_t body) const {
  if (!covers || scene.bodies()[body].is_static) return;
  const auto snapshot = poses.snapshot();
  const ReceivedPoints* const received = snapshot->points_of(body);
  if (!received) return;
  std::vector<CoverStore::Parts> shapes;
  if (received->cloud) shapes.push_back(snapshot->scene->bodies()[body].parts);
  covers->request(std::move(shapes), received->owner, false);
}

bool Engine::wait_covers(std::chrono::nanoseconds timeout) const {
  impl_->check_process();
  if (!impl_->covers) return true;
  const auto begin = std::chrono::steady_clock::now();
  return impl_->covers->wait(timeout) && impl_->tables->wait(timeout - (std::chrono::steady_clock::now() - begin));
}

const std::shared_ptr<CoverStore>& Engine::cover_store() const {
  return impl_->covers;
}

const std::shared_ptr<JointTableStore>& Engine::joint_table_store() const {
  return impl_->tables;
}

}  // namespace clearance::engine
