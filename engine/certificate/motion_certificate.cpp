#include "engine/certificate/motion_certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "engine/certificate/pair_prover.h"
#include "engine/motion/motion_block.h"
#include "engine/motion/motion_job.h"

namespace clearance {

namespace {

class MotionCertificateJob final : public CertificateJob {
 public:
  MotionCertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows)
      : CertificateJob(context, std::move(plan), rows, true),
        bounds_(scene(), plan_),
        moment_(scene(), plan_, boxes()) {
    set_motion_options(plan_, options_);
    block_.emplace(motion_query_, options_, boxes(), 1);
  }

 private:
  enum class Step { kBegin, kAnswer, kPairs, kWitness, kContact };
  static constexpr double kInf = std::numeric_limits<double>::infinity();
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
    if (step_ == Step::kWitness && !prove_witness(slice)) return false;
    if (!prove_hit(slice)) return false;
    end_row(is_proved_);
    step_ = Step::kBegin;
    return true;
  }

  // Answers a motion once for several successive rows.
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

  // Returns false if the row is complete, because no body has a usable pose.
  bool begin_row(std::uint64_t number, std::uint64_t motion) {
    const PairAnswer& answer = row_->row.answer;
    text_.begin_row(number, motion, row_->row.pair, answer);
    contact_.reset();
    if (wants_contact()) {
      const MotionHit& hit = row_->hit;
      contact_ = {row_->free_until, hit.time, {}, {}};
      if (hit.time < kInf) contact_->pair = plan_.pairs.at(hit.position);
    }
    witness_.reset();
    witness_prover_.reset();
    pair_prover_.reset();
    is_proved_ = true;
    step_ = Step::kPairs;
    // Two half-spaces have infinite bounds as well, but their row does name two bodies.
    if (!std::isinf(answer.lower) || answer.lower > 0 || answer.status == Status::kUnconverged) return true;
    if (contact_) contact_ = {0, kInf, {}, {}};  // a row without an answer claims nothing
    end_row(true);
    step_ = Step::kBegin;
    return false;
  }

  void end_row(bool proved) { text_.end_row(witness_, contact_, proved); }

  bool wants_contact() const { return (plan_.size.fields & kFieldFirstContact) != 0; }

  // Lower bound to prove for a pair: the row's bound or, if the row claims that all pairs are beyond their margins, the
  // pair's margin.
  double lower_of(std::uint64_t position) const {
    const PairAnswer& answer = row_->row.answer;
    const bool beyond = plan_.query.reduce == Reduce::kAny && answer.status == Status::kBeyond;
    if (!beyond) return answer.lower;
    return std::max(answer.lower, above_margin(position));
  }
  double above_margin(std::uint64_t position) const { return std::nextafter(plan_.margins.of(position), kInf); }

  bool prove_pairs(WorkMeter& slice) {
    for (; pair_ < end_; ++pair_) {
      const BodyPair pair = plan_.pairs.at(pair_);
      if (!pair_prover_ && !begin_pair(pair)) continue;
      const auto span_at = [this](const BodyPoses& here, BodyPair of) { return this->span_at(here, of); };
      do {
        if (!pair_prover_->advance(slice, span_at)) return false;
        is_proved_ = is_proved_ && pair_prover_->has_proved();
      } while (begin_free(pair));
      pair_prover_.reset();
      text_.end_pair();
    }
    step_ = Step::kWitness;
    return true;
  }

  // Returns false if the pair needs no proof.
  bool begin_pair(BodyPair pair) {
    moment_.move_to(0.5);
    if (is_unusable(scene(), moment_.placed(), pair)) return false;  // the row's status is incomplete
    const double lower = lower_of(pair_);
    text_.begin_pair(pair, moment_.placed(), plan_.margins.of(pair_), lower);
    // A proof for the whole motion also holds until first contact.
    wants_free_ = contact_ && contact_->free_until > 0 && !(lower > plan_.margins.of(pair_));
    if (lower > 0 && is_proved_) {
      pair_prover_.emplace(scene(), bounds_, options_, moment_, pair_, pair, lower, 1, text_);
      return true;
    }
    if (begin_free(pair)) return true;
    text_.end_pair();
    return false;
  }

  // Continues with the pair until first contact. Returns false if that needs no proof.
  bool begin_free(BodyPair pair) {
    if (!std::exchange(wants_free_, false) || !is_proved_) return false;
    const double lower = above_margin(pair_), until = std::min(contact_->free_until, 1.0);
    text_.begin_free(lower);
    pair_prover_.emplace(scene(), bounds_, options_, moment_, pair_, pair, lower, until, text_);
    return true;
  }

  bool prove_witness(WorkMeter& slice) {
    const PairAnswer& answer = row_->row.answer;
    if (answer.upper < kInf && !prove_upper(row_->row.pair, row_->found, answer, witness_, slice)) return false;
    step_ = Step::kContact;
    return true;
  }

  // Proves that a pair is within its margin at the time of contact.
  bool prove_hit(WorkMeter& slice) {
    const MotionHit& hit = row_->hit;
    if (!contact_ || !(hit.time < kInf)) return true;
    PairAnswer within{};
    within.upper = plan_.margins.of(hit.position);
    within.part_a = hit.part_a;
    within.part_b = hit.part_b;
    return prove_upper(contact_->pair, hit.time, within, contact_->witness, slice);
  }

  // Returns false if the slice ended first.
  // \param answer holds the upper bound and the indices of the parts that attain it
  bool prove_upper(BodyPair pair, double time, const PairAnswer& answer, std::optional<WitnessProof>& found,
                   WorkMeter& slice) {
    if (!witness_prover_) {
      moment_.move_to(time);
      upper_alone_ = answer;
      upper_alone_.lower = -kInf;
      // The points are of the parts, which do not grow. Rounded down.
      const DoubleDouble apart = dd::two_sum(answer.upper, bounds_.growth(pair, moving_, time).least);
      upper_alone_.upper = apart.lo < 0 ? std::nextafter(apart.hi, -kInf) : apart.hi;
      witness_prover_ = make_row_prover(scene(), options_, moment_.placed(), pair, upper_alone_, text_);
    }
    if (!witness_prover_->advance(slice)) return false;
    is_proved_ = is_proved_ && witness_prover_->has_proved();
    if (witness_prover_->upper()) found = witness_at(moment_.placed(), pair, time, *witness_prover_->upper());
    witness_prover_.reset();
    return true;
  }

  MotionBounds bounds_;
  MotionQuery motion_query_{scene(), plan_, bounds_};
  std::optional<MotionBlock> block_;
  MotionMoment moment_;
  MovingBodies moving_;
  std::uint64_t motion_ = kNone64;  // motion whose rows `answered_` holds
  std::vector<MotionRow> answered_;

  Step step_ = Step::kBegin;  // of the current row
  const MotionRow* row_ = nullptr;
  std::uint64_t pair_ = 0, end_ = 0;  // the current pair and the end of its range
  std::optional<PairProver> pair_prover_;
  PairAnswer upper_alone_;
  std::unique_ptr<RowProver> witness_prover_;
  std::optional<WitnessProof> witness_;
  std::optional<FirstContactProof> contact_;  // unset if not requested
  bool wants_free_ = false;                   // the current pair needs a proof until first contact
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
