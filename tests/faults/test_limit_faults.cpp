// A daemon without descriptors, memory or disk space: it rejects impossible requests with a message, continues with the
// others, and recovers when the limit is lifted.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>

#include <fstream>
#include <thread>

#include "tests/faults/arena.h"
#include "tests/faults/limits.h"
#include "tests/faults/rounds.h"
#include "tests/patience.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class LimitFaults : public testing::Test {
 protected:
  void SetUp() override {
    for (const std::string& url : arena_.urls())
      witnesses_.push_back(std::make_unique<Witness>(url, exam_, 30 + witnesses_.size(), 0.3));
    before_ = arena_.census();
  }
  /// Waits until the clients' memory is unmapped, which happens outside the loop, because until then it can serve
  /// another client. Returns whether the daemon uses less than 96 MiB more than `rested`.
  bool await_room(std::uint64_t rested) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (address_space_of(arena_.daemon().pid()) > rested + (96 << 20)) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::sleep_for(2ms);
    }
    return true;
  }

  /// Checks that everything is as before once the limits are lifted.
  void expect_recovered() {
    EXPECT_EQ(arena_.await_census(before_), "");
    ASSERT_EQ(await_answers(witnesses_, 3), "");
    for (const std::string& url : arena_.urls()) {
      Client client = patient(url);
      EXPECT_TRUE(is_right(request_surely(client, *exam_.queries()[0]), *exam_.queries()[0])) << url;
    }
    Client client = patient(arena_.zmq());
    EXPECT_EQ(unbalanced(stats_of(client)), "");
    for (const auto& witness : witnesses_) {
      const Witness::Counts counts = witness->counts();
      EXPECT_EQ(counts.wrong + counts.lost + counts.busy + counts.others, 0u) << witness->url();
      for (const std::string& complaint : witness->complaints())
        EXPECT_TRUE(contains(complaint, "udpm://")) << complaint;
    }
  }

  const Exam exam_{kScene, 3};
  Arena arena_;
  Witnesses witnesses_;
  Census before_;
};

TEST_F(LimitFaults, WithoutDescriptorsNewClientsAreRejectedAndOldOnesServed) {
  for (int round = 0; round < rounds(1); ++round)
    for (const int spare : {0, 1, 2, 3, 7}) {
      std::vector<Client> clients;
      std::string rejected;
      {
        const Limit limit(arena_.daemon().pid(), RLIMIT_NOFILE, descriptors_for(arena_.daemon().pid(), spare));
        while (rejected.empty() && clients.size() < 100)
          rejected = error_of([&] { clients.push_back(patient(arena_.shm())); });
        EXPECT_TRUE(contains(rejected, "rejected: ") && contains(rejected, "Too many open files"))
            << spare << ": " << rejected;
        EXPECT_EQ(clients.size(), static_cast<std::size_t>(spare / 3)) << "a client takes three";
        // ZeroMQ cannot report the reason.
        const std::string hung_up = error_of([&] { patient(arena_.zmq()); });
        if (spare % 3 == 0) {
          EXPECT_TRUE(contains(hung_up, "has no descriptor for another client")) << hung_up;
        }
        ASSERT_EQ(await_answers(witnesses_, 2), "");
        for (Client& client : clients) client.ping();
      }
      clients.clear();
      ASSERT_EQ(arena_.await_census(before_), "");
    }
  expect_recovered();
}

TEST_F(LimitFaults, WithoutMemoryLargeRequestsAreRejectedAndSmallOnesAnswered) {
  const std::uint32_t body = 1;
  const auto poses = [](std::size_t count) { return std::vector<Pose7>(count, Pose7{1, 2, 3, 1, 0, 0, 0}); };
  const std::uint64_t rested = address_space_of(arena_.daemon().pid());
  for (int round = 0; round < rounds(1); ++round) {
    for (const std::string& url : {arena_.shm(), arena_.zmq()}) {
      ASSERT_EQ(arena_.await_census(before_), "");
      ASSERT_TRUE(await_room(rested));
      Client client = patient(url);
      // 2 M rows of 121 bytes exceed any remaining memory.
      const std::vector<Pose7> many = poses(20000);
      Query query;
      query.bodies = {&body, 1};
      query.configurations = many;
      query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
      query.max_distance = 0.1;
      {
        const Limit limit(arena_.daemon().pid(), RLIMIT_AS, address_space_of(arena_.daemon().pid()) + (48 << 20));
        const std::string rejected = error_of([&] { client.distances(query); });
        EXPECT_TRUE(contains(rejected, "more than this client has room for") ||
                    contains(rejected, "the daemon has no memory for this request"))
            << url << ": " << rejected;
        EXPECT_TRUE(is_right(client.distances(exam_.queries()[1]->query), *exam_.queries()[1]));
        ASSERT_EQ(await_answers(witnesses_, 2), "");
      }
      EXPECT_EQ(client.distances(query).rows(), 20000u * 99) << "with memory it is answered";
    }
    // Connections for which there is no memory.
    std::vector<Client> clients;
    std::string rejected;
    {
      const Limit limit(arena_.daemon().pid(), RLIMIT_AS, address_space_of(arena_.daemon().pid()) + (64 << 20));
      while (rejected.empty() && clients.size() < 100)
        rejected = error_of([&] { clients.push_back(patient(arena_.shm())); });
      EXPECT_TRUE(contains(rejected, "rejected: mapping a segment of ")) << rejected;
      EXPECT_GE(clients.size(), 1u);
      ASSERT_EQ(await_answers(witnesses_, 2), "");
    }
  }
  expect_recovered();
}

TEST_F(LimitFaults, SegmentsBeyondTheFileSizeLimitAreRejected) {
  {
    const Limit limit(arena_.daemon().pid(), RLIMIT_FSIZE, 1 << 20);
    const std::string rejected = error_of([&] { patient(arena_.shm()); });
    EXPECT_TRUE(contains(rejected, "rejected: a segment of ") && contains(rejected, "File too large")) << rejected;
    ASSERT_EQ(await_answers(witnesses_, 2), "");
  }
  expect_recovered();
}

/// A small file system; only root can mount one.
class SmallDisk {
 public:
  explicit SmallDisk(const char* options) {
    mounted_ = mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, options) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount2(folder_.path().c_str(), MNT_DETACH);
  }
  bool is_there() const { return mounted_; }
  const std::string& path() const { return folder_.path(); }
  /// Writes until the disk is full.
  void fill() const {
    std::ofstream file(path() + "/filler", std::ios::app);
    while (file << std::string(4096, 'x') << std::flush) {
    }
  }

 private:
  TestFolder folder_;
  bool mounted_ = false;
};

TEST(DiskFaults, AFullRunTimeFolderIsReported) {
  const SmallDisk disk("size=1m,nr_inodes=2");
  if (!disk.is_there()) GTEST_SKIP() << "only root can mount a small disk";
  std::ofstream(disk.path() + "/last_inode") << "x";
  for (const auto& [option, url] :
       {std::pair{"--shm", disk.path() + "/c.sock"}, {"--zmq", "ipc://" + disk.path() + "/c.ipc"}}) {
    const Finished daemon = run({program("clearanced"), "--scene", kScene, option, url});
    EXPECT_EQ(daemon.code, 4) << daemon.err;
    EXPECT_TRUE(contains(daemon.err, "No space left on device")) << daemon.err;
    EXPECT_TRUE(contains(daemon.err, disk.path())) << daemon.err;
  }
}

TEST(DiskFaults, ALogThatCannotBeWrittenStopsNothing) {
  const SmallDisk disk("size=64k");
  if (!disk.is_there()) GTEST_SKIP() << "only root can mount a small disk";
  const Exam exam(kScene, 4);
  const char* before = getenv("TMPDIR");
  const std::string kept = before ? before : "";
  setenv("TMPDIR", disk.path().c_str(), 1);  // receives the daemon's standard error
  Daemon daemon({"--scene", kScene, "--shm", disk.path() + "/c.sock", "--backend", "cpu", "--threads", "1",
                 "--log-level", "trace"});
  before ? setenv("TMPDIR", kept.c_str(), 1) : unsetenv("TMPDIR");
  disk.fill();
  const std::size_t written = daemon.log().size();
  Client client = patient(daemon.url());
  for (int i = 0; i < 100; ++i) {
    const KnownQuery& known = *exam.queries()[static_cast<std::size_t>(i) % exam.queries().size()];
    ASSERT_TRUE(is_right(client.distances(known.query), known));
    Query bad;
    const IdPair no_such_group{5 | kGroupBit, 1};
    bad.pairs = {&no_such_group, 1};
    EXPECT_THROW(client.distances(bad), RequestError);  // would be logged if the disk had space
  }
  kill(daemon.pid(), SIGHUP);
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (stats_of(client)["reloads"] == 0) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(is_right(client.distances(exam.queries()[0]->query), *exam.queries()[0]));
  EXPECT_LE(daemon.log().size(), written + 4096) << "the disk was not full";
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
}

}  // namespace
}  // namespace clearance::faults
