#include "engine/certificate/certificate.h"

#include <algorithm>
#include <cassert>

#include "engine/base/fp_environment.h"
#include "engine/certificate/certificate_job.h"
#include "engine/certificate/row_prover.h"

namespace clearance {

namespace {

constexpr std::uint64_t kMostRows = 100'000;  // about 100 MB of document

[[noreturn]] void reject(QueryErrorCode code, const std::string& what) {
  throw engine::QueryError(code, "certificate: " + what);
}

// Rows of `reduce` none without motions.
class RowCertificateJob final : public CertificateJob {
 public:
  RowCertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows)
      : CertificateJob(context, std::move(plan), rows, false), evaluator_(scene(), with_parts()) {}

 private:
  enum class Step { kBegin, kAnswer, kProve };

  // Returns true once the row is written, and false if the slice ended first.
  bool go_on_with(std::uint64_t row, WorkMeter& slice) override {
    const std::uint64_t k = row / plan_.size.pairs;
    if (step_ == Step::kBegin) {
      const BodyPair pair = plan_.pairs.at(row % plan_.size.pairs);
      here_ = &placement(0, k);
      bodies_ = {pair, here_, plan_.query.max_distance};
      answer_ = {};
      evaluator_.begin({&bodies_, 1}, {&answer_, 1});
      step_ = Step::kAnswer;
    }
    const BodyPair pair = bodies_.pair;
    if (step_ == Step::kAnswer) {
      if (!evaluator_.advance(slice)) return false;
      text_.begin_row(row, k, pair, answer_);
      if (is_unusable(scene(), *here_, pair)) {
        text_.end_row(std::nullopt, std::nullopt, true);
        step_ = Step::kBegin;
        return true;
      }
      text_.begin_pair(pair, *here_, 0, answer_.lower);
      text_.begin_span(pair, span_at(*here_, pair));
      prover_ = make_row_prover(scene(), options_, *here_, pair, answer_, text_);
      step_ = Step::kProve;
    }
    if (!prover_->advance(slice)) return false;
    text_.end_span();
    text_.end_pair();
    std::optional<WitnessProof> witness;
    if (prover_->upper()) witness = witness_at(*here_, pair, 0, *prover_->upper());
    text_.end_row(witness, std::nullopt, prover_->has_proved());
    step_ = Step::kBegin;
    return true;
  }

  Evaluator evaluator_;
  Step step_ = Step::kBegin;  // of the current row
  const BodyPoses* here_ = nullptr;
  PlacedBodies bodies_{};
  PairAnswer answer_;
  std::unique_ptr<RowProver> prover_;
};

void check_rows(const CertificateRows& rows, const QuerySize& size) {
  CertificateRows::check_count(rows.numbers ? rows.numbers->size() : size.rows);
  for (std::size_t i = 0; rows.numbers && i < rows.numbers->size(); ++i)
    if ((*rows.numbers)[i] >= size.rows)
      reject(QueryErrorCode::kBadQuery, "rows[" + std::to_string(i) + "]: expected one of " +
                                            std::to_string(size.rows) + " rows, got " +
                                            std::to_string((*rows.numbers)[i]));
}

}  // namespace

void CertificateRows::check_count(std::uint64_t count) {
  if (count <= kMostRows) return;
  std::string text = "of at most " + std::to_string(kMostRows);
  text.append(" rows at a time, got ").append(std::to_string(count));
  reject(QueryErrorCode::kTooLarge, text);
}

struct CertificateRun::Impl {
  JobContext context;
  CertificateRows rows;
  MotionCertifier* certify_motions;
  Planner planner;
  std::unique_ptr<CertificateJob> job;
};

CertificateRun::CertificateRun(const JobContext& context, std::shared_ptr<const PoseSnapshot> snapshot,
                               const QueryView& query, CertificateRows rows, std::uint64_t max_rows,
                               MotionCertifier* certify_motions) {
  if (query.reduce != Reduce::kNone && query.max_evaluations == 0)
    reject(QueryErrorCode::kBadQuery, "only rows of reduce none and motions have one");
  impl_.reset(new Impl{context, std::move(rows), certify_motions,
                       Planner(query, *context.scene, std::move(snapshot), max_rows, true), nullptr});
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
    Plan& plan = impl_->planner.plan();
    if (plan.query.max_evaluations > 0)
      impl_->job = impl_->certify_motions(impl_->context, std::move(plan), impl_->rows);
    else
      impl_->job = std::make_unique<RowCertificateJob>(impl_->context, std::move(plan), impl_->rows);
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
