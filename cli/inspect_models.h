// The models of a scene's bodies, as text.
#pragma once

#include <vector>

#include "cli/table.h"
#include "inspect/models.h"

namespace clearance::cli {

/// Returns a row for each group.
Table table_of_models(const engine::Scene& scene, const std::vector<GroupModel>& models);

/// Prints a line for each group, and the models that decisions by the margin (metres) require.
void print_models(const engine::Scene& scene, const std::vector<GroupModel>& models, double margin);

}  // namespace clearance::cli
