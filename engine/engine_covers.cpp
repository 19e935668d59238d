// Covers of an engine's bodies.
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "engine/base/digest.h"
#include "engine/engine_impl.h"

namespace clearance::engine {

namespace {

/// Limit on the shapes of movable bodies, other than links, that get a cover.
constexpr std::size_t kMostOtherShapes = 64;

}  // namespace

Covers covers_named(std::string_view name) {
  if (name == "background") return Covers::kBackground;
  if (name == "off") return Covers::kOff;
  throw std::invalid_argument("covers: expected background or off, got '" + std::string(name) + "'");
}

void Engine::Impl::request_covers() const {
  std::vector<CoverStore::Parts> shapes;
  std::unordered_set<std::uint64_t> seen;
  const auto add = [&](const Body& body) {
    Digest digest;
    for (const ConvexPartPtr& part : body.parts) digest.add(part->digest);
    if (!body.parts.empty() && !has_surface(body) && seen.insert(digest.value()).second) shapes.push_back(body.parts);
  };
  for (const Body& body : scene.bodies())
    if (body.robot != kNone) add(body);
  const std::size_t most = shapes.size() + kMostOtherShapes;
  for (const Body& body : scene.bodies())
    if (body.robot == kNone && !body.is_static && shapes.size() < most) add(body);
  covers->request(std::move(shapes));
}

bool Engine::wait_covers(std::chrono::nanoseconds timeout) const {
  impl_->check_process();
  return !impl_->covers || impl_->covers->wait(timeout);
}

const std::shared_ptr<CoverStore>& Engine::cover_store() const {
  return impl_->covers;
}

}  // namespace clearance::engine
