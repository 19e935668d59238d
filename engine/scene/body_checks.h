// Checks of bodies and names when they enter a scene. All throw SceneError.
#pragma once

#include <string>

#include "engine/scene/scene.h"

namespace clearance {

inline constexpr const char* kPlaneStands = "a half_space cannot follow a body: only its own pose places it";

std::string in_quotes(const std::string& name);
/// The number with as many digits as identify it.
std::string number_text(double x);

/// Error text for a name that no body has, with similar names.
std::string no_body(const engine::Scene& scene, const std::string& name);

/// \param what kind of the name, such as "body"
void check_name(const std::string& name, const char* what);
/// \param name of the body
/// \param what quantity, in metres
void check_positive(const std::string& name, const char* what, double x, bool zero_allowed = false);
void check_may_require_pose(const Body& body);
void check_uncertainty(const Body& body);

bool is_plane(const Body& body);
/// Makes a half-space static. Its pose must be exact and it has no parent, because the least turn moves distant points
/// by any length.
void fix_half_space(Body& body);
/// Makes a body whose only part is a cloud accept new points, as a body of add_points() does.
void adopt_cloud(Body& body);

}  // namespace clearance
