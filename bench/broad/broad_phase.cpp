#include "bench/broad/broad_phase.h"

#include <omp.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "engine/base/fp_environment.h"
#include "engine/broad/box_columns.h"
#include "engine/broad/box_tree.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

int threads_or_all(int threads) {
  return threads > 0 ? threads : omp_get_num_procs();
}

class BruteForce final : public BroadPhase {
 public:
  explicit BruteForce(int threads) : threads_(threads_or_all(threads)) {}
  std::string_view name() const override { return "brute"; }

  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    constexpr std::size_t kRows = 32;
    const std::size_t n = boxes.size(), units = (n + kRows - 1) / kRows;
    BoxColumns columns;
    columns.assign(boxes);
    std::vector<std::vector<BodyPair>> found(units);
#pragma omp parallel for schedule(dynamic) num_threads(threads_) if (threads_ > 1)
    for (std::size_t u = 0; u < units; ++u) {
      const FpEnvironment environment;
      std::vector<double> gaps(n);
      std::vector<std::uint32_t> near(n);
      for (std::size_t a = u * kRows; a < std::min(n, (u + 1) * kRows); ++a) {
        const std::size_t count = n - a - 1;
        box_gaps(boxes[a], columns.view().from(a + 1), count, gaps.data());
        const std::size_t hits = gaps_within(gaps.data(), count, margin, near.data());
        for (std::size_t i = 0; i < hits; ++i)
          if (gaps[near[i]] < kInf)
            found[u].push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(a + 1 + near[i])});
      }
    }
    for (const auto& pairs : found) out.insert(out.end(), pairs.begin(), pairs.end());
  }

 private:
  int threads_;
};

class Tree final : public BroadPhase {
 public:
  Tree(int threads, bool keep) : threads_(threads_or_all(threads)), keep_(keep) {}
  std::string_view name() const override { return "tree"; }

  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    ids_.resize(boxes.size());
    std::iota(ids_.begin(), ids_.end(), 0u);
    keep_ ? tree_.fit(ids_, boxes) : tree_.build(ids_, boxes);
    constexpr std::uint32_t kBlocks = 16;
    const std::uint32_t units = (tree_.blocks() + kBlocks - 1) / kBlocks;
    std::vector<std::vector<BodyPair>> found(units);
#pragma omp parallel for schedule(dynamic) num_threads(threads_) if (threads_ > 1)
    for (std::uint32_t u = 0; u < units; ++u) {
      const FpEnvironment environment;
      tree_.pairs_within(u * kBlocks, std::min(tree_.blocks(), (u + 1) * kBlocks), margin, found[u]);
    }
    const auto first = static_cast<std::ptrdiff_t>(out.size());
    for (const auto& pairs : found) out.insert(out.end(), pairs.begin(), pairs.end());
    std::sort(out.begin() + first, out.end());
  }

 private:
  int threads_;
  bool keep_;
  mutable std::vector<std::uint32_t> ids_;
  mutable BoxTree tree_;
};

}  // namespace

std::unique_ptr<BroadPhase> make_brute_force_broad_phase(int threads) {
  return std::make_unique<BruteForce>(threads);
}
std::unique_ptr<BroadPhase> make_tree_broad_phase(int threads, bool keep) {
  return std::make_unique<Tree>(threads, keep);
}

}  // namespace clearance
