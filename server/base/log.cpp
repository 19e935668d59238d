#include "server/base/log.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <utility>

namespace clearance::log {
namespace {

spdlog::level::level_enum spdlogs(Level level) {
  switch (level) {
    case Level::kDebug:
      return spdlog::level::debug;
    case Level::kInfo:
      return spdlog::level::info;
    case Level::kWarn:
      return spdlog::level::warn;
    case Level::kError:
      break;
  }
  return spdlog::level::err;
}

}  // namespace

void start(const std::string& level) {
  auto logger = std::make_shared<spdlog::logger>("clearanced", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("time=%Y-%m-%dT%H:%M:%S.%e%z level=%l %v");
  logger->set_level(spdlog::level::from_str(level));
  logger->flush_on(spdlog::level::trace);
  spdlog::set_default_logger(std::move(logger));
}

void end() {
  spdlog::shutdown();
}

void write(Level level, fmt::string_view format, fmt::format_args args) {
  if (!spdlog::should_log(spdlogs(level))) return;
  spdlog::log(spdlogs(level), "{}", fmt::vformat(format, args));
}

}  // namespace clearance::log
