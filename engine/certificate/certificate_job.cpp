#include "engine/certificate/certificate_job.h"

namespace clearance {

namespace {

constexpr std::uint64_t kUnitsPerRow = 64;

}  // namespace

CertificateJob::CertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows, bool boxes)
    : ParallelJob(context, std::move(plan), {}, boxes),
      rows_(rows),
      count_(rows.numbers ? rows.numbers->size() : plan_.size.rows),
      text_(scene(), plan_, rows.most_bytes) {
  text_.begin(info);
}

bool CertificateJob::go_on(WorkMeter& slice) {
  for (; next_ < count_; ++next_) {
    if (!go_on_with(rows_.numbers ? (*rows_.numbers)[next_] : next_, slice)) return false;
    slice.count(kUnitsPerRow);
    if (slice.is_over()) {
      ++next_;
      return false;
    }
  }
  return text_.end(slice);
}

const EvaluateOptions& CertificateJob::with_parts() {
  options_.want_points = true;  // identifies the nearest parts
  return options_;
}

SpanPlace CertificateJob::span_at(const BodyPoses& here, BodyPair pair) const {
  SpanPlace place;
  place.slack = pair_slack(here, pair);
  place.between_a = here.chain_slack(pair.a).inner;
  place.between_b = here.chain_slack(pair.b).inner;
  if (!here.has_uncertainties()) return place;
  const PoseUncertainty &a = here.uncertainty(pair.a), &b = here.uncertainty(pair.b);
  place.parts_a = a.parts;
  place.parts_b = b.parts;
  const double joints = joints_between(a, b);
  if (joints == std::numeric_limits<double>::infinity()) return place;
  place.joints = joints;
  for (SlackParts* const parts : {&place.parts_a, &place.parts_b}) parts->parent = 0, parts->placed = parts->step;
  return place;
}

WitnessProof CertificateJob::witness_at(const BodyPoses& here, BodyPair pair, double time, PartProof proof) const {
  return {time, here[pair.a].pose.X_wb, here[pair.b].pose.X_wb, std::move(proof)};
}

}  // namespace clearance
