// Times of prepared queries of one robot whose inputs are files: float64, a row of joint positions for each state.
#pragma once

#include <span>
#include <string>

namespace clearance {

/// Times queries of one state, and prints a line for each without and with covers: its name, "off" or "background", and
/// each round's processor time for all states, in seconds.
void time_states(const std::string& scene, const std::string& robot, const std::string& file, int rounds);

/// Times verdicts, and prints a line for each file, without and with covers, in batches and one a call:
///
///   FILE "off"|"background" "batch"|"call" COUNT SECONDS...
///
/// with the number of states or edges, and each round's processor time for all.
/// \param files a state is a row; in a file whose name ends with "edges" two rows are an edge
void time_verdicts(const std::string& scene, const std::string& robot, int rounds, double margin,
                   std::span<const std::string> files);

}  // namespace clearance
