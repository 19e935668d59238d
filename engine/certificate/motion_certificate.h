// Certificates of motions: docs/trust/certificates.md.
#pragma once

#include <memory>

#include "engine/certificate/certificate_job.h"

namespace clearance {

/// Certifies a plan with max_evaluations > 0. Throws QueryError for more pairs than a motion may have.
std::unique_ptr<CertificateJob> make_motion_certificate(const JobContext& context, Plan&& plan,
                                                        const CertificateRows& rows);

}  // namespace clearance
