// Serializes geometry for the cache.
#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <type_traits>

#include "engine/bvh/surface.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/direction_table.h"
#include "engine/hull/primitive.h"

namespace clearance {

namespace {

class Writer {
 public:
  template <class T>
  void add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    append(&value, sizeof value);
  }
  /// Their number, then the elements.
  template <class T>
  void add(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    add(std::uint64_t{values.size()});
    append(values.data(), values.size() * sizeof(T));
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void append(const void* data, std::size_t bytes) {
    const auto* from = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), from, from + bytes);
  }
  std::vector<std::byte> bytes_;
};

struct Damaged : std::runtime_error {
  Damaged() : std::runtime_error("no record of a geometry") {}
};

// Reads the bytes of a Writer in order. Throws Damaged at their end.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : left_(bytes) {}
  template <class T>
  T get() {
    T value;
    copy(&value, sizeof value);
    return value;
  }
  template <class T>
  std::vector<T> list() {
    const auto count = get<std::uint64_t>();
    if (count > left_.size() / sizeof(T)) throw Damaged();
    std::vector<T> values(count);
    copy(values.data(), count * sizeof(T));
    return values;
  }
  void expect_end() const {
    if (!left_.empty()) throw Damaged();
  }

 private:
  void copy(void* to, std::size_t bytes) {
    if (bytes > left_.size()) throw Damaged();
    if (bytes > 0) std::memcpy(to, left_.data(), bytes);
    left_ = left_.subspan(bytes);
  }
  std::span<const std::byte> left_;
};

// Whether two lists have the same bits.
template <class T>
bool same(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

// A list, or only a note that it equals the one of the display mesh, as is usual.
template <class T>
void add_list(Writer& out, const std::vector<T>& list, const std::vector<T>* displayed) {
  const bool is_there = displayed && same<T>(list, *displayed);
  out.add(std::uint64_t{is_there});
  if (!is_there) out.add(list);
}

template <class T>
std::vector<T> get_list(Reader& in, const std::vector<T>* displayed) {
  if (in.get<std::uint64_t>() == 0) return in.list<T>();
  if (!displayed) throw Damaged();
  return *displayed;
}

enum class ExactKind : std::uint64_t { kConvexPart, kSurface, kSolid, kPrimitive, kCloud };

// The exact geometry of the part: vertices and triangles, from which the rest is computed again.
void add_surface(Writer& out, const Surface* surface, const DisplayMesh* display) {
  out.add(!surface ? ExactKind::kConvexPart : surface->is_solid() ? ExactKind::kSolid : ExactKind::kSurface);
  if (!surface) return;
  add_list(out, {surface->vertices().begin(), surface->vertices().end()}, display ? &display->vertices : nullptr);
  add_list(out, triangles_as_loaded(*surface), display ? &display->triangles : nullptr);
}

ConvexPartPtr get_surface_part(Reader& in, ExactKind exact_value, double radius, std::uint64_t loaded,
                               const DisplayMesh* display) {
  std::vector<Vec3d> vertices = get_list(in, display ? &display->vertices : nullptr);
  std::vector<Triangle> triangles = get_list(in, display ? &display->triangles : nullptr);
  return make_surface_part(std::move(vertices), std::move(triangles), exact_value == ExactKind::kSolid, radius, loaded);
}

void add_convex_part(Writer& out, const ConvexPart& part, const DisplayMesh* display, Tables tables) {
  out.add(part.radius);
  out.add(part.loaded_vertices);
  if (part.primitive) {
    out.add(ExactKind::kPrimitive);
    out.add(static_cast<std::uint64_t>(part.primitive->kind));
    return out.add(part.primitive->size);
  }
  if (part.surface && part.surface->is_cloud()) {
    out.add(ExactKind::kCloud);
    out.add(part.surface->edge());
    return out.add(std::vector<CloudPoint>(part.surface->points().begin(), part.surface->points().end()));
  }
  add_surface(out, part.surface.get(), display);
  if (part.surface) return;  // its hull is computed again, since nothing else proves that it encloses the surface
  out.add(part.digest);
  add_list(out, part.vertices, display ? &display->vertices : nullptr);
  const bool has_table = part.table && tables == Tables::kKept;
  out.add(std::uint64_t{has_table});
  if (!has_table) return;
  out.add(part.table->grid_bits);
  out.add(part.table->cells);
  out.add(part.table->lists);
}

ConvexPartPtr get_primitive(Reader& in, double radius) {
  const auto kind = in.get<std::uint64_t>();
  const auto size = in.get<Vec3d>();
  if (kind < static_cast<std::uint64_t>(Primitive::Kind::kHalfSpace) ||
      kind > static_cast<std::uint64_t>(Primitive::Kind::kCylinder))
    throw Damaged();
  return make_primitive_part({static_cast<Primitive::Kind>(kind), size}, radius);
}

ConvexPartPtr get_part(Reader& in, const DisplayMesh* display, Tables tables) {
  const auto radius = in.get<double>();
  const auto loaded = in.get<std::uint64_t>();
  const auto exact_value = in.get<ExactKind>();
  if (exact_value > ExactKind::kCloud) throw Damaged();
  if (exact_value == ExactKind::kPrimitive) return get_primitive(in, radius);
  if (exact_value == ExactKind::kCloud) {
    const auto edge = in.get<float>();
    return make_cloud_part(in.list<CloudPoint>(), edge, radius);
  }
  if (exact_value != ExactKind::kConvexPart) return get_surface_part(in, exact_value, radius, loaded, display);
  const auto digest = in.get<std::uint64_t>();
  std::vector<Vec3d> vertices = get_list(in, display ? &display->vertices : nullptr);
  std::shared_ptr<DirectionTable> table;
  if (in.get<std::uint64_t>() != 0) {
    if (tables != Tables::kKept) throw Damaged();
    table = std::make_shared<DirectionTable>();
    table->grid_bits = in.get<std::uint32_t>();
    table->cells = in.list<std::uint32_t>();
    table->lists = in.list<std::uint32_t>();
    if (!is_sound(*table, vertices.size())) throw Damaged();
  }
  return make_convex_part(std::move(vertices), radius, loaded, digest, std::move(table));
}

}  // namespace

std::vector<std::byte> geometry_record(const Geometry& geometry, Tables tables) {
  // Bound by name and number: with another member this does not compile, so that none is forgotten.
  const auto& [parts, display, model_error, model_inner, hull_excess, empty_share, source, cloud, radius, voxel] =
      geometry;
  static_cast<void>(source);  // names the file, and is no part of the geometry made from it
  static_cast<void>(cloud), static_cast<void>(radius), static_cast<void>(voxel);  // of clouds, which have no record
  Writer out;
  for (const double number : {model_error, model_inner, hull_excess, empty_share}) out.add(number);
  out.add(std::uint64_t{display != nullptr});
  if (display) {
    out.add(display->vertices);
    out.add(display->triangles);
  }
  out.add(std::uint64_t{parts.size()});
  for (const ConvexPartPtr& part : parts) add_convex_part(out, *part, display.get(), tables);
  return out.take();
}

std::optional<Geometry> geometry_of_record(std::span<const std::byte> record, Tables tables) try {
  Reader in(record);
  Geometry geometry;
  geometry.model_error = in.get<double>();
  geometry.model_inner = in.get<double>();
  geometry.hull_excess = in.get<double>();
  geometry.empty_share = in.get<double>();  // may be NaN
  if (!(geometry.model_error >= 0) || !(geometry.model_inner >= 0) || !(geometry.hull_excess >= 0) ||
      geometry.empty_share < 0 || geometry.empty_share > 1)
    return {};
  if (in.get<std::uint64_t>() != 0) {
    auto display = std::make_shared<DisplayMesh>();
    display->vertices = in.list<Vec3d>();
    display->triangles = in.list<Triangle>();
    for (const Triangle& t : display->triangles)
      for (const std::uint32_t corner : t)
        if (corner >= display->vertices.size()) return {};
    geometry.display = std::move(display);
  }
  for (auto parts = in.get<std::uint64_t>(); parts > 0; --parts)
    geometry.parts.push_back(get_part(in, geometry.display.get(), tables));
  in.expect_end();
  if (geometry.parts.empty()) return {};
  return geometry;
} catch (const Damaged&) {
  return {};
} catch (const std::invalid_argument&) {  // of make_convex_part(), for invalid vertices
  return {};
}

}  // namespace clearance
