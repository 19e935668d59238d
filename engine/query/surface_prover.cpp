#include "engine/query/surface_prover.h"

#include <algorithm>
#include <cassert>

#include "engine/surface/surface.h"

namespace clearance {

namespace {

constexpr std::uint32_t kKeptFrom = 256;  // elements: what is around fewer is made again when it is needed

// The elements of a node's subtree are those from first_of() until before end_of().
std::uint32_t first_of(const Surface& surface, std::uint32_t node) {
  while (!surface.nodes()[node].is_leaf()) ++node;
  return surface.nodes()[node].begin();
}
std::uint32_t end_of(const Surface& surface, std::uint32_t node) {
  while (!surface.nodes()[node].is_leaf()) node = surface.nodes()[node].right;
  return surface.nodes()[node].end();
}

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
    : RowProver(scene, options, here, pair, answer, text), sides_{Side(a_), Side(b_)} {
  if (wants_lower_) open_.push_back({sides_[0].whole(), sides_[1].whole()});
  nearest_.begin(a_, pose_a_, b_, pose_b_);
}

const Surface* SurfaceProver::Side::surface(const Part& part) const {
  return part.piece == kAll ? nullptr : body_.pieces[part.piece]->surface.get();
}

// The hull of some elements.
const Piece& SurfaceProver::Side::around(const Part& part, std::uint32_t begin, std::uint32_t end) {
  if (const auto found = large_.find(part); found != large_.end()) return found->second;
  if (part == of_small_) return small_;
  const Surface& surface = *this->surface(part);
  Piece piece;
  piece.radius = body_.pieces[part.piece]->radius;
  for (std::uint32_t i = begin; i < end; ++i) {
    const ElementCorners element = surface.element(i);
    piece.vertices.insert(piece.vertices.end(), element.span().begin(), element.span().end());
  }
  if (end - begin >= kKeptFrom) return large_.emplace(part, without_table(piece)).first->second;
  of_small_ = part;
  return small_ = without_table(piece);
}

SurfaceProver::Bulk SurfaceProver::Side::bulk(const Part& part) {
  if (part.piece == kAll) return {nullptr, 0, 0};
  const Surface* const surface = this->surface(part);
  const std::uint32_t place = piece_place(body_, part.piece);
  if (part.at == kNone) return {body_.pieces[part.piece].get(), place, surface ? surface->size() : 1};
  const bool is_element = (part.at & kElement) != 0;
  const std::uint32_t begin = is_element ? part.at & ~kElement : first_of(*surface, part.at),
                      end = is_element ? begin + 1 : end_of(*surface, part.at);
  return {&around(part, begin, end), place + begin, end - begin};
}

std::vector<SurfaceProver::Part> SurfaceProver::Side::halves(const Part& part) const {
  std::vector<Part> halves;
  if (part.piece == kAll) {
    for (std::uint32_t i = 0; i < body_.pieces.size(); ++i) halves.push_back({i, kNone});
    return halves;
  }
  const Surface* const surface = this->surface(part);
  if (!surface || (part.at != kNone && (part.at & kElement) != 0)) return halves;
  const std::uint32_t at = part.at == kNone ? 0 : part.at;
  const Surface::Node& node = surface->nodes()[at];
  if (!node.is_leaf()) return {{part.piece, at + 1}, {part.piece, node.right}};
  for (std::uint32_t i = node.begin(); i < node.end(); ++i) halves.push_back({part.piece, i | kElement});
  return halves;
}

bool SurfaceProver::step(WorkMeter& meter) {
  if (wants_upper_ && !upper_) return find_upper(meter);
  if (open_.empty())
    end(true);
  else
    cover(meter);
  return true;
}

// One direction for the parts whose turn it is, or halves of the larger one.
void SurfaceProver::cover(WorkMeter& meter) {
  const std::array<Part, 2> parts = open_.back();
  open_.pop_back();
  const std::array<Bulk, 2> bulks{sides_[0].bulk(parts[0]), sides_[1].bulk(parts[1])};
  const std::array<std::vector<Part>, 2> halves{sides_[0].halves(parts[0]), sides_[1].halves(parts[1])};
  const bool are_whole = bulks[0].piece && bulks[1].piece;
  meter.count(kUnitsPerProof);
  if (are_whole) {
    meter.count(WorkMeter::units_of(*bulks[0].piece, *bulks[1].piece));
    if (covers(parts, bulks, halves[0].empty() && halves[1].empty())) return;
  }
  // Directions of several parts say nothing of how deep an overlap is.
  if ((halves[0].empty() && halves[1].empty()) || (are_whole && answer_.lower <= 0)) return end(false);
  const std::size_t larger =
      halves[0].empty()                                                                                             ? 1
      : halves[1].empty() || !bulks[0].piece || (bulks[1].piece && bulks[0].piece->spread > bulks[1].piece->spread) ? 0
                                                                                                                    : 1;
  for (const Part& half : halves[larger]) {
    open_.push_back(parts);
    open_.back()[larger] = half;
  }
}

bool SurfaceProver::covers(const std::array<Part, 2>& parts, const std::array<Bulk, 2>& bulks, bool are_elements) {
  PieceProof found{bulks[0].place, bulks[1].place, {}};
  found.count_a = bulks[0].count;
  found.count_b = bulks[1].count;
  if (parts[0] == sides_[0].whole() && parts[1] == sides_[1].whole()) found.piece_a = found.piece_b = kNone;
  if (are_elements || answer_.lower <= 0) return prove(*bulks[0].piece, *bulks[1].piece, std::move(found), true, false);
  NarrowLimits limits = limits_;
  limits.signed_distance = false;
  limits.max_distance = std::min(limits_.max_distance, slack_.cut_off(answer_.lower));
  const NarrowAnswer answer =
      narrow_phase_proved(*bulks[0].piece, pose_a_, *bulks[1].piece, pose_b_, limits, found.proof);
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
      if (answer_.upper > 0 || (!find_held(0, meter) && !find_held(1, meter))) end(false);
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
  NarrowLimits limits = proof_attempts(limits_)[2];
  limits.signed_distance = false;
  for (std::uint32_t t = 0; t < around.surface->size(); ++t) {
    remake_piece(triangle, around.surface->element(t).span(), 0);
    meter.count(kUnitsPerProof);
    NarrowProof found;
    const Piece &p = outer == 0 ? triangle : point, &q = outer == 0 ? point : triangle;
    const double apart = narrow_phase_proved(p, pose_a_, q, pose_b_, limits, found).bounds.lower;
    if (!(apart > 0) || !covers_upper(-apart)) return false;
    proof.proof.faces.push_back({{0, 0, 0}, -found.direction});
  }
  proof.proof.upper_in_double_double = true;
  upper_ = std::move(proof);
  return true;
}

}  // namespace clearance
