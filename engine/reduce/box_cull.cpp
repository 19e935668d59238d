#include "engine/reduce/box_cull.h"

#include <algorithm>
#include <cassert>
#include <cstring>

#include "engine/selection/columns.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kSideBySideFrom = 4;  // fewer configurations are compared one by one

}  // namespace

std::span<const double> BoxCull::gaps(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed) {
  assert(!placed.empty());
  gaps_.resize(std::max(gaps_.size(), pairs.size() * placed.size()));
  const std::span<const double> all(gaps_.data(), pairs.size() * placed.size());
  if (!placed[0].moves_any()) {
    gaps_where_they_are(pairs);
  } else if (placed.size() >= kSideBySideFrom) {
    if (const std::uint64_t first = placed[0].number(); first != first_) {  // other configurations have other boxes
      for (const std::uint32_t body : moved_bodies_) moved_at_[body] = kNone;
      moved_bodies_.clear();
      first_ = first;
    }
    gaps_across(pairs, placed);
  } else {
    double* out = gaps_.data();
    for (const BodyPoses& here : placed)
      for (const BodyPair pair : pairs) *out++ = box_gap(scene_, here, pair);
  }
  return all;
}

// Compares runs of pairs (a, b), (a, b + 1), ... by one box and a row of boxes. A whole table and most lists consist of
// such runs.
void BoxCull::gaps_where_they_are(std::span<const BodyPair> pairs) {
  const std::size_t n = boxes_.size();
  for (std::size_t i = 0, end; i < pairs.size(); i = end) {
    const auto [a, b] = pairs[i];
    end = i + 1;
    if (a >= n || b >= n) {
      gaps_[i] = kInf;
      continue;
    }
    const std::size_t most = std::min(pairs.size(), i + (n - b));
    while (end < most && pairs[end].a == a && pairs[end].b - b == end - i) ++end;
    if (end - i == 1)
      gaps_[i] = certify_box_gap(boxes_[a], boxes_[b]);
    else
      box_gaps(boxes_[a], columns_.view().from(b), end - i, gaps_.data() + i);
  }
}

void BoxCull::gaps_across(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed) {
  moved_at_.resize(boxes_.size(), kNone);
  row_.resize(placed.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto [a, b] = pairs[i];
    if (a >= boxes_.size() || b >= boxes_.size()) {
      std::fill(row_.begin(), row_.end(), kInf);
    } else {
      for (const std::uint32_t body : {a, b})  // before taking references, as moved_ may grow
        if (placed[0].moves(body)) side(body, placed);
      const BodyBoxes at_a = side(a, placed), at_b = side(b, placed);
      if (at_a.box && at_b.box)
        std::fill(row_.begin(), row_.end(), certify_box_gap(*at_a.box, *at_b.box));
      else if (at_a.box)
        box_gaps(*at_a.box, at_b.columns, placed.size(), row_.data());
      else if (at_b.box)
        box_gaps(*at_b.box, at_a.columns, placed.size(), row_.data());
      else
        box_gaps(at_a.columns, at_b.columns, placed.size(), row_.data());
    }
    for (std::size_t k = 0; k < placed.size(); ++k) gaps_[k * pairs.size() + i] = row_[k];
  }
}

BoxCull::BodyBoxes BoxCull::side(std::uint32_t body, std::span<const BodyPoses> placed) {
  if (!placed[0].moves(body)) return {&boxes_[body], {}};
  std::uint32_t& at = moved_at_[body];
  if (at == kNone) {
    at = static_cast<std::uint32_t>(moved_bodies_.size());
    moved_bodies_.push_back(body);
    if (at == moved_.size()) moved_.emplace_back();
    moved_[at].resize(placed.size());
    for (std::size_t k = 0; k < placed.size(); ++k) moved_[at].set(k, *placed[k].known_box(body));
  }
  return {nullptr, moved_[at].view()};
}

namespace {

// Column by column, so that each is one stream of stores.
template <class T>
void fill(T* column, std::uint64_t first, std::uint64_t count, const T& value) {
  if (column) std::fill_n(column + first, count, value);
}

}  // namespace

void write_beyond_rows(const ReplyView& reply, std::uint64_t first, std::span<const BodyPair> pairs,
                       std::uint32_t configuration, const double* gaps, const std::uint16_t* flags) {
  const std::uint64_t count = pairs.size();
  const PairAnswer row = beyond_answer(0);
  for (double* const column : {reply.distance, reply.lower})
    if (column) std::memcpy(column + first, gaps, count * sizeof(double));
  fill(reply.upper, first, count, row.upper);
  fill(reply.status, first, count, static_cast<std::uint8_t>(row.status));
  for (std::uint64_t i = 0; reply.bounds && i < count; ++i) {
    reply.bounds[2 * (first + i)] = detail::float_below(gaps[i]);
    reply.bounds[2 * (first + i) + 1] = static_cast<float>(row.upper);
  }
  if (flags && reply.flags) std::memcpy(reply.flags + first, flags, count * sizeof *flags);
  if (!flags) fill(reply.flags, first, count, row.flags);
  for (double* const column : {reply.point_a, reply.point_b, reply.normal})
    fill(column, 3 * first, 3 * count, row.normal.x);
  fill(reply.points32, 6 * first, 6 * count, static_cast<float>(row.normal.x));
  fill(reply.parts, 2 * first, 2 * count, row.part_a);
  if (reply.gradient) {
    double gradient[12];
    detail::write_gradient(gradient, row);
    for (std::uint64_t i = 0; i < count; ++i) std::memcpy(reply.gradient + 12 * (first + i), gradient, sizeof gradient);
  }
  fill(reply.gradient_joints, reply.joints * first, reply.joints * count, row.normal.x);
  fill(reply.hessian_joints, reply.joints * reply.joints * first, reply.joints * reply.joints * count, row.normal.x);
  for (double* const column : {reply.rate, reply.curvature, reply.smooth_radius})
    fill(column, first, count, row.normal.x);
  for (std::uint64_t i = first; reply.rate_bounds && i < first + count; ++i) {
    reply.rate_bounds[2 * i] = -std::numeric_limits<double>::infinity();
    reply.rate_bounds[2 * i + 1] = std::numeric_limits<double>::infinity();
  }
  for (BodyPair* const column : {reply.pair, reply.pair_lower})
    if (column) std::copy(pairs.begin(), pairs.end(), column + first);
  fill(reply.configuration, first, count, configuration);
}

}  // namespace clearance
