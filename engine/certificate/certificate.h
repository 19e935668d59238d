// Certificates: rows of a query with all that proves them, for a checker that trusts nobody. docs/certificates.md says
// what a document holds and what it does not prove.
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

/// Which rows of a query a certificate is of, and how large it may be.
struct CertificateRows {
  /// Throws QueryError for more rows than a document may have.
  static void check_count(std::uint64_t count);

  std::optional<std::vector<std::uint64_t>> numbers;  ///< none: all
  std::uint64_t most_bytes = std::uint64_t{0} - 1;    ///< of the document; a larger one is refused
};

/// Makes the job of a plan with motions (engine/certificate/motion_certificate.h).
using MotionCertifier = std::unique_ptr<CertificateJob>(const JobContext& context, Plan&& plan,
                                                        const CertificateRows& rows);

/// A certificate under way: answers rows of a query anew, as a job on the CPU does, finds what proves each, and writes
/// the document (JSON) meanwhile. Holds the snapshot it began with.
class CertificateRun {
 public:
  /// Checks the query. Throws QueryError. \param query what it points to must outlive this, as must what `context`
  /// points to, but for the scene, which the snapshot holds
  CertificateRun(const JobContext& context, std::shared_ptr<const PoseSnapshot> snapshot, const QueryView& query,
                 CertificateRows rows, std::uint64_t max_rows, MotionCertifier* certify_motions);
  CertificateRun(CertificateRun&&) noexcept;
  CertificateRun& operator=(CertificateRun&&) noexcept;
  ~CertificateRun();

  /// Works for about `budget` (on one pair of pieces at least). Returns true once the document is whole. Throws
  /// QueryError for a reduced query without motions, for a row that it has not, for bodies of which no row is
  /// certified, and for a document that is too large.
  bool advance(const WorkBudget& budget = {});
  /// The document. Once, when advance() has returned true.
  std::vector<std::byte> take();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance
