// The part of clearance-certify about robots that brake.
#include <fstream>
#include <iostream>
#include <mutex>
#include <stdexcept>

#include "tests/oracle/certify.h"
#include "tests/oracle/in_parallel.h"
#include "tests/oracle/stops/approaches.h"

namespace clearance::exact {

bool certify_stops(const CertifyOptions& o) {
  constexpr std::int64_t kAtOnce = 2000;
  const auto shares = static_cast<std::size_t>((o.stops + kAtOnce - 1) / kAtOnce);
  stops::Findings all;
  std::mutex mutex;
  std::size_t done = 0;
  const auto write = [&] {
    if (o.csv.empty()) return;
    std::ofstream out(o.csv);
    const auto compared = static_cast<double>(all.compared);
    out << "# approaches " << all.approaches << " of " << o.stops << ", seed " << o.seed << ", " << done << " arms\n"
        << "approaches,contacts,within_10_mm,least_m,braked_harder,joint_by_joint,compared,slower,slower_still,"
           "speed_scale,capsule_speed_scale\n"
        << all.approaches << ',' << all.contacts << ',' << all.close << ',' << all.least << ',' << all.harder << ','
        << all.apart << ',' << all.compared << ',' << all.slower << ',' << all.slower_still << ','
        << all.speed / compared << ',' << all.capsule_speed / compared << '\n';
    if (!out.flush()) throw std::runtime_error("cannot write " + o.csv);
  };
  in_parallel(shares, o.threads, [&](std::size_t k) {
    const stops::Findings found = stops::approach(o.seed * 1'000'000 + k, kAtOnce);
    const std::lock_guard lock(mutex);
    all.add(found);
    if (found.wrong() > 0) std::cerr << "stops, share " << k << ": " << found.text() << '\n';
    if (++done % 20 == 0) {
      std::cerr << all.approaches << " approaches\n";
      write();  // for a run that is stopped
    }
  });
  write();
  std::cerr << all.text() << '\n';
  return all.wrong() == 0;
}

}  // namespace clearance::exact
