// The curves of a motion, and of its spans.
#include "engine/decision/motion_decider.h"

namespace clearance {

void MotionDecider::begin_curves() {
  curves_.clear();
  for (std::size_t j = 0; j < start_.size(); ++j) {
    curves_.emplace_back(&start_[j], plan_.query.control_points, start_.size());
    total_ += curves_.back().length();
  }
  in_middle_.assign(1, 1);
  for (std::uint32_t p = 1; p < plan_.query.control_points; ++p) {  // rows of Pascal's triangle, halved
    in_middle_.push_back(0);
    for (std::uint32_t i = p; i > 0; --i) in_middle_[i] = 0.5 * (in_middle_[i] + in_middle_[i - 1]);
    in_middle_[0] *= 0.5;
  }
  given_.append_to(curves_);
  for (const JointCurve& curve : std::span(curves_).subspan(start_.size())) total_ += curve.length();
}

// Cuts the curves into those of the first spans, in order.
void MotionDecider::cut_curves() {
  const std::size_t degree = curves_[0].degree(), each = (degree + 1) * curves_.size();
  curve_points_.resize(each);
  for (std::size_t j = 0; j < curves_.size(); ++j) curves_[j].part(0, 1, &curve_points_[j], curves_.size());
  scratch_.resize(2 * each);
  std::size_t first = 0;  // of the spans so far
  for (std::size_t count = 1; count < spans_.size(); count *= 2) {
    const std::size_t next = first + count * each;
    curve_points_.resize(next + 2 * count * each);
    for (std::size_t i = 0; i < count; ++i) {
      double* const before = &curve_points_[next + 2 * i * each];
      halve_curves(&curve_points_[first + i * each], static_cast<std::uint32_t>(degree), curves_.size(), before,
                   before + each, scratch_.data());
    }
    first = next;
  }
  for (std::size_t i = 0; i < spans_.size(); ++i) spans_[i].curve = first + i * each;
}

// Keeps the control points of the halves of the span that was decided last, for the spans that were added last.
void MotionDecider::keep_halves() {
  static_assert(kLeastSpan >= 2.0 / (1 << CurveSpan::kMostHalvings));
  const std::span<const double> halves = curve_span_.halves();
  next_[next_.size() - 2].curve = curve_points_.size();
  next_.back().curve = curve_points_.size() + halves.size() / 2;
  curve_points_.insert(curve_points_.end(), halves.begin(), halves.end());
}

// Positions of the joints in the middle of a span.
void MotionDecider::take_middle(const Span& span, double* row) const {
  for (std::size_t j = 0; j < start_.size(); ++j) row[j] = 0;
  for (std::size_t i = 0; i < in_middle_.size(); ++i)
    for (std::size_t j = 0; j < start_.size(); ++j)
      row[j] += in_middle_[i] * curve_points_[span.curve + i * curves_.size() + j];
}

// Takes the rates of a span, which are those of a straight motion apart from the bend.
void MotionDecider::take_curves(const Span& span, double half) {
  curve_span_.take(curves_, &curve_points_[span.curve], half);
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& moving : plan_.motions[m].moving()) {
      const JointSpan& joint = curve_span_.joints()[moving.at];
      along_[m][moving.column] = joint.slope;
      changes_.change[m][moving.column] = joint.change;
      changes_.bend[m][moving.column] = joint.bend;
      reach_[moving.at] = joint.change * half;
    }
  given_.take_span(curve_span_.joints(), changes_.given);
  take_rates();
}

}  // namespace clearance
