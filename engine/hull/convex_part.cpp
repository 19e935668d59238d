#include "engine/hull/convex_part.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/hull/direction_table.h"
#include "engine/hull/hull.h"
#include "engine/hull/measure.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"
#include "engine/pose/pose.h"

namespace clearance {

namespace {

// List lengths of the direction table. Large hulls get longer lists, since their tables are large and slow to build.
constexpr std::size_t kFew = 6, kFewOfMany = 16, kMany = 200000;

constexpr std::size_t kWidestRegister = 64;  // bytes

void fill_rows(ConvexPart& part, const std::vector<Vec3d>& vertices) {
  const auto padded_to = [&](std::size_t lanes) { return (vertices.size() + lanes - 1) / lanes * lanes; };
  const std::size_t f64 = padded_to(kWidestRegister / sizeof(double)), f32 = padded_to(kWidestRegister / sizeof(float));
  for (std::size_t i = 0; i < f32; ++i) {
    const Vec3d& v = vertices[i < vertices.size() ? i : 0];
    part.x_f32.push_back(static_cast<float>(v.x - part.centre.x));
    part.y_f32.push_back(static_cast<float>(v.y - part.centre.y));
    part.z_f32.push_back(static_cast<float>(v.z - part.centre.z));
    if (i >= f64) continue;
    part.x.push_back(v.x);
    part.y.push_back(v.y);
    part.z.push_back(v.z);
  }
}

void measure(ConvexPart& part, const std::vector<Vec3d>& vertices) {
  measure_hull(
      static_cast<std::uint32_t>(vertices.size()), [&](std::uint32_t i) -> const Vec3d& { return vertices[i]; }, part);
}

}  // namespace

ConvexPartPtr make_convex_part(std::vector<Vec3d> vertices, double radius, std::uint64_t loaded_vertices,
                               std::uint64_t digest, std::shared_ptr<const DirectionTable> table,
                               std::shared_ptr<const Surface> surface) {
  const FpEnvironment environment;
  check_vertices(vertices);
  if (!(radius >= 0 && radius <= kMaxCoordinate))
    throw std::invalid_argument("radius must be a number of metres >= 0, got " + std::to_string(radius));

  auto part = std::make_shared<ConvexPart>();
  part->radius = radius;
  part->loaded_vertices = loaded_vertices ? loaded_vertices : vertices.size();
  if (digest == 0) {
    Digest d;
    d.add(vertices);
    d.add(radius);
    digest = d.value();
  }
  part->digest = digest;

  measure(*part, vertices);
  if (vertices.size() > kTableFromVertices)
    part->table = table ? std::move(table)
                        : std::make_shared<const DirectionTable>(
                              make_direction_table(vertices, part->rho, vertices.size() > kMany ? kFewOfMany : kFew));
  else
    fill_rows(*part, vertices);
  part->vertices = std::move(vertices);
  part->surface = std::move(surface);
  return part;
}

void remake_part(ConvexPart& part, std::span<const Vec3d> vertices, double radius) {
  assert(!vertices.empty() && vertices.size() <= kTableFromVertices && !part.table);
  part.vertices.assign(vertices.begin(), vertices.end());
  part.radius = radius;
  for (std::vector<double>* row : {&part.x, &part.y, &part.z}) row->clear();
  for (std::vector<float>* row : {&part.x_f32, &part.y_f32, &part.z_f32}) row->clear();
  measure(part, part.vertices);
  fill_rows(part, part.vertices);
}

ConvexPart without_table(const ConvexPart& part) {
  if (part.primitive) return part;  // does not depend on vertices
  ConvexPart plain;
  plain.vertices = part.vertices;
  plain.radius = part.radius;
  plain.loaded_vertices = part.loaded_vertices;
  plain.digest = part.digest;
  measure(plain, plain.vertices);
  fill_rows(plain, plain.vertices);
  return plain;
}

std::uint64_t resident_bytes(const ConvexPart& part) {
  const auto held = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  std::uint64_t bytes = sizeof(ConvexPart) + held(part.vertices) + held(part.x) + held(part.y) + held(part.z) +
                        held(part.x_f32) + held(part.y_f32) + held(part.z_f32);
  if (part.table) bytes += sizeof(DirectionTable) + part.table->bytes();
  return bytes;
}

}  // namespace clearance
