#include "engine/query/certificate.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "engine/query/certificate_text.h"
#include "engine/query/parallel_job.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kMostRows = 100'000;  // a document of some 100 MB
constexpr std::uint64_t kUnitsPerDirection = 8, kUnitsPerProof = 64;
constexpr double kFine = 1e-12;  // rel_tol of a second attempt: far narrower than any float32 interval

[[noreturn]] void refuse(QueryErrorCode code, const std::string& what) {
  throw QueryError(code, "certificate: " + what);
}

// From the nearest of box a towards box b, as long as they are apart; 0 where they are not.
Vec3d between(const Aabb& a, const Aabb& b) {
  Vec3d n{0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const double ahead = b.low[k] - a.high[k], behind = a.low[k] - b.high[k];
    n[k] = ahead > 0 ? ahead : behind > 0 ? -behind : 0;
  }
  return n;
}

// Finds what proves one answer, a pair of pieces at a time, and writes it down.
class RowProver {
 public:
  RowProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
            const PairAnswer& answer, CertificateText& text)
      : a_(scene.bodies()[pair.a]),
        b_(scene.bodies()[pair.b]),
        pose_a_(here[pair.a].pose),
        pose_b_(here[pair.b].pose),
        box_a_(here.box(pair.a)),
        box_b_(here.box(pair.b)),
        slack_(pair_slack(here, pair)),
        limits_(options.limits),
        answer_(answer),
        text_(text) {
    limits_.max_distance = slack_.cut_off(limits_.max_distance);
    limits_.overlap_by = slack_.outer;
    wants_lower_ = answer_.lower > (limits_.signed_distance ? -kInf : 0);
    wants_upper_ = answer_.upper < kInf;
    by_box_ = wants_lower_ && !wants_upper_;
  }

  // Returns true once it is known whether both bounds are proved; false where the slice is over.
  bool advance(WorkMeter& meter) {
    while (!is_over_) {
      by_box_ ? try_box(meter) : try_pieces(meter);
      if (!is_over_ && meter.is_over()) return false;
    }
    return true;
  }
  bool has_proved() const { return proved_; }
  const std::optional<PieceProof>& upper() const { return upper_; }

 private:
  bool covers_lower(double lower) const { return slack_.true_lower(lower) >= answer_.lower; }
  bool covers_upper(double upper) const {
    const double proved = slack_.true_upper(upper);
    return proved <= answer_.upper || (!limits_.signed_distance && answer_.upper == 0 && proved <= 0);
  }

  // To the next pair of pieces. Returns false behind the last.
  bool go_on() {
    if (++j_ < b_.pieces.size()) return true;
    j_ = 0;
    return ++i_ < a_.pieces.size();
  }
  void end(bool proved) {
    proved_ = proved;
    is_over_ = true;
  }

  // One direction between the bodies' boxes for all their pieces: whether it does for these two.
  void try_box(WorkMeter& meter) {
    meter.count(kUnitsPerDirection + WorkMeter::units_of(*a_.pieces[i_], *b_.pieces[j_]));
    const Vec3d n = between(box_a_, box_b_);
    NarrowProof proof;
    if (!covers_lower(lower_along(*a_.pieces[i_], pose_a_, *b_.pieces[j_], pose_b_, n, proof))) {
      by_box_ = false;
      i_ = j_ = 0;
    } else if (!go_on()) {
      text_.add_lower({kNone, kNone, proof});
      end(true);
    }
  }

  void try_pieces(WorkMeter& meter) {
    meter.count(kUnitsPerProof + WorkMeter::units_of(*a_.pieces[i_], *b_.pieces[j_]));
    const bool is_nearest = wants_upper_ && i_ == answer_.piece_a && j_ == answer_.piece_b;
    if ((wants_lower_ || is_nearest) && !prove_pieces(i_, j_, wants_lower_, is_nearest))
      end(false);
    else if (!go_on())
      end(!wants_upper_ || upper_.has_value());
  }

  // Attempts as dear as they need to be: what proves the answer is mostly what has made it.
  bool prove_pieces(std::uint32_t i, std::uint32_t j, bool wants_lower, bool wants_upper) {
    const Piece &p = *a_.pieces[i], &q = *b_.pieces[j];
    NarrowProof proof;
    if (wants_lower && !wants_upper) {
      const Vec3d n = between(certify_box(p, pose_a_.R_wb, pose_a_.t_w), certify_box(q, pose_b_.R_wb, pose_b_.t_w));
      if (covers_lower(lower_along(p, pose_a_, q, pose_b_, n, proof))) {
        text_.add_lower({i, j, proof});
        return true;
      }
    }
    for (const NarrowLimits& limits : attempts(wants_upper)) {
      const NarrowAnswer found = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, proof);
      if (wants_lower && covers_lower(found.bounds.lower)) {
        text_.add_lower({i, j, proof});
        wants_lower = false;
      }
      if (wants_upper && covers_upper(found.bounds.upper)) {
        upper_ = PieceProof{i, j, proof};
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
  CertificateText& text_;
  bool wants_lower_, wants_upper_, by_box_;
  std::uint32_t i_ = 0, j_ = 0;  // the pieces whose turn it is
  std::optional<PieceProof> upper_;
  bool is_over_ = false, proved_ = false;
};

class CertificateJob final : public ParallelJob {
 public:
  CertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows)
      : ParallelJob(context, std::move(plan), {}, false),
        rows_(rows),
        count_(rows.numbers ? rows.numbers->size() : plan_.size.rows),
        evaluator_(scene(), with_pieces()),
        text_(scene(), rows.most_bytes) {
    text_.begin(info, plan_.query);
  }

  bool go_on(WorkMeter& slice) override {
    for (; next_ < count_; ++next_) {
      if (!go_on_with(rows_.numbers ? (*rows_.numbers)[next_] : next_, slice)) return false;
      step_ = Step::kBegin;
      slice.count(kUnitsPerRow);
      if (slice.is_over()) {
        ++next_;
        return false;
      }
    }
    return text_.end(slice);
  }

  std::vector<std::byte> take() { return text_.take(); }

 private:
  static constexpr std::uint64_t kUnitsPerRow = 64;
  enum class Step { kBegin, kAnswer, kProve };

  const EvaluateOptions& with_pieces() {
    options_.want_points = true;  // which pieces are the nearest
    return options_;
  }

  // Returns true once the row is written; false where the slice is over.
  bool go_on_with(std::uint64_t row, WorkMeter& slice) {
    const std::uint64_t k = row / plan_.size.pairs;
    if (step_ == Step::kBegin) {
      const BodyPair pair = plan_.pairs.at(row % plan_.size.pairs);
      refuse_surfaces(pair);
      here_ = &placement(0, k);
      asked_ = {pair, here_, plan_.query.max_distance};
      answer_ = {};
      evaluator_.begin({&asked_, 1}, {&answer_, 1});
      step_ = Step::kAnswer;
    }
    if (step_ == Step::kAnswer) {
      if (!evaluator_.advance(slice)) return false;
      text_.begin_row(row, k, asked_.pair, answer_);
      if (is_unusable(scene(), *here_, asked_.pair)) {
        text_.end_row(true);
        return true;
      }
      begin_proof();
      step_ = Step::kProve;
    }
    if (!prover_->advance(slice)) return false;
    text_.end_span(prover_->upper());
    text_.end_row(prover_->has_proved());
    return true;
  }

  void begin_proof() {
    const BodyPair pair = asked_.pair;
    const Placement& here = *here_;
    for (const std::uint32_t body : {pair.a, pair.b}) refuse_half_spaces(scene().bodies()[body]);
    SpanPlace place;
    place.X_wa = here[pair.a].pose.X_wb;
    place.X_wb = here[pair.b].pose.X_wb;
    place.slack = pair_slack(here, pair);
    place.composed_a = is_composed_at(here, pair.a);
    place.composed_b = is_composed_at(here, pair.b);
    place.follows_a = followed_by(pair.a);
    place.follows_b = followed_by(pair.b);
    if (!plan_.doubts.empty()) take_parts(here.doubt(pair.a), here.doubt(pair.b), place);
    text_.begin_span(pair, place);
    prover_.emplace(scene(), options_, here, pair, answer_, text_);
  }

  // Of which only one direction proves anything, which another body's axes hold up to rounding only.
  static void refuse_half_spaces(const Body& body) {
    for (const PiecePtr& piece : body.pieces)
      if (is_half_space(*piece))
        refuse(QueryErrorCode::kNotSupported,
               "of bodies that are bounded, so far, and not of '" + body.name + "' (" + body.source + ")");
  }
  void refuse_surfaces(BodyPair pair) const {
    if (!scene().has_surfaces()) return;
    if (const std::string why = no_convex_truth(scene(), pair); !why.empty())
      refuse(QueryErrorCode::kNotSupported,
             why + ", of whose rows none is certified so far; its hull's are (convexify: hull)");
  }

  static void take_parts(const BodyDoubt& a, const BodyDoubt& b, SpanPlace& place) {
    place.parts_a = a.parts;
    place.parts_b = b.parts;
    const double joints = joints_between(a, b);
    if (joints == kInf) return;
    place.joints = joints;
    for (SlackParts* const parts : {&place.parts_a, &place.parts_b}) parts->parent = 0, parts->placed = parts->step;
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

  const CertificateRows& rows_;
  std::uint64_t count_, next_ = 0;
  Evaluator evaluator_;
  CertificateText text_;
  Step step_ = Step::kBegin;  // of the row whose turn it is
  const Placement* here_ = nullptr;
  PlacedBodies asked_{};
  PairAnswer answer_;
  std::optional<RowProver> prover_;
};

void check_rows(const CertificateRows& rows, const QuerySize& size) {
  CertificateRows::check_count(rows.numbers ? rows.numbers->size() : size.rows);
  for (std::size_t i = 0; rows.numbers && i < rows.numbers->size(); ++i)
    if ((*rows.numbers)[i] >= size.rows)
      refuse(QueryErrorCode::kBadQuery, "rows[" + std::to_string(i) + "]: expected one of " +
                                            std::to_string(size.rows) + " rows, got " +
                                            std::to_string((*rows.numbers)[i]));
}

}  // namespace

void CertificateRows::check_count(std::uint64_t count) {
  if (count > kMostRows)
    refuse(QueryErrorCode::kTooLarge,
           "of at most " + std::to_string(kMostRows) + " rows at a time, got " + std::to_string(count));
}

struct CertificateRun::Impl {
  JobContext context;
  CertificateRows rows;
  Planner planner;
  std::optional<CertificateJob> job;
};

CertificateRun::CertificateRun(const JobContext& context, std::shared_ptr<const PoseSnapshot> snapshot,
                               const QueryView& query, CertificateRows rows, std::uint64_t max_rows) {
  if (query.reduce != Reduce::kNone) refuse(QueryErrorCode::kBadQuery, "only rows of reduce none have one");
  if (query.max_steps > 0) refuse(QueryErrorCode::kNotSupported, "of rows without motions, so far");
  impl_.reset(new Impl{context, std::move(rows), Planner(query, *context.scene, std::move(snapshot), max_rows, true),
                       std::nullopt});
}
CertificateRun::CertificateRun(CertificateRun&&) noexcept = default;
CertificateRun& CertificateRun::operator=(CertificateRun&&) noexcept = default;
CertificateRun::~CertificateRun() = default;

bool CertificateRun::advance(const WorkBudget& budget) {
  const FpEnvironment environment;
  if (!impl_->job) {
    WorkMeter meter(budget);
    const bool is_planned = impl_->planner.advance(meter);
    units_of_this_thread += meter.spent();
    if (!is_planned) return false;
    check_rows(impl_->rows, impl_->planner.plan().size);
    impl_->job.emplace(impl_->context, std::move(impl_->planner.plan()), impl_->rows);
    if (meter.is_over()) return false;
  }
  const std::uint64_t before = impl_->job->units;
  const bool is_whole = impl_->job->advance(budget);
  units_of_this_thread += impl_->job->units - before;
  return is_whole;
}

std::vector<std::byte> CertificateRun::take() {
  return impl_->job->take();
}

}  // namespace clearance
