#include "engine/certificate/row_prover.h"

#include <algorithm>

#include "engine/certificate/surface_prover.h"
#include "engine/hull/primitive.h"

namespace clearance {

namespace {

constexpr std::uint64_t kUnitsPerDirection = 8;
constexpr double kFine = 1e-12;  // rel_tol of a second attempt, much narrower than any float32 interval

// Bodies whose convex parts are exact geometry: one direction for all parts, or one for each pair.
class PartsProver final : public RowProver {
 public:
  PartsProver(const engine::Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
              const PairAnswer& answer, CertificateText& text)
      : RowProver(scene, options, here, pair, answer, text),
        box_a_(here.box(pair.a)),
        box_b_(here.box(pair.b)),
        by_box_(wants_lower_ && !wants_upper_) {}

 private:
  bool step(WorkMeter& meter) override;
  bool go_on();
  void try_box(WorkMeter& meter);
  void try_parts(WorkMeter& meter);
  bool prove_parts(std::uint32_t i, std::uint32_t j, bool wants_lower, bool wants_upper);

  Aabb box_a_, box_b_;
  bool by_box_;
  std::uint32_t i_ = 0, j_ = 0;  // the current pair of parts
};

}  // namespace

Vec3d between(const Aabb& a, const Aabb& b) {
  Vec3d n{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double ahead = b.low[k] - a.high[k], behind = a.low[k] - b.high[k];
    n[k] = ahead > 0 ? ahead : behind > 0 ? -behind : 0;
  }
  return n;
}

std::array<NarrowLimits, 4> proof_attempts(const NarrowLimits& requested) {
  std::array<NarrowLimits, 4> limits;
  limits.fill(requested);
  limits[1].max_distance = limits[2].max_distance = limits[3].max_distance = std::numeric_limits<double>::infinity();
  limits[2].abs_tol = limits[3].abs_tol = 0;
  limits[2].rel_tol = std::min(requested.rel_tol, kFine);
  limits[3].rel_tol = 0;
  return limits;
}

RowProver::RowProver(const engine::Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
                     const PairAnswer& answer, CertificateText& text)
    : a_(scene.bodies()[pair.a]),
      b_(scene.bodies()[pair.b]),
      pose_a_(here[pair.a].pose),
      pose_b_(here[pair.b].pose),
      slack_(pair_slack(here, pair)),
      limits_(options.limits),
      answer_(answer),
      text_(text) {
  limits_.max_distance = slack_.cut_off(limits_.max_distance);
  limits_.min_penetration = slack_.outer;
  wants_lower_ = answer_.lower > (limits_.signed_distance ? -kInf : 0);
  wants_upper_ = answer_.upper < kInf;
  has_plane_ = wants_lower_ && (is_half_space(*a_.parts[0]) || is_half_space(*b_.parts[0]));
}

bool RowProver::advance(WorkMeter& meter) {
  while (!is_over_)
    if (!step(meter) || (!is_over_ && meter.is_over())) return false;
  return true;
}

bool RowProver::covers_upper(double upper) const {
  const double proved = slack_.true_upper(upper);
  return proved <= answer_.upper || (!limits_.signed_distance && answer_.upper == 0 && proved <= 0);
}

void RowProver::end(bool proved) {
  proved_ = proved;
  is_over_ = true;
}

void RowProver::try_plane(WorkMeter& meter) {
  const bool is_a = is_half_space(*a_.parts[0]);
  const Body& other = is_a ? b_ : a_;
  const ConvexPart &p = *a_.parts[is_a ? 0 : above_], &q = *b_.parts[is_a ? above_ : 0];
  meter.count(kUnitsPerDirection + WorkMeter::units_of(p, q));
  PartProof all{kNone, kNone, {}};
  has_plane_ = covers_lower(plane_proved(p, pose_a_, q, pose_b_, all.proof).lower);
  if (!has_plane_ || ++above_ < other.parts.size()) return;
  text_.add_lower(all);
  has_plane_ = wants_lower_ = false;
}

bool RowProver::prove(const ConvexPart& p, const ConvexPart& q, PartProof found, bool wants_lower, bool wants_upper) {
  std::array<NarrowLimits, 4> attempts = proof_attempts(limits_);
  // Only the nearest pair needs the exact distance; others are proved only as far as the answer claims.
  if (!wants_upper)
    attempts[0].max_distance = std::min(limits_.max_distance, slack_.cut_off(std::max(answer_.lower, 0.0)));
  for (const NarrowLimits& limits : attempts) {
    const NarrowAnswer answer = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, found.proof);
    if (wants_lower && covers_lower(answer.bounds.lower)) {
      text_.add_lower(found);
      wants_lower = false;
    }
    if (wants_upper && covers_upper(answer.bounds.upper)) {
      upper_ = found;
      wants_upper = false;
    }
    if (!wants_lower && !wants_upper) return true;
  }
  return false;
}

std::unique_ptr<RowProver> make_row_prover(const engine::Scene& scene, const EvaluateOptions& options,
                                           const BodyPoses& here, BodyPair pair, const PairAnswer& answer,
                                           CertificateText& text) {
  if (surface_of(scene.bodies()[pair.a]) || surface_of(scene.bodies()[pair.b]))
    return std::make_unique<SurfaceProver>(scene, options, here, pair, answer, text);
  return std::make_unique<PartsProver>(scene, options, here, pair, answer, text);
}

namespace {

bool PartsProver::step(WorkMeter& meter) {
  if (has_plane())
    try_plane(meter);
  else
    by_box_&& wants_lower_ ? try_box(meter) : try_parts(meter);
  return true;
}

// Advances to the next pair of parts. Returns false after the last.
bool PartsProver::go_on() {
  if (++j_ < b_.parts.size()) return true;
  j_ = 0;
  return ++i_ < a_.parts.size();
}

// Tests whether the direction between the bodies' boxes, one for all parts, suffices for the current pair.
void PartsProver::try_box(WorkMeter& meter) {
  meter.count(kUnitsPerDirection + WorkMeter::units_of(*a_.parts[i_], *b_.parts[j_]));
  const Vec3d n = between(box_a_, box_b_);
  PartProof all{kNone, kNone, {}};
  if (!covers_lower(lower_along(*a_.parts[i_], pose_a_, *b_.parts[j_], pose_b_, n, all.proof))) {
    by_box_ = false;
    i_ = j_ = 0;
  } else if (!go_on()) {
    text_.add_lower(all);
    end(true);
  }
}

void PartsProver::try_parts(WorkMeter& meter) {
  meter.count(kUnitsPerProof + WorkMeter::units_of(*a_.parts[i_], *b_.parts[j_]));
  const bool is_nearest = wants_upper_ && i_ == answer_.part_a && j_ == answer_.part_b;
  if ((wants_lower_ || is_nearest) && !prove_parts(i_, j_, wants_lower_, is_nearest))
    end(false);
  else if (!go_on())
    end(!wants_upper_ || upper_.has_value());
}

bool PartsProver::prove_parts(std::uint32_t i, std::uint32_t j, bool wants_lower, bool wants_upper) {
  const ConvexPart &p = *a_.parts[i], &q = *b_.parts[j];
  PartProof found{i, j, {}};
  if (wants_lower && !wants_upper) {
    const Vec3d n = between(certify_box(p, pose_a_.R_wb, pose_a_.t_w), certify_box(q, pose_b_.R_wb, pose_b_.t_w));
    if (covers_lower(lower_along(p, pose_a_, q, pose_b_, n, found.proof))) {
      text_.add_lower(found);
      return true;
    }
  }
  return prove(p, q, std::move(found), wants_lower, wants_upper);
}

}  // namespace

}  // namespace clearance
