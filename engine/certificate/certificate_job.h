// Common part of certificates of rows and of motions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/certificate/certificate.h"
#include "engine/certificate/certificate_text.h"
#include "engine/query/parallel_job.h"

namespace clearance {

/// Answers rows again and writes their proofs, row by row.
class CertificateJob : public ParallelJob {
 public:
  std::vector<std::byte> take() { return text_.take(); }

 protected:
  /// \param rows must outlive this
  /// \param boxes as for ParallelJob
  CertificateJob(const JobContext& context, Plan&& plan, const CertificateRows& rows, bool boxes);

  bool go_on(WorkMeter& slice) final;
  /// Writes a row. Returns true once it is written, and false if the slice ended first; the next call continues.
  virtual bool go_on_with(std::uint64_t row, WorkMeter& slice) = 0;

  const EvaluateOptions& with_parts();
  /// Describes bodies with usable poses over a whole motion; the caller may then set begin, end and time.
  SpanPlace span_at(const BodyPoses& here, BodyPair pair) const;
  WitnessProof witness_at(const BodyPoses& here, BodyPair pair, double time, PartProof proof) const;

  const CertificateRows& rows_;
  std::uint64_t count_, next_ = 0;
  CertificateText text_;
};

}  // namespace clearance
