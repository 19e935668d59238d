// A scene that changes at run time: the bodies it was loaded with, and the changes made since.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/scene/scene.h"
#include "wire/payloads.h"

namespace clearance {

/// Shape of a body to be added or reshaped.
struct NewShape {
  wire::BodyShape kind = wire::BodyShape::kHull;
  Vec3d size{};                       ///< as in wire::NewBodyRecord; the edge of voxels first for a cloud
  std::vector<Vec3d> vertices{};      ///< of a hull or mesh, metres
  std::vector<Triangle> triangles{};  ///< of a mesh
  MeshAs mesh_as = MeshAs::kHull;     ///< kind of the mesh
  std::vector<CloudPoint> points{};   ///< of a cloud
};

/// A body added at run time.
struct AddedBody {
  Body body;           ///< geometry and initial pose; no parent, whose id may change
  std::string parent;  ///< initial parent, or empty
};

/// Makes a body of a shape. Throws SceneError.
/// \param options its parent is AddedBody::parent
AddedBody make_body(const std::string& name, const NewShape& shape, engine::Scene::BodyOptions options);

/// Parts of a scene: the bodies that were loaded and, behind them so that those keep their ids, the added ones. The
/// functions throw SceneError; then nothing has changed.
struct SceneParts {
  std::shared_ptr<const engine::Scene> loaded;  ///< null if nothing was changed, as the engine has the loaded scene
  std::vector<AddedBody> added;
  std::vector<std::pair<std::string, Geometry>> reshaped;  ///< by name, each once

  /// Returns the whole scene. Throws SceneError for a name that is taken or a missing parent.
  engine::Scene whole() const;
  /// Returns the loaded scene with the changes that still fit it, and drops the others.
  /// \param dropped receives their reasons
  engine::Scene whole_as_far_as_possible(std::string& dropped);
  bool was_added(std::string_view name) const;
  /// Throws SceneError unless a body was added.
  /// \param why that is required, for a body of the loaded scene
  void check_added(const std::string& name, const std::string& who, const char* why) const;
  /// Removes an added body. Bodies that followed it become free, without a pose until they receive one.
  void remove(const std::string& name);
  /// Replaces the shape of a body. Its padding and uncertainty grow the new shape, too.
  /// \param radius metres, added to the shape
  void reshape(const std::string& name, const NewShape& shape, double radius);
};

/// Error text if a body cannot be removed because another one follows it, or empty.
/// \param parent_of returns the present parent of a body, by id
template <class F>
std::string why_not_removed(const engine::Scene& scene, std::string_view name, F&& parent_of) {
  const std::uint32_t removed = scene.find_body(name);
  for (std::uint32_t i = 0; removed != kNone && i < scene.bodies().size(); ++i)
    if (parent_of(i) == removed)
      return "remove_body: \"" + scene.bodies()[i].name + "\" follows \"" + std::string(name) + "\": detach it first";
  return "";
}

}  // namespace clearance
