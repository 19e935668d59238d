// Certificates: rows of a query with all that proves them, for a checker that trusts nobody. docs/certificates.md says
// what a document holds and what it does not prove.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/narrow/proof.h"
#include "engine/query/job_state.h"

namespace clearance {

/// What proves a bound of two pieces.
struct PieceProof {
  std::uint32_t piece_a, piece_b;  ///< of their bodies; both kNone: the direction is for every pair of pieces
  NarrowProof proof;
};

/// What proves a row while its bodies stand where they are. A row has one; what moves has several.
struct SpanCertificate {
  Pose X_wa, X_wb;
  Slack slack;  ///< of the pair
  SlackParts parts_a, parts_b;
  double joints = 0;                                ///< of links of one robot: joints_between()
  bool composed_a = false, composed_b = false;      ///< the pose was composed with that of another body, and rounded
  std::vector<std::uint32_t> follows_a, follows_b;  ///< the bodies that each follows, the nearest first
  std::vector<PieceProof> lower;                    ///< empty: the bound says nothing (unsigned and 0, or -inf)
  std::optional<PieceProof> upper;                  ///< none: it is infinite
};

struct RowCertificate {
  std::uint64_t row;
  std::uint32_t configuration;
  BodyPair pair;
  PairAnswer answer;
  bool proved = false;                 ///< what follows proves `answer`, or its status needs no proof
  std::vector<SpanCertificate> spans;  ///< empty: the bodies have no usable poses
};

struct Certificate {
  ReplyInfo info;
  double max_distance, abs_tol, rel_tol;
  bool signed_distance;
  std::vector<RowCertificate> rows;
};

/// Answers rows of a query anew, as a job on the CPU does, and finds what proves each. Throws QueryError for a reduced
/// query, and for a row that it has not.
Certificate certify_rows(const JobContext& context, Plan plan, std::span<const std::uint64_t> rows);

/// The document (JSON), with the bodies and pieces that its rows name.
std::string to_json(const Certificate& certificate, const Scene& scene);

}  // namespace clearance
