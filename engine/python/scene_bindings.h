#pragma once

#include <nanobind/nanobind.h>

#include "engine/pose/pose.h"

namespace clearance::python {

/// Adds the class Scene to the module.
void bind_scene(nanobind::module_& m);

/// A pose from seven numbers in a row.
inline Pose pose_from(const double* p) {
  return {{p[0], p[1], p[2]}, p[3], p[4], p[5], p[6]};
}

inline nanobind::tuple tuple_of(const Pose& X) {
  return nanobind::make_tuple(X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz);
}

}  // namespace clearance::python
