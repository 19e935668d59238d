#pragma once

#include <nanobind/nanobind.h>

#include <span>

#include "engine/pose/pose.h"

namespace clearance::python {

/// Adds the class Scene to the module.
void bind_scene(nanobind::module_& m);

/// A pose from seven numbers in a row.
inline Pose pose_from(const double* p) {
  return {{p[0], p[1], p[2]}, p[3], p[4], p[5], p[6]};
}

/// Rows of an array.
template <class Row, class Rows>
std::span<const Row> rows_of(const Rows& rows) {
  return {reinterpret_cast<const Row*>(rows.data()), rows.shape(0)};
}

inline nanobind::tuple tuple_of(const Pose& X) {
  return nanobind::make_tuple(X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz);
}

}  // namespace clearance::python
