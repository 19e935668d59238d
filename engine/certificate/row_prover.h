// Proves the bounds of one pair of bodies at rest, one pair of convex parts at a time.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>

#include "engine/certificate/certificate_text.h"
#include "engine/evaluate/evaluate.h"

namespace clearance {

/// Shortest vector from box a to box b; zero if they overlap.
Vec3d between(const Aabb& a, const Aabb& b);

/// Attempts of increasing cost: usually the arithmetic of the answer proves it, otherwise a narrower tolerance does.
/// \param limits of the pair's parts
std::array<NarrowLimits, 4> proof_attempts(const NarrowLimits& limits);

/// Finds proofs of an answer's bounds, and writes those of lower bounds as they are found.
class RowProver {
 public:
  virtual ~RowProver() = default;

  /// Returns true once both bounds are proved or have failed, and false if the slice ended first.
  bool advance(WorkMeter& meter);
  bool has_proved() const { return proved_; }
  const std::optional<PartProof>& upper() const { return upper_; }

 protected:
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  static constexpr std::uint64_t kUnitsPerProof = 64;

  /// All references must outlive this.
  /// \param answer holds the bounds and the indices of the nearest parts
  RowProver(const engine::Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
            const PairAnswer& answer, CertificateText& text);

  /// Performs one unit of work; the last one calls end(). Returns false if the slice ended first.
  virtual bool step(WorkMeter& meter) = 0;
  bool covers_lower(double lower) const { return slack_.true_lower(lower) >= answer_.lower; }
  bool covers_upper(double upper) const;
  void end(bool proved);
  /// Returns true if a body is a half-space whose normal is to be tried first, for all parts of the other body.
  bool has_plane() const { return has_plane_; }
  /// Tries the normal for the next part. If it suffices for all of them, the lower bound is no longer wanted.
  void try_plane(WorkMeter& meter);
  /// Proves two convex parts as far as the answer needs.
  /// \param found the claim to complete with a proof
  bool prove(const ConvexPart& p, const ConvexPart& q, PartProof found, bool wants_lower, bool wants_upper);

  const Body &a_, &b_;
  const PoseMatrix &pose_a_, &pose_b_;
  Slack slack_;
  NarrowLimits limits_;
  const PairAnswer& answer_;
  CertificateText& text_;
  bool wants_lower_, wants_upper_;
  std::optional<PartProof> upper_;

 private:
  bool is_over_ = false, proved_ = false, has_plane_ = false;
  std::uint32_t above_ = 0;  // the current part
};

/// All references must outlive the result.
/// \param answer holds the bounds and the indices of the nearest parts
std::unique_ptr<RowProver> make_row_prover(const engine::Scene& scene, const EvaluateOptions& options,
                                           const BodyPoses& here, BodyPair pair, const PairAnswer& answer,
                                           CertificateText& text);

}  // namespace clearance
