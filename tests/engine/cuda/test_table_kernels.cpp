// The kernels that find the near pairs of a whole table (engine/cuda/reduce/table_kernel.cuh), compiled for the host:
// their list is compared with the CPU's boxes, and rows must have the CPU's bits. No GPU needed.
#include <map>

#include "engine/state/pair_table.h"
// After all other headers.
#include "tests/engine/cuda/emulated_reduction.h"

#define cuda emulated
#include "engine/cuda/reduce/table_kernel.cuh"
#undef cuda

namespace clearance::test {
namespace {

constexpr std::uint32_t kNowhere = 7;  // a body without a pose

struct Listed {
  std::uint64_t near = 0, far = 0, nowhere = 0;  // table pairs listed, not listed, and of kNowhere
};

// Pairs of a whole table within a distance.
class TableReduction : private HostReduction {
 public:
  /// \param ordered whether bodies are sorted along the curve
  /// \param capacity of the list, which selects how it is sorted
  TableReduction(const engine::Engine& cpu, const QueryView& q, bool ordered, std::uint32_t capacity)
      : HostReduction(cpu, q), table_(*bodies_.plan.snapshot->pairs), ordered_(ordered) {
    const auto n = static_cast<std::uint32_t>(cpu.scene().bodies().size());
    const PairTable::Arrays a = table_.arrays();
    r_.table = {a.is_static.data(), a.movable_before.data(), a.row_begin.data(), a.excluded_begin.data(),
                a.excluded.data()};
    r_.key_bits = static_cast<std::uint32_t>(std::bit_width(n - 1));
    r_.capacity = capacity;
    found_.assign(2 * std::size_t{capacity}, ~std::uint64_t{0});
    r_.found = found_.data();
    r_.keys = found_.data() + capacity;
    hits_.assign(2 * std::size_t{hit_word_count(r_)}, 0x55555555);
    r_.hit_words = hits_.data();
    r_.hit_ranks = capacity <= kFewItems ? nullptr : hits_.data() + hit_word_count(r_);
    tiles_ = {n, (n + kTileBodies - 1) / kTileBodies, bodies_.fixed_box.data(), nullptr, nullptr, nullptr};
  }

  /// Expects the rows of the CPU.
  void compare_rows(const std::string& what, Listed& listed) {
    compare(what, [&] { list(listed); });
  }

 private:
  // Launches as in engine/cuda/reduce/table_search.cuh.
  void list(Listed& listed) {
    if (ordered_) put_bodies_in_order();
    const float limit = square_from_above(q_.max_distance);
    const unsigned share = kSearchWarps * (ordered_ ? kSpan : 1);
    EmulatedGrid::one().launch(
        EmulatedDim{(tiles_.tiles + share - 1) / share, tiles_.tiles, 1}, kSearchWarps * 32,
        [&] { ordered_ ? find_near<true>(r_, tiles_, limit) : find_near<false>(r_, tiles_, limit); });
    ASSERT_LE(counts_[kCandidates], r_.capacity);
    expect_near_pairs(listed);
    if (r_.hit_ranks) {
      std::copy(r_.found, r_.found + r_.capacity, r_.keys);
      std::sort(r_.keys, r_.keys + r_.capacity);
      launch(hit_word_count(r_), kScanThreads, [&] { begin_hits(r_); });
    } else {
      EmulatedGrid::one().launch(hit_word_count(r_), kScanThreads, [&] { order_items(r_); });
      std::vector<std::uint64_t> sorted(r_.found, r_.found + counts_[kCandidates]);
      std::sort(sorted.begin(), sorted.end());
      EXPECT_TRUE(std::equal(sorted.begin(), sorted.end(), r_.keys)) << "in the table's order";
    }
    std::uint32_t bits = 0;
    for (std::uint32_t i = 0; i < hit_word_count(r_); ++i)
      bits += static_cast<std::uint32_t>(std::popcount(r_.hit_words[i]));
    EXPECT_EQ(bits, counts_[kCandidates]) << "each is a hit for the time being";
  }

  void put_bodies_in_order() {
    const std::uint32_t n = tiles_.bodies;
    std::vector<std::uint32_t> bounds(6, ~0u), keys(n), ids(n);
    launch(n, kScanThreads, [&] { bound_bodies(tiles_.given, n, bounds.data()); });
    launch(n, kScanThreads, [&] { place_on_curve(tiles_.given, n, bounds.data(), keys.data(), ids.data()); });
    std::multimap<std::uint32_t, std::uint32_t> sorted;
    for (std::uint32_t i = 0; i < n; ++i) sorted.emplace(keys[i], ids[i]);
    for (const auto& [key, id] : sorted) order_.push_back(id);
    EXPECT_EQ(order_.back(), kNowhere) << "those without a pose come last";
    boxes_.resize(std::size_t{tiles_.tiles} * (kTileBodies + 1));
    tiles_.order = order_.data();
    tiles_.box = boxes_.data();
    tiles_.tile = tiles_.box + std::size_t{tiles_.tiles} * kTileBodies;
    launch(std::size_t{tiles_.tiles} * 32, kSearchWarps * 32, [&] { make_tiles(tiles_); });
  }

  // Expects each pair of the table once if its boxes may be near enough, and no other pair.
  void expect_near_pairs(Listed& listed) {
    std::map<std::uint64_t, int> times;
    for (std::uint32_t i = 0; i < counts_[kCandidates]; ++i) ++times[r_.found[i]];
    const std::vector<Aabb> boxes = boxes_of_bodies();
    for (std::uint32_t b = 1; b < tiles_.bodies; ++b)
      for (std::uint32_t a = 0; a < b; ++a) {
        const auto at = times.find(std::uint64_t{a} << r_.key_bits | b);
        const int seen = at == times.end() ? 0 : at->second;
        if (at != times.end()) times.erase(at);
        const bool enabled = table_.enabled(a, b);
        EXPECT_LE(seen, enabled) << a << ' ' << b;
        if (!enabled) continue;
        (seen ? listed.near : listed.far) += 1;
        listed.nowhere += seen && (a == kNowhere || b == kNowhere);
        const double gap = a == kNowhere || b == kNowhere ? 0 : certify_box_gap(boxes[a], boxes[b]);
        EXPECT_TRUE(seen || gap > q_.max_distance) << a << ' ' << b << " gap " << gap;
        EXPECT_TRUE(!seen || gap <= q_.max_distance * (1 + 1e-4) + 1e-5) << a << ' ' << b << " gap " << gap;
      }
    EXPECT_TRUE(times.empty()) << "pairs that there are not";
  }
  std::vector<Aabb> boxes_of_bodies() const {
    std::vector<Aabb> boxes(tiles_.bodies, kEmptyBox);
    for (std::uint32_t b = 0; b < tiles_.bodies; ++b) {
      if (b == kNowhere) continue;
      const PoseMatrix& X = bodies_.plan.snapshot->placed[b].pose;
      for (const ConvexPartPtr& part : cpu_.scene().bodies()[b].parts)
        boxes[b] = joined(boxes[b], certify_box(*part, X.R_wb, X.t_w));
    }
    return boxes;
  }

  const PairTable& table_;
  const bool ordered_;
  TilesView tiles_{};
  std::vector<std::uint64_t> found_;
  std::vector<std::uint32_t> hits_, order_;
  std::vector<OuterBox> boxes_;
};

TEST(TableKernels, ListThePairsThatAreNear) {
  engine::Scene scene = mixed_scene(150, 3, 11);
  scene.set_requires_pose("body" + std::to_string(kNowhere));
  scene.ignore("body0", "body1");
  for (int i = 20; i < 60; i += 2) scene.ignore("body" + std::to_string(i), "body" + std::to_string(i + 31));
  const engine::Engine cpu(std::move(scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.reduce = Reduce::kWithin;
  q.fields = kAllFields;
  for (const bool ordered : {false, true})
    for (const std::uint32_t capacity : {kFewItems, 2 * kFewItems})
      for (const double distance : {0.0, 0.4, 1.5}) {
        q.max_distance = distance;
        Listed listed;
        TableReduction(cpu, q, ordered, capacity)
            .compare_rows(std::string(ordered ? "ordered" : "by ids") + ", within " + std::to_string(distance), listed);
        EXPECT_GT(listed.near, 300u);
        EXPECT_GT(listed.far, 1000u);
        EXPECT_GT(listed.nowhere, 100u);
      }
}

}  // namespace
}  // namespace clearance::test
