// Common part of the files that write the seeds of the fuzz targets.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "wire/wire.h"

namespace clearance::fuzz {

namespace fs = std::filesystem;
using Data = std::vector<std::byte>;

/// The output folder.
inline fs::path& seeds_folder() {
  static fs::path folder;
  return folder;
}

/// Throws std::runtime_error if the file cannot be written.
void save(const std::string& target, const std::string& name, const Data& data);

inline Data data_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

template <class... Numbers>
void add(Data& data, Numbers... numbers) {
  (wire::append(data, numbers), ...);
}

/// Writes meshes, scenes, robots and records of the cache.
void save_files();

}  // namespace clearance::fuzz
