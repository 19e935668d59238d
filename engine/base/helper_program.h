// Location and start of Clearance's helper programs and libraries.
#pragma once

#include <sys/types.h>

#include <span>
#include <string>
#include <vector>

namespace clearance {

/// Returns the path of a helper: the environment's `variable`; otherwise a file next to this library or program, or in
/// a libexec folder next to it; otherwise `built`, if it is not null and exists. Throws std::runtime_error naming the
/// program and the variable.
/// \param what its purpose, for messages, such as ", which reads mesh files,"
std::string helper_program(const std::string& name, const char* variable, const char* built, const std::string& what);

/// Returns the path of a library that is opened on demand, by the same rules.
std::string helper_library(const std::string& name, const char* variable, const char* built, const std::string& what);

/// Starts a helper program with default signal handlers. Its standard descriptors are /dev/null; `descriptors` become
/// 3, 4, ... Throws std::runtime_error naming program and cause.
pid_t start_helper(const std::string& program, std::vector<std::string> arguments, std::span<const int> descriptors);

}  // namespace clearance
