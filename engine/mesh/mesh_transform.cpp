#include "engine/mesh/mesh_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

// Relative error of a sum of four products: at most seven roundings along any path, and those of the bound itself.
constexpr double kRounding = 16 * 0x1p-53;
constexpr double kTiny = std::numeric_limits<double>::min();  // underflow

}  // namespace

bool MeshTransform::is_identity() const {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c)
      if (m[r][c] != (r == c ? 1 : 0) || error[r][c] != 0) return false;
  return true;
}

double MeshTransform::determinant() const {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

MeshTransform MeshTransform::after(const MeshTransform& inner) const {
  if (is_identity()) return inner;
  if (inner.is_identity()) return *this;
  MeshTransform out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) {
      double sum = c == 3 ? m[r][3] : 0, size = std::abs(sum), off = c == 3 ? error[r][3] : 0;
      for (int k = 0; k < 3; ++k) {
        sum += m[r][k] * inner.m[k][c];
        size += std::abs(m[r][k] * inner.m[k][c]);
        off += error[r][k] * (std::abs(inner.m[k][c]) + inner.error[k][c]) + std::abs(m[r][k]) * inner.error[k][c];
      }
      out.m[r][c] = sum;
      out.error[r][c] = (1 + kRounding) * off + kRounding * size + kTiny;
    }
  return out;
}

void MeshTransform::apply(MeshPart* part) const {
  if (is_identity()) return;
  double worst = 0;
  for (Vec3d& p : part->positions) {
    Vec3d moved{0, 0, 0};
    double off = 0;  // sum over the axes, at least the length
    for (int r = 0; r < 3; ++r) {
      moved[r] = m[r][0] * p.x + m[r][1] * p.y + m[r][2] * p.z + m[r][3];
      double size = std::abs(m[r][3]);
      off += error[r][3] + kTiny;
      for (int k = 0; k < 3; ++k) {
        size += std::abs(m[r][k] * p[k]);
        off += error[r][k] * (std::abs(p[k]) + part->rounding) + std::abs(m[r][k]) * part->rounding;
      }
      off += kRounding * size;
    }
    p = moved;
    worst = std::max(worst, (1 + kRounding) * off);
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z) || !std::isfinite(worst))
      throw LoadError("the transform of a node is not finite");
  }
  part->rounding = worst;
  if (determinant() < 0)
    for (Triangle& t : part->triangles) std::swap(t[1], t[2]);
}

}  // namespace clearance
