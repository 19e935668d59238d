// clearance-broad: cost of finding near pairs, for every method on the same moving bodies, then of whole queries by
// brute force and by the tree. Writes one row for each.
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numeric>

#include "bench/broad/broad_phase.h"
#include "bench/report/close_pairs.h"
#include "bench/timing.h"
#include "cli/machine_name.h"
#include "engine/engine.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/cases/random_motion.h"

namespace clearance {
namespace {

constexpr double kRadius = 2, kMargin = 2;                                 // metres
constexpr double kStep = 0.05, kTurn = 0.02;                               // motion per step, in metres and radians
constexpr std::size_t kMostForReport = 5000, kMostForBruteNearest = 5000;  // bodies; larger scenes take minutes

struct Options {
  std::string csv;
  std::vector<std::size_t> bodies{30, 100, 300, 1000, 5000, 50000};
  int rounds = 7;
  std::uint64_t seed = 1;
};

struct Setting {
  const char* name;
  double edge;  // edge of the volume of a thousand bodies, in metres; larger scenes are equally dense
};
constexpr Setting kSettings[] = {{"sparse", 200}, {"crowded", 60}};

// Spheres of 42 vertices that translate and rotate.
class Motion {
 public:
  Motion(std::size_t count, double edge, std::uint64_t seed) : random_(seed) {
    const double room = edge * std::cbrt(static_cast<double>(count) / 1000);
    for (std::size_t i = 0; i < count; ++i) {
      const auto id = scene.add_uv_sphere("s" + std::to_string(i), kRadius, 5, {});
      poses.push_back({id, random_.pose({room, room, room})});
      drift_.push_back(direction(random_) * kStep);
      turn_.push_back(turn(direction(random_), kTurn));
    }
  }
  void step() {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Vec3d t = poses[i].pose.translation + drift_[i];
      poses[i].pose = compose(poses[i].pose, turn_[i]);
      poses[i].pose.translation = t;
    }
  }
  std::vector<Aabb> boxes() const {
    std::vector<Aabb> all;
    for (const BodyPose& p : poses)
      all.push_back(certify_box(*scene.bodies()[p.body].parts[0], rotation_of(p.pose), p.pose.translation));
    return all;
  }

  engine::Scene scene;
  std::vector<BodyPose> poses;

 private:
  PortableRandom random_;
  std::vector<Vec3d> drift_;
  std::vector<Pose> turn_;
};

// Sweep and prune along x. The order is kept between calls and corrected by insertion sort.
class Sweep final : public BroadPhase {
 public:
  std::string_view name() const override { return "sweep"; }
  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    const auto before = [&](std::uint32_t a, std::uint32_t b) { return boxes[a].low.x < boxes[b].low.x; };
    if (order_.size() != boxes.size()) {
      order_.resize(boxes.size());
      std::iota(order_.begin(), order_.end(), 0u);
      std::sort(order_.begin(), order_.end(), before);
    }
    for (std::size_t i = 1; i < order_.size(); ++i)
      for (std::size_t k = i; k > 0 && before(order_[k], order_[k - 1]); --k) std::swap(order_[k], order_[k - 1]);
    const auto first = static_cast<std::ptrdiff_t>(out.size());
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const Aabb& a = boxes[order_[i]];
      for (std::size_t k = i + 1; k < order_.size(); ++k) {
        const Aabb& b = boxes[order_[k]];
        if (b.low.x - a.high.x > margin * (1 + 0x1p-40)) break;
        if (certify_box_gap(a, b) <= margin)
          out.push_back({std::min(order_[i], order_[k]), std::max(order_[i], order_[k])});
      }
    }
    std::sort(out.begin() + first, out.end());
  }

 private:
  mutable std::vector<std::uint32_t> order_;
};

struct Timing {
  std::string what, method;
  int threads;
  std::vector<double> ms;
  std::uint64_t pairs = 0;  // found in the last round
};

// The first round is a warm-up. Every method gets the same boxes, and all must find the same pairs.
std::vector<Timing> time_boxes(Motion& motion, int rounds) {
  const int all = omp_get_num_procs();
  const std::size_t n = motion.poses.size();
  struct Method {
    Timing timing;
    std::unique_ptr<BroadPhase> broad_phase;
  };
  std::vector<Method> methods;
  const auto add = [&](const char* name, int threads, std::unique_ptr<BroadPhase> method) {
    methods.push_back({{"boxes", name, threads, {}}, std::move(method)});
  };
  if (n <= kMostForReport) {
    add("report all pairs", 1, baselines::make_close_pairs("aabb_naive"));
    add("report all pairs", all, baselines::make_close_pairs("aabb_naive_omp"));
    add("report tree", 1, baselines::make_close_pairs("aabb_tree"));
  }
  add("brute force", 1, make_brute_force_broad_phase(1));
  add("brute force", all, make_brute_force_broad_phase(all));
  add("sweep kept", 1, std::make_unique<Sweep>());
  add("tree anew", 1, make_tree_broad_phase(1));
  add("tree kept", 1, make_tree_broad_phase(1, true));
  add("tree kept", all, make_tree_broad_phase(all, true));
  std::vector<BodyPair> expected, found;
  for (int round = 0; round <= rounds; ++round, motion.step()) {
    const std::vector<Aabb> boxes = motion.boxes();
    for (std::size_t m = 0; m < methods.size(); ++m) {
      found.clear();
      const double ms = 1e-3 * bench::took_us([&] { methods[m].broad_phase->candidates(boxes, kMargin, found); });
      if (m == 0) expected = found;
      if (found != expected)
        throw std::runtime_error(methods[m].timing.method + " finds other pairs than the first method");
      if (round > 0) methods[m].timing.ms.push_back(ms);
      methods[m].timing.pairs = found.size();
    }
  }
  std::vector<Timing> timings;
  for (Method& m : methods) timings.push_back(std::move(m.timing));
  return timings;
}

// Whole queries during motion, including the narrow phase.
std::vector<Timing> time_queries(Motion& motion, int rounds) {
  const int all = omp_get_num_procs();
  struct Requested {
    Timing timing;
    engine::Engine* engine;
    Reduce reduce;
  };
  std::vector<std::unique_ptr<engine::Engine>> engines;
  std::vector<Requested> requested;
  for (const int threads : {1, all})
    for (const char* by : {"brute", "tree"}) {
      engine::Engine::Options options;
      options.threads = threads;
      options.broad_phase = by;
      engines.push_back(std::make_unique<engine::Engine>(motion.scene, options));
      for (const auto& [name, reduce] :
           {std::pair("within", Reduce::kWithin), {"nearest", Reduce::kNearest}, {"min", Reduce::kMin}}) {
        if (reduce != Reduce::kWithin && by == std::string("brute") && motion.poses.size() > kMostForBruteNearest)
          continue;
        requested.push_back({{name, by, threads, {}}, engines.back().get(), reduce});
      }
    }
  for (int round = 0; round <= rounds; ++round, motion.step()) {
    for (const auto& engine : engines) engine->set_poses(motion.poses);
    for (Requested& a : requested) {
      QueryView query;
      query.reduce = a.reduce;
      if (a.reduce == Reduce::kWithin) query.max_distance = kMargin;
      const QuerySize size = a.engine->size(query);
      std::vector<double> distance(size.rows), lower(size.rows), upper(size.rows);
      std::vector<BodyPair> pair(size.rows);
      ReplyView reply;
      reply.distance = distance.data(), reply.lower = lower.data(), reply.upper = upper.data(),
      reply.pair = pair.data();
      const double ms = 1e-3 * bench::took_us([&] {
                          Job job = a.engine->start(query, reply);
                          while (!job.advance()) {
                          }
                          a.timing.pairs = job.info().pairs_evaluated;
                        });
      if (round > 0) a.timing.ms.push_back(ms);
    }
  }
  std::vector<Timing> timings;
  for (Requested& a : requested) timings.push_back(std::move(a.timing));
  return timings;
}

// Load of the machine at the start of the run; at most 1 on an idle machine.
double load_average() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? std::round(10 * load) / 10 : -1;
}

void run(const Options& o) {
  std::ofstream out(o.csv);
  if (!out) throw std::runtime_error(o.csv + ": cannot be written");
  out << "# spheres of 42 vertices and radius 2 m, pairs within 2 m, steps of 5 cm and 0.02 rad, seed " << o.seed
      << ", " << machine_name() << ", load " << load_average()
      << "\nsetting,bodies,what,method,threads,ms_median,ms_least,ms_most,pairs,rounds\n";
  for (const Setting& setting : kSettings)
    for (const std::size_t count : o.bodies) {
      const int rounds = count > 10000 ? std::min(o.rounds, 3) : count > 1000 ? o.rounds : 3 * o.rounds;
      Motion motion(count, setting.edge, o.seed);
      std::vector<Timing> timings = time_boxes(motion, rounds);
      for (Timing& t : time_queries(motion, rounds)) timings.push_back(std::move(t));
      std::printf("%s, %zu bodies\n", setting.name, count);
      for (const Timing& t : timings) {
        const auto [least, most] = std::minmax_element(t.ms.begin(), t.ms.end());
        // compares with the last method of the same task: the tree on all threads
        const Timing& best =
            *std::find_if(timings.rbegin(), timings.rend(), [&](const Timing& b) { return b.what == t.what; });
        std::printf("  %-8s %-18s %2d threads %12.4f ms  [%.4f, %.4f]  %10llu pairs  %8.2f x the tree\n",
                    t.what.c_str(), t.method.c_str(), t.threads, bench::median(t.ms), *least, *most,
                    static_cast<unsigned long long>(t.pairs), bench::median(t.ms) / bench::median(best.ms));
        out << setting.name << ',' << count << ',' << t.what << ',' << t.method << ',' << t.threads << ','
            << bench::median(t.ms) << ',' << *least << ',' << *most << ',' << t.pairs << ',' << rounds << '\n';
      }
      std::fflush(stdout);
      out.flush();
    }
  if (!out) throw std::runtime_error(o.csv + ": cannot be written");
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) {
  clearance::Options o;
  CLI::App app("Times the ways to find near pairs, alone and within whole queries.", "clearance-broad");
  app.add_option("--csv", o.csv, "file to write")->required();
  app.add_option("--bodies", o.bodies, "how many (may be repeated)")->check(CLI::Range(2, 1000000));
  app.add_option("--rounds", o.rounds, "timed, after one that is not")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--seed", o.seed)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    clearance::run(o);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "clearance-broad: " << error.what() << "\n";
    return 1;
  }
}
