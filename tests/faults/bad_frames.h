// Invalid requests, drawn at random by kind.
#pragma once

#include <cstddef>
#include <random>
#include <string_view>
#include <vector>

namespace clearance::faults {

/// The kinds. All are rejected, except that a flipped bit may leave a request valid.
inline constexpr std::string_view kFlippedBits = "flipped bits";
inline constexpr std::string_view kBadKinds[] = {
    "magic",         "version", "type",       "said size", "reserved words", "cut",
    "longer",        "noise",   "counts",     "values",    "choices",        "groups without end",
    "another scene", "poses",   "attachment", "new body",  "removed body",   kFlippedBits};

/// A whole frame of that kind, of less than 48 KB, for the scene random_100 or one that begins with it. None of them,
/// rejected or not, changes later answers of the daemon.
std::vector<std::byte> bad_frame(std::string_view kind, std::uint64_t id, std::mt19937_64& random);

}  // namespace clearance::faults
