#include "engine/state/pair_table.h"

#include <algorithm>
#include <cassert>

namespace clearance {

PairTable::PairTable(const engine::Scene& scene, std::span<const std::uint32_t> parents,
                     std::span<const BodyPair> ignored)
    : bodies_(static_cast<std::uint32_t>(scene.bodies().size())) {
  assert(parents.size() == bodies_);
  for (const Body& body : scene.bodies()) is_static_.push_back(body.is_static);

  std::vector<BodyPair> excluded;
  const auto exclude = [&](std::uint32_t a, std::uint32_t b) {
    if (!(is_static_[a] && is_static_[b])) excluded.push_back({std::min(a, b), std::max(a, b)});
  };
  for (const auto& [a, b] : ignored) exclude(a, b);
  for (std::uint32_t i = 0; i < bodies_; ++i)
    if (parents[i] != kNone) exclude(i, parents[i]);
  for (std::uint32_t i = 0; i < bodies_; ++i)
    if (scene.bodies()[i].parts.empty())  // a frame
      for (std::uint32_t j = 0; j < bodies_; ++j)
        if (j != i) exclude(i, j);
  std::sort(excluded.begin(), excluded.end());
  excluded.erase(std::unique(excluded.begin(), excluded.end()), excluded.end());

  movable_before_.push_back(0);
  for (const std::uint8_t fixed : is_static_) movable_before_.push_back(movable_before_.back() + !fixed);
  row_begin_.push_back(0);
  excluded_begin_.push_back(0);
  std::size_t next = 0;
  for (std::uint32_t i = 0; i < bodies_; ++i) {
    for (; next < excluded.size() && excluded[next].a == i; ++next) excluded_.push_back(excluded[next].b);
    excluded_begin_.push_back(static_cast<std::uint32_t>(excluded_.size()));
    row_begin_.push_back(row_begin_.back() + partners_before(i, bodies_) -
                         (excluded_begin_[i + 1] - excluded_begin_[i]));
  }
}

std::uint32_t PairTable::partners_before(std::uint32_t row, std::uint32_t j) const {
  return is_static_[row] ? movable_before_[j] - movable_before_[row + 1] : j - row - 1;
}

std::uint64_t PairTable::position(BodyPair pair) const {
  assert(pair.a < pair.b && enabled(pair.a, pair.b));
  const auto row = excluded_.begin() + excluded_begin_[pair.a];
  const auto left_out = std::lower_bound(row, excluded_.begin() + excluded_begin_[pair.a + 1], pair.b) - row;
  return row_begin_[pair.a] + partners_before(pair.a, pair.b) - static_cast<std::uint64_t>(left_out);
}

bool PairTable::excluded(std::uint32_t a, std::uint32_t b) const {
  return std::binary_search(excluded_.begin() + excluded_begin_[a], excluded_.begin() + excluded_begin_[a + 1], b);
}

bool PairTable::enabled(std::uint32_t a, std::uint32_t b) const {
  if (a > b) std::swap(a, b);
  return a != b && b < bodies_ && !(is_static_[a] && is_static_[b]) && !excluded(a, b);
}

void PairTable::copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const {
  assert(begin + count <= size());
  if (count == 0) return;
  auto row = static_cast<std::uint32_t>(std::upper_bound(row_begin_.begin(), row_begin_.end(), begin) -
                                        row_begin_.begin() - 1);
  std::uint64_t skip = begin - row_begin_[row];
  for (; count > 0; ++row, skip = 0) {
    auto next_excluded = excluded_.begin() + excluded_begin_[row];
    const auto last_excluded = excluded_.begin() + excluded_begin_[row + 1];
    const bool row_is_static = is_static_[row];
    std::uint32_t j = row + 1;
    if (!row_is_static && next_excluded == last_excluded) {  // no exclusions left in this row
      j += static_cast<std::uint32_t>(skip);
      const std::uint64_t here = std::min<std::uint64_t>(count, bodies_ - j);
      for (std::uint64_t i = 0; i < here; ++i) out[i] = {row, j + static_cast<std::uint32_t>(i)};
      out += here;
      count -= here;
      continue;
    }
    for (; j < bodies_ && count > 0; ++j) {
      if (row_is_static && is_static_[j]) continue;
      if (next_excluded != last_excluded && *next_excluded == j) {
        ++next_excluded;
        continue;
      }
      if (skip > 0) {
        --skip;
        continue;
      }
      *out++ = {row, j};
      --count;
    }
  }
}

}  // namespace clearance
