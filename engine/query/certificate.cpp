#include "engine/query/certificate.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "engine/query/parallel_job.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostRows = 100'000;  // a document of some 100 MB
constexpr double kFine = 1e-12;             // rel_tol of a second attempt: far narrower than any float32 interval

// From the nearest of box a towards box b, as long as they are apart; 0 where they are not.
Vec3d between(const Aabb& a, const Aabb& b) {
  Vec3d n{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double ahead = b.low[k] - a.high[k], behind = a.low[k] - b.high[k];
    n[k] = ahead > 0 ? ahead : behind > 0 ? -behind : 0;
  }
  return n;
}

// Finds what proves one answer.
class RowProver {
 public:
  RowProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
            const PairAnswer& answer)
      : a_(scene.bodies()[pair.a]),
        b_(scene.bodies()[pair.b]),
        pose_a_(here[pair.a].pose),
        pose_b_(here[pair.b].pose),
        box_a_(here.box(pair.a)),
        box_b_(here.box(pair.b)),
        slack_(pair_slack(here, pair)),
        limits_(options.limits),
        answer_(answer) {
    limits_.max_distance = slack_.cut_off(limits_.max_distance);
    limits_.overlap_by = slack_.outer;
  }

  // Returns whether both bounds are proved.
  bool prove(SpanCertificate& span) const {
    span.slack = slack_;
    const bool wants_lower = answer_.lower > (limits_.signed_distance ? -kInf : 0);
    const bool wants_upper = answer_.upper < kInf;
    if (wants_lower && !wants_upper && prove_by_box(span)) return true;
    for (std::uint32_t i = 0; i < a_.pieces.size(); ++i)
      for (std::uint32_t j = 0; j < b_.pieces.size(); ++j) {
        const bool is_nearest = wants_upper && i == answer_.piece_a && j == answer_.piece_b;
        if ((wants_lower || is_nearest) && !prove_pieces(i, j, wants_lower, is_nearest, span)) return false;
      }
    return !wants_upper || span.upper.has_value();
  }

 private:
  bool covers_lower(double lower) const { return slack_.true_lower(lower) >= answer_.lower; }
  bool covers_upper(double upper) const {
    const double proved = slack_.true_upper(upper);
    return proved <= answer_.upper || (!limits_.signed_distance && answer_.upper == 0 && proved <= 0);
  }

  // One direction between the bodies' boxes for all their pieces.
  bool prove_by_box(SpanCertificate& span) const {
    const Vec3d n = between(box_a_, box_b_);
    NarrowProof proof;
    for (const PiecePtr& p : a_.pieces)
      for (const PiecePtr& q : b_.pieces)
        if (!covers_lower(lower_along(*p, pose_a_, *q, pose_b_, n, proof))) return false;
    span.lower.push_back({kNone, kNone, proof});
    return true;
  }

  // Attempts as dear as they need to be: what proves the answer is mostly what has made it.
  bool prove_pieces(std::uint32_t i, std::uint32_t j, bool wants_lower, bool wants_upper, SpanCertificate& span) const {
    const Piece &p = *a_.pieces[i], &q = *b_.pieces[j];
    NarrowProof proof;
    if (wants_lower && !wants_upper) {
      const Vec3d n = between(certify_box(p, pose_a_.R_wb, pose_a_.t_w), certify_box(q, pose_b_.R_wb, pose_b_.t_w));
      if (covers_lower(lower_along(p, pose_a_, q, pose_b_, n, proof))) {
        span.lower.push_back({i, j, proof});
        return true;
      }
    }
    for (const NarrowLimits& limits : attempts(wants_upper)) {
      const NarrowAnswer found = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, proof);
      if (wants_lower && covers_lower(found.bounds.lower)) {
        span.lower.push_back({i, j, proof});
        wants_lower = false;
      }
      if (wants_upper && covers_upper(found.bounds.upper)) {
        span.upper = PieceProof{i, j, proof};
        wants_upper = false;
      }
      if (!wants_lower && !wants_upper) return true;
    }
    return false;
  }

  std::array<NarrowLimits, 4> attempts(bool is_nearest) const {
    std::array<NarrowLimits, 4> limits;
    limits.fill(limits_);
    // Others than the nearest need only be proved as far as the answer says.
    if (!is_nearest)
      limits[0].max_distance = std::min(limits_.max_distance, slack_.cut_off(std::max(answer_.lower, 0.0)));
    limits[1].max_distance = limits[2].max_distance = limits[3].max_distance = kInf;
    limits[2].abs_tol = limits[3].abs_tol = 0;
    limits[2].rel_tol = std::min(limits_.rel_tol, kFine);
    limits[3].rel_tol = 0;
    return limits;
  }

  const Body &a_, &b_;
  const PlacedPose &pose_a_, &pose_b_;
  Aabb box_a_, box_b_;
  Slack slack_;
  NarrowLimits limits_;
  const PairAnswer& answer_;
};

class CertificateJob final : public ParallelJob {
 public:
  CertificateJob(const JobContext& context, Plan&& plan, std::span<const std::uint64_t> rows)
      : ParallelJob(context, std::move(plan), {}, false), rows_(rows), evaluator_(scene(), with_pieces()) {}

  bool go_on(WorkMeter& slice) override {
    while (proved_.size() < rows_.size()) {
      proved_.push_back(prove(rows_[proved_.size()]));
      slice.count(kUnitsPerRow);
      if (slice.is_over()) break;
    }
    info.rows = info.total = proved_.size();
    return proved_.size() == rows_.size();
  }

  Certificate take() {
    const QueryView& q = plan_.query;
    return {info, q.max_distance, q.abs_tol, q.rel_tol, q.signed_distance, std::move(proved_)};
  }

 private:
  static constexpr std::uint64_t kUnitsPerRow = 256;

  const EvaluateOptions& with_pieces() {
    options_.want_points = true;  // which pieces are the nearest
    return options_;
  }

  RowCertificate prove(std::uint64_t row) {
    const std::uint64_t k = row / plan_.size.pairs;
    const Placement& here = placement(0, k);
    RowCertificate r{row, static_cast<std::uint32_t>(k), plan_.pairs.at(row % plan_.size.pairs), {}, true, {}};
    const PlacedBodies asked{r.pair, &here, plan_.query.max_distance};
    evaluator_.run({&asked, 1}, {&r.answer, 1});
    if (is_unusable(scene(), here, r.pair)) return r;
    for (const std::uint32_t body : {r.pair.a, r.pair.b}) refuse_half_spaces(scene().bodies()[body]);
    SpanCertificate& span = r.spans.emplace_back();
    span.X_wa = here[r.pair.a].pose.X_wb;
    span.X_wb = here[r.pair.b].pose.X_wb;
    span.composed_a = is_composed_at(here, r.pair.a);
    span.composed_b = is_composed_at(here, r.pair.b);
    span.follows_a = followed_by(r.pair.a);
    span.follows_b = followed_by(r.pair.b);
    if (!plan_.doubts.empty()) {
      take_parts(here.doubt(r.pair.a), here.doubt(r.pair.b), span);
    }
    r.proved = RowProver(scene(), options_, here, r.pair, r.answer).prove(span);
    return r;
  }

  // Of which only one direction proves anything, which another body's axes hold up to rounding only.
  static void refuse_half_spaces(const Body& body) {
    for (const PiecePtr& piece : body.pieces)
      if (is_half_space(*piece))
        throw QueryError(
            QueryErrorCode::kNotSupported,
            "certificate: of bodies that are bounded, so far, and not of '" + body.name + "' (" + body.source + ")");
  }

  static void take_parts(const BodyDoubt& a, const BodyDoubt& b, SpanCertificate& span) {
    span.parts_a = a.parts;
    span.parts_b = b.parts;
    const double joints = joints_between(a, b);
    if (joints == kInf) return;
    span.joints = joints;
    for (SlackParts* const parts : {&span.parts_a, &span.parts_b}) parts->parent = 0, parts->placed = parts->step;
  }

  bool is_composed_at(const Placement& here, std::uint32_t body) const {
    const std::uint32_t on = plan_.snapshot->parent[body];
    return on != kNone && is_composed(here[on]);
  }

  std::vector<std::uint32_t> followed_by(std::uint32_t body) const {
    std::vector<std::uint32_t> above;
    for (std::uint32_t on = body; (on = plan_.snapshot->parent[on]) != kNone;) above.push_back(on);
    return above;
  }

  std::span<const std::uint64_t> rows_;
  Evaluator evaluator_;
  std::vector<RowCertificate> proved_;
};

}  // namespace

Certificate certify_rows(const JobContext& context, Plan plan, std::span<const std::uint64_t> rows) {
  const auto refuse = [](QueryErrorCode code, const std::string& what) {
    throw QueryError(code, "certificate: " + what);
  };
  if (plan.query.reduce != Reduce::kNone) refuse(QueryErrorCode::kBadQuery, "only rows of reduce none have one");
  if (plan.query.max_steps > 0) refuse(QueryErrorCode::kNotSupported, "of rows without motions, so far");
  if (rows.size() > kMostRows)
    refuse(QueryErrorCode::kTooLarge,
           "of at most " + std::to_string(kMostRows) + " rows at a time, got " + std::to_string(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i] >= plan.size.rows)
      refuse(QueryErrorCode::kBadQuery, "rows[" + std::to_string(i) + "]: expected one of " +
                                            std::to_string(plan.size.rows) + " rows, got " + std::to_string(rows[i]));
  if (context.scene->has_surfaces())
    for (const std::uint64_t row : rows)
      if (const std::string why = no_convex_truth(*context.scene, plan.pairs.at(row % plan.size.pairs)); !why.empty())
        refuse(QueryErrorCode::kNotSupported,
               why + ", of whose rows none is certified so far; its hull's are (convexify: hull)");
  plan.keep_configurations();
  CertificateJob job(context, std::move(plan), rows);
  while (!job.advance({})) {
  }
  return job.take();
}

}  // namespace clearance
