// clearance-report: the experiments of the 2023 report on this machine, with its systems, ours and Coal (make bench
// SUITE=report, make gpu-bench TASK=report). Writes one row for each method and case.
#include <omp.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "bench/report/close_pairs.h"
#include "bench/report/contest.h"
#include "bench/report/cuda_gjk.h"
#include "cli/machine_name.h"
#include "engine/device/device.h"
#include "engine/hull/shapes.h"

namespace clearance::report {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Options {
  std::string csv, scenes = "scenes", remark = "make bench SUITE=report";
  std::vector<std::string> only;
  ContestOptions contest;
  bool brief = false;
};

class Experiments {
 public:
  Experiments(Sheet& sheet, const Options& options) : sheet_(sheet), o_(options) {}

  /// Sections 4.2.1 and 4.4.2: pairs of near boxes; computing the boxes is not timed.
  void close_pairs() {
    boxes_of("1000 meshes", baselines::World(load("random_1000")).boxes(), {0.0, 1.0, kInf});
    boxes_of("2 meshes", baselines::World(two_large()).boxes(), {kInf});
  }

  /// Section 4.4.2: distribution of the tree's time.
  void tree_profile() {
    const std::vector<Aabb> boxes = baselines::World(load("random_1000")).boxes();
    using Insert = baselines::AabbTree::Insert;
    for (const auto& [method, insert] : {std::pair{"heuristic as printed", Insert::kCost},
                                         {"without it", Insert::kLeft},
                                         {"price of the new parent", Insert::kNewParent}}) {
      std::unique_ptr<baselines::AabbTree> tree;
      const double build = timed([&] {
        tree = std::make_unique<baselines::AabbTree>(insert);
        for (std::uint32_t i = 0; i < boxes.size(); ++i) tree->insert(i, boxes[i]);
      });
      const baselines::TreeCounts counts = tree->counts();
      char note[120];
      std::snprintf(note, sizeof note, "depth %llu; %llu nodes visited; %llu costs",
                    static_cast<unsigned long long>(counts.depth),
                    static_cast<unsigned long long>(counts.visited_by_inserts),
                    static_cast<unsigned long long>(counts.costs));
      add_boxes("tree_profile", "build", method, boxes.size(), build, note);
      for (const double margin : {0.0, kInf}) {
        std::vector<std::uint32_t> found;
        const double us = timed([&] {
          for (const Aabb& box : boxes) {
            found.clear();
            tree->query(box, margin, found);
          }
        });
        add_boxes("tree_profile", margin > 0 ? "query margin inf" : "query margin 0", method, boxes.size(), us, "");
      }
    }
  }

  /// Sections 4.2.2 and 4.2.3: one pair of very large meshes, and the table of products for small meshes.
  void support_and_terms() {
    {
      Contest c(sheet_, o_.contest, "support", "2 large spheres", two_large());
      for (const char* method : {"gjk", "gjk_hill", "gjk_omp", "cuda_support_seq"}) c.baseline(method);
      c.baseline("cuda_support_par", ~0ull, 1024);
      ours(c);
      c.coal();
    }
    {
      Contest c(sheet_, o_.contest, "terms", "2 large spheres", two_large());
      c.baseline("cuda_terms_seq", ~0ull, 1024);
      c.baseline("cuda_terms_par", ~0ull, 1024);
    }
    Contest c(sheet_, o_.contest, "terms", "1000 spheres", load("random_1000"));
    c.baseline("cuda_terms_seq", most(20'000));
    c.baseline("cuda_terms_par", most(20'000));
  }

  /// Section 4.2.4.
  void pairs() {
    for (const char* count : {"1000", "5000"}) {
      if (o_.brief && *count == '5') continue;
      Contest c(sheet_, o_.contest, "pairs", std::string(count) + " spheres", load("random_" + std::string(count)));
      for (const char* method : {"gjk", "gjk_omp", "cuda_pairwise"}) c.baseline(method, most(500'000));
      c.baseline("cuda_batched");
      ours(c);
      c.coal(most(500'000));
    }
    if (!o_.contest.gpu) return;
    Contest c(sheet_, o_.contest, "block_size", "1000 spheres", load("random_1000"));
    for (const int block : {1, 2, 4, 8, 16, 26, 32, 64, 128, 256, 512}) c.baseline("cuda_batched", ~0ull, block);
  }

  /// Section 4.2.5, figure 4.
  void lite() {
    Contest c(sheet_, o_.contest, "lite", "benchmark_lite", load("benchmark_lite"));
    for (const char* method : {"naive", "naive_omp", "gjk", "gjk_hill", "gjk_omp", "cuda_pairwise", "cuda_batched"})
      c.baseline(method);
    ours(c);
    c.coal();
  }

  /// Section 4.3, figure 5, and beyond.
  void spheres() {
    for (const std::uint32_t count : {10u, 100u, 200u, 1000u, 5000u, 20'000u}) {
      if (o_.brief && count > 200) break;
      const engine::Scene scene = count <= 5000 ? load("random_" + std::to_string(count)) : random_spheres(count);
      Contest c(sheet_, o_.contest, "spheres", std::to_string(count), scene);
      if (count <= 1000) c.baseline("naive", most(400));
      c.baseline("gjk", most(500'000));
      c.baseline("gjk_omp", most(1'000'000));
      if (count <= 5000) c.baseline("cuda_batched");
      c.engine("clearance", "cpu", o_.contest.threads);
      c.engine("clearance_cuda", "cuda", o_.contest.threads);
      c.nearest("clearance_nearest");
      c.coal(most(200'000));
    }
  }

  /// Section 4.4.3.
  void transfers() {
    engine::Scene scene = load("random_1000");
    baselines::World world(scene);
    std::vector<Pose> poses;
    for (const Body& body : scene.bodies()) poses.push_back(*body.pose);
    const std::uint64_t pairs = world.size() * (world.size() - 1) / 2;
    const auto add = [&](const char* method, double us, std::size_t bytes) {
      Row r;
      r.experiment = "transfers";
      r.name = "1000 spheres";
      r.method = method;
      r.pairs = r.measured = pairs;
      r.wall_us = us;
      r.note = std::to_string(bytes) + " bytes";
      sheet_.add(r);
    };
    add("vertices moved into the world", timed([&] { world.place(poses); }), world.vertices().size_bytes());
    if (!o_.contest.gpu) return;
    using baselines::Transfer;
    baselines::Transfers transfers(world, pairs);
    for (const auto& [method, transfer] : {std::pair{"vertices mesh by mesh", Transfer::kMeshByMesh},
                                           {"vertices in one array", Transfer::kGeometry},
                                           {"list of pairs", Transfer::kPairs},
                                           {"answers back", Transfer::kAnswers},
                                           {"poses alone", Transfer::kPoses}}) {
      std::size_t bytes = 0;
      const double us = timed([&] { bytes = transfers.run(transfer); });
      add(method, us, bytes);
    }
    Contest c(sheet_, o_.contest, "transfers", "1000 spheres", scene);
    c.baseline("cuda_batched");
    c.engine("clearance_cuda", "cuda", o_.contest.threads);
  }

 private:
  engine::Scene load(const std::string& name) const {
    return engine::Scene::load(o_.scenes + "/" + name + "/scene.yaml");
  }

  // scenes/two_spheres, or the same with fewer vertices for quick runs.
  engine::Scene two_large() const {
    if (!o_.brief) return load("two_spheres");
    engine::Scene scene;
    scene.add_uv_sphere("left", 2, 20, {.pose = Pose{{-2.5, 0, 0}, 1, 0, 0, 0}});
    scene.add_uv_sphere("right", 2, 20, {.pose = Pose{{2.5, 0.7, 0.3}, 0.8, 0.2, 0.4, 0.4}});
    return scene;
  }

  // Like scenes/random_*, with the same density.
  static engine::Scene random_spheres(std::uint32_t count) {
    const double box = 60 * std::cbrt(count / 1000.0);
    PortableRandom random(1);
    engine::Scene scene;
    for (std::uint32_t i = 0; i < count; ++i)
      scene.add_uv_sphere("s" + std::to_string(i), 2, 5, {.pose = random.pose({box, box, box})});
    return scene;
  }

  template <class F>
  double timed(const F& call) const {
    return least_us(call, o_.contest.once);
  }

  std::uint64_t most(std::uint64_t pairs) const { return o_.brief ? std::min<std::uint64_t>(pairs, 50) : pairs; }

  void ours(Contest& c) {
    c.engine("clearance_1", "cpu", 1);
    c.engine("clearance", "cpu", o_.contest.threads);
    c.engine("clearance_cuda", "cuda", o_.contest.threads);
  }

  void add_boxes(const std::string& experiment, const std::string& name, const std::string& method, std::size_t bodies,
                 double us, const std::string& note, int threads = 1) {
    Row r;
    r.experiment = experiment;
    r.name = name;
    r.method = method;
    r.pairs = r.measured = bodies * (bodies - 1) / 2;
    r.wall_us = us;
    r.threads = threads;
    r.note = note;
    sheet_.add(r);
  }

  void boxes_of(const std::string& name, const std::vector<Aabb>& boxes, const std::vector<double>& margins) {
    const int all = o_.contest.threads ? o_.contest.threads : omp_get_max_threads();
    // Boxes one step later: a kept tree follows them back and forth.
    std::vector<Aabb> moved = boxes;
    PortableRandom random(1);
    for (Aabb& box : moved) {
      const Vec3d step{random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02)};
      box.low += step;
      box.high += step;
    }
    for (const double margin : margins) {
      std::vector<std::pair<std::string, std::unique_ptr<BroadPhase>>> methods;
      for (const std::string& method : baselines::close_pairs_names())
        methods.emplace_back(method, baselines::make_close_pairs(method, o_.contest.threads));
      methods.emplace_back("clearance_brute", make_brute_force_broad_phase());
      methods.emplace_back("clearance_tree", make_tree_broad_phase());
      methods.emplace_back("clearance_tree_kept", make_tree_broad_phase(1, true));
      char label[80];
      std::snprintf(label, sizeof label, "%s; margin %g", name.c_str(), margin);
      std::vector<BodyPair> expected, found;
      for (const auto& [method, system] : methods) {
        bool there = method.ends_with("_kept");
        const double us = timed([&] {
          if (method.ends_with("_kept")) there = !there;
          found.clear();
          system->candidates(there ? moved : boxes, margin, found);
        });
        found.clear();
        system->candidates(boxes, margin, found);
        if (expected.empty()) expected = found;
        if (found != expected) throw std::runtime_error(method + " finds other pairs than aabb_naive");
        add_boxes("close_pairs", label, method, boxes.size(), us, std::to_string(found.size()) + " found",
                  method.ends_with("_omp") ? all : 1);
      }
    }
  }

  Sheet& sheet_;
  const Options& o_;
};

/// Load of the machine at the start: other programs slow down methods with several threads most.
std::string load() {
  std::string one = "?";
  std::ifstream("/proc/loadavg") >> one;
  return "load " + one;
}

int run(Options o) {
  o.contest.gpu = cuda::device_info().present && !baselines::cuda_narrow_names().empty();
  o.contest.once = o.brief;
  std::filesystem::create_directories(o.contest.scratch);
  Sheet sheet(
      o.csv, machine_name() + (o.contest.gpu ? ", " + cuda::device_info().name : "") + "; " + load() + "; " + o.remark);
  Experiments all(sheet, o);
  const std::pair<const char*, void (Experiments::*)()> experiments[] = {{"close_pairs", &Experiments::close_pairs},
                                                                         {"tree_profile", &Experiments::tree_profile},
                                                                         {"support", &Experiments::support_and_terms},
                                                                         {"pairs", &Experiments::pairs},
                                                                         {"lite", &Experiments::lite},
                                                                         {"spheres", &Experiments::spheres},
                                                                         {"transfers", &Experiments::transfers}};
  for (const auto& [name, member] : experiments)
    if (o.only.empty() || std::find(o.only.begin(), o.only.end(), name) != o.only.end()) (all.*member)();
  return 0;
}

}  // namespace
}  // namespace clearance::report

int main(int argc, char** argv) {
  using namespace clearance::report;
  Options o;
  CLI::App app("Measures the systems of the 2023 report, the engine, and Coal on the report's experiments.",
               "clearance-report");
  app.add_option("--csv", o.csv, "file to write")->required();
  app.add_option("--remark", o.remark, "how it was run, for the file's first line")->capture_default_str();
  app.add_option("--scenes", o.scenes, "folder of the repository's scenes")->capture_default_str();
  app.add_option("--only", o.only,
                 "close_pairs, tree_profile, support, pairs, lite, spheres or transfers (may be repeated)");
  app.add_option("--threads", o.contest.threads, "of methods with several; 0 for all cores")->capture_default_str();
  app.add_option("--coal", o.contest.coal,
                 "Coal's program, built by bench/peers/bench_peers.py; without it Coal is left out");
  app.add_option("--scratch", o.contest.scratch, "folder for Coal's problems")->default_val("/tmp");
  app.add_flag("--brief", o.brief, "small cases only, to see that it runs");
  CLI11_PARSE(app, argc, argv);
  try {
    return run(o);
  } catch (const std::exception& error) {
    std::cerr << "clearance-report: " << error.what() << "\n";
    return 1;
  }
}
