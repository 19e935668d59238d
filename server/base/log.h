// The daemon's log on standard error, as lines of key=value that begin with event=. External text goes through
// log_text(). Only log.cpp includes spdlog, whose headers take the compiler five seconds a file.
#pragma once

#include <fmt/core.h>

#include <string>

namespace clearance::log {

enum class Level { kDebug, kInfo, kWarn, kError };

/// Starts logging.
/// @param level of the least severe lines ("debug", "info", "warn", "error", "off")
void start(const std::string& level);
/// Flushes the log when the daemon ends.
void end();

void write(Level level, fmt::string_view format, fmt::format_args args);

template <class... Args>
void debug(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kDebug, format, fmt::make_format_args(args...));
}
template <class... Args>
void info(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kInfo, format, fmt::make_format_args(args...));
}
template <class... Args>
void warn(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kWarn, format, fmt::make_format_args(args...));
}
template <class... Args>
void error(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::kError, format, fmt::make_format_args(args...));
}

}  // namespace clearance::log
