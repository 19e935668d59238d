// Programs and libraries of ours that another of ours starts or opens: where they lie, and their start.
#pragma once

#include <sys/types.h>

#include <span>
#include <string>
#include <vector>

namespace clearance {

/// The path of a helper: what the environment's `variable` says; else beside this library or program, or in a libexec
/// folder by it; else `built`, if it is not null and there. Throws std::runtime_error naming the program and the
/// variable. \param what it is for: ", which reads mesh files,"
std::string helper_program(const std::string& name, const char* variable, const char* built, const std::string& what);

/// The same of a library that is opened when it is needed.
std::string helper_library(const std::string& name, const char* variable, const char* built, const std::string& what);

/// Starts a helper program, with every signal as by default. Its standard descriptors are /dev/null; `descriptors`
/// become 3, 4, ... Throws std::runtime_error naming program and cause.
pid_t start_helper(const std::string& program, std::vector<std::string> arguments, std::span<const int> descriptors);

}  // namespace clearance
