#include "engine/mesh_distance/decomposed_pair.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/base/slack.h"
#include "engine/bvh/surface.h"
#include "engine/hull/decomposition.h"
#include "engine/hull/primitive.h"

namespace clearance {

namespace {

constexpr std::size_t kMostTests = 4096;  // beyond which triangles are as fast

const Decomposition* decomposition_of(const ConvexPart& part) {
  return part.surface ? part.surface->decomposition() : nullptr;
}

}  // namespace

bool has_decomposition(const Body& body) {
  return std::ranges::any_of(body.parts, [](const ConvexPartPtr& part) { return decomposition_of(*part) != nullptr; });
}

void DecomposedPair::hold(const Body& body, const PoseMatrix& pose, std::vector<Holder>& holders, Aabb& around) {
  holders.clear();
  around = kEmptyBox;
  const auto add = [&](const ConvexPart& part, double inner) {
    holders.push_back({&part, inner, certify_box(part, pose.R_wb, pose.t_w)});
    around = joined(around, grown(holders.back().box, inner));
  };
  for (const ConvexPartPtr& part : body.parts) {
    const Decomposition* decomposition = decomposition_of(*part);
    if (!decomposition) {
      add(*part, 0);  // it contains the mesh whose hull it is
      continue;
    }
    const double inner = sum_above(decomposition->inner, part->radius);  // the decomposition's parts are cores
    for (const ConvexPartPtr& core : decomposition->parts) add(*core, inner);
  }
}

bool DecomposedPair::begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                           double cut_off) {
  if (!(cut_off < std::numeric_limits<double>::infinity()) || is_half_space(*a.parts[0]) ||
      is_half_space(*b.parts[0]) || !(has_decomposition(a) || has_decomposition(b)))
    return false;
  tests_.clear();
  next_ = 0;
  round_ = 4;
  cut_off_ = cut_off;
  lower_ = std::numeric_limits<double>::infinity();
  has_failed_ = false;
  Aabb around_a, around_b;
  hold(a, pose_a, a_, around_a);
  hold(b, pose_b, b_, around_b);
  const auto is_far = [&](const Aabb& box, double inner, const Aabb& around) {
    const double gap = difference_below(certify_box_gap(box, around), inner);
    if (!(gap > cut_off_)) return false;
    lower_ = std::min(lower_, gap);
    return true;
  };
  std::erase_if(a_, [&](const Holder& h) { return is_far(h.box, h.inner, around_b); });
  std::erase_if(b_, [&](const Holder& h) { return is_far(h.box, h.inner, around_a); });
  for (const Holder& h : a_)
    for (const Holder& other : b_) {
      const double inner = sum_above(h.inner, other.inner), gap = certify_box_gap(h.box, other.box);
      if (const double apart = difference_below(gap, inner); apart > cut_off_) {
        lower_ = std::min(lower_, apart);
        continue;
      }
      if (tests_.size() == kMostTests) return false;
      tests_.push_back({h.part, other.part, gap, inner, Slack{inner, 0}.cut_off(cut_off_)});
    }
  std::stable_sort(tests_.begin(), tests_.end(), [](const PartTest& p, const PartTest& q) { return p.gap < q.gap; });
  return true;
}

std::span<const DecomposedPair::PartTest> DecomposedPair::round() const {
  const std::size_t end = has_failed_ ? next_ : std::min(tests_.size(), next_ + round_);
  return std::span(tests_).subspan(next_, end - next_);
}

void DecomposedPair::take(std::size_t i, double lower) {
  assert(next_ + i < tests_.size());
  const double apart = difference_below(lower, tests_[next_ + i].inner);
  if (apart > cut_off_)
    lower_ = std::min(lower_, apart);
  else
    has_failed_ = true;
}

void DecomposedPair::end_round() {
  next_ = std::min(tests_.size(), next_ + round_);
  round_ = std::min(2 * round_, kMostOfRound);
}

}  // namespace clearance
