// Paths of joints that are proved free, for clearance/_query/plan.py.
#pragma once

#include <nanobind/nanobind.h>

#include <memory>

#include "client/python/bindings/query.h"
#include "engine/engine.h"
#include "planner/rrt_connect.h"

namespace clearance::python {

/// Searches for a path of the query's joints, without the interpreter's lock except to test for Ctrl-C. Returns the path
/// (N J,) flat, empty if none was found, the samples drawn, and the motions tried.
/// \param query with the limits of its joints
/// \param motion the query of one motion: Reduce::kAny with the column of verdicts, without positions
nb::tuple find_path(std::shared_ptr<engine::Engine> engine, const Query& query, const QueryView& motion,
                    std::span<const double> start, std::span<const double> goal, const PlanOptions& options);

}  // namespace clearance::python
