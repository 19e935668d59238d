// Kinds of bodies for the kernels of a device, and the pairs that none evaluates.
#pragma once

#include <cstdint>
#include <string>

#include "engine/device/device.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// Kind of a body for reductions on a device. kLeft is a cloud or mesh that the device cannot evaluate. kUnknown has no
/// box on the device either.
enum class BodyKind : std::uint8_t { kHull, kPoints, kMesh, kLeft, kUnknown };
BodyKind kind_of(const engine::Scene& scene, const Device& device, std::uint32_t body);

/// The kernel for pairs of two such bodies, one of which is not a hull. Null if the CPU answers them.
bool ElementKinds::* kernel_for(BodyKind a, BodyKind b);

/// Reason why no kernel evaluates some pair of a query, naming a body of the first such pair, or empty.
/// \param with_elements whether there are kernels for clouds and meshes
std::string unsupported_pair(const engine::Scene& scene, const Device& device, const Plan& plan, bool with_elements);

}  // namespace clearance::cuda
