// Escapes external text (names of bodies, clients' texts, paths) for the log.
#pragma once

#include <string>
#include <string_view>

namespace clearance {

/// Text on one line, without commands to a terminal: quotes, backslashes, unprintable characters and invalid UTF-8
/// become escapes (\n, \x1b). Between quotes the result is one value of a log line.
/// @param quoted if false, quotes and backslashes stay, for text that is not quoted
std::string log_text(std::string_view text, bool quoted = true);

}  // namespace clearance
