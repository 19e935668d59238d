// CoverStore: a cover is there once it was made, whole, and only for the body that it covers.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

#include "engine/cover/cover_record.h"
#include "engine/cover/cover_store.h"
#include "engine/hull/primitive.h"
#include "tests/engine/engine_test_util.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using std::chrono::nanoseconds;
using std::chrono::seconds;
constexpr seconds kPatience{600};
using Parts = CoverStore::Parts;

Parts body(std::uint64_t seed, int parts = 1) {
  test::Random random(seed);
  Parts made;
  for (int i = 0; i < parts; ++i) made.push_back(make_convex_part(random.cloud(5, {0.1, 0.1, 0.1}), i * 0.01));
  return made;
}

std::vector<std::byte> bytes_of(const Cover& cover) {
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
  const Parts one = body(1), two = body(2, 2);
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

}  // namespace
}  // namespace clearance
