// The parts of clearance-certify about motions.
#include <fstream>
#include <iostream>
#include <mutex>
#include <stdexcept>

#include "tests/engine/motion/motion_oracle.h"
#include "tests/oracle/certify.h"
#include "tests/oracle/in_parallel.h"

namespace clearance::exact {
namespace {

void write_motions(const CertifyOptions& o, const std::string& what, std::size_t first_kind,
                   const std::vector<test::MotionFindings>& kinds) {
  if (o.csv.empty()) return;
  std::ofstream out(o.csv);
  out << "# " << what << ", seed " << o.seed << ", backend " << o.backends.front() << ", judged with 60 digits\n"
      << "kind,motions,overlaps,free,hits,undecided,on_device,least_on_device,nearer,farther,untrue,wide,decided_early,"
         "stopped\n";
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const test::MotionFindings& f = kinds[k];
    out << test::name_of(static_cast<test::MotionKind>(first_kind + k)) << ',' << f.motions << ',' << f.overlaps << ','
        << f.free << ',' << f.hits << ',' << f.undecided << ',' << f.on_device << ',' << f.least_on_device << ','
        << f.nearer << ',' << f.farther << ',' << f.untrue << ',' << f.wide << ',' << f.decided << ',' << f.stopped
        << '\n';
  }
  if (!out.flush()) throw std::runtime_error("cannot write " + o.csv);
}

}  // namespace

bool certify_motions(const CertifyOptions& o) {
  const std::string& backend = o.backends.front();
  constexpr int kAtOnce = 400;
  const auto shares = static_cast<std::size_t>((o.motions + kAtOnce - 1) / kAtOnce);
  std::vector<test::MotionFindings> kinds(test::kMotionKinds);
  test::MotionFindings all;
  std::mutex mutex;
  in_parallel(shares, o.threads, [&](std::size_t k) {
    const std::size_t kind = k % kinds.size();
    const test::MotionFindings found =
        test::check_many(o.seed * 1'000 + k, kAtOnce, static_cast<int>(kind), false, backend);
    const std::lock_guard lock(mutex);
    kinds[kind].add(found);
    all.add(found);
    if (found.wrong() > 0) std::cerr << "motions, share " << k << ": " << found.text() << '\n';
    if (all.motions / kAtOnce % 25 == 0) std::cerr << all.motions << " motions\n";
  });
  std::cerr << all.text() << '\n';
  write_motions(o, "motions " + std::to_string(o.motions), 0, kinds);
  return all.wrong() == 0 && (backend != "cuda" || all.on_device > 0);
}

bool certify_trajectories(const CertifyOptions& o) {
  constexpr std::int64_t kAtOnce = 100;
  const auto shares = static_cast<std::size_t>((o.trajectories + kAtOnce - 1) / kAtOnce);
  std::vector<test::MotionFindings> all(1);
  std::mutex mutex;
  std::size_t done = 0;
  in_parallel(shares, o.threads, [&](std::size_t k) {
    const std::int64_t count = std::min(kAtOnce, o.trajectories - static_cast<std::int64_t>(k) * kAtOnce);
    const test::MotionFindings found = test::check_trajectories(o.seed * 1'000'000 + k, static_cast<int>(count));
    const std::lock_guard lock(mutex);
    all[0].add(found);
    if (found.wrong() > 0) std::cerr << "trajectories, share " << k << ": " << found.text() << '\n';
    if (++done % 20 == 0) std::cerr << done * kAtOnce << " trajectories\n";
  });
  std::cerr << o.trajectories << " trajectories: " << all[0].text() << '\n';
  write_motions(o, "trajectories " + std::to_string(o.trajectories),
                static_cast<std::size_t>(test::MotionKind::kTrajectory), all);
  return all[0].wrong() == 0;
}

}  // namespace clearance::exact
