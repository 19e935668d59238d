// How pairs are dealt to a device's kernels: those of several pieces apart from the others. A device that leaves all rows to the CPU
// stands in for a real one.
#include <algorithm>
#include <numeric>

#include "stand_in_device.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kUnheld = 7;  // a body that the device does not hold

// What a device was given.
struct Dealt {
  std::vector<std::uint32_t> position;
  std::vector<cuda::ChunkSetup> chunks;
};

class NotingDense final : public IdleDense {
 public:
  NotingDense(Fault& fault, Dealt& dealt) : IdleDense(fault), dealt_(dealt) {}
  void launch(int slot, const cuda::ChunkSetup& chunk, const ReplyView& direct) override {
    dealt_.chunks.push_back(chunk);
    IdleDense::launch(slot, chunk, direct);
  }

 private:
  Dealt& dealt_;
};

class NotingDevice final : public IdleDevice {
 public:
  NotingDevice(const Scene& scene, Fault& fault, Dealt& dealt) : IdleDevice(fault), scene_(scene), fault_(fault), dealt_(dealt) {}
  std::uint32_t hull_of(std::uint32_t body) const override {
    return body == kUnheld ? kNone : scene_.bodies()[body].pieces.size() > 1 ? cuda::kSeveral : body % 3;
  }
  using IdleDevice::upload;
  std::shared_ptr<const cuda::ResidentPairs> upload(std::span<const cuda::PairRef> pairs, std::span<const std::uint32_t> position,
                                                    std::span<const cuda::Group> tiles) override {
    dealt_.position.assign(position.begin(), position.end());
    return IdleDevice::upload(pairs, position, tiles);
  }
  std::shared_ptr<cuda::Workspace> borrow() override { return std::make_shared<NotingDense>(fault_, dealt_); }

 private:
  const Scene& scene_;
  Fault& fault_;
  Dealt& dealt_;
};

TEST(PairDeal, PutsPairsOfSeveralPiecesBehindTheOthers) {
  const auto scene = [] { return decomposed_scene(50, 3, 1); };
  Random random(2);
  const std::vector<std::uint32_t> bodies{0, 2, 5, 30};
  for (const std::uint32_t configurations : {0u, 90u}) {
    Fault fault;
    Dealt dealt;
    const cuda::DeviceStandIn stand_in({true, "a stand-in", ""}, [&](const Scene& s, int, std::uint64_t) {
      return std::make_shared<NotingDevice>(s, fault, dealt);
    });
    const Engine device(scene(), {"cuda", 2}), cpu(scene(), {"cpu", 2});
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(3));
    QueryView q;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    if (configurations > 0) q.bodies = bodies;
    q.configurations = poses;
    // The stand-in leaves all rows open, also those that it was not given: how many were looked at is not compared.
    expect_same(ask(device, q), ask(cpu, q), std::to_string(configurations) + " configurations", true);

    const std::vector<BodyPair> pairs = device.pairs(q);
    const auto piece_pairs = [&](std::uint32_t place) {
      const BodyPair pair = pairs[dealt.position[place]];
      return device.scene().bodies()[pair.a].pieces.size() * device.scene().bodies()[pair.b].pieces.size();
    };
    const auto unheld = static_cast<std::size_t>(
        std::count_if(pairs.begin(), pairs.end(), [](BodyPair p) { return p.a == kUnheld || p.b == kUnheld; }));
    ASSERT_GT(unheld, 0u);
    ASSERT_FALSE(dealt.chunks.empty());
    EXPECT_EQ(dealt.position.size(), pairs.size() - unheld);
    for (const cuda::ChunkSetup& c : dealt.chunks) {
      ASSERT_EQ(c.first_pair, 0u) << "one part";
      EXPECT_GT(c.several.count, 50u);
      EXPECT_EQ(c.strays.first + c.strays.count, c.several.first);
      EXPECT_EQ(c.several.first + c.several.count, dealt.position.size());
      EXPECT_EQ(c.several_tiles, (c.several.count * c.configurations + cuda::kTile - 1) / cuda::kTile);
      for (std::uint32_t i = 0; i < c.several.first; ++i) EXPECT_EQ(piece_pairs(i), 1u);
      for (std::uint32_t i = c.several.first; i < dealt.position.size(); ++i) {
        EXPECT_GT(piece_pairs(i), 1u);
        if (i > c.several.first) {
          EXPECT_GE(piece_pairs(i), piece_pairs(i - 1)) << "side by side are as many piece pairs";
        }
      }
    }
    std::vector<std::uint32_t> sorted = dealt.position;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end()) << "each once";
  }
}

TEST(PairDeal, BeginsWithAChunkHalfAsLargeAsTheOthers) {
  const auto scene = [] {
    Scene s;
    Random random(3);
    for (int i = 0; i < 800; ++i) s.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(10)});
    return s;
  };
  Fault fault;
  Dealt dealt;
  const cuda::DeviceStandIn stand_in({true, "a stand-in", ""}, [&](const Scene& s, int, std::uint64_t) {
    return std::make_shared<NotingDevice>(s, fault, dealt);
  });
  const Engine device(scene(), {"cuda", 2}), cpu(scene(), {"cpu", 2});
  expect_same(ask(device, {}), ask(cpu, {}), "800 bodies", true);
  ASSERT_GT(dealt.chunks.size(), 2u);
  std::uint64_t rows = 0;
  for (const cuda::ChunkSetup& c : dealt.chunks) {
    EXPECT_EQ(c.first_row, rows) << "one after another";
    rows += c.rows();
    if (&c != &dealt.chunks[0]) {
      EXPECT_NEAR(c.pair_count, dealt.chunks[1].pair_count, 8);
      EXPECT_GT(c.pair_count, 1.5 * dealt.chunks[0].pair_count);
    }
  }
  EXPECT_EQ(rows, device.pairs({}).size());
}

}  // namespace
}  // namespace clearance::test
