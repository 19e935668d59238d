// The cache: an entry is returned whole or not at all, and only if this user wrote it.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/cache/cache.h"
#include "engine/hull/shapes.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

constexpr uid_t kSomebody = 12345;  // neither root nor this user

Bytes bytes(std::size_t count, int seed) {
  Bytes out(count);
  PortableRandom random(static_cast<std::uint64_t>(seed));
  for (std::byte& b : out) b = static_cast<std::byte>(random.uniform(0, 256));
  return out;
}

std::string name(int i, const char* kind = "test") {
  return CacheKey(kind, "1").add(static_cast<std::uint64_t>(i)).name();
}

std::string contents(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
void put(const fs::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

class CacheTest : public testing::Test {
 protected:
  fs::path entry(int i) const { return fs::path(path_) / name(i); }
  std::uint64_t held() const {
    std::uint64_t sum = 0;
    for (const auto& file : fs::directory_iterator(path_)) sum += file.file_size();
    return sum;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_ / "a/cache";
};

TEST_F(CacheTest, GivesBackWhatItWasGiven) {
  const Cache cache(path_);
  ASSERT_TRUE(cache.is_on()) << cache.why_off();
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_all);
  const Bytes one = bytes(100'000, 1), none;
  cache.write(name(1), one);
  cache.write(name(2), none);
  EXPECT_EQ(cache.read(name(1)), one);
  EXPECT_EQ(cache.read(name(2)), none);
  EXPECT_EQ(cache.read(name(3)), std::nullopt);
  EXPECT_EQ(Cache(path_).read(name(1)), one) << "another process, later";
  EXPECT_EQ(fs::status(entry(1)).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  cache.write(name(1), none);
  EXPECT_EQ(cache.read(name(1)), none);
  EXPECT_EQ(std::distance(fs::directory_iterator(path_), {}), 2) << "nothing unfinished is left";
}

TEST_F(CacheTest, KeysDistinguishAllInputs) {
  const auto key = [](const char* kind, const char* version, auto... parts) {
    CacheKey k(kind, version);
    (k.add(parts), ...);
    return k.name();
  };
  using Text = std::string_view;
  const std::vector<std::string> all = {key("a", "1"),
                                        key("b", "1"),
                                        key("a", "2"),
                                        key("a", "1", Text("xy"), Text("z")),
                                        key("a", "1", Text("x"), Text("yz")),
                                        key("a", "1", 0.0),
                                        key("a", "1", -0.0),
                                        key("a", "1", std::uint64_t{1}),
                                        key("a", "1", std::uint64_t{1}, std::uint64_t{1})};
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(all[i], all[j]);
  EXPECT_EQ(key("a", "1", 2.5), key("a", "1", 2.5));
}

TEST_F(CacheTest, BelievesNoEntryThatIsDamaged) {
  const Cache cache(path_);
  const Bytes right = bytes(1000, 2);
  cache.write(name(1), right);
  const std::string whole = contents(entry(1));
  const auto expect_gone = [&](const std::string& what) {
    EXPECT_EQ(cache.read(name(1)), std::nullopt) << what;
    EXPECT_FALSE(fs::exists(fs::symlink_status(entry(1)))) << what;
  };
  for (std::size_t at = 0; at < whole.size(); at += at < 64 ? 1 : 97) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << at % 8));
    put(entry(1), damaged);
    expect_gone("byte " + std::to_string(at));
  }
  for (const std::size_t length :
       {std::size_t{0}, std::size_t{1}, std::size_t{47}, std::size_t{48}, whole.size() / 2, whole.size() - 1}) {
    put(entry(1), whole.substr(0, length));
    expect_gone(std::to_string(length) + " bytes");
  }
  put(entry(1), whole + "x");
  expect_gone("one byte more");
  cache.write(name(2), right);
  fs::rename(entry(2), entry(1));
  expect_gone("an entry under another one's name");
  std::string huge = whole;
  huge.replace(8, 8, std::string("\0\0\0\0\0\1\0\0", 8));  // a payload of 2^40 bytes
  put(entry(1), huge);
  fs::resize_file(entry(1), (std::uint64_t{1} << 40) + 48);
  expect_gone("larger than the cache may be");
  put(entry(1), whole);
  EXPECT_EQ(cache.read(name(1)), right) << "as it was, it would be believed";
}

TEST_F(CacheTest, BelievesNoEntryThatOthersMayHaveWritten) {
  const Cache cache(path_);
  const Bytes right = bytes(1000, 3);
  const auto expect_gone = [&](const char* what) {
    EXPECT_EQ(cache.read(name(1)), std::nullopt) << what;
    EXPECT_FALSE(fs::exists(fs::symlink_status(entry(1)))) << what;
  };
  for (const mode_t mode : {0620, 0602, 0666}) {
    cache.write(name(1), right);
    ASSERT_EQ(::chmod(entry(1).c_str(), mode), 0);
    expect_gone("writable by others");
  }
  cache.write(name(1), right);
  fs::rename(entry(1), folder_ / "elsewhere");
  fs::create_symlink(folder_ / "elsewhere", entry(1));
  expect_gone("a link");
  EXPECT_TRUE(fs::exists(folder_ / "elsewhere"));
  ASSERT_EQ(::mkfifo(entry(1).c_str(), 0600), 0);
  expect_gone("a pipe");
  fs::create_directory(entry(1));
  EXPECT_EQ(cache.read(name(1)), std::nullopt) << "a folder";
  cache.write(name(1), right);
  EXPECT_EQ(cache.read(name(1)), std::nullopt) << "still a folder";
  fs::remove(entry(1));
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  cache.write(name(1), right);
  ASSERT_EQ(::chown(entry(1).c_str(), kSomebody, kSomebody), 0);
  expect_gone("somebody else's");
}

TEST_F(CacheTest, UsesNoFolderThatOthersMayHaveFilled) {
  const auto why_not = [](const std::string& path) {
    const Cache cache(path);
    EXPECT_EQ(cache.is_on(), cache.why_off().empty()) << path;
    if (!cache.is_on()) {
      cache.write(name(1), bytes(10, 1));  // no effect
      EXPECT_EQ(cache.read(name(1)), std::nullopt);
      EXPECT_TRUE(cache.list().empty());
      EXPECT_EQ(cache.clear(), 0u);
    }
    return cache.why_off();
  };
  ASSERT_EQ(why_not(path_), "");
  for (const mode_t mode : {0720, 0702, 0777, 01777}) {
    ASSERT_EQ(::chmod(path_.c_str(), mode), 0);
    EXPECT_NE(why_not(path_).find("may write to it"), std::string::npos) << std::oct << mode;
  }
  ASSERT_EQ(::chmod(path_.c_str(), 0700), 0);
  const std::string above = folder_ / "a";
  ASSERT_EQ(::chmod(above.c_str(), 0777), 0);
  EXPECT_EQ(why_not(path_), above + ": all users may write to it");
  ASSERT_EQ(::chmod(above.c_str(), 01777), 0);
  EXPECT_EQ(why_not(path_), "") << "as in /tmp, nobody can put another one in its place";
  fs::create_symlink("a", folder_ / "link");
  EXPECT_EQ(why_not(folder_ / "link/cache"), "");
  EXPECT_EQ(why_not(folder_ / "link/../link/./cache"), "");
  fs::create_symlink("ring", folder_ / "ring");
  EXPECT_NE(why_not(folder_ / "ring/cache").find("Too many levels"), std::string::npos);
  folder_.write("file", "text");
  EXPECT_EQ(why_not(folder_ / "file"), folder_ / "file" + ": is not a folder");
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  const auto give_away = [](const std::string& path, uid_t whom) { return ::lchown(path.c_str(), whom, ::getegid()); };
  ASSERT_EQ(give_away(folder_ / "link", kSomebody), 0);
  EXPECT_EQ(why_not(folder_ / "link/cache"), folder_ / "link" + ": belongs to another user");
  ASSERT_EQ(give_away(path_, kSomebody), 0);
  EXPECT_EQ(why_not(path_), path_ + ": belongs to another user");
  ASSERT_EQ(give_away(path_, 0), 0);
  ASSERT_EQ(give_away(above, kSomebody), 0);
  EXPECT_EQ(why_not(path_), above + ": belongs to another user");
}

TEST_F(CacheTest, HoldsNoMoreThanItMayAndLosesWhatWasNotUsedForLongest) {
  constexpr std::uint64_t kMost = 100'000;
  const Cache cache(path_, kMost);
  for (int i = 0; i < 8; ++i) {
    cache.write(name(i), bytes(10'000, i));
    const timespec then[2] = {{1000 + i, 0}, {1000 + i, 0}};
    ASSERT_EQ(::utimensat(AT_FDCWD, entry(i).c_str(), then, 0), 0);
  }
  ASSERT_TRUE(cache.read(name(0))) << "used now";
  const int before = 8;
  for (int i = before; i < 40; ++i) {
    cache.write(name(i), bytes(10'000, i));
    EXPECT_LE(held(), kMost) << i;
    EXPECT_TRUE(cache.read(name(i))) << "the newest is there";
    if (i == before + 2) {
      EXPECT_TRUE(cache.read(name(0))) << "was used";
      EXPECT_FALSE(fs::exists(entry(1))) << "was not";
      EXPECT_TRUE(fs::exists(entry(7)));
    }
  }
  EXPECT_GT(held(), kMost / 2);
  cache.write(name(50), bytes(kMost, 50));
  EXPECT_FALSE(fs::exists(entry(50))) << "too large for any room";
  EXPECT_GT(held(), kMost / 2) << "and nothing had to go for it";

  // The unfinished file of a dead process is removed, too; that of a running one stays.
  const fs::path dead = fs::path(path_) / "unfinished-1", alive = fs::path(path_) / "unfinished-2";
  put(dead, "half");
  put(alive, "half");
  const timespec long_ago[2] = {{1000, 0}, {1000, 0}};
  ASSERT_EQ(::utimensat(AT_FDCWD, dead.c_str(), long_ago, 0), 0);
  const Cache next(path_, kMost);
  next.write(name(60), bytes(10'000, 60));
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_TRUE(fs::exists(alive));
}

TEST_F(CacheTest, ListsAndClearsItsEntriesAlone) {
  const Cache cache(path_);
  cache.write(name(1, "mesh"), bytes(10, 1));
  cache.write(name(2, "proof"), bytes(20, 2));
  const timespec then[2] = {{1000, 0}, {1000, 0}};
  ASSERT_EQ(::utimensat(AT_FDCWD, (path_ + "/" + name(1, "mesh")).c_str(), then, 0), 0);
  put(path_ + "/notes.txt", "mine");
  const auto entries = cache.list();
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].kind, "proof");
  EXPECT_EQ(entries[0].bytes, 48u + 20);
  EXPECT_EQ(entries[1].name, name(1, "mesh"));
  EXPECT_EQ(std::chrono::system_clock::to_time_t(entries[1].used), 1000);
  EXPECT_EQ(cache.clear(), 2u);
  EXPECT_TRUE(cache.list().empty());
  EXPECT_TRUE(fs::exists(path_ + "/notes.txt"));
}

// Processes that write, read, corrupt and clear the same few entries: every payload read is correct.
TEST_F(CacheTest, ServesManyProcessesAtATime) {
  constexpr int kProcesses = 4, kRounds = 300, kNames = 6;
  constexpr std::uint64_t kMost = 30'000;  // of 6 entries of 10,000 bytes
  std::vector<pid_t> children;
  for (int child = 0; child < kProcesses; ++child) {
    const pid_t pid = ::fork();
    ASSERT_GE(pid, 0);
    if (pid > 0) {
      children.push_back(pid);
      continue;
    }
    const Cache cache(path_, kMost);
    PortableRandom random(static_cast<std::uint64_t>(child));
    int found = 0;
    for (int round = 0; round < kRounds; ++round) {
      const int i = static_cast<int>(random.uniform(0, kNames));
      const Bytes right = bytes(10'000, i);
      if (const auto read = cache.read(name(i))) {
        if (*read != right) ::_exit(2);
        ++found;
      }
      cache.write(name(i), right);
      if (cache.read(name(i)).value_or(right) != right) ::_exit(3);
      if (round % 50 == 49) cache.clear();
      if (round % 20 == 19)
        std::fstream(entry(i), std::ios::in | std::ios::out | std::ios::binary).seekp(100) << "spoilt";
    }
    ::_exit(found > 0 ? 0 : 4);
  }
  for (const pid_t pid : children) {
    int status = 0;
    ASSERT_EQ(::waitpid(pid, &status, 0), pid);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  }
  const Cache cache(path_, kMost);
  cache.write(name(100), bytes(10, 100));
  EXPECT_LE(held(), kMost);
}

TEST_F(CacheTest, IsWhereTheEnvironmentSays) {
  const char* const names[] = {"CLEARANCE_CACHE", "CLEARANCE_CACHE_MIB", "XDG_CACHE_HOME", "HOME"};
  std::vector<std::pair<const char*, std::optional<std::string>>> before;
  for (const char* n : names) {
    const char* value = std::getenv(n);
    before.emplace_back(n, value ? std::optional<std::string>(value) : std::nullopt);
    ::unsetenv(n);
  }
  const auto with = [](const char* n, const std::string& value) {
    ::setenv(n, value.c_str(), 1);
    return Cache::of_environment();
  };
  EXPECT_NE(Cache::of_environment().why_off().find("HOME"), std::string::npos);
  EXPECT_EQ(with("HOME", folder_ / "home").path(), folder_ / "home/.cache/clearance");
  EXPECT_EQ(with("XDG_CACHE_HOME", "relative").path(), folder_ / "home/.cache/clearance") << "as the standard has it";
  EXPECT_EQ(with("XDG_CACHE_HOME", folder_ / "xdg").path(), folder_ / "xdg/clearance");
  EXPECT_TRUE(fs::is_directory(folder_ / "xdg/clearance"));
  EXPECT_EQ(with("CLEARANCE_CACHE", path_).path(), path_);
  EXPECT_EQ(Cache::of_environment().most_bytes(), std::uint64_t{2} << 30);
  EXPECT_EQ(with("CLEARANCE_CACHE_MIB", "3").most_bytes(), std::uint64_t{3} << 20);
  for (const char* wrong : {"0", "-1", "1.5", "3 MiB", "99999999999999999999"}) {
    const Cache cache = with("CLEARANCE_CACHE_MIB", wrong);
    EXPECT_FALSE(cache.is_on()) << wrong;
    EXPECT_NE(cache.why_off().find("CLEARANCE_CACHE_MIB: expected a whole number of MiB"), std::string::npos) << wrong;
  }
  ::unsetenv("CLEARANCE_CACHE_MIB");
  const Cache relative = with("CLEARANCE_CACHE", "some/folder");
  EXPECT_FALSE(relative.is_on());
  EXPECT_NE(relative.why_off().find("absolute path"), std::string::npos);
  const Cache off = with("CLEARANCE_CACHE", "off");
  EXPECT_FALSE(off.is_on());
  EXPECT_EQ(off.why_off(), "") << "as was asked for";
  for (const auto& [n, value] : before) value ? ::setenv(n, value->c_str(), 1) : ::unsetenv(n);
}

}  // namespace
}  // namespace clearance
