// clearance cache: lists and clears this user's cache.
#include "engine/cache/cache.h"

#include <cstdio>
#include <ctime>
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

std::string utc(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm parts{};
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", ::gmtime_r(&seconds, &parts));
  return text;
}

/// Throws std::runtime_error if the cache is off.
void expect_cache(const Cache& cache) {
  if (!cache.is_on())
    throw std::runtime_error("there is no cache: " +
                             (cache.why_off().empty() ? "CLEARANCE_CACHE=off" : cache.why_off()));
}

void list_cache(Output output) {
  const Cache cache = Cache::of_environment();
  expect_cache(cache);
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

void clear_cache() {
  const Cache cache = Cache::of_environment();
  expect_cache(cache);
  const std::size_t removed = cache.clear();
  std::printf("%zu entries removed from %s\n", removed, cache.path().c_str());
}

}  // namespace

void add_cache(CLI::App& app) {
  auto& command = *app.add_subcommand("cache", "the cache of loaded meshes: list, clear");
  command.require_subcommand(1);
  const auto output = std::make_shared<Output>(Output::kTable);
  auto& listing = *command.add_subcommand("list", "the entries, last used first");
  add_output_options(listing, *output);
  listing.callback([output] { list_cache(*output); });
  command.add_subcommand("clear", "removes all entries; running programs continue and create new ones")
      ->callback(clear_cache);
  command.footer(R"(
The folder is `clearance` in $XDG_CACHE_HOME, or in ~/.cache; set CLEARANCE_CACHE to another absolute
path, or to `off`. Its limit is CLEARANCE_CACHE_MIB (2048); the least recently used entries are removed first.

Exit codes
  0 done    1 there is no cache    2 the command line is wrong)");
}

}  // namespace clearance::cli
