// What comes from outside (names of bodies, clients' texts, paths) as it goes to the log.
#pragma once

#include <string>
#include <string_view>

namespace clearance {

/// The text on one line and without orders to a terminal: quotes, backslashes and whatever does not print become
/// escapes
/// (\n, \x1b), and so do bytes that are no UTF-8. Between quotes it is one value of a log line, whatever is in it.
/// \param quoted false: quotes and backslashes stay, in a sentence that stands by itself.
std::string log_text(std::string_view text, bool quoted = true);

}  // namespace clearance
