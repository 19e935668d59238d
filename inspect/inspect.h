// What a scene's bodies are modelled by, what that costs, how far it may be off, and what could be left out.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.h"
#include "inspect/choices.h"

namespace clearance {

/// What one body is made of.
struct BodyReport {
  std::string form;  ///< "point", "sphere", "segment", "capsule", "box", "hull", "surface", "solid", "cone",
                     ///< "ellipsoid", "half_space", "rounded box", ..., "mixed" or "frame"
  std::size_t pieces = 0;
  std::uint64_t loaded = 0;             ///< vertices, before duplicates and inner ones were dropped
  std::uint64_t vertices = 0;           ///< that bounds are made from
  std::optional<std::uint64_t> inside;  ///< distinct vertices dropped, proved to lie inside; unknown for some sources
  std::size_t faces = 0;                ///< of the mesh as loaded; 0: none
  std::uint64_t triangles = 0;          ///< of a surface or solid: those that answers are about; 0: pieces are
  double radius = 0;                    ///< metres; largest of the pieces
  double extent = 0;                    ///< metres; farthest that the body reaches from its origin
  double model_error = 0;               ///< metres; how far it may stand out from what was asked for
  double hull_excess = 0;               ///< metres; no point of it is farther from its mesh
  std::optional<double> empty_share;    ///< of its volume, that its mesh leaves empty; unknown for meshes with holes
  std::string warning;                  ///< what mesh_warning() says of it
  std::uint64_t partners = 0;           ///< bodies that it is asked about with
  std::uint64_t ignored = 0;            ///< bodies that it is not asked about with: on the ignore list
  std::uint64_t bytes = 0;              ///< its pieces, also where other bodies share them
  std::uint64_t display_bytes = 0;      ///< its mesh for pictures
  std::uint32_t sharing = 1;            ///< bodies that hold the very same pieces, itself included
  std::optional<double> ns_per_pair;    ///< measured; none: not measured, or no partner with a pose
};

/// Something that the scene could do without, or have cheaper.
struct Finding {
  enum class Kind : std::uint8_t {
    kUnused,        ///< no enabled pair touches the body
    kDuplicate,     ///< same shape and pose as `other`
    kUnshared,      ///< same geometry as `other`, held a second time
    kInnerPiece,    ///< the piece lies inside another one of its body: proved
    kFlatVertices,  ///< vertices that lie in the surface which the others span, to rounding
    kSphere,        ///< a sphere around the body is hardly larger
    kBox,           ///< a box around the body is hardly larger
  };
  Kind kind = Kind::kUnused;
  std::uint32_t body = kNone;
  std::uint32_t other = kNone;
  std::optional<double> error;  ///< metres; how far the primitive stands out at most (a certified bound)
  std::string text;             ///< for people: a sentence without the body's name
};
/// "unused", "duplicate", "unshared", "inner_piece", "flat_vertices", "sphere", "box".
const char* name_of(Finding::Kind kind);

struct InspectOptions {
  bool measure = true;   ///< times each body's pairs (some of them) at the poses at load, with one thread
  double within = 0.01;  ///< a primitive is named if it stands out by no more than this share of the body's size
};

struct SceneReport {
  std::vector<BodyReport> bodies;  ///< by id
  std::vector<Finding> findings;   ///< by body
  std::vector<Choice> choices;     ///< by body: what meshes that are not convex could be
  std::uint64_t pairs = 0;         ///< enabled
  std::uint64_t bytes = 0;         ///< of all pieces, shared ones once
  std::uint64_t display_bytes = 0;
  std::optional<double> ns_all_pairs;  ///< all enabled pairs asked about once, from what was measured
};

/// Looks at every body. Takes a few hundred microseconds for each one that is measured. Throws what Engine throws.
SceneReport inspect(const Scene& scene, const InspectOptions& options);

/// The findings alone. \param partners BodyReport::partners of each body.
std::vector<Finding> find_redundancy(const Scene& scene, const std::vector<std::uint64_t>& partners, double within);

}  // namespace clearance
