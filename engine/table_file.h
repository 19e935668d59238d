// Direction tables of large meshes, kept in files beside them: building one takes longer than reading it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "direction_table.h"

namespace clearance {

/// Tables of fewer vertices are made as fast as they are read.
inline constexpr std::size_t kTableFileFromVertices = 10'000;

/// make_direction_table(), or the same from the file that an earlier call has left beside `mesh`.
///
/// The file, MESH.DIGEST.table, is named after the vertices and the version that it is for, and used only if it
/// belongs to this user or to root, nobody else may write it, its length, checksum and indices are in order, and a few
/// supports are those of the vertices. Otherwise, or where nothing can be written, the table is made anew: no error.
/// \param mesh path of a mesh file; empty, or CLEARANCE_TABLE_FILES=off in the environment: no files.
DirectionTable direction_table_beside(const std::string& mesh, std::span<const Vec3d> vertices, double rho, std::size_t few);

/// The table in a file; none unless everything that direction_table_beside() says of it holds.
/// \param key of the vertices and the version, as in the file's name.
std::optional<DirectionTable> read_table_file(const std::string& path, std::uint64_t key, std::span<const Vec3d> vertices);

/// Leaves the table in a file, if it can be written; under another name first, so that nobody ever reads half of one.
/// \param vertices how many the table is for.
void write_table_file(const std::string& path, std::uint64_t key, std::size_t vertices, const DirectionTable& table);

}  // namespace clearance
