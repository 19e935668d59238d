// Finds what proves the bounds of one pair of bodies where they stand, a pair of pieces at a time.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>

#include "engine/certificate/certificate_text.h"
#include "engine/evaluate/evaluate.h"

namespace clearance {

/// From the nearest of box a towards box b, as long as they are apart; 0 where they are not.
Vec3d between(const Aabb& a, const Aabb& b);

/// Attempts as dear as they need to be: what proves an answer is mostly what has made it, and else a narrower one.
/// \param limits of the pair's pieces
std::array<NarrowLimits, 4> proof_attempts(const NarrowLimits& limits);

/// What proves the bounds of an answer, of which the lower ones are written down as they are found.
class RowProver {
 public:
  virtual ~RowProver() = default;

  /// Returns true once it is known whether both bounds are proved; false where the slice is over.
  bool advance(WorkMeter& meter);
  bool has_proved() const { return proved_; }
  const std::optional<PieceProof>& upper() const { return upper_; }

 protected:
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  static constexpr std::uint64_t kUnitsPerProof = 64;

  /// All must outlive this. \param answer its bounds, and which pieces are the nearest
  RowProver(const Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
            const PairAnswer& answer, CertificateText& text);

  /// A bit of the work, of which end() is the last. False: the slice is over.
  virtual bool step(WorkMeter& meter) = 0;
  bool covers_lower(double lower) const { return slack_.true_lower(lower) >= answer_.lower; }
  bool covers_upper(double upper) const;
  void end(bool proved);
  /// Where one of the bodies is a half-space, its normal is to be tried first, for all pieces of the other.
  bool has_plane() const { return has_plane_; }
  /// For the next of them. The lower bound is not wanted any more where the normal does for all.
  void try_plane(WorkMeter& meter);
  /// Two convex ones, by what the answer needs. \param found whose proof is to be found
  bool prove(const Piece& p, const Piece& q, PieceProof found, bool wants_lower, bool wants_upper);

  const Body &a_, &b_;
  const PoseMatrix &pose_a_, &pose_b_;
  Slack slack_;
  NarrowLimits limits_;
  const PairAnswer& answer_;
  CertificateText& text_;
  bool wants_lower_, wants_upper_;
  std::optional<PieceProof> upper_;

 private:
  bool is_over_ = false, proved_ = false, has_plane_ = false;
  std::uint32_t above_ = 0;  // the piece whose turn it is
};

/// All must outlive what it returns. \param answer its bounds, and which pieces are the nearest
std::unique_ptr<RowProver> make_row_prover(const Scene& scene, const EvaluateOptions& options, const BodyPoses& here,
                                           BodyPair pair, const PairAnswer& answer, CertificateText& text);

}  // namespace clearance
