// CoverStore: a cover is there once it was made, whole, and only for the body that it covers.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "engine/cover/cover_record.h"
#include "engine/cover/cover_store.h"
#include "engine/hull/primitive.h"
#include "tests/engine/engine_test_util.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

constexpr std::chrono::minutes kPatience{10};
using Bytes = std::vector<std::byte>;
using Parts = CoverStore::Parts;

/// Spheres, whose covers take little time.
Parts body(std::uint64_t seed, int parts = 1) {
  test::Random random(seed);
  Parts made;
  for (int i = 0; i < parts; ++i) made.push_back(make_convex_part(random.cloud(1, {0.1, 0.1, 0.1}), 0.1 + i * 0.01));
  return made;
}
/// A hull, whose cover has all levels.
Parts hull(std::uint64_t seed) {
  return {make_convex_part(test::Random(seed).cloud(5, {0.1, 0.1, 0.1}))};
}

Bytes bytes_of(const Cover& cover) {
  return cover_record({cover, 0});
}

class CoverStoreTest : public testing::Test {
 protected:
  void SetUp() override { ::setenv("CLEARANCE_CACHE", "off", 1); }
  void use_cache() { ::setenv("CLEARANCE_CACHE", path_.c_str(), 1); }

  TemporaryFolder folder_;
  const std::string path_ = folder_ / "cache";
};

TEST_F(CoverStoreTest, FindsACoverOnceItIsMade) {
  CoverStore store;
  const Parts one = hull(1), two = body(2, 2);
  EXPECT_EQ(store.find(one), nullptr);
  store.request({one, two, one});
  EXPECT_EQ(store.progress().pending + store.progress().made, 2);
  ASSERT_TRUE(store.wait(kPatience));
  ASSERT_TRUE(store.find(one) && store.find(two));
  EXPECT_EQ(bytes_of(*store.find(two)), bytes_of(*make_cover(two)));
  EXPECT_NE(bytes_of(*store.find(one)), bytes_of(*store.find(two)));
  const CoverStore::Progress progress = store.progress();
  EXPECT_EQ(progress.made, 2);
  EXPECT_EQ(progress.pending, 0);
  EXPECT_EQ(progress.impossible, 0);
  EXPECT_EQ(progress.bytes, store.find(one)->resident_bytes() + store.find(two)->resident_bytes());
  EXPECT_GT(progress.seconds, 0);
  EXPECT_EQ(store.revision(), 2);
}

TEST_F(CoverStoreTest, BodiesOfEqualPartsShareACover) {
  CoverStore store;
  store.request({body(1, 2)});
  ASSERT_TRUE(store.wait(kPatience));
  const Parts again = body(1, 2);
  store.request({again});
  EXPECT_EQ(store.progress().pending, 0);
  const auto cover = store.find(again);
  ASSERT_TRUE(cover);
  EXPECT_EQ(cover, store.find(body(1, 2)));
  EXPECT_EQ(store.find({again.data(), 1}), nullptr);
  EXPECT_EQ(store.find(Parts{again[1], again[0]}), nullptr);
  // The digest alone does not identify a part.
  const Parts other{make_convex_part(body(3)[0]->vertices, 0, 0, again[0]->digest), again[1]};
  EXPECT_EQ(store.find(other), nullptr);
  store.request({other});
  EXPECT_EQ(store.progress().pending, 1);
}

TEST_F(CoverStoreTest, SkipsBodiesThatCanHaveNone) {
  CoverStore store;
  store.request(
      {Parts{}, Parts{make_primitive_part({Primitive::Kind::kHalfSpace})}, Parts(kMostCoveredParts + 1, body(1)[0])});
  EXPECT_EQ(store.progress().pending, 0);
  EXPECT_TRUE(store.wait(std::chrono::nanoseconds(0)));
}

TEST_F(CoverStoreTest, AFullStoreMakesNoMore) {
  CoverStore store(1);
  store.request({body(1)});
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(store.find(body(1)), nullptr);
  EXPECT_EQ(store.progress().impossible, 1);
  EXPECT_EQ(store.progress().bytes, 0);
  EXPECT_EQ(store.revision(), 0);
}

TEST_F(CoverStoreTest, DropsCoversWhoseOwnersAreGone) {
  CoverStore store;
  auto first = std::make_shared<int>(), second = std::make_shared<int>();
  store.request({body(1), body(2)}, first);
  store.request({body(2)}, second);
  store.request({body(3)});  // for ever
  ASSERT_TRUE(store.wait(kPatience));
  const std::uint64_t bytes = store.progress().bytes, revision = store.revision();
  first.reset();
  store.request({}, second);
  EXPECT_EQ(store.find(body(1)), nullptr);
  EXPECT_TRUE(store.find(body(2)) && store.find(body(3)));
  EXPECT_EQ(store.progress().made, 2);
  EXPECT_LT(store.progress().bytes, bytes);
  EXPECT_EQ(store.revision(), revision) << "never decreases";
}

TEST_F(CoverStoreTest, DropsPendingCoversWhoseOwnersAreGone) {
  CoverStore store;
  {
    const auto owner = std::make_shared<int>();
    std::vector<Parts> bodies;
    for (int i = 0; i < 2000; ++i) bodies.push_back(hull(i));
    store.request(bodies, owner);
  }
  store.request({body(1)});
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_LE(store.progress().made, 4) << "those at work";
  EXPECT_TRUE(store.find(body(1)));
}

TEST_F(CoverStoreTest, DoesNotGrowAsShapesComeAndGo) {
  CoverStore store;
  std::shared_ptr<int> now, before;
  for (int i = 0; i < 300; ++i) {
    before = std::exchange(now, std::make_shared<int>());
    store.request({body(1), body(i + 2)}, now);
    ASSERT_TRUE(store.wait(kPatience));
    ASSERT_LE(store.progress().made, 4);
  }
  EXPECT_EQ(store.revision(), 301);
}

TEST_F(CoverStoreTest, ThreadsRequestAndFindAtOnce) {
  constexpr int kThreads = 4, kBodies = 40;
  CoverStore store;
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < kBodies; ++i) store.request({body((t + i) % kBodies)});
      const std::uint64_t before = store.revision();
      wrong += !store.wait(kPatience) || store.revision() < before;
      for (int i = 0; i < kBodies; ++i) wrong += store.find(body(i)) == nullptr;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(store.progress().made, kBodies);
}

TEST_F(CoverStoreTest, TheThreadMakesCoversByItself) {
  CoverStore store;
  store.request({body(1)});
  while (store.revision() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(store.find(body(1)));
  store.request({body(2)});  // after the thread has ended
  while (store.revision() == 1) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_TRUE(store.find(body(2)));
}

TEST_F(CoverStoreTest, EndsWhileCoversArePending) {
  std::vector<Parts> bodies;
  for (int i = 0; i < 2000; ++i) bodies.push_back(hull(i));  // minutes of work
  auto store = std::make_unique<CoverStore>();
  store->request(bodies);
  ASSERT_FALSE(store->wait(std::chrono::milliseconds(1)));
  EXPECT_GT(store->progress().pending, 1900);
  store.reset();
}

TEST_F(CoverStoreTest, AChildCanDestroyItAndMakeAnother) {
  auto store = std::make_unique<CoverStore>();
  store->request({body(1), hull(2), hull(3)});
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(600);
    store.reset();
    CoverStore another;
    another.request({body(1)});
    std::exit(another.wait(kPatience) && another.find(body(1)) ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_TRUE(store->wait(kPatience));
}

TEST_F(CoverStoreTest, AProcessEndsWhileCoversArePending) {
  EXPECT_EXIT(
      {
        auto* const store = new CoverStore;  // which nothing destroys
        store->request({body(1), hull(2), hull(3), hull(4), hull(5)});
        while (store->revision() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        std::exit(store->progress().pending > 0 ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

TEST_F(CoverStoreTest, ASecondStoreReadsTheCache) {
  use_cache();
  const Parts one = body(1), two = body(2, 2);
  {
    CoverStore store;
    store.request({one});
    ASSERT_TRUE(store.wait(kPatience));
  }
  const Cache cache(path_);
  const auto kept = read_cover(cache, cover_name(one));
  ASSERT_TRUE(kept);
  EXPECT_GT(kept->seconds, 0);
  // Another body's record in its place shows where the cover is from.
  const auto other = make_cover(two);
  cache.write(cover_name(one), cover_record({*other, 1}));
  CoverStore store;
  store.request({one});
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(bytes_of(*store.find(one)), bytes_of(*other));
}

TEST_F(CoverStoreTest, KeepsNoneInTheCacheThatAreNotForIt) {
  use_cache();
  CoverStore store;
  store.request({body(1)}, {}, false);
  store.request({body(2)});
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_TRUE(store.find(body(1)));
  const Cache cache(path_);
  EXPECT_FALSE(read_cover(cache, cover_name(body(1))));
  EXPECT_TRUE(read_cover(cache, cover_name(body(2))));
}

TEST_F(CoverStoreTest, ADamagedRecordIsMadeAgain) {
  use_cache();
  const Parts one = body(1);
  const Cache cache(path_);
  const Bytes good = bytes_of(*make_cover(one));
  cache.write(cover_name(one), Bytes(good.begin(), good.end() - 4));
  CoverStore store;
  store.request({one});
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(bytes_of(*store.find(one)), good);
  EXPECT_TRUE(read_cover(cache, cover_name(one)));
}

template <class T>
Bytes with(Bytes record, std::size_t at, T value) {
  std::memcpy(record.data() + at, &value, sizeof value);
  return record;
}

TEST_F(CoverStoreTest, RecordsAreChecked) {
  const auto cover = make_cover(hull(1));
  ASSERT_TRUE(cover);
  const Bytes good = cover_record({*cover, 0.5});
  const auto read = cover_of_record(good);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->seconds, 0.5);
  EXPECT_EQ(cover_record(*read), good);

  // The layout: seconds, reach, the root's centre and radii, the levels' first packets; then packets.
  constexpr std::size_t kReach = 8, kRoot = 16, kLevels = 36, kPacket = 56, kOuter = 96, kChildren = 160, kCount = 192;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const Bytes wrong[] = {{},
                         Bytes(good.begin(), good.begin() + 20),
                         Bytes(good.begin(), good.end() - 1),
                         Bytes(good.begin(), good.end() - 196),
                         with(good, 0, -1.0),
                         with(good, kReach, std::numeric_limits<double>::infinity()),
                         with(good, kReach, 0.0),
                         with(good, kRoot, kNan),
                         with(good, kRoot + 12, -1.0f),
                         with(good, kRoot + 16, kNan),
                         with(good, kLevels, 1),
                         with(good, kLevels + 8, 0),
                         with(good, kLevels + 16, 1 << 30),
                         with(good, kPacket, kNan),
                         with(good, kPacket, 1e9f),
                         with(good, kPacket + kOuter, kNan),
                         with(good, kPacket + kOuter, -1.0f),
                         with(good, kPacket + kChildren, 0),
                         with(good, kPacket + kChildren, 1 << 30),
                         with(good, kPacket + kCount, 0),
                         with(good, kPacket + kCount, 9),
                         with(good, good.size() - 4 - 32, 2)};
  for (const Bytes& record : wrong) EXPECT_FALSE(cover_of_record(record)) << "case " << &record - wrong;
}

}  // namespace
}  // namespace clearance
