// Models of a scene's bodies, with their cost, their error and possible savings.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.h"
#include "inspect/choices.h"
#include "inspect/covers.h"
#include "inspect/models.h"

namespace clearance {

/// Model and cost of one body.
struct BodyReport {
  std::string form;  ///< "point", "sphere", "segment", "capsule", "box", "hull", "surface", "solid", "cone",
                     ///< "ellipsoid", "half_space", "rounded box", ..., "mixed" or "frame"
  std::size_t parts = 0;
  std::uint64_t loaded = 0;             ///< vertices before duplicates and inner ones were dropped
  std::uint64_t vertices = 0;           ///< that bounds use
  std::optional<std::uint64_t> inside;  ///< dropped since proved to lie inside; unknown for some sources
  std::size_t faces = 0;                ///< of the mesh as loaded, or 0
  std::uint64_t triangles = 0;          ///< exact triangles of a surface or solid; 0 if the body is its parts
  double radius = 0;                    ///< largest radius of a part, metres
  double extent = 0;                    ///< largest distance from the body's origin, metres
  double model_error = 0;               ///< bound on the error of the model, metres
  double hull_excess = 0;               ///< bound on the hull's distance from the mesh, metres
  std::optional<double> empty_share;    ///< share of the hull's volume outside the mesh; unknown for meshes with holes
  std::string warning;                  ///< of mesh_warning()
  std::uint64_t partners = 0;           ///< bodies of enabled pairs with it
  std::uint64_t ignored = 0;            ///< bodies of ignored pairs with it
  std::uint64_t bytes = 0;              ///< of its parts, shared ones included
  std::uint64_t display_bytes = 0;      ///< of its display mesh
  std::uint32_t sharing = 1;            ///< bodies that share its parts, itself included
  std::optional<double> ns_per_pair;    ///< none if not measured, or without a partner that has a pose
};

/// A possible saving.
struct Finding {
  enum class Kind : std::uint8_t {
    kUnused,        ///< no enabled pair touches the body
    kDuplicate,     ///< same shape and pose as `other`
    kUnshared,      ///< a second copy of the geometry of `other`
    kInnerPart,     ///< the part is proved to lie inside another one of its body
    kFlatVertices,  ///< vertices on the hull of the others, up to rounding
    kSphere,        ///< a sphere around the body is hardly larger
    kBox,           ///< a box around the body is hardly larger
  };
  Kind kind = Kind::kUnused;
  std::uint32_t body = kNone;
  std::uint32_t other = kNone;
  std::optional<double> error;  ///< certified bound on the primitive's distance from the body, metres
  std::string text;             ///< a sentence without the body's name
};
/// "unused", "duplicate", "unshared", "inner_piece", "flat_vertices", "sphere", "box".
const char* name_of(Finding::Kind kind);

struct InspectOptions {
  bool measure = true;   ///< time some pairs of each body at the initial poses, in one thread
  double within = 0.01;  ///< largest excess of a reported primitive, as a share of the body's size
  bool covers = false;   ///< make covers, a second each on one core, or read them from the cache
  double margin = 5e-3;  ///< metres: the distance that decisions are about, for the choice of models
};

struct SceneReport {
  std::vector<BodyReport> bodies;  ///< by id
  std::vector<Finding> findings;   ///< by body
  std::vector<Choice> choices;     ///< by body, for non-convex meshes
  std::vector<GroupModel> models;  ///< of each robot and of the other bodies
  std::vector<CoverReport> covers;
  std::uint64_t pairs = 0;  ///< enabled
  std::uint64_t bytes = 0;  ///< of all parts, shared ones once
  std::uint64_t display_bytes = 0;
  std::optional<double> ns_all_pairs;  ///< estimate for one query of all enabled pairs
};

/// Inspects every body, a few hundred microseconds for each one that is measured. Throws as Engine.
SceneReport inspect(const engine::Scene& scene, const InspectOptions& options);

/// Returns the findings alone.
/// \param partners BodyReport::partners of each body
std::vector<Finding> find_redundancy(const engine::Scene& scene, const std::vector<std::uint64_t>& partners,
                                     double within);

}  // namespace clearance
