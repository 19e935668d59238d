// Error of bad input at set-up.
#pragma once

#include <stdexcept>

namespace clearance::engine {

/// Names cause and place: "scenes/a.yaml:12: bodies[3].radius: expected a number > 0, got -1".
struct SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace clearance::engine
