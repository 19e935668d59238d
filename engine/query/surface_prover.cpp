#include "engine/query/surface_prover.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "engine/surface/surface.h"

namespace clearance {

namespace {

// An element with one of the surface's vertices, and which of its corners that is.
std::array<std::uint32_t, 2> element_with(const Surface& surface, std::uint32_t vertex) {
  for (std::uint32_t t = 0; t < surface.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k)
      if (surface.triangles()[t][k] == vertex) return {t, k};
  assert(false);
  return {0, 0};
}

}  // namespace

SurfaceProver::SurfaceProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
                             const PairAnswer& answer, CertificateText& text)
    : RowProver(scene, options, here, pair, answer, text), cover_(a_, b_) {
  if (wants_lower_) cover_.begin();
  nearest_.begin(a_, pose_a_, b_, pose_b_);
}

bool SurfaceProver::step(WorkMeter& meter) {
  if (wants_upper_ && !upper_) return find_upper(meter);
  if (cover_.is_done())
    end(true);
  else
    cover(meter);
  return true;
}

// One direction for the parts whose turn it is, or halves of them.
void SurfaceProver::cover(WorkMeter& meter) {
  PairCover::Parts parts = cover_.parts();
  const bool are_elements = parts.are_elements, are_pieces = parts.are_pieces();
  meter.count(kUnitsPerProof);
  if (are_pieces) meter.count(WorkMeter::units_of(*parts.a, *parts.b));
  // Directions of several parts say nothing of how deep an overlap is.
  if (are_pieces && covers(std::move(parts)))
    cover_.settle();
  else if (are_elements || (are_pieces && answer_.lower <= 0))
    end(false);
  else
    cover_.halve();
}

bool SurfaceProver::covers(PairCover::Parts parts) {
  if (parts.are_elements || answer_.lower <= 0) return prove(*parts.a, *parts.b, std::move(parts.claim), true, false);
  NarrowLimits limits = limits_;
  limits.signed_distance = false;
  limits.max_distance = std::min(limits_.max_distance, slack_.cut_off(answer_.lower));
  PieceProof& found = parts.claim;
  const NarrowAnswer answer = narrow_phase_proved(*parts.a, pose_a_, *parts.b, pose_b_, limits, found.proof);
  if (!covers_lower(answer.bounds.lower)) return false;
  text_.add_lower(found);
  return true;
}

// The next two elements, the nearest first, or where none is left that may do a solid around the other body.
bool SurfaceProver::find_upper(WorkMeter& meter) {
  ElementPair pair;
  switch (nearest_.next(std::max(answer_.upper, 0.0), meter, pair)) {
    case NearestElements::Found::kPaused:
      return false;
    case NearestElements::Found::kNoMore:
      if (!find_held(0, meter) && !find_held(1, meter)) end(false);
      return true;
    case NearestElements::Found::kPair:
      break;
  }
  const auto place = [](const Body& body, const Element& element) {
    return piece_place(body, element.piece) + (element.triangle == kNone ? 0 : element.triangle);
  };
  Piece room_a, room_b;
  const Piece &p = piece_of(a_, pair.a, room_a), &q = piece_of(b_, pair.b, room_b);
  meter.count(kUnitsPerProof + WorkMeter::units_of(p, q));
  prove(p, q, {place(a_, pair.a), place(b_, pair.b), {}}, false, true);
  return true;
}

// A part of one body that lies within a solid of the `outer` one.
bool SurfaceProver::find_held(std::size_t outer, WorkMeter& meter) {
  const Body &holder = outer == 0 ? a_ : b_, &held = outer == 0 ? b_ : a_;
  const PlacedPose &X_wo = outer == 0 ? pose_a_ : pose_b_, &X_wi = outer == 0 ? pose_b_ : pose_a_;
  for (std::uint32_t o = 0; o < holder.pieces.size(); ++o) {
    const Surface* const solid = holder.pieces[o]->surface.get();
    if (!solid || !solid->is_solid()) continue;
    for (std::uint32_t i = 0; i < held.pieces.size(); ++i) {
      const Piece& piece = *held.pieces[i];
      const auto is_within = [&](std::uint32_t element, std::uint32_t corner, const Vec3d& vertex) {
        meter.count(1);
        if (winding_number(*solid, X_wo.R_wb.transpose_times(X_wi.R_wb * vertex + (X_wi.t_w - X_wo.t_w))) == 0)
          return false;
        PieceProof proof{piece_place(holder, o), piece_place(held, i) + element, {}};
        if (outer == 1) std::swap(proof.piece_a, proof.piece_b);
        proof.within = static_cast<std::uint32_t>(outer);
        proof.proof.vertices.push_back(outer == 0 ? ProofVertex{0, corner, {}} : ProofVertex{corner, 0, {}});
        if (piece.primitive)
          (outer == 0 ? proof.proof.points_b : proof.proof.points_a).push_back(cast<DoubleDouble>(vertex));
        return prove_held(outer, o, std::move(proof), vertex, meter);
      };
      const Surface* const surface = piece.surface.get();
      if (!surface) {
        if (is_within(0, 0, piece.vertices[0])) return true;
      } else if (surface->is_cloud()) {
        for (std::uint32_t k = 0; k < surface->size(); ++k)
          if (is_within(k, 0, surface->element(k).corner[0])) return true;
      } else {
        for (const std::uint32_t vertex : surface->parts()) {
          const auto [element, corner] = element_with(*surface, vertex);
          if (is_within(element, corner, surface->vertices()[vertex])) return true;
        }
      }
    }
  }
  return false;
}

// A direction to each triangle of the solid around a vertex of the other, far enough along all of them.
bool SurfaceProver::prove_held(std::size_t outer, std::uint32_t solid, PieceProof proof, const Vec3d& vertex,
                               WorkMeter& meter) {
  const Piece& around = *(outer == 0 ? a_ : b_).pieces[solid];
  Piece point, triangle;
  remake_piece(point, {&vertex, 1}, 0);
  std::array<NarrowLimits, 4> attempts = proof_attempts(limits_);
  for (NarrowLimits& limits : attempts) limits.signed_distance = false;
  for (std::uint32_t t = 0; t < around.surface->size(); ++t) {
    remake_piece(triangle, around.surface->element(t).span(), 0);
    meter.count(kUnitsPerProof);
    NarrowProof found;
    const Piece &p = outer == 0 ? triangle : point, &q = outer == 0 ? point : triangle;
    const auto is_far_enough = [&](const NarrowLimits& limits) {
      const double apart = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, found).bounds.lower;
      return apart > 0 && covers_upper(-apart);
    };
    if (!is_far_enough(attempts[2]) && !is_far_enough(attempts[3])) return false;
    proof.proof.faces.push_back({{0, 0, 0}, -found.direction});
  }
  proof.proof.upper_in_double_double = true;
  upper_ = std::move(proof);
  return true;
}

}  // namespace clearance
