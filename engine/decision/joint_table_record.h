// Joint tables in the cache.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/decision/joint_table_maker.h"

namespace clearance {

/// Name of a pair's table in the cache: a digest of all that the table depends on.
std::string joint_table_name(const TablePair& pair);
/// A table as bytes for the cache.
std::vector<std::byte> joint_table_record(const JointTable& table);
/// The table of a record, or nothing for bytes that are not those of a sound table of the pair.
std::optional<JointTable> joint_table_of_record(const TablePair& pair, std::span<const std::byte> record);

}  // namespace clearance
