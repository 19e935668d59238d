#include "table_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <vector>

#include "digest.h"

namespace clearance {

namespace {

constexpr std::uint64_t kMagic = 0x315458444e494c43;  // "CLINDXT1": also tells the order of bytes
constexpr std::uint64_t kVersion = 1;                 // of the file and of what make_direction_table() makes

struct Header {
  std::uint64_t magic, version, key, vertices, grid_bits, cells, lists, checksum;
};

std::uint64_t key_of(std::span<const Vec3d> vertices, double rho, std::size_t few) {
  Digest d;
  d.add(kVersion);
  d.add(vertices);
  d.add(rho);
  d.add(std::uint64_t{few});
  return d.value();
}

std::uint64_t checksum_of(const DirectionTable& table) {
  Digest d;
  d.add(std::uint64_t{table.grid_bits});
  for (const auto* words : {&table.cells, &table.lists})
    for (std::size_t i = 0; i < words->size(); i += 2)
      d.add(std::uint64_t{(*words)[i]} << 32 | (i + 1 < words->size() ? (*words)[i + 1] : 0));
  return d.value();
}

// Whether every path through the cells ends at a list of vertices that there are.
bool is_sound(const DirectionTable& table, std::size_t vertices) {
  if (table.grid_bits < 1 || table.grid_bits > DirectionTable::kDeepest) return false;
  const std::size_t grid = std::size_t{1} << (2 * table.grid_bits);
  if (table.cells.size() < grid) return false;
  std::vector<std::uint8_t> depth(table.cells.size(), 0);
  for (std::size_t i = 0; i < table.cells.size(); ++i) {
    const std::uint32_t word = table.cells[i];
    if (word & DirectionTable::kDivided) {
      const std::size_t first = word & ~DirectionTable::kDivided;
      if (first <= i || first < grid || first + 4 > table.cells.size()) return false;
      if (table.grid_bits + depth[i] >= DirectionTable::kDeepest) return false;
      for (std::size_t k = 0; k < 4; ++k) depth[first + k] = static_cast<std::uint8_t>(depth[i] + 1);
    } else if (word >= table.lists.size()) {
      return false;
    }
  }
  for (std::size_t i = 0; i < table.lists.size();) {
    const std::size_t count = table.lists[i];
    if (count == 0 || count > table.lists.size() - i - 1) return false;
    for (std::size_t k = 1; k <= count; ++k)
      if (table.lists[i + k] >= vertices) return false;
    i += count + 1;
  }
  // Cells must point at where a list begins.
  std::vector<bool> begins(table.lists.size(), false);
  for (std::size_t i = 0; i < table.lists.size(); i += table.lists[i] + 1) begins[i] = true;
  return std::all_of(table.cells.begin(), table.cells.end(),
                     [&](std::uint32_t word) { return (word & DirectionTable::kDivided) || begins[word]; });
}

bool finds_the_farthest(const DirectionTable& table, std::span<const Vec3d> vertices) {
  for (const Vec3d& n : {Vec3d{0.3, -0.5, 0.8}, Vec3d{-0.7, 0.2, -0.1}, Vec3d{0.1, 0.9, -0.4}}) {
    double most = dot(n, vertices[0]), listed = -std::numeric_limits<double>::infinity();
    for (const Vec3d& v : vertices) most = std::max(most, dot(n, v));
    for (const std::uint32_t i : table.candidates(n)) listed = std::max(listed, dot(n, vertices[i]));
    if (listed != most) return false;
  }
  return true;
}

class File {
 public:
  explicit File(int fd) : fd_(fd) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (fd_ >= 0) ::close(fd_);
  }
  bool is_open() const { return fd_ >= 0; }
  int fd() const { return fd_; }
  bool read(void* to, std::size_t bytes) const {
    for (char* p = static_cast<char*>(to); bytes > 0;) {
      const ssize_t got = ::read(fd_, p, bytes);
      if (got <= 0) return false;
      p += got;
      bytes -= static_cast<std::size_t>(got);
    }
    return true;
  }
  bool write(const void* from, std::size_t bytes) const {
    for (const char* p = static_cast<const char*>(from); bytes > 0;) {
      const ssize_t put = ::write(fd_, p, bytes);
      if (put <= 0) return false;
      p += put;
      bytes -= static_cast<std::size_t>(put);
    }
    return true;
  }

 private:
  int fd_;
};

std::size_t bytes_of(const std::vector<std::uint32_t>& words) { return words.size() * sizeof(std::uint32_t); }

bool wanted(const std::string& mesh, std::size_t vertices) {
  const char* setting = std::getenv("CLEARANCE_TABLE_FILES");
  return !mesh.empty() && vertices >= kTableFileFromVertices && !(setting && std::strcmp(setting, "off") == 0);
}

}  // namespace

std::optional<DirectionTable> read_table_file(const std::string& path, std::uint64_t key, std::span<const Vec3d> vertices) {
  const File file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat info {};
  if (!file.is_open() || ::fstat(file.fd(), &info) != 0 || !S_ISREG(info.st_mode)) return {};
  if ((info.st_uid != ::geteuid() && info.st_uid != 0) || (info.st_mode & (S_IWGRP | S_IWOTH))) return {};
  Header h{};
  if (!file.read(&h, sizeof h) || h.magic != kMagic || h.version != kVersion || h.key != key || h.vertices != vertices.size())
    return {};
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (h.cells > size || h.lists > size || size != sizeof h + (h.cells + h.lists) * sizeof(std::uint32_t)) return {};
  DirectionTable table;
  table.grid_bits = static_cast<std::uint32_t>(std::min<std::uint64_t>(h.grid_bits, 255));
  table.cells.resize(h.cells);
  table.lists.resize(h.lists);
  if (!file.read(table.cells.data(), bytes_of(table.cells)) || !file.read(table.lists.data(), bytes_of(table.lists))) return {};
  if (checksum_of(table) != h.checksum || !is_sound(table, vertices.size()) || !finds_the_farthest(table, vertices)) return {};
  return table;
}

void write_table_file(const std::string& path, std::uint64_t key, std::size_t vertices, const DirectionTable& table) {
  const std::string unfinished = path + "." + std::to_string(::getpid());
  bool whole = false;
  {
    const File file(::open(unfinished.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0644));
    if (!file.is_open()) return;
    const Header h{kMagic, kVersion, key, vertices, table.grid_bits, table.cells.size(), table.lists.size(), checksum_of(table)};
    whole = file.write(&h, sizeof h) && file.write(table.cells.data(), bytes_of(table.cells)) &&
            file.write(table.lists.data(), bytes_of(table.lists)) && ::fchmod(file.fd(), 0644) == 0;
  }
  if (!whole || ::rename(unfinished.c_str(), path.c_str()) != 0) ::unlink(unfinished.c_str());
}

DirectionTable direction_table_beside(const std::string& mesh, std::span<const Vec3d> vertices, double rho, std::size_t few) {
  if (!wanted(mesh, vertices.size())) return make_direction_table(vertices, rho, few);
  const std::uint64_t key = key_of(vertices, rho, few);
  char digest[17];
  std::snprintf(digest, sizeof digest, "%016llx", static_cast<unsigned long long>(key));
  const std::string path = mesh + "." + digest + ".table";
  if (std::optional<DirectionTable> table = read_table_file(path, key, vertices)) return std::move(*table);
  DirectionTable table = make_direction_table(vertices, rho, few);
  write_table_file(path, key, vertices.size(), table);
  return table;
}

}  // namespace clearance
