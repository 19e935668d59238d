// Names of the ids in a query, by which a prepared query notices that ids have another meaning.
#pragma once

#include <array>
#include <charconv>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "wire/api/scene_info.h"

namespace clearance {

/// The name of an id, empty outside the scene, and the limits of a joint.
struct IdName {
  std::string name;
  JointLimits limits{0, 0};
  bool is_joint = false;

  bool operator==(const IdName& other) const {
    return name == other.name && limits.lower == other.limits.lower && limits.upper == other.limits.upper;
  }
  std::string text() const {
    if (!is_joint || name.empty()) return name;
    return name + " from " + exact_text(limits.lower) + " to " + exact_text(limits.upper);
  }

 private:
  // The shortest text that only this number has: limits that differ at all are other limits.
  static std::string exact_text(double x) {
    std::array<char, 32> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), x).ptr};
  }
};

/// Names in the order of for_each_id().
using QueryNames = std::vector<IdName>;

/// Calls f(kind, name) for each id of a query. Moved bodies have their parent's name added, since their poses are
/// relative to it.
template <class F>
void for_each_id(const Query& query, const SceneInfo& scene, const JointsInfo& joints, F&& f) {
  const auto body = [&](std::uint32_t id) { return id < scene.bodies.size() ? scene.bodies[id].name : std::string(); };
  const auto selector = [&](std::uint32_t id) {
    if (id == kEveryBody) return;
    const std::uint32_t group = id & ~kGroupBit;
    if (!(id & kGroupBit))
      f("body", IdName{body(id)});
    else
      f("group", IdName{group < scene.groups.size() ? scene.groups[group].name : std::string()});
  };
  for (const IdPair& pair : query.pairs)
    for (const std::uint32_t id : pair) selector(id);
  for (const MarginEntry& entry : query.margins)
    for (const std::uint32_t id : {entry.a, entry.b}) selector(id);
  for (const std::uint32_t id : query.bodies) {
    const std::uint32_t parent = id < scene.bodies.size() ? scene.bodies[id].parent : kNone;
    f("body", IdName{parent == kNone ? body(id) : body(id) + " on " + body(parent)});
  }
  for (const std::uint32_t id : query.joints) {
    if (id >= joints.joints.size())
      f("joint", IdName{});
    else
      f("joint", IdName{joints.joints[id].name, {joints.joints[id].lower, joints.joints[id].upper}, true});
  }
}

inline QueryNames names_in(const Query& query, const SceneInfo& scene, const JointsInfo& joints) {
  QueryNames names;
  for_each_id(query, scene, joints, [&](const char*, IdName name) { names.push_back(std::move(name)); });
  return names;
}

/// Describes the first id whose meaning has changed, or is empty.
inline std::string changed_name(const QueryNames& then, const Query& query, const SceneInfo& scene,
                                const JointsInfo& joints) {
  std::string text;
  std::size_t i = 0;
  for_each_id(query, scene, joints, [&](const char* kind, const IdName& now) {
    const IdName& before = then[i++];
    if (!text.empty() || now == before) return;
    text = std::string("the ") + kind + " \"" + before.text() + "\" is " +
           (now.name.empty() ? "no longer in the scene" : "now \"" + now.text() + "\"") + ": prepare it again";
  });
  return text;
}

}  // namespace clearance
