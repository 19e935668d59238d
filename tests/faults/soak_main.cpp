// clearance-soak: random faults of all kinds while clients check every bit; writes its observations as CSV.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iostream>
#include <span>
#include <thread>

#include "tests/faults/soak.h"
#include "tests/faults/trend.h"

namespace clearance::faults {
namespace {

/// Growth of memory that is not counted: clients come and go, and a short run has more that is new.
constexpr double kGrowthSparedKb = 2048, kGrowthSparedShortKb = 16384, kShortMinutes = 10;

struct Options {
  double minutes = 60;
  std::uint64_t seed = 1;
  double load = 0.25;
  std::string csv;
};

const char* const kFaults[] = {"killed",    "frozen",  "scribbling",       "descriptors",   "memory",
                               "file_size", "reloads", "killed_of_mortal", "daemons_killed"};
const char* const kStats[] = {"frames",          "replies",        "errors",          "requests.dropped",
                              "shm.connections", "shm.violations", "heap.used_bytes", "heap.kept_bytes"};

void write_head(std::ostream& out, const Options& o) {
  out << "# clearance-soak --minutes " << o.minutes << " --seed " << o.seed << " --load " << o.load << "\nseconds,cpu";
  for (const char* name : kFaults) out << ',' << name;
  out << ",right,wrong,refused,late,mortal_right,mortal_wrong,mortal_lost,mortal_late";
  for (const char* name : kStats) out << ',' << name;
  out << ",private_kb,shared_kb,descriptors,segments,mappings,threads\n" << std::flush;
}

void write_row(std::ostream& out, Soak::Sample s) {
  char head[64];
  std::snprintf(head, sizeof head, "%.1f,%.2f", s.seconds, s.cpu);
  out << head;
  for (const char* name : kFaults) out << ',' << s.faults[name];
  out << ',' << s.living.right << ',' << s.living.wrong << ',' << s.living.busy << ',' << s.living.late << ','
      << s.mortal.right << ',' << s.mortal.wrong << ',' << s.mortal.lost << ',' << s.mortal.late;
  for (const char* name : kStats) out << ',' << s.stats[name];
  const Census& c = s.census;
  out << ',' << c.private_kb << ',' << c.shared_kb << ',' << c.descriptors << ',' << c.segments << ',' << c.mappings
      << ',' << c.threads << '\n'
      << std::flush;
}

/// Tests a part of the daemon's memory. The first quarter is left out as a warm-up.
bool is_flat(const char* part, std::span<const Soak::Sample> samples, double (*kilobytes_of)(const Soak::Sample&)) {
  std::vector<double> minutes, kilobytes;
  for (const Soak::Sample& sample : samples.subspan(samples.size() / 4)) {
    minutes.push_back(sample.seconds / 60);
    kilobytes.push_back(kilobytes_of(sample));
  }
  if (minutes.size() < 3) {
    std::printf("%s: too short a run to tell\n", part);
    return true;
  }
  const Trend trend = trend_of(minutes, kilobytes);
  const double span = minutes.back() - minutes.front(), grown = trend.slope * span;
  const double spared = samples.back().seconds < 60 * kShortMinutes ? kGrowthSparedShortKb : kGrowthSparedKb;
  const bool flat = trend.slope <= 3 * trend.standard_error || grown <= spared;
  std::printf("%s: %.0f KB, slope %.2f KB a minute (standard error %.2f), %.0f KB in %.1f minutes: %s\n", part,
              kilobytes.back(), trend.slope, trend.standard_error, grown, span, flat ? "flat" : "IT GROWS");
  return flat;
}

double stat_kb(const Soak::Sample& sample, const char* name) {
  const auto found = sample.stats.find(name);  // sanitized daemons do not count allocated bytes
  return found == sample.stats.end() ? 0 : static_cast<double>(found->second) / 1024;
}

/// Tests the memory that the daemon has allocated, and its private memory outside of the heaps. Freed memory that the
/// heaps keep has a limit (server/app/main.cpp), and approaches it in the first minutes.
bool is_memory_flat(std::span<const Soak::Sample> samples) {
  const bool allocated =
      is_flat("allocated", samples, [](const Soak::Sample& sample) { return stat_kb(sample, "heap.used_bytes"); });
  const bool others = is_flat("outside of the heaps", samples, [](const Soak::Sample& sample) {
    return static_cast<double>(sample.census.private_kb) - stat_kb(sample, "heap.used_bytes") -
           stat_kb(sample, "heap.kept_bytes");
  });
  std::printf("private memory: %.1f MB, of which the heaps keep %.1f MB for later requests\n",
              static_cast<double>(samples.back().census.private_kb) / 1024,
              stat_kb(samples.back(), "heap.kept_bytes") / 1024);
  return allocated && others;
}

int soak(const Options& o) {
  std::ofstream file;
  if (!o.csv.empty()) {
    file.open(o.csv);
    if (!file) throw std::runtime_error(o.csv + ": cannot be written");
  }
  std::ostream& csv = o.csv.empty() ? std::cout : file;
  write_head(csv, o);

  const auto begin = Soak::Clock::now();
  const std::chrono::duration<double> length(60 * o.minutes);
  const auto pause =
      std::clamp<std::chrono::duration<double>>(length / 40, std::chrono::seconds(3), std::chrono::seconds(60));
  std::mt19937_64 random(o.seed + 1);
  Soak all(o.seed, o.load);
  std::vector<Soak::Sample> samples;
  bool failed = false;
  const auto look = [&] {
    samples.push_back(all.keep_still());
    write_row(csv, samples.back());
    if (samples.back().trouble.empty()) return;
    failed = true;
    std::printf("after %.0f s: %s\n", samples.back().seconds, samples.back().trouble.c_str());
  };
  look();
  while (Soak::Clock::now() - begin < length) {
    for (const auto until = Soak::Clock::now() + pause; Soak::Clock::now() < until;) {
      all.fault();
      std::this_thread::sleep_for(std::chrono::milliseconds(random() % 200));
    }
    look();
  }
  const std::string trouble = all.end();
  if (!trouble.empty()) std::printf("at the end: %s\n", trouble.c_str());
  failed |= !trouble.empty();
  if (!is_memory_flat(samples)) failed = true;
  Soak::Sample& last = samples.back();
  std::printf(
      "%.1f minutes: %llu right answers of %llu and %llu wrong ones; %llu clients killed, %llu frozen, %llu "
      "scribbling, %llu deaths of a daemon\n",
      last.seconds / 60, static_cast<unsigned long long>(last.living.right + last.mortal.right),
      static_cast<unsigned long long>(last.living.right + last.mortal.right + last.living.wrong + last.mortal.wrong),
      static_cast<unsigned long long>(last.living.wrong + last.mortal.wrong),
      static_cast<unsigned long long>(last.faults["killed"] + last.faults["killed_of_mortal"]),
      static_cast<unsigned long long>(last.faults["frozen"]),
      static_cast<unsigned long long>(last.faults["scribbling"]),
      static_cast<unsigned long long>(last.faults["daemons_killed"]));
  if (failed)
    for (const std::string& complaint : all.complaints()) std::printf("  %s\n", complaint.c_str());
  std::printf("%s\n", failed ? "FAILED" : "passed");
  return failed ? 1 : 0;
}

}  // namespace
}  // namespace clearance::faults

int main(int argc, char** argv) {
  clearance::faults::Options o;
  CLI::App app(
      "Clients are killed, frozen and scribble, a daemon is starved of what it needs and another one killed, at "
      "random; clients beside them check every bit of their answers against an engine of their own. Exit code 0: "
      "no answer was wrong, nothing was left behind, the counters add up and memory is flat.",
      "clearance-soak");
  app.add_option("--minutes", o.minutes, "how long")->check(CLI::Range(0.05, 1e5))->capture_default_str();
  app.add_option("--seed", o.seed, "of all that is drawn at random")->capture_default_str();
  app.add_option("--load", o.load, "part of the time that each of the four clients of the daemon that lives asks")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--csv", o.csv, "where to write what was seen; default: standard output")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);
  setenv("CLEARANCE_HEAP_COUNTERS", "1", 1);  // for the daemons that this process starts
  std::setvbuf(stdout, nullptr, _IOLBF, 0);   // line-buffered, so that errors also reach a file immediately
  try {
    return clearance::faults::soak(o);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "clearance-soak: %s\n", error.what());
    return 1;
  }
}
