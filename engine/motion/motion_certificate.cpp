#include "engine/motion/motion_certificate.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/motion/motion_block.h"
#include "engine/motion/motion_job.h"
#include "engine/motion/pair_prover.h"

namespace clearance {

namespace {

class MotionCertificateJob final : public CertificateJob {
 public:
  MotionCertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows)
      : CertificateJob(context, std::move(plan), rows, true),
        bounds_(scene(), plan_),
        moment_(scene(), plan_, boxes()) {
    set_motion_options(plan_, options_);
    block_.emplace(question_, options_, boxes(), 1);
  }

 private:
  enum class Step { kBegin, kAnswer, kPairs, kWitness };
  static constexpr std::uint64_t kNone64 = ~std::uint64_t{0};

  bool go_on_with(std::uint64_t number, WorkMeter& slice) override {
    const bool each = plan_.query.reduce == Reduce::kNone;
    const std::uint64_t motion = each ? number / plan_.size.pairs : number;
    if (step_ == Step::kBegin) begin(motion, slice);
    if (step_ == Step::kAnswer && !answer(motion, slice)) return false;
    if (step_ == Step::kAnswer) {
      row_ = &answered_[each ? number % plan_.size.pairs : 0];
      pair_ = each ? number % plan_.size.pairs : 0;
      end_ = each ? pair_ + 1 : plan_.size.pairs;
      if (!begin_row(number, motion)) return true;
    }
    if (step_ == Step::kPairs && !prove_pairs(slice)) return false;
    if (!prove_witness(slice)) return false;
    text_.end_row(witness_, is_proved_);
    step_ = Step::kBegin;
    return true;
  }

  // Of several rows of one motion, one after another, it is answered once.
  void begin(std::uint64_t motion, WorkMeter& slice) {
    step_ = Step::kAnswer;
    if (motion == motion_) return;
    motion_ = kNone64;
    bounds_.take(motion, moving_);
    moment_.begin(moving_);
    block_->begin(motion, 1, slice);
    answered_.clear();
  }

  bool answer(std::uint64_t motion, WorkMeter& slice) {
    if (motion == motion_) return true;
    if (!block_->advance(slice)) return false;
    block_->end(answered_);
    motion_ = motion;
    return true;
  }

  // Returns false where the row is whole with that: nothing has a usable pose.
  bool begin_row(std::uint64_t number, std::uint64_t motion) {
    const PairAnswer& answer = row_->row.answer;
    text_.begin_row(number, motion, row_->row.pair, answer);
    witness_.reset();
    witness_prover_.reset();
    pair_prover_.reset();
    is_proved_ = true;
    step_ = Step::kPairs;
    if (!std::isinf(answer.lower) || answer.lower > 0) return true;
    text_.end_row(std::nullopt, true);
    step_ = Step::kBegin;
    return false;
  }

  // What is proved of a pair: the row's bound and, where it says that all are beyond their margins, its margin.
  double lower_of(std::uint64_t position) const {
    const PairAnswer& answer = row_->row.answer;
    const bool beyond = plan_.query.reduce == Reduce::kAny && answer.status == Status::kBeyond;
    if (!beyond) return answer.lower;
    return std::max(answer.lower, std::nextafter(plan_.margins.of(position), HUGE_VAL));
  }

  bool prove_pairs(WorkMeter& slice) {
    for (; pair_ < end_; ++pair_) {
      const BodyPair pair = plan_.pairs.at(pair_);
      if (!pair_prover_ && !begin_pair(pair)) continue;
      const auto span_at = [this](const Placement& here, BodyPair of) { return this->span_at(here, of); };
      if (!pair_prover_->advance(slice, span_at)) return false;
      is_proved_ = is_proved_ && pair_prover_->has_proved();
      pair_prover_.reset();
      text_.end_pair();
    }
    step_ = Step::kWitness;
    return true;
  }

  // Returns false where nothing is to be proved of it.
  bool begin_pair(BodyPair pair) {
    moment_.move_to(0.5);
    if (is_unusable(scene(), moment_.placed(), pair)) return false;  // the row says so: it is incomplete
    refuse_surfaces(pair);
    refuse_half_spaces(pair);
    const double lower = lower_of(pair_);
    text_.begin_pair(pair, moment_.placed(), plan_.margins.of(pair_), lower);
    if (lower > 0 && is_proved_) {
      pair_prover_.emplace(scene(), bounds_, options_, moment_, pair_, pair, lower, text_);
      return true;
    }
    text_.end_pair();
    return false;
  }

  bool prove_witness(WorkMeter& slice) {
    const PairAnswer& answer = row_->row.answer;
    if (!(answer.upper < HUGE_VAL)) return true;
    const BodyPair pair = row_->row.pair;
    if (!witness_prover_) {
      moment_.move_to(row_->found);
      upper_alone_ = answer;
      upper_alone_.lower = -HUGE_VAL;
      witness_prover_.emplace(scene(), options_, moment_.placed(), pair, upper_alone_, text_);
    }
    if (!witness_prover_->advance(slice)) return false;
    is_proved_ = is_proved_ && witness_prover_->has_proved();
    if (witness_prover_->upper()) witness_ = witness_at(moment_.placed(), pair, row_->found, *witness_prover_->upper());
    return true;
  }

  MotionBounds bounds_;
  MotionQuestion question_{scene(), plan_, bounds_, options_.stale, options_.want_flags};
  std::optional<MotionBlock> block_;
  MotionMoment moment_;
  MovingBodies moving_;
  std::uint64_t motion_ = kNone64;  // whose rows are answered
  std::vector<MotionRow> answered_;

  Step step_ = Step::kBegin;  // of the row whose turn it is
  const MotionRow* row_ = nullptr;
  std::uint64_t pair_ = 0, end_ = 0;  // the pair whose turn it is
  std::optional<PairProver> pair_prover_;
  PairAnswer upper_alone_;
  std::optional<RowProver> witness_prover_;
  std::optional<WitnessProof> witness_;
  bool is_proved_ = true;
};

}  // namespace

std::unique_ptr<CertificateJob> make_motion_certificate(const JobContext& context, Plan&& plan,
                                                        const CertificateRows& rows) {
  check_motion_pairs(plan);
  plan.keep_configurations();
  return std::make_unique<MotionCertificateJob>(context, std::move(plan), rows);
}

}  // namespace clearance
