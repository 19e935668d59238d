#include "engine/cover/cover_simplices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace clearance {

namespace {

struct Edge {
  int from = 0, to = 1;
  double length = 0;
};

Edge longest_edge(const CoverSimplex& s) {
  Edge longest;
  double most = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j)
      if (const double d = squared_norm(s.corner[i] - s.corner[j]); d > most)
        most = d, longest.from = i, longest.to = j;
  longest.length = std::sqrt(most);
  return longest;
}

/// Halves a simplex at an edge. The rounding of the midpoint is charged to the growth of both.
std::array<CoverSimplex, 2> halves(const CoverSimplex& s, const Edge& edge) {
  const Vec3d middle = (s.corner[edge.from] + s.corner[edge.to]) * 0.5;
  std::array<CoverSimplex, 2> two{s, s};
  two[0].corner[edge.from] = two[1].corner[edge.to] = middle;
  for (CoverSimplex& half : two) half.growth = (s.growth + 0x1p-50 * norm(middle)) * kCoverUp;
  return two;
}

/// A simplex by its claim to be halved next; equal claims in order of their making, which is the same everywhere.
struct Claim {
  double size;
  std::size_t index;

  bool operator<(const Claim& other) const { return size != other.size ? size < other.size : index > other.index; }
};

/// Halves the simplices of the greatest claims above `enough`, until there are `most`. A simplex without a claim above
/// 0 stays.
template <class ClaimOf>
void halve_greatest(std::vector<CoverSimplex>& simplices, double enough, std::size_t most, ClaimOf claim_of) {
  std::vector<Claim> heap;
  const auto push = [&](std::size_t i) {
    const double size = claim_of(i);
    if (!(size > enough)) return;
    heap.push_back({size, i});
    std::push_heap(heap.begin(), heap.end());
  };
  for (std::size_t i = 0; i < simplices.size(); ++i) push(i);
  while (!heap.empty() && simplices.size() < most) {
    std::pop_heap(heap.begin(), heap.end());
    const std::size_t i = heap.back().index;
    heap.pop_back();
    const auto two = halves(simplices[i], longest_edge(simplices[i]));
    simplices[i] = two[0];
    simplices.push_back(two[1]);
    push(i);
    push(simplices.size() - 1);
  }
}

}  // namespace

double radius_for(const CoverSimplex& s, const Vec3d& c) {
  double most = 0;
  for (const Vec3d& corner : s.corner) most = std::max(most, squared_norm(corner - c));
  return std::sqrt(most) * kCoverUp + kCoverTiny + s.growth;
}

std::vector<CoverSimplex> divided(std::span<const CoverSimplex> simplices, double edge, std::size_t most) {
  std::vector<CoverSimplex> result(simplices.begin(), simplices.end());
  halve_greatest(result, edge, most, [&](std::size_t i) { return longest_edge(result[i]).length; });
  return result;
}

std::vector<std::vector<CoverSimplex>> distribute(std::span<const CoverSimplex> simplices,
                                                  std::span<const ChosenBall> balls, double slack, std::size_t most) {
  std::vector<CoverSimplex> pieces(simplices.begin(), simplices.end());
  std::vector<std::size_t> owner(pieces.size());
  halve_greatest(pieces, slack, most, [&](std::size_t i) {
    owner.resize(pieces.size());
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < balls.size(); ++k)
      if (const double lack = radius_for(pieces[i], balls[k].centre) - balls[k].radius; lack < least)
        least = lack, owner[i] = k;
    // Halving a simplex that is small compared with its lack gains little.
    return longest_edge(pieces[i]).length > 0.25 * least ? least : 0;
  });
  std::vector<std::vector<CoverSimplex>> shares(balls.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) shares[owner[i]].push_back(pieces[i]);
  return shares;
}

}  // namespace clearance
