// clearance-cache: what the cache of this user holds, and an empty one instead.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <iostream>

#include "cli/table.h"
#include "engine/cache/cache.h"

namespace clearance {
namespace {

using cli::Cell;
using cli::Output;
using cli::Table;

std::string utc(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm parts{};
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", ::gmtime_r(&seconds, &parts));
  return text;
}

/// Throws std::runtime_error where nothing is kept.
void expect_on(const Cache& cache) {
  if (!cache.is_on())
    throw std::runtime_error("there is no cache: " +
                             (cache.why_off().empty() ? "CLEARANCE_CACHE=off" : cache.why_off()));
}

void list(Output output) {
  const Cache cache = Cache::of_environment();
  expect_on(cache);
  Table table({"kind", "bytes", "used", "entry"});
  std::uint64_t bytes = 0;
  const std::vector<CacheEntry> entries = cache.list();
  for (const CacheEntry& entry : entries) {
    table.add({entry.kind, entry.bytes, utc(entry.used), entry.name});
    bytes += entry.bytes;
  }
  table.print(std::cout, output);
  if (output != Output::kTable) return;
  std::printf("%zu entries, %.4g of %.4g MiB, in %s\n", entries.size(), static_cast<double>(bytes) / (1 << 20),
              static_cast<double>(cache.most_bytes()) / (1 << 20), cache.path().c_str());
}

void clear() {
  const Cache cache = Cache::of_environment();
  expect_on(cache);
  const std::size_t removed = cache.clear();
  std::printf("%zu entries removed from %s\n", removed, cache.path().c_str());
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  using namespace clearance;
  constexpr int kNoCache = 1, kCommandLine = 2;
  CLI::App app("What is kept of meshes that were loaded before, so that they load faster.", "clearance cache");
  app.require_subcommand(1);
  Output output = Output::kTable;
  auto& listing = *app.add_subcommand("list", "the entries, last used first");
  auto* json = listing.add_flag_callback("--json", [&] { output = Output::kJson; }, "print JSON");
  listing.add_flag_callback("--csv", [&] { output = Output::kCsv; }, "print comma-separated values")->excludes(json);
  listing.callback([&] { list(output); });
  app.add_subcommand("clear", "removes all entries; programs that run go on, and make them anew")->callback(clear);
  app.footer(R"(
The folder is `clearance` in $XDG_CACHE_HOME, or in ~/.cache; CLEARANCE_CACHE names another one by its absolute
path, or says `off`. It may hold CLEARANCE_CACHE_MIB (2048); what was not used for longest goes first.

Exit codes
  0 done    1 there is no cache    2 the command line is wrong)");
  try {
    app.parse(argc, argv);
    if (!std::cout.flush()) throw std::runtime_error("the list cannot be written");
    return 0;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::cerr << "clearance cache: " << error.what() << "\n";
    return kCommandLine;
  } catch (const std::exception& error) {
    std::cerr << "clearance cache: " << error.what() << "\n";
    return kNoCache;
  }
}
