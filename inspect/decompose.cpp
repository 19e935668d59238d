#include "inspect/decompose.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "engine/bvh/surface.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/decomposition.h"
#include "inspect/coacd_process.h"

namespace clearance {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// Writes an OBJ with one object per part to a temporary file and renames it.
void write_parts(const std::string& path, const std::vector<ProposedPart>& parts, const DecomposeOptions& options) {
  const std::string unfinished = path + ".unfinished";
  std::ofstream file(unfinished);
  file << "# convex pieces for " << std::filesystem::path(options.mesh).filename().string()
       << ", proposed by CoACD with the threshold " << options.threshold << "\n";
  std::uint64_t before = 1;
  char text[96];
  for (std::size_t i = 0; i < parts.size(); ++i) {
    file << "o piece_" << i << "\n";
    for (const Vec3d& v : parts[i].vertices) {
      std::snprintf(text, sizeof text, "v %.17g %.17g %.17g\n", v.x, v.y, v.z);
      file << text;
    }
    for (const Triangle& t : parts[i].triangles)
      file << "f " << before + t[0] << " " << before + t[1] << " " << before + t[2] << "\n";
    before += parts[i].vertices.size();
  }
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(unfinished, path, error);
  if (file && !error) return;
  std::filesystem::remove(unfinished, error);
  throw std::runtime_error(path + " cannot be written");
}

}  // namespace

DecomposedMesh decompose(const DecomposeOptions& options, const std::atomic<bool>& stop) {
  DecomposedMesh out;
  out.file = options.mesh + std::string(kPiecesExtension);
  {
    // Loads the mesh as a solid first, to check that it is closed.
    MeshFile file(options.mesh);
    const Geometry solid = geometry_of_mesh(file.mesh(), {.mesh_as = MeshAs::kSolid}, options.mesh);
    const DisplayMesh& mesh = *solid.display;
    out.triangles = mesh.triangles.size();
    out.size = 2 * norm(solid.parts[0]->half);
    if (!options.keep) {
      const Clock::time_point begin = Clock::now();
      write_parts(out.file, propose_parts(mesh.vertices, mesh.triangles, options, stop), options);
      out.propose_s = seconds_since(begin);
    }
  }
  const Clock::time_point begin = Clock::now();
  MeshFile file(options.mesh);
  if (!file.parts()) throw std::runtime_error(out.file + ": no such file");
  MeshGeometries geometries;
  const Geometry made = geometries.make(file, {{1, 1, 1}, MeshAs::kDecompose, 0}, options.mesh);
  out.prove_s = seconds_since(begin);
  const Decomposition& proved = *made.parts[0]->surface->decomposition();
  out.parts = proved.parts.size();
  for (const ConvexPartPtr& part : proved.parts) out.vertices += part->vertices.size();
  out.inner = proved.inner;
  std::vector<double> outer = proved.outer;
  std::sort(outer.begin(), outer.end());
  out.outer = outer.back();
  out.median_outer = outer[outer.size() / 2];
  return out;
}

}  // namespace clearance
