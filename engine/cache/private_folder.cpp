#include "engine/cache/private_folder.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <climits>
#include <deque>
#include <system_error>

namespace clearance {

namespace {

constexpr int kMostLinks = 40;  // as in the kernel

/// Walks along a path, one name at a time, and checks the owner of each step.
class Walk {
 public:
  explicit Walk(std::string* why) : at_(::open("/", O_PATH | O_DIRECTORY | O_CLOEXEC)), why_(why) {}

  Fd along(const std::string& path) {
    push(path);
    while (!names_.empty()) {
      const std::string name = std::move(names_.front());
      names_.pop_front();
      if (!step(name)) return Fd();
    }
    return std::move(at_);
  }

 private:
  bool fail(const std::string& what) {
    *why_ = where_ + ": " + what;
    return false;
  }
  bool fail(int error) { return fail(std::generic_category().message(error)); }

  // Puts the names of a path before the remaining ones.
  void push(const std::string& path) {
    std::deque<std::string> names;
    for (std::size_t begin = 0, end; begin < path.size(); begin = end + 1) {
      end = std::min(path.find('/', begin), path.size());
      if (end > begin) names.push_back(path.substr(begin, end - begin));
    }
    names_.insert(names_.begin(), names.begin(), names.end());
  }

  bool step(const std::string& name) {
    where_ += '/' + name;
    struct stat info{};
    if (::fstatat(at_.get(), name.c_str(), &info, AT_SYMLINK_NOFOLLOW) != 0) {
      if (errno != ENOENT || (::mkdirat(at_.get(), name.c_str(), 0700) != 0 && errno != EEXIST)) return fail(errno);
    }
    // Checks and continues with the same descriptor, so that a concurrent rename has no effect.
    Fd next(::openat(at_.get(), name.c_str(), O_PATH | O_NOFOLLOW | O_CLOEXEC));
    if (!next || ::fstat(next.get(), &info) != 0) return fail(errno);
    if (info.st_uid != 0 && info.st_uid != ::geteuid()) return fail("belongs to another user");
    if (S_ISLNK(info.st_mode)) return follow(next);
    if (!S_ISDIR(info.st_mode)) return fail("is not a folder");
    if ((info.st_mode & S_IWOTH) && !(info.st_mode & S_ISVTX)) return fail("all users may write to it");
    at_ = std::move(next);
    return true;
  }

  bool follow(const Fd& link) {
    char target[PATH_MAX];
    const ssize_t size = ::readlinkat(link.get(), "", target, sizeof target);
    if (size < 0) return fail(errno);
    if (++links_ > kMostLinks) return fail(ELOOP);
    if (size > 0 && target[0] == '/') at_ = Fd(::open("/", O_PATH | O_DIRECTORY | O_CLOEXEC));
    push(std::string(target, static_cast<std::size_t>(size)));
    return true;
  }

  Fd at_;
  std::deque<std::string> names_;
  std::string where_;
  std::string* why_;
  int links_ = 0;
};

}  // namespace

Fd open_private_folder(const std::string& path, std::string* why) {
  const Fd found = Walk(why).along(path);
  if (!found) return Fd();
  struct stat info{};
  Fd folder(::openat(found.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder || ::fstat(folder.get(), &info) != 0)
    *why = path + ": " + std::generic_category().message(errno);
  else if (info.st_uid != ::geteuid())
    *why = path + ": belongs to another user";
  else if (info.st_mode & (S_IWGRP | S_IWOTH))
    *why = path + ": other users may write to it; check its contents, then `chmod 700` it";
  else
    return folder;
  return Fd();
}

}  // namespace clearance
