#include "engine/certificate/surface_prover.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "engine/bvh/surface.h"

namespace clearance {

namespace {

// An element that contains a given vertex of the surface, and the vertex's corner in it.
std::array<std::uint32_t, 2> element_with(const Surface& surface, std::uint32_t vertex) {
  for (std::uint32_t t = 0; t < surface.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k)
      if (surface.triangles()[t][k] == vertex) return {t, k};
  assert(false);
  return {0, 0};
}

// Number of vertices that represent all components of a part: if none of them is inside a solid whose triangles do not
// touch the part, no other vertex is.
std::uint32_t candidates_of(const ConvexPart& part) {
  const Surface* const surface = part.surface.get();
  if (!surface) return 1;
  return surface->is_cloud() ? surface->size() : static_cast<std::uint32_t>(surface->parts().size());
}

}  // namespace

SurfaceProver::SurfaceProver(const engine::Scene& scene, const EvaluateOptions& options, const BodyPoses& here,
                             BodyPair pair, const PairAnswer& answer, CertificateText& text)
    : RowProver(scene, options, here, pair, answer, text), cover_(a_, b_) {
  if (wants_lower_) cover_.begin();
  nearest_.begin(a_, pose_a_, b_, pose_b_);
}

bool SurfaceProver::step(WorkMeter& meter) {
  if (has_plane()) {
    try_plane(meter);
    return true;
  }
  if (wants_upper_ && !upper_) {
    if (!seeks_held_) return find_upper(meter);
    held_ ? prove_held(meter) : seek_held(meter);
    return true;
  }
  if (!wants_lower_ || cover_.is_done())
    end(true);
  else
    cover(meter);
  return true;
}

// Tries one direction for the current parts, or halves them.
void SurfaceProver::cover(WorkMeter& meter) {
  PairCover::Parts parts = cover_.parts();
  const bool are_elements = parts.are_elements, are_parts = parts.are_parts();
  meter.count(kUnitsPerProof);
  if (are_parts) meter.count(WorkMeter::units_of(*parts.a, *parts.b));
  // A direction for several parts does not bound a penetration depth.
  if (are_parts && covers(std::move(parts)))
    cover_.pop();
  else if (are_elements || (are_parts && answer_.lower <= 0))
    end(false);
  else
    cover_.halve();
}

bool SurfaceProver::covers(PairCover::Parts parts) {
  if (parts.are_elements || answer_.lower <= 0) return prove(*parts.a, *parts.b, std::move(parts.claim), true, false);
  NarrowLimits limits = limits_;
  limits.signed_distance = false;
  limits.max_distance = std::min(limits_.max_distance, slack_.cut_off(answer_.lower));
  PartProof& found = parts.claim;
  const NarrowAnswer answer = narrow_phase_proved(*parts.a, pose_a_, *parts.b, pose_b_, limits, found.proof);
  if (!covers_lower(answer.bounds.lower)) return false;
  text_.add_lower(found);
  return true;
}

// Tries the next pair of elements, nearest first.
bool SurfaceProver::find_upper(WorkMeter& meter) {
  ElementPair pair;
  switch (nearest_.next(std::max(answer_.upper, 0.0), meter, pair)) {
    case NearestElements::Found::kPaused:
      return false;
    case NearestElements::Found::kNoMore:
      seeks_held_ = true;
      return true;
    case NearestElements::Found::kPair:
      break;
  }
  const auto place = [](const Body& body, const Element& element) {
    return part_place(body, element.part) + (element.triangle == kNone ? 0 : element.triangle);
  };
  ConvexPart storage_a, storage_b;
  const ConvexPart &p = part_of(a_, pair.a, storage_a), &q = part_of(b_, pair.b, storage_b);
  meter.count(kUnitsPerProof + WorkMeter::units_of(p, q));
  prove(p, q, {place(a_, pair.a), place(b_, pair.b), {}}, false, true);
  return true;
}

// Advances to the next vertex of one body that may lie inside a solid of the other; one vertex per component.
void SurfaceProver::seek_held(WorkMeter& meter) {
  Candidates& c = candidates_;
  const Body &holder = c.outer == 0 ? a_ : b_, &held = c.outer == 0 ? b_ : a_;
  const Surface* const solid = holder.parts[c.solid]->surface.get();
  const bool is_solid = solid && solid->is_solid();
  if (const ConvexPart& part = *held.parts[c.part]; is_solid && c.next < candidates_of(part))
    try_held(*solid, part, c.next++, meter);
  else if (is_solid && c.part + 1 < held.parts.size())
    c = {c.outer, c.solid, c.part + 1, 0};
  else if (c.solid + 1 < holder.parts.size())
    c = {c.outer, c.solid + 1, 0, 0};
  else if (c.outer == 0)
    c = {1, 0, 0, 0};
  else
    end(false);
}

void SurfaceProver::try_held(const Surface& solid, const ConvexPart& part, std::uint32_t candidate, WorkMeter& meter) {
  meter.count(1);
  const std::size_t outer = candidates_.outer;
  const PoseMatrix &X_wo = outer == 0 ? pose_a_ : pose_b_, &X_wi = outer == 0 ? pose_b_ : pose_a_;
  const Surface* const surface = part.surface.get();
  const bool is_mesh = surface && !surface->is_cloud();
  const Vec3d vertex = is_mesh   ? surface->vertices()[surface->parts()[candidate]]
                       : surface ? surface->element(candidate).corner[0]
                                 : part.vertices[0];
  if (winding_number(solid, X_wo.R_wb.transpose_times(X_wi.R_wb * vertex + (X_wi.t_w - X_wo.t_w))) == 0) return;
  const auto [element, corner] =
      is_mesh ? element_with(*surface, surface->parts()[candidate]) : std::array<std::uint32_t, 2>{candidate, 0};
  PartProof proof{part_place(outer == 0 ? a_ : b_, candidates_.solid),
                  part_place(outer == 0 ? b_ : a_, candidates_.part) + element,
                  {}};
  if (outer == 1) std::swap(proof.part_a, proof.part_b);
  proof.within = static_cast<std::uint32_t>(outer);
  proof.proof.vertices.push_back(outer == 0 ? ProofVertex{0, corner, {}} : ProofVertex{corner, 0, {}});
  if (part.primitive) (outer == 0 ? proof.proof.points_b : proof.proof.points_a).push_back(cast<DoubleDouble>(vertex));
  held_ = {std::move(proof), vertex};
}

// Finds a direction for the next triangle of the solid around the vertex; the vertex must be deep enough along each.
void SurfaceProver::prove_held(WorkMeter& meter) {
  const std::size_t outer = candidates_.outer;
  const Surface& around = *(outer == 0 ? a_ : b_).parts[candidates_.solid]->surface;
  if (held_->next == around.size()) {
    held_->proof.proof.upper_in_double_double = true;
    upper_ = std::move(held_->proof);
    return held_.reset();
  }
  meter.count(kUnitsPerProof);
  ConvexPart point, triangle;
  remake_part(point, {&held_->vertex, 1}, 0);
  remake_part(triangle, around.element(held_->next++).span(), 0);
  const ConvexPart &p = outer == 0 ? triangle : point, &q = outer == 0 ? point : triangle;
  NarrowProof found;
  const auto is_far_enough = [&](NarrowLimits limits) {
    limits.signed_distance = false;
    const double apart = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, found).bounds.lower;
    return apart > 0 && covers_upper(-apart);
  };
  const std::array<NarrowLimits, 4> attempts = proof_attempts(limits_);
  if (is_far_enough(attempts[2]) || is_far_enough(attempts[3]))
    held_->proof.proof.faces.push_back({{0, 0, 0}, -found.direction});
  else
    held_.reset();  // other vertices may suffice
}

}  // namespace clearance
