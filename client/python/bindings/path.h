// Paths of joints that are proved free, for clearance/_query/plan.py.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <chrono>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "client/python/bindings/gil.h"
#include "client/python/bindings/query.h"
#include "planner/rrt_connect.h"

namespace clearance::python {

/// Interval at which a search tests for Ctrl-C.
constexpr std::chrono::milliseconds kSearchSignalPeriod{50};

/// Start, goal and options of a search, as Python passes them.
struct PathSearch {
  PositionRow start, goal;
  PlanOptions options;
};

/// Searches for a path of the query's joints. Returns the path (N J,) flat, empty if none was found, the samples drawn,
/// and the motions tried.
/// \param query with the limits of its joints
/// \param make_prover returns the prover of its motions, an optional one that exists during the search alone
template <class MakeProver>
nb::tuple find_path(const Query& query, const PathSearch& search, MakeProver&& make_prover) {
  std::vector<JointLimits> limits;
  for (std::size_t j = 0; j < search.start.shape(0); ++j)
    limits.push_back({query.lower->data()[j], query.upper->data()[j]});
  PathFound found;
  {
    auto prover = make_prover();
    found = clearance::find_path(prover, limits, {search.start.data(), search.start.shape(0)},
                                 {search.goal.data(), search.goal.shape(0)}, search.options);
  }
  auto* path = new std::vector<double>(std::move(found.path));
  const nb::capsule owner(path, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return nb::make_tuple(nb::ndarray<nb::numpy, double>(path->data(), {path->size()}, owner), found.iterations,
                        found.edges);
}

/// Binds find_path(query, start, goal, range, max_iterations, shortcuts, seed) of an engine or a client.
/// \tparam T has a member find_path(const Q& query, const PathSearch& search)
template <class Q, class T>
void bind_find_path(nb::class_<T>& type) {
  type.def(
      "find_path",
      [](const T& self, const Q& query, PositionRow start, PositionRow goal, double range, std::uint64_t max_iterations,
         std::uint32_t shortcuts, std::uint64_t seed) {
        return self.find_path(query, {std::move(start), std::move(goal), {range, max_iterations, shortcuts, seed}});
      },
      nb::arg("query"), nb::arg("start"), nb::arg("goal"), nb::arg("range"), nb::arg("max_iterations"),
      nb::arg("shortcuts"), nb::arg("seed"));
}

}  // namespace clearance::python
