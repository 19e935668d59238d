#include "engine/geometry/geometry_file.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "engine/cache/sha256.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/geometry/scene_error.h"

namespace clearance {

namespace {

namespace fs = std::filesystem;

// Format: this line, the digest of the rest as hexadecimal digits with a line end, the source's length as a uint64, the
// source, and the record. Another layout gets another number.
constexpr std::string_view kFirstLine = "clearance geometry 2\n";
constexpr std::size_t kHexDigits = 2 * sizeof(Sha256Digest), kHeadBytes = kFirstLine.size() + kHexDigits + 1;
constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 32;

std::string digest_of(std::string_view content) {
  Sha256 digest;
  digest.add(content.data(), content.size());
  return hex(digest.digest());
}

[[noreturn]] void fail(const std::string& path, const std::string& why) {
  throw engine::SceneError(path + ": " + why);
}

std::string read_all(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) fail(path, std::generic_category().message(errno));
  if (!S_ISREG(info.st_mode)) fail(path, "not a plain file");
  if (static_cast<std::uint64_t>(info.st_size) > kMaxBytes) fail(path, "larger than 4 GiB");
  std::string bytes(static_cast<std::size_t>(info.st_size), '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file) fail(path, "cannot be read");
  return bytes;
}

}  // namespace

std::string write_geometry_file(const std::string& folder, const Geometry& geometry) {
  const std::uint64_t length = geometry.source.size();
  std::string content(sizeof length, '\0');
  std::memcpy(content.data(), &length, sizeof length);
  content += geometry.source;
  const std::vector<std::byte> record = geometry_record(geometry, Tables::kMadeAnew);
  content.append(reinterpret_cast<const char*>(record.data()), record.size());
  const std::string digest = digest_of(content);
  const std::string name = digest.substr(0, 32) + ".geometry", path = (fs::path(folder) / name).string();
  if (fs::exists(path)) return name;
  std::ofstream file(path, std::ios::binary);
  file << kFirstLine << digest << '\n' << content;
  file.close();
  if (!file) fail(path, "cannot be written");
  return name;
}

Geometry read_geometry_file(const std::string& path) {
  const std::string bytes = read_all(path);
  std::string_view content(bytes);
  std::uint64_t length = 0;
  if (!content.starts_with(kFirstLine)) fail(path, "no geometry as Scene::save() writes it");
  if (content.size() < kHeadBytes + sizeof length) fail(path, "it ends early");
  const std::string_view digest = content.substr(kFirstLine.size(), kHexDigits);
  content.remove_prefix(kHeadBytes);
  if (digest_of(content) != digest) fail(path, "damaged: its content is not that of its digest");
  std::memcpy(&length, content.data(), sizeof length);
  content.remove_prefix(sizeof length);
  std::optional<Geometry> geometry;
  if (length <= content.size())
    geometry = geometry_of_record(std::as_bytes(std::span(content.substr(length))), Tables::kMadeAnew);
  if (!geometry) fail(path, "no geometry that can be used");
  geometry->source = content.substr(0, length);
  return *std::move(geometry);
}

}  // namespace clearance
