// Paths of joints that an engine proves free, for clearance/_query/plan.py.
#pragma once

#include <nanobind/nanobind.h>

#include <memory>

#include "client/python/bindings/path.h"
#include "engine/engine.h"

namespace clearance::python {

/// Searches for a path, as find_path() of client/python/bindings/path.h, without the interpreter's lock except to test
/// for Ctrl-C.
/// \param motion the query of one motion: Reduce::kAny with the column of verdicts, without positions
nb::tuple find_path(std::shared_ptr<engine::Engine> engine, const Query& query, const QueryView& motion,
                    const PathSearch& search);

}  // namespace clearance::python
