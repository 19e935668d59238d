#include "engine/scene/body_checks.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "wire/api/unknown_name.h"

namespace clearance {

std::string in_quotes(const std::string& name) {
  return '"' + name + '"';
}

std::string no_body(const engine::Scene& scene, const std::string& name) {
  return "there is no body " + in_quotes(name) + did_you_mean(name, all_names(scene.bodies()));
}

std::string number_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  char shorter[32];
  std::snprintf(shorter, sizeof shorter, "%g", x);
  return std::strtod(shorter, nullptr) == x ? shorter : text;
}

namespace {

// Length of the UTF-8 character at text[i], or 0 if a name may not contain it.
std::size_t printable_character(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const unsigned c = byte(i);
  if (c < 0x80) return c >= 0x20 && c != 0x7f ? 1 : 0;
  const std::size_t length = c >= 0xf0 ? 4 : c >= 0xe0 ? 3 : 2;
  if (c < 0xc2 || c > 0xf4) return 0;
  std::uint32_t code = c & (0xffu >> (length + 1));
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(i + k) & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte(i + k) & 0x3f);
  }
  constexpr std::uint32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xd800 && code < 0xe000;
  return code >= kSmallest[length] && code <= 0x10ffff && !surrogate && code >= 0xa0 ? length : 0;
}

}  // namespace

void check_name(const std::string& name, const char* what) {
  const std::string subject = std::string(what) + " name";
  if (name.empty()) throw engine::SceneError(subject + " is empty");
  if (name.size() > static_cast<std::size_t>(kMaxNameBytes))
    throw engine::SceneError(subject + " has " + std::to_string(name.size()) + " bytes, expected at most " +
                             std::to_string(kMaxNameBytes) + ": " + in_quotes(name.substr(0, 40)) + "...");
  if (name == "*") throw engine::SceneError(subject + " \"*\" is reserved: it selects every body");
  for (std::size_t i = 0; i < name.size();) {
    const std::size_t length = printable_character(name, i);
    if (length == 0)
      throw engine::SceneError(subject + " holds an unprintable character or bad UTF-8 at byte " + std::to_string(i));
    i += length;
  }
}

void check_positive(const std::string& name, const char* what, double x, bool zero_allowed) {
  if ((x > 0 || (zero_allowed && x == 0)) && x <= kMaxCoordinate) return;
  throw engine::SceneError("body " + in_quotes(name) + ": " + what + ": expected a number of metres " +
                           (zero_allowed ? ">= 0" : "> 0") + ", got " + number_text(x));
}

void check_may_require_pose(const Body& body) {
  if (body.robot != kNone)
    throw engine::SceneError("body " + in_quotes(body.name) + ": requires_pose: " + placed_by_joints(body));
  if (body.is_static)
    throw engine::SceneError("body " + in_quotes(body.name) +
                             ": requires_pose: a static body never gets another pose than its own");
}

void check_uncertainty(const Body& body) {
  const auto& [position, angle] = body.uncertainty;
  check_positive(body.name, "uncertainty.position", position, true);
  check_positive(body.name, "padding", body.padding, true);
  const std::string who = "body " + in_quotes(body.name) + ": ";
  if (!(angle >= 0 && angle <= 3.2))
    throw engine::SceneError(who + "uncertainty.angle: expected 0 to 3.2 radians, got " + number_text(angle));
  if (!(body.max_speed >= 0 && body.max_speed <= kMaxCoordinate))
    throw engine::SceneError(who + "max_speed: expected a number of metres a second >= 0, got " +
                             number_text(body.max_speed));
}

bool is_plane(const Body& body) {
  return std::any_of(body.parts.begin(), body.parts.end(), [](const ConvexPartPtr& p) { return is_half_space(*p); });
}

void fix_half_space(Body& body) {
  if (!is_plane(body)) return;
  const std::string who = "body " + in_quotes(body.name) + ": ";
  if (body.parts.size() > 1) throw engine::SceneError(who + "a half_space must be the only part of its body");
  if (body.parent != kNone) throw engine::SceneError(who + "parent: " + kPlaneStands);
  if (body.uncertainty.angle > 0)
    throw engine::SceneError(
        who + "uncertainty.angle: expected 0, since a turn moves a half_space by any length, far enough out");
  body.is_static = true;
}

void adopt_cloud(Body& body) {
  const Surface* const cloud = body.parts.size() == 1 ? body.parts[0]->surface.get() : nullptr;
  if (is_cloud(body) || !cloud || !cloud->is_cloud()) return;
  body.cloud = CloudState::kPoints;
  const double grown_by = body.is_grown ? body.padding + body.uncertainty.position : 0;
  body.cloud_radius = std::max(0.0, body.parts[0]->radius - grown_by);
  body.voxel = cloud->edge();
  body.model_error = std::max(body.model_error, cloud->rounding());
  body.model_inner = std::max(body.model_inner, cloud->rounding());
}

}  // namespace clearance
