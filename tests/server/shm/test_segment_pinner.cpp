// Segments that are pinned for a GPU: the pinning thread alone, and through a whole service if there is a GPU.
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstring>
#include <future>
#include <stdexcept>

#include "server/core/loop.h"
#include "server/shm/segment_pinner.h"
#include "server/shm/shm_transport.h"
#include "tests/gpu/skip_without_device.h"
#include "tests/server/shm/shm_echo.h"

namespace clearance {
namespace {

constexpr std::size_t kBytes = 1 << 20;

/// Waits for a condition that another thread will satisfy.
template <class Condition>
bool comes(Condition condition) {
  const auto deadline = soon();
  while (!condition() && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  return condition();
}

std::shared_ptr<Mapping> map_some() {
  void* memory = ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("mmap");
  return std::make_shared<Mapping>(static_cast<std::byte*>(memory), kBytes);
}

bool is_mapped(std::byte* memory) {
  unsigned char page;
  return ::mincore(memory, 4096, &page) == 0;
}

/// Pins nothing, and records the calls.
struct Notes {
  std::atomic<int> pinned{0}, unpinned{0}, unpinned_unmapped{0};
  SegmentPinner::Pin pin() {
    return [this](std::byte* begin, std::size_t) {
      ++pinned;
      return std::shared_ptr<void>(begin, [this](void* memory) {
        unpinned_unmapped += !is_mapped(static_cast<std::byte*>(memory));
        ++unpinned;
      });
    };
  }
};

TEST(SegmentPinner, UnpinsBeforeItUnmaps) {
  Notes notes;
  SegmentPinner pinner(2 * kBytes, notes.pin());
  std::weak_ptr<Mapping> gone;
  {
    std::shared_ptr<Mapping> mapping = map_some();
    gone = mapping;
    SegmentPinner::Ticket* ticket = pinner.pin(mapping);
    ASSERT_TRUE(comes([&] { return pinner.bytes() == kBytes; }));
    mapping.reset();
    EXPECT_FALSE(gone.expired());
    pinner.let_go(ticket);
  }
  EXPECT_TRUE(comes([&] { return gone.expired(); }));
  EXPECT_EQ(notes.pinned, 1);
  EXPECT_EQ(notes.unpinned, 1);
  EXPECT_EQ(notes.unpinned_unmapped, 0);
  EXPECT_EQ(pinner.bytes(), 0u);
  EXPECT_EQ(pinner.rejections(), 0u);
}

TEST(SegmentPinner, PinsNoMoreThanItsBudgetAtATime) {
  Notes notes;
  SegmentPinner pinner(2 * kBytes, notes.pin());
  std::vector<SegmentPinner::Ticket*> tickets;
  for (int i = 0; i < 3; ++i) tickets.push_back(pinner.pin(map_some()));
  EXPECT_TRUE(comes([&] { return pinner.rejections() == 1; }));
  EXPECT_EQ(pinner.bytes(), 2 * kBytes);
  pinner.let_go(tickets[0]);
  EXPECT_TRUE(comes([&] { return pinner.bytes() == kBytes; }));
  tickets.push_back(pinner.pin(map_some()));
  EXPECT_TRUE(comes([&] { return pinner.bytes() == 2 * kBytes; }));
  for (std::size_t i = 1; i < tickets.size(); ++i) pinner.let_go(tickets[i]);
  EXPECT_TRUE(comes([&] { return notes.unpinned == 3; }));
  EXPECT_EQ(notes.pinned, 3);
}

TEST(SegmentPinner, LeavesAMappingAsItIsThatCannotBePinned) {
  SegmentPinner pinner(kBytes,
                       [](std::byte*, std::size_t) -> std::shared_ptr<void> { throw std::runtime_error("no"); });
  SegmentPinner::Ticket* ticket = pinner.pin(map_some());
  EXPECT_TRUE(comes([&] { return pinner.rejections() == 1; }));
  EXPECT_EQ(pinner.bytes(), 0u);
  pinner.let_go(ticket);
}

TEST(SegmentPinner, HasUnpinnedAllAtItsEnd) {
  Notes notes;
  {
    SegmentPinner pinner(100 * kBytes, notes.pin());
    for (int i = 0; i < 10; ++i) pinner.let_go(pinner.pin(map_some()));  // some before they are pinned
  }
  EXPECT_EQ(notes.pinned, notes.unpinned);
  EXPECT_EQ(notes.unpinned_unmapped, 0);
}

/// A loop over an engine, on its own thread, with a shared-memory endpoint.
class Service {
 public:
  Service(const std::string& path, engine::Scene scene, const std::string& backend, std::uint64_t pinned_bytes)
      : engine_(std::move(scene), {backend}), loop_(engine_) {
    ShmLimits limits;
    limits.pinned_bytes = pinned_bytes;
    loop_.add(make_shm_transport(path, limits));
    thread_ = std::thread([this] { loop_.run(); });
  }
  ~Service() {
    loop_.stop();
    thread_.join();
  }

 private:
  engine::Engine engine_;
  Loop loop_;
  std::thread thread_;
};

engine::Scene spheres(int count) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> box(-30, 30);
  engine::Scene scene;
  for (int i = 0; i < count; ++i) {
    engine::Scene::BodyOptions options;
    options.pose = {{box(random), box(random), box(random)}};
    scene.add_uv_sphere("s" + std::to_string(i), 2, 6, options);
  }
  return scene;
}

std::uint64_t counter(Client& client, const std::string& name) {
  for (const auto& [key, value] : client.stats())
    if (key == name) return value;
  ADD_FAILURE() << "no counter " << name;
  return 0;
}

std::vector<float> points_of(const Result& reply) {
  const auto points = reply.points32();
  return {points.begin(), points.end()};
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
}

TEST(PinnedService, HasTheDeviceWriteIntoTheClientsMemory) {
  SKIP_WITHOUT_DEVICE();
  const TemporaryFolder folder;
  const std::string path = folder / "c.sock";
  const Service service(path, spheres(600), "cuda", std::uint64_t{1} << 30);
  Client watcher = connect("shm://" + path, 30s);
  {
    Client client = connect("shm://" + path, 30s);
    Query query;
    query.fields = kFieldPoints32;
    const std::vector<float> copied = points_of(client.distances(query));
    ASSERT_EQ(copied.size(), 6 * 600u * 599 / 2);
    const std::uint64_t before = counter(watcher, "cuda.reply_bytes_copied");
    EXPECT_GE(before, copied.size() * sizeof(float));
    // The counter follows at the next tick.
    ASSERT_TRUE(comes([&] { return counter(watcher, "shm.pinned_bytes") > 0; }));
    const std::vector<float> written = points_of(client.distances(query));
    EXPECT_TRUE(same_bits(copied, written));
    const std::uint64_t after = counter(watcher, "cuda.reply_bytes_copied");
    EXPECT_LT(after - before, copied.size() * sizeof(float) / 10) << "columns were still copied";
  }
  EXPECT_TRUE(comes([&] { return counter(watcher, "shm.pinned_bytes") == 0; })) << "the client is gone";
  EXPECT_EQ(counter(watcher, "shm.pin_failures"), 0u);
}

TEST(PinnedService, CopiesWhereNothingMayBePinned) {
  SKIP_WITHOUT_DEVICE();
  const TemporaryFolder folder;
  const std::string path = folder / "c.sock";
  const Service service(path, spheres(200), "cuda", 1 << 20);  // less than the smallest segment
  Client client = connect("shm://" + path, 30s);
  Query query;
  query.fields = kFieldPoints32;
  const std::vector<float> first = points_of(client.distances(query));
  ASSERT_TRUE(comes([&] { return counter(client, "shm.pin_failures") == 1; }));
  EXPECT_TRUE(same_bits(first, points_of(client.distances(query))));
  EXPECT_EQ(counter(client, "shm.pinned_bytes"), 0u);
}

}  // namespace
}  // namespace clearance
