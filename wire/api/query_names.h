// Names of the ids in a query, by which a prepared query notices that ids have another meaning.
#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <vector>

#include "wire/api/scene_info.h"

namespace clearance {

/// Names in the order of for_each_id().
using QueryNames = std::vector<std::string>;

/// A number as std::to_string() writes it, without its time.
inline std::string limit_text(double limit) {
  char digits[400];
  return {digits, std::to_chars(digits, digits + sizeof digits, limit, std::chars_format::fixed, 6).ptr};
}

/// Calls f(kind, name) for each id of a query, with "" for ids outside the scene. Moved bodies have their parent's name
/// added, since their poses are relative to it; joints have their limits.
template <class F>
void for_each_id(const Query& query, const SceneInfo& scene, const JointsInfo& joints, F&& f) {
  const auto body = [&](std::uint32_t id) { return id < scene.bodies.size() ? scene.bodies[id].name : std::string(); };
  const auto selector = [&](std::uint32_t id) {
    if (id == kEveryBody) return;
    const std::uint32_t group = id & ~kGroupBit;
    if (!(id & kGroupBit))
      f("body", body(id));
    else
      f("group", group < scene.groups.size() ? scene.groups[group].name : std::string());
  };
  for (const IdPair& pair : query.pairs)
    for (const std::uint32_t id : pair) selector(id);
  for (const MarginEntry& entry : query.margins)
    for (const std::uint32_t id : {entry.a, entry.b}) selector(id);
  for (const std::uint32_t id : query.bodies) {
    const std::uint32_t parent = id < scene.bodies.size() ? scene.bodies[id].parent : kNone;
    f("body", parent == kNone ? body(id) : body(id) + " on " + body(parent));
  }
  for (const std::uint32_t id : query.joints) {
    if (id >= joints.joints.size())
      f("joint", std::string());
    else
      f("joint", joints.joints[id].name + " from " + limit_text(joints.joints[id].lower) + " to " +
                     limit_text(joints.joints[id].upper));
  }
}

inline QueryNames names_in(const Query& query, const SceneInfo& scene, const JointsInfo& joints) {
  QueryNames names;
  for_each_id(query, scene, joints, [&](const char*, std::string name) { names.push_back(std::move(name)); });
  return names;
}

/// Describes the first id whose meaning has changed, or is empty.
inline std::string changed_name(const QueryNames& then, const Query& query, const SceneInfo& scene,
                                const JointsInfo& joints) {
  std::string text;
  std::size_t i = 0;
  for_each_id(query, scene, joints, [&](const char* kind, const std::string& now) {
    const std::string& before = then[i++];
    if (!text.empty() || now == before) return;
    text = std::string("the ") + kind + " \"" + before + "\" is " +
           (now.empty() ? "no longer in the scene" : "now \"" + now + "\"") + ": prepare it again";
  });
  return text;
}

}  // namespace clearance
