#include "engine/cache/cache.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "engine/cache/private_folder.h"

namespace clearance {

namespace {

constexpr std::uint64_t kMagic = 0x3165686361634c43;  // "CLcache1", which also identifies the byte order
constexpr const char* kUnfinished = "unfinished-";    // prefix of files that are being written
constexpr std::chrono::hours kUnfinishedFor{1};       // age at which the writer counts as dead
constexpr std::uint64_t kLooks = 32;                  // scans while this process writes as much as the cache can hold

struct Header {
  std::uint64_t magic, payload_bytes;
  Sha256Digest digest;  // digest of the name and the payload
};
static_assert(sizeof(Header) == 48);

Sha256Digest digest_of(const std::string& name, std::span<const std::byte> payload) {
  Sha256 digest;
  digest.add(name.data(), name.size());
  digest.add(payload);
  return digest.digest();
}

bool read_all(int fd, void* to, std::size_t bytes) {
  for (char* p = static_cast<char*>(to); bytes > 0;) {
    const ssize_t got = ::read(fd, p, bytes);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    p += got;
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}

bool write_all(int fd, const void* from, std::size_t bytes) {
  for (const char* p = static_cast<const char*>(from); bytes > 0;) {
    const ssize_t put = ::write(fd, p, bytes);
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return false;
    p += put;
    bytes -= static_cast<std::size_t>(put);
  }
  return true;
}

// Whether the file can only have been written by this user.
bool is_own(const struct stat& info) {
  return S_ISREG(info.st_mode) && info.st_uid == ::geteuid() && !(info.st_mode & (S_IWGRP | S_IWOTH));
}

// Returns the payload of an open entry if it is valid.
std::optional<std::vector<std::byte>> payload_of(int fd, const std::string& name, std::uint64_t most_bytes) {
  struct stat info{};
  Header header{};
  if (::fstat(fd, &info) != 0 || !is_own(info) || !read_all(fd, &header, sizeof header)) return {};
  if (header.magic != kMagic || header.payload_bytes != static_cast<std::uint64_t>(info.st_size) - sizeof header ||
      header.payload_bytes > most_bytes)
    return {};
  std::vector<std::byte> payload(header.payload_bytes);
  if (!read_all(fd, payload.data(), payload.size()) || digest_of(name, payload) != header.digest) return {};
  return payload;
}

// Returns "KIND" of "KIND-DIGEST", or empty for a file that is no entry.
std::string kind_of(const std::string& name) {
  constexpr std::size_t kDigits = 2 * sizeof(Sha256Digest);
  if (name.size() < kDigits + 2 || name[name.size() - kDigits - 1] != '-') return "";
  const std::size_t dash = name.size() - kDigits - 1;
  return name.find_first_not_of("0123456789abcdef", dash + 1) == std::string::npos ? name.substr(0, dash) : "";
}

struct File {
  std::string name;
  struct stat info;
};

std::vector<File> files_in(const Fd& folder) {
  std::vector<File> files;
  const int fd = ::openat(folder.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const std::unique_ptr<DIR, int (*)(DIR*)> open(fd < 0 ? nullptr : ::fdopendir(fd), &::closedir);
  while (const dirent* entry = open ? ::readdir(open.get()) : nullptr) {
    File file{entry->d_name, {}};
    if (kind_of(file.name).empty() && file.name.rfind(kUnfinished, 0) != 0) continue;
    if (::fstatat(folder.get(), entry->d_name, &file.info, AT_SYMLINK_NOFOLLOW) == 0) files.push_back(std::move(file));
  }
  return files;
}

std::chrono::system_clock::time_point changed(const struct stat& info) {
  return std::chrono::system_clock::time_point(std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::seconds(info.st_mtim.tv_sec) + std::chrono::nanoseconds(info.st_mtim.tv_nsec)));
}

const char* set_in_environment(const char* name) {
  const char* value = std::getenv(name);
  return value && *value ? value : nullptr;
}

}  // namespace

CacheKey::CacheKey(std::string_view kind, std::string_view version) : kind_(kind) {
  add(kind).add(version);
}

CacheKey& CacheKey::add(std::string_view part) {
  add(std::uint64_t{part.size()});
  digest_.add(part.data(), part.size());
  return *this;
}

CacheKey& CacheKey::add(const Sha256Digest& part) {
  digest_.add(part.data(), part.size());
  return *this;
}

CacheKey& CacheKey::add(std::uint64_t part) {
  digest_.add(&part, sizeof part);
  return *this;
}

CacheKey& CacheKey::add(double part) {
  return add(std::bit_cast<std::uint64_t>(part));
}

std::string CacheKey::name() {
  return kind_ + '-' + hex(digest_.digest());
}

Cache Cache::of_environment() {
  std::uint64_t most = kMostBytes;
  if (const char* mib = set_in_environment("CLEARANCE_CACHE_MIB")) {
    const char* end = mib + std::strlen(mib);
    const auto [read, error] = std::from_chars(mib, end, most);
    if (error != std::errc() || read != end || most == 0 || most > (std::uint64_t{1} << 40))
      return {Off(), std::string("CLEARANCE_CACHE_MIB: expected a whole number of MiB, got \"") + mib + '"'};
    most <<= 20;
  }
  if (const char* folder = set_in_environment("CLEARANCE_CACHE")) {
    if (std::strcmp(folder, "off") == 0) return {Off(), ""};
    if (*folder == '/') return Cache(folder, most);
    return {Off(), std::string("CLEARANCE_CACHE: expected \"off\" or an absolute path, got \"") + folder + '"'};
  }
  if (const char* caches = set_in_environment("XDG_CACHE_HOME"); caches && *caches == '/')
    return Cache(std::string(caches) + "/clearance", most);
  if (const char* home = set_in_environment("HOME"); home && *home == '/')
    return Cache(std::string(home) + "/.cache/clearance", most);
  return {Off(), "neither CLEARANCE_CACHE, XDG_CACHE_HOME nor HOME names a folder"};
}

Cache::Cache(const std::string& folder, std::uint64_t most_bytes)
    : path_(folder), folder_(open_private_folder(folder, &why_off_)), most_bytes_(most_bytes) {}

std::optional<std::vector<std::byte>> Cache::read(const std::string& name) const {
  if (!is_on()) return {};
  const Fd file(::openat(folder_.get(), name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (!file && errno == ENOENT) return {};
  auto payload = file ? payload_of(file.get(), name, most_bytes_) : std::nullopt;
  if (!payload)
    ::unlinkat(folder_.get(), name.c_str(), 0);
  else
    ::futimens(file.get(), nullptr);  // marks it as used now
  return payload;
}

void Cache::write(const std::string& name, std::span<const std::byte> payload) const {
  const std::uint64_t bytes = sizeof(Header) + payload.size();
  if (!is_on() || bytes > most_bytes_ || !may_write(bytes)) return;
  std::uint64_t drawn = 0;
  if (::getrandom(&drawn, sizeof drawn, 0) != sizeof drawn) return;
  const std::string unfinished = kUnfinished + std::to_string(drawn);
  const Header header{kMagic, payload.size(), digest_of(name, payload)};
  bool whole = false;
  {
    const Fd file(
        ::openat(folder_.get(), unfinished.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (!file) return;
    whole = write_all(file.get(), &header, sizeof header) && write_all(file.get(), payload.data(), payload.size());
  }
  if (!whole || ::renameat(folder_.get(), unfinished.c_str(), folder_.get(), name.c_str()) != 0) {
    ::unlinkat(folder_.get(), unfinished.c_str(), 0);
    return;
  }
  const std::lock_guard lock(mutex_);
  if (bytes <= free_bytes_)
    free_bytes_ -= bytes;
  else
    evict();
}

// Other processes write, too, so each scans the folder again after writing a small part of its maximum size.
void Cache::evict() const {
  std::vector<File> files = files_in(folder_);
  std::uint64_t held = 0;
  for (const File& file : files) held += static_cast<std::uint64_t>(file.info.st_size);
  std::sort(files.begin(), files.end(), [](const File& a, const File& b) { return changed(a.info) < changed(b.info); });
  const auto now = std::chrono::system_clock::now();
  const std::uint64_t wanted = held > most_bytes_ ? most_bytes_ - most_bytes_ / 8 : most_bytes_;
  for (const File& file : files) {
    const bool unfinished = kind_of(file.name).empty();
    if (unfinished ? changed(file.info) > now - kUnfinishedFor : held <= wanted) continue;
    ::unlinkat(folder_.get(), file.name.c_str(), 0);
    held -= static_cast<std::uint64_t>(file.info.st_size);
  }
  free_bytes_ = std::min(most_bytes_ - std::min(held, most_bytes_), most_bytes_ / kLooks);
}

std::vector<CacheEntry> Cache::list() const {
  std::vector<CacheEntry> entries;
  if (!is_on()) return entries;
  for (File& file : files_in(folder_)) {
    std::string kind = kind_of(file.name);
    if (kind.empty()) continue;
    entries.push_back(
        {std::move(file.name), std::move(kind), static_cast<std::uint64_t>(file.info.st_size), changed(file.info)});
  }
  std::sort(entries.begin(), entries.end(), [](const CacheEntry& a, const CacheEntry& b) { return a.used > b.used; });
  return entries;
}

std::size_t Cache::clear() const {
  std::size_t removed = 0;
  for (const File& file : is_on() ? files_in(folder_) : std::vector<File>())
    if (::unlinkat(folder_.get(), file.name.c_str(), 0) == 0 && !kind_of(file.name).empty()) ++removed;
  return removed;
}

}  // namespace clearance
