// Assignment of pairs to a device's kernels: pairs of several convex parts are separate. A fake device leaves all rows
// to the CPU.
#include <algorithm>
#include <cstring>
#include <numeric>

#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kUnheld = 7;  // a body that the device does not hold
const std::vector<std::uint32_t> kMoved{0, 2, 5, 30};

// Data passed to a device.
struct NotedChunks {
  std::vector<std::uint32_t> position;
  std::vector<cuda::ChunkSetup> chunks;
  std::vector<Pose> poses;
};

class NotingDense final : public IdleDense {
 public:
  NotingDense(Fault& fault, NotedChunks& noted) : IdleDense(fault), noted_(noted) {}
  void launch(int slot, const cuda::ChunkSetup& chunk, const ReplyView& direct) override {
    noted_.chunks.push_back(chunk);
    if (chunk.poses) {
      const Pose* const end = chunk.poses + chunk.configurations * kMoved.size();
      chunk.wait_for(cuda::Given::kPoses, end);
      noted_.poses.insert(noted_.poses.end(), chunk.poses, end);
    }
    IdleDense::launch(slot, chunk, direct);
  }

 private:
  NotedChunks& noted_;
};

class NotingDevice final : public IdleDevice {
 public:
  NotingDevice(const engine::Scene& scene, Fault& fault, NotedChunks& noted)
      : IdleDevice(fault), scene_(scene), fault_(fault), noted_(noted) {}
  std::uint32_t hull_of(std::uint32_t body) const override {
    return body == kUnheld ? kNone : scene_.bodies()[body].parts.size() > 1 ? cuda::kSeveral : body % 3;
  }
  using IdleDevice::upload;
  std::shared_ptr<const cuda::ResidentPairs> upload(std::span<const cuda::PairRef> pairs,
                                                    std::span<const std::uint32_t> position,
                                                    std::span<const cuda::Group> tiles) override {
    noted_.position.assign(position.begin(), position.end());
    return IdleDevice::upload(pairs, position, tiles);
  }
  std::shared_ptr<cuda::Workspace> borrow() override { return std::make_shared<NotingDense>(fault_, noted_); }

 private:
  const engine::Scene& scene_;
  Fault& fault_;
  NotedChunks& noted_;
};

TEST(ChunkPlan, PutsPairsOfSeveralPartsBehindTheOthers) {
  const auto scene = [] { return decomposed_scene(50, 3, 1); };
  Random random(2);
  for (const std::uint32_t configurations : {0u, 90u}) {
    Fault fault;
    NotedChunks noted;
    const cuda::FakeDevice fake_device({true, "a stand-in", ""}, [&](const engine::Scene& s, int, std::uint64_t) {
      return std::make_shared<NotingDevice>(s, fault, noted);
    });
    const engine::Engine device(scene(), {"cuda", 2}), cpu(scene(), {"cpu", 2});
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < configurations * kMoved.size(); ++i) poses.push_back(random.pose(3));
    QueryView q;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    if (configurations > 0) q.bodies = kMoved;
    q.configurations = poses;
    // The fake device leaves all rows unresolved, including rows it was not given, so the number of evaluated rows is
    // not compared.
    expect_same(evaluate(device, q), evaluate(cpu, q), std::to_string(configurations) + " configurations", true);

    const std::vector<BodyPair> pairs = device.pairs(q);
    const auto part_pairs = [&](std::uint32_t place) {
      const BodyPair pair = pairs[noted.position[place]];
      return device.scene().bodies()[pair.a].parts.size() * device.scene().bodies()[pair.b].parts.size();
    };
    const auto unheld = static_cast<std::size_t>(
        std::count_if(pairs.begin(), pairs.end(), [](BodyPair p) { return p.a == kUnheld || p.b == kUnheld; }));
    ASSERT_GT(unheld, 0u);
    ASSERT_FALSE(noted.chunks.empty());
    EXPECT_EQ(noted.position.size(), pairs.size() - unheld);
    for (const cuda::ChunkSetup& c : noted.chunks) {
      ASSERT_EQ(c.first_pair, 0u) << "one part";
      EXPECT_GT(c.several.count, 50u);
      EXPECT_EQ(c.ungrouped.first + c.ungrouped.count, c.several.first);
      EXPECT_EQ(c.several.first + c.several.count, noted.position.size());
      EXPECT_EQ(c.several_tiles, (c.several.count * c.configurations + cuda::kTile - 1) / cuda::kTile);
      for (std::uint32_t i = 0; i < c.several.first; ++i) EXPECT_EQ(part_pairs(i), 1u);
      for (std::uint32_t i = c.several.first; i < noted.position.size(); ++i) {
        EXPECT_GT(part_pairs(i), 1u);
        if (i > c.several.first) {
          EXPECT_GE(part_pairs(i), part_pairs(i - 1)) << "side by side are as many piece pairs";
        }
      }
    }
    std::vector<std::uint32_t> sorted = noted.position;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end()) << "each once";
  }
}

TEST(ChunkPlan, MakesFewChunksThatGrow) {
  const auto scene = [] {
    engine::Scene s;
    Random random(3);
    for (int i = 0; i < 800; ++i) s.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(10)});
    return s;
  };
  Fault fault;
  NotedChunks noted;
  const cuda::FakeDevice fake_device({true, "a stand-in", ""}, [&](const engine::Scene& s, int, std::uint64_t) {
    return std::make_shared<NotingDevice>(s, fault, noted);
  });
  const engine::Engine device(scene(), {"cuda", 2}), cpu(scene(), {"cpu", 2});
  expect_same(evaluate(device, {}), evaluate(cpu, {}), "800 bodies", true);
  ASSERT_EQ(noted.chunks.size(), std::size_t{cuda::kChunksUnderWay});
  std::uint64_t rows = 0;
  for (std::size_t i = 0; i < noted.chunks.size(); ++i) {
    const cuda::ChunkSetup& c = noted.chunks[i];
    EXPECT_EQ(c.first_row, rows) << "one after another";
    rows += c.rows();
    EXPECT_NEAR(c.pair_count, static_cast<double>(i + 1) * noted.chunks[0].pair_count, 4 * cuda::kTile);
  }
  EXPECT_EQ(rows, device.pairs({}).size());
}

// Enough for several threads to copy them while chunks are started.
TEST(ChunkPlan, GivesEachChunkItsPosesOnceTheyAreWaitedFor) {
  const auto scene = [] { return mixed_scene(31, 3, 1); };
  Fault fault;
  NotedChunks noted;
  const cuda::FakeDevice fake_device({true, "a stand-in", ""}, [&](const engine::Scene& s, int, std::uint64_t) {
    return std::make_shared<NotingDevice>(s, fault, noted);
  });
  const engine::Engine device(scene(), {"cuda", 4});
  Random random(4);
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < 5000 * kMoved.size(); ++i) poses.push_back(random.pose(3));
  ASSERT_GT(poses.size() * sizeof(Pose), 1u << 20);
  const std::vector<BodyPair> pairs{{0, 1}, {2, 5}, {1, 3}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = kMoved;
  q.configurations = poses;
  q.configuration_count = 5000;
  for (int round = 0; round < 5; ++round) {
    noted.poses.clear();
    evaluate(device, q);
    ASSERT_EQ(noted.poses.size(), poses.size());
    EXPECT_EQ(std::memcmp(noted.poses.data(), poses.data(), poses.size() * sizeof(Pose)), 0);
  }
}

}  // namespace
}  // namespace clearance::test
