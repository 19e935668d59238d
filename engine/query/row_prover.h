// Finds what proves the bounds of one pair of bodies where they stand, a pair of pieces at a time.
#pragma once

#include <array>
#include <limits>
#include <optional>

#include "engine/query/certificate_text.h"
#include "engine/query/evaluate.h"

namespace clearance {

/// From the nearest of box a towards box b, as long as they are apart; 0 where they are not.
Vec3d between(const Aabb& a, const Aabb& b);

/// Attempts as dear as they need to be: what proves an answer is mostly what has made it, and else a narrower one.
/// \param limits of the pair's pieces
std::array<NarrowLimits, 4> proof_attempts(const NarrowLimits& limits);

/// What proves the bounds of an answer, of which the lower ones are written down as they are found.
class RowProver {
 public:
  /// All must outlive this. \param answer its bounds, and which pieces are the nearest
  RowProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
            const PairAnswer& answer, CertificateText& text);

  /// Returns true once it is known whether both bounds are proved; false where the slice is over.
  bool advance(WorkMeter& meter);
  bool has_proved() const { return proved_; }
  const std::optional<PieceProof>& upper() const { return upper_; }

 private:
  static constexpr double kInf = std::numeric_limits<double>::infinity();

  bool covers_lower(double lower) const { return slack_.true_lower(lower) >= answer_.lower; }
  bool covers_upper(double upper) const;
  bool go_on();
  void end(bool proved);
  void try_box(WorkMeter& meter);
  void try_pieces(WorkMeter& meter);
  bool prove_pieces(std::uint32_t i, std::uint32_t j, bool wants_lower, bool wants_upper);

  const Body &a_, &b_;
  const PlacedPose &pose_a_, &pose_b_;
  Aabb box_a_, box_b_;
  Slack slack_;
  NarrowLimits limits_;
  const PairAnswer& answer_;
  CertificateText& text_;
  bool wants_lower_, wants_upper_, by_box_;
  std::uint32_t i_ = 0, j_ = 0;  // the pieces whose turn it is
  std::optional<PieceProof> upper_;
  bool is_over_ = false, proved_ = false;
};

}  // namespace clearance
