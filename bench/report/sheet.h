// The rows that clearance-report measures, and its timing loop.
#pragma once

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/timing.h"

namespace clearance::report {

/// A measurement: one method on one case of one experiment.
struct Row {
  std::string experiment, name, method;  ///< name: of the case
  std::uint64_t pairs = 0;               ///< of the whole case
  std::uint64_t measured = 0;            ///< pairs that were timed; wall_us is extrapolated from them
  double wall_us = 0;                    ///< least of several, for all pairs
  double kernel_us = 0;                  ///< likewise, of kernels; 0 if there are none or it is unknown
  int threads = 1;
  double worst_error = 0;  ///< in metres, outside the engine's certified intervals
  std::string note;
};

/// The CSV file, written row by row and printed as it grows.
class Sheet {
 public:
  Sheet(const std::string& path, const std::string& remark) : out_(path), path_(path) {
    out_ << "# " << remark << "\nexperiment,case,method,pairs,measured,wall_us,kernel_us,threads,worst_error_m,note\n";
    check();
  }
  void add(const Row& r) {
    char numbers[200];
    std::snprintf(numbers, sizeof numbers, "%llu,%llu,%.5g,%.5g,%d,%.2g", static_cast<unsigned long long>(r.pairs),
                  static_cast<unsigned long long>(r.measured), r.wall_us, r.kernel_us, r.threads, r.worst_error);
    out_ << r.experiment << ',' << r.name << ',' << r.method << ',' << numbers << ',' << r.note << std::endl;
    std::printf("%-12s %-16s %-24s %12.5g us  kernels %10.4g us  %s\n", r.experiment.c_str(), r.name.c_str(),
                r.method.c_str(), r.wall_us, r.kernel_us, r.note.c_str());
    std::fflush(stdout);
    check();
  }

 private:
  void check() const {
    if (!out_) throw std::runtime_error(path_ + ": cannot be written");
  }
  std::ofstream out_;
  std::string path_;
};

/// Least time of a call in microseconds, because other programs can only add to it. After a warm-up call, as many calls
/// as half a second allows, 3 to 50; calls of more than two seconds run twice in total.
/// \param once for quick runs: the first call alone
template <class F>
double least_us(const F& call, bool once = false) {
  const double first = bench::took_us(call);
  if (once) return first;
  if (first > 2e6) return std::min(first, bench::took_us(call));
  double least = bench::took_us(call);
  for (double spent = least, count = 1; count < 3 || (spent < 5e5 && count < 50); ++count) {
    const double us = bench::took_us(call);
    least = std::min(least, us);
    spent += us;
  }
  return least;
}

}  // namespace clearance::report
