#include "engine/broad/box_tree.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>
#include <numeric>

#include "engine/base/clones.h"
#include "engine/hull/box.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kWorn = 1.5;    // wear from which a new order pays (docs/notes/performance.md)
constexpr double kMostWear = 8;  // limit for one block, so that a few torn blocks do not decide for all

bool empty(const Aabb& box) {
  return !(box.low.x <= box.high.x);
}

double width(const Aabb& box) {
  return empty(box) ? 0 : (box.high.x - box.low.x) + (box.high.y - box.low.y) + (box.high.z - box.low.z);
}

}  // namespace

// Limit on squared gaps before the last rounding of certify_box_gap(): a gap <= margin has a square <= this.
double BoxTree::squared_limit(double margin) {
  return margin * margin * (1 + 0x1p-40) + 1e-300;
}

CLEARANCE_CLONES void BoxTree::squared_gaps(const Block& block, const Aabb& box, Squares& squared) {
  for (std::uint32_t i = 0; i < kWide; ++i) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const double ahead = block.column[k][i] - box.high[k], behind = box.low[k] - block.column[3 + k][i];
      double gap = ahead > 0 ? ahead : 0;
      if (behind > gap) gap = behind;
      sum += gap * gap;
    }
    squared[i] = sum;
  }
}

Aabb BoxTree::box_at(std::uint32_t place) const {
  const Block& b = levels_[0][place / kWide];
  const std::uint32_t i = place % kWide;
  return {{b.column[0][i], b.column[1][i], b.column[2][i]}, {b.column[3][i], b.column[4][i], b.column[5][i]}};
}

Aabb BoxTree::around_all(const Block& b) {
  Aabb box = kEmptyBox;
  for (int k = 0; k < 3; ++k)
    for (std::uint32_t i = 0; i < kWide; ++i) {
      box.low[k] = std::min(box.low[k], b.column[k][i]);
      box.high[k] = std::max(box.high[k], b.column[3 + k][i]);
    }
  return box;
}

void BoxTree::build(std::span<const std::uint32_t> ids, std::span<const Aabb> boxes) {
  ++builds_;
  ids_.assign(ids.begin(), ids.end());
  order_.assign(ids.begin(), ids.end());
  count_ = static_cast<std::uint32_t>(ids.size());
  // Bodies without a pose go last, since they have no neighbours.
  const auto placed =
      std::stable_partition(order_.begin(), order_.end(), [&](std::uint32_t id) { return !empty(boxes[id]); });
  order(0, static_cast<std::uint32_t>(placed - order_.begin()), boxes);
  order_.resize((count_ + kWide - 1) / kWide * kWide, kNone);
  levels_.clear();
  for (std::size_t n = order_.size() / kWide; n > 0; n = n == 1 ? 0 : (n + kWide - 1) / kWide) levels_.emplace_back(n);
  width_built_.clear();
  fit_boxes(boxes);
}

void BoxTree::fit(std::span<const std::uint32_t> ids, std::span<const Aabb> boxes) {
  assert(std::all_of(ids.begin(), ids.end(), [&](std::uint32_t id) { return id < boxes.size(); }));
  if (!std::equal(ids.begin(), ids.end(), ids_.begin(), ids_.end())) return build(ids, boxes);
  fit_boxes(boxes);
  if (worn()) build(ids, boxes);
}

// Halves a range at its middle along its longest side, in whole blocks of the next level below.
void BoxTree::order(std::uint32_t begin, std::uint32_t end, std::span<const Aabb> boxes) {
  const std::uint32_t count = end - begin;
  if (count <= kWide) return;
  const auto centre = [&](std::uint32_t id, int k) { return 0.5 * boxes[id].low[k] + 0.5 * boxes[id].high[k]; };
  Vec3d low{kInf, kInf, kInf}, high{-kInf, -kInf, -kInf};
  for (std::uint32_t i = begin; i < end; ++i)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], centre(order_[i], k));
      high[k] = std::max(high[k], centre(order_[i], k));
    }
  const Vec3d size = high - low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  std::uint64_t block = kWide;
  while (block * kWide < count) block *= kWide;
  const auto whole = static_cast<std::uint32_t>((count + block - 1) / block);
  const std::uint32_t middle = begin + static_cast<std::uint32_t>(block) * (whole / 2);
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t p, std::uint32_t q) { return centre(p, axis) < centre(q, axis); });
  order(begin, middle, boxes);
  order(middle, end, boxes);
}

void BoxTree::fit_boxes(std::span<const Aabb> boxes) {
  const bool anew = width_built_.empty();
  wear_.assign(levels_.size(), 1);
  if (anew)
    for (const auto& level : levels_) width_built_.emplace_back(level.size());
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    double wear = 0;
    for (std::size_t j = 0; j < levels_[l].size(); ++j) {
      Block& block = levels_[l][j];
      Aabb all = kEmptyBox;
      for (std::uint32_t k = 0; k < kWide; ++k) {
        const std::size_t below = j * kWide + k;
        Aabb box = kEmptyBox;
        if (l == 0 && order_[below] != kNone) box = boxes[order_[below]];
        if (l > 0 && below < levels_[l - 1].size()) box = around_all(levels_[l - 1][below]);
        for (int c = 0; c < 3; ++c) {
          block.column[c][k] = box.low[c];
          block.column[3 + c][k] = box.high[c];
        }
        all = joined(all, box);
      }
      const double now = width(all);
      if (anew) width_built_[l][j] = now;
      const double built = width_built_[l][j];
      wear += now <= built ? 1 : (now < kMostWear * built ? now / built : kMostWear);
    }
    wear_[l] = wear / static_cast<double>(levels_[l].size());
  }
}

bool BoxTree::worn() const {
  return std::any_of(wear_.begin(), wear_.end(), [](double w) { return w > kWorn; });
}

std::uint64_t BoxTree::bytes() const {
  std::uint64_t sum = (ids_.capacity() + order_.capacity()) * sizeof(std::uint32_t);
  for (const auto& level : levels_) sum += level.capacity() * (sizeof(Block) + sizeof(double));
  return sum;
}

void BoxTree::pairs_within(std::uint32_t first, std::uint32_t last, double margin, std::vector<BodyPair>& out) const {
  assert(first <= last && last <= blocks());
  if (!(margin >= 0)) return;
  const double limit = squared_limit(margin);
  const auto top = static_cast<std::uint32_t>(levels_.size()) - 1;
  std::vector<Step> waiting;
  Squares squared;
  for (std::uint32_t mine = first; mine < last; ++mine) {
    const Aabb all = around_all(levels_[0][mine]);
    if (empty(all)) continue;
    waiting.assign(1, {top, 0, 0});
    while (!waiting.empty()) {
      const Step at = waiting.back();
      waiting.pop_back();
      const Block& block = levels_[at.level][at.block];
      if (at.level > 0) {
        squared_gaps(block, all, squared);
        // Pairs are found from the earlier of two blocks, so branches that end before this one are skipped.
        const std::uint64_t shift = 3 * (at.level - 1);
        for (std::uint32_t k = 0; k < kWide; ++k) {
          const std::uint32_t below = at.block * kWide + k;
          if (squared[k] <= limit && squared[k] < kInf && (((std::uint64_t{below} + 1) << shift) - 1) >= mine)
            waiting.push_back({at.level - 1, below, 0});
        }
        continue;
      }
      for (std::uint32_t i = 0; i < kWide; ++i) {
        const std::uint32_t place = mine * kWide + i;
        const Aabb box = box_at(place);
        if (empty(box)) continue;
        squared_gaps(block, box, squared);
        for (std::uint32_t k = at.block == mine ? i + 1 : 0; k < kWide; ++k) {
          if (!(squared[k] <= limit && squared[k] < kInf)) continue;
          const std::uint32_t other = at.block * kWide + k;
          if (!(certify_box_gap(box, box_at(other)) <= margin)) continue;
          const auto [a, b] = std::minmax(order_[place], order_[other]);
          out.push_back({a, b});
        }
      }
    }
  }
}

}  // namespace clearance
