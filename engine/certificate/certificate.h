// Certificates: rows of a query together with their proofs, for an independent checker. docs/trust/certificates.md
// defines the document and the limits of its proofs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "engine/narrow/work_meter.h"
#include "engine/selection/query.h"

namespace clearance {

class CertificateJob;
struct JobContext;
struct Plan;
struct PoseSnapshot;

/// Selects the rows of a query to certify, and limits the document's size.
struct CertificateRows {
  /// Throws QueryError for more rows than a document may have.
  static void check_count(std::uint64_t count);

  std::optional<std::vector<std::uint64_t>> numbers;  ///< all rows if unset
  std::uint64_t most_bytes = std::uint64_t{0} - 1;    ///< size limit; a larger document is rejected
};

/// Makes the job of a plan with motions (engine/certificate/motion_certificate.h).
using MotionCertifier = std::unique_ptr<CertificateJob>(const JobContext& context, Plan&& plan,
                                                        const CertificateRows& rows);

/// A certificate in progress: answers rows of a query again on the CPU, finds their proofs, and writes the document
/// (JSON) as it goes. Holds the snapshot that it started with.
class CertificateRun {
 public:
  /// Checks the query. Throws QueryError.
  /// \param context its references must outlive this, except the scene, which the snapshot holds
  /// \param query the arrays that it refers to must outlive this
  CertificateRun(const JobContext& context, std::shared_ptr<const PoseSnapshot> snapshot, const QueryView& query,
                 CertificateRows rows, std::uint64_t max_rows, MotionCertifier* certify_motions);
  CertificateRun(CertificateRun&&) noexcept;
  CertificateRun& operator=(CertificateRun&&) noexcept;
  ~CertificateRun();

  /// Works for about `budget`, but on at least one pair of convex parts. Returns true once the document is complete.
  /// Throws QueryError for a reduced query without motions, a row out of range, bodies that cannot be certified, or a
  /// document over the limit.
  bool advance(const WorkBudget& budget = {});
  /// Returns the document; call once, after advance() has returned true.
  std::vector<std::byte> take();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance
