// Edges of planning problems per second on a device, host to host, compared with the CPU's results:
// clearance-gpu-motions FOLDER ... (bench/gpu/write_motion_scenes.py).
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>

#include "bench/timing.h"
#include "engine/device/device.h"
#include "engine/motion/motion_step.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::uint32_t edges = 1'000'000, compared = 5000;
  double margin = 0;
  int repeats = 5, threads = 0;
  std::string csv;
  std::vector<std::string> folders;
};

// The reduction, and the columns in addition to the default ones.
struct Columns {
  const char* name;
  std::uint32_t fields;
  Reduce reduce = Reduce::kAny;
};
constexpr std::uint32_t kVerdict = kDefaultFields | kFieldPair | kFieldTime | kFieldSteps;
constexpr Columns kColumns[]{{"verdict", kVerdict},
                             {"first_contact", kVerdict | kFieldFirstContact},
                             {"python_default", kVerdict | kFieldFirstContact | kFieldFlags},
                             {"least", kVerdict, Reduce::kMin},
                             {"least_python_default", kVerdict | kFieldFirstContact | kFieldFlags, Reduce::kMin}};

std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [key, value] : engine.stats())
    if (key == name) return value;
  return 0;
}

// From a problem's start and goal in random directions, 0.2 to 1.5 rad long, as in bench/robots/bench_motions.py.
struct Edges {
  std::vector<std::uint32_t> joints;
  std::vector<double> positions;

  Edges(const engine::Scene& scene, const std::string& folder, std::uint32_t count) {
    std::ifstream file(folder + "/ends.txt");
    std::string line, name;
    if (!std::getline(file, line)) throw std::runtime_error(folder + "/ends.txt: cannot read it");
    std::istringstream names(line);
    while (names >> name) {
      const auto at = std::find_if(scene.joints().begin(), scene.joints().end(),
                                   [&](const SceneJoint& joint) { return joint.name == name; });
      if (at == scene.joints().end()) throw std::runtime_error(folder + ": no joint " + name);
      joints.push_back(static_cast<std::uint32_t>(at - scene.joints().begin()));
    }
    std::vector<double> ends[2];
    for (auto& end : ends) {
      double q = 0;
      while (end.size() < joints.size() && file >> q) end.push_back(q);
      if (end.size() < joints.size()) throw std::runtime_error(folder + "/ends.txt: expected two configurations");
    }
    Random random(1);
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::vector<double>& start = ends[i % 2];
      std::vector<double> way;
      double squares = 0;
      for (std::size_t j = 0; j < joints.size(); ++j) way.push_back(random.normal()), squares += way[j] * way[j];
      const double scale = random.uniform(0.2, 1.5) / std::sqrt(squares);
      positions.insert(positions.end(), start.begin(), start.end());
      for (std::size_t j = 0; j < joints.size(); ++j) positions.push_back(start[j] + scale * way[j]);
    }
  }
  QueryView query(double margin, std::uint32_t count, const Columns& columns) const {
    const bool least = columns.reduce == Reduce::kMin;
    QueryView q;
    q.joints = joints;
    q.positions = std::span(positions).first(std::size_t{2} * count * joints.size());
    q.configuration_count = 2 * count;
    q.reduce = columns.reduce;
    q.max_evaluations = 256;
    q.margin = margin;
    q.abs_tol = least ? 1e-3 : 0;
    q.rel_tol = least ? 0 : 1e-6;
    q.fields = columns.fields;
    return q;
  }
};

struct Sums {
  double wall_s = 0, kernel_s = 0, cpu_s = 0;
  std::uint64_t edges = 0, free = 0, undecided = 0, on_cpu = 0, compared = 0, wrong = 0, undecided_on_cpu = 0;
  std::uint64_t steps = 0, apart = 0;
};

// Whether the intervals of first contact intersect and the device's is as narrow as the CPU's are required to be.
bool is_same_contact(const ReplyView& ours, const ReplyView& theirs, std::uint32_t i) {
  if (!ours.first_contact) return true;
  const double *const a = ours.first_contact + 2 * std::size_t{i}, *const b = theirs.first_contact + 2 * std::size_t{i};
  const bool is_narrow = std::isinf(a[1]) || a[1] - a[0] <= std::max(kContactTime, b[1] - b[0]);
  return a[0] <= b[1] && b[0] <= a[1] && is_narrow;
}

bool is_free(const ReplyView& reply, std::uint32_t i, const Columns& columns, double margin) {
  return columns.reduce == Reduce::kMin ? reply.lower[i] > margin
                                        : static_cast<Status>(reply.status[i]) == Status::kBeyond;
}
// Whether the decisions are equal; for the least distance, whether the intervals intersect and the device's is as
// narrow as requested, apart from slack.
bool is_same(const ReplyView& ours, const ReplyView& theirs, std::uint32_t i, const Columns& columns) {
  if (columns.reduce != Reduce::kMin) return is_free(ours, i, columns, 0) == is_free(theirs, i, columns, 0);
  return ours.lower[i] <= theirs.upper[i] && theirs.lower[i] <= ours.upper[i] &&
         ours.upper[i] - ours.lower[i] <= 1e-3 * (1 + 1e-6);
}

// Writes a row of the results.
void write(std::ostream& csv, const std::string& name, const Columns& columns, std::uint64_t pairs, double margin,
           const Sums& s) {
  const double million = 1e-6 * static_cast<double>(s.edges);
  csv << name << ',' << columns.name << ',' << pairs << ',' << margin << ',' << s.edges << ',' << million / s.wall_s
      << ',' << million / s.kernel_s << ',' << 1e-6 * static_cast<double>(s.compared) / s.cpu_s << ',' << s.free << ','
      << s.on_cpu << ',' << s.undecided << ',' << s.compared << ',' << s.undecided_on_cpu << ',' << s.wrong << '\n';
}

void run(const std::string& folder, const engine::Scene& scene, const Edges& edges, const Columns& columns,
         const Options& o, std::ostream& csv, Sums& sums) {
  engine::Engine device(engine::Scene(scene), {.backend = "cuda", .threads = o.threads}),
      cpu(engine::Scene(scene), {.backend = "cpu", .threads = o.threads});
  const QueryView all = edges.query(o.margin, o.edges, columns);
  const QuerySize size = device.size(all);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  const cuda::PinnedMemory room(bytes);
  const ReplyView reply = reply_view_over(room.data(), size.rows, size.fields);
  std::vector<double> walls, kernels;
  std::uint64_t on_cpu = 0;
  std::string backend;
  for (int i = -1; i < o.repeats; ++i) {
    const std::uint64_t kernel_before = counter(device, "cuda.kernel_ns"),
                        cpu_before = counter(device, "cuda.motions_finished_on_cpu");
    const auto begin = Clock::now();
    Job job = device.start(all, reply);
    while (!job.advance()) {
    }
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    backend = job.info().backend;
    on_cpu = counter(device, "cuda.motions_finished_on_cpu") - cpu_before;
    if (i < 0) continue;
    walls.push_back(seconds);
    kernels.push_back(1e-9 * static_cast<double>(counter(device, "cuda.kernel_ns") - kernel_before));
  }
  if (backend != "cuda") throw std::runtime_error(folder + ": answered by " + backend);
  const double wall = bench::median(walls), kernel = bench::median(kernels);
  Sums own;
  own.wall_s = wall;
  own.kernel_s = kernel;
  own.edges = o.edges;
  own.on_cpu = on_cpu;
  for (std::uint32_t i = 0; i < o.edges; ++i) {
    const auto status = static_cast<Status>(reply.status[i]);
    own.free += is_free(reply, i, columns, o.margin);
    own.undecided += status == Status::kUnconverged;
    own.steps += reply.steps[i];
  }
  own.compared = std::min(o.compared, o.edges);
  const QueryView some = edges.query(o.margin, static_cast<std::uint32_t>(own.compared), columns);
  evaluate(cpu, some);
  const auto begin = Clock::now();
  const Answer wanted = evaluate(cpu, some);
  own.cpu_s = std::chrono::duration<double>(Clock::now() - begin).count();
  for (std::uint32_t i = 0; i < own.compared; ++i) {
    const auto theirs = static_cast<Status>(wanted.view.status[i]), ours = static_cast<Status>(reply.status[i]);
    own.undecided_on_cpu += theirs == Status::kUnconverged;
    if (theirs == Status::kUnconverged || ours == Status::kUnconverged) continue;
    own.wrong += !is_same(reply, wanted.view, i, columns) || !is_same_contact(reply, wanted.view, i);
    own.apart += !(reply.lower[i] <= reply.upper[i]);
  }
  std::printf(
      "%-40s %-14s %6u pairs | %8.0f edges/ms kernels %8.0f | CPU %6.2f edges/ms | free %4.1f %% | to the CPU %6.3f %% "
      "| undecided %llu, CPU's %llu of %llu | steps %.2f | wrong %llu\n",
      folder.c_str(), columns.name, static_cast<unsigned>(size.pairs), 1e-3 * o.edges / wall, 1e-3 * o.edges / kernel,
      1e-3 * static_cast<double>(own.compared) / own.cpu_s, 100.0 * static_cast<double>(own.free) / o.edges,
      100.0 * static_cast<double>(on_cpu) / o.edges, static_cast<unsigned long long>(own.undecided),
      static_cast<unsigned long long>(own.undecided_on_cpu), static_cast<unsigned long long>(own.compared),
      static_cast<double>(own.steps) / o.edges, static_cast<unsigned long long>(own.wrong));
  std::fflush(stdout);
  own.wrong += own.apart;
  const std::size_t slash = folder.find_last_of('/');
  write(csv, folder.substr(slash == std::string::npos ? 0 : slash + 1), columns, size.pairs, o.margin, own);
  sums.wall_s += wall;
  sums.kernel_s += kernel;
  sums.cpu_s += own.cpu_s;
  sums.edges += own.edges;
  sums.free += own.free;
  sums.undecided += own.undecided;
  sums.on_cpu += own.on_cpu;
  sums.compared += own.compared;
  sums.wrong += own.wrong;
  sums.undecided_on_cpu += own.undecided_on_cpu;
}

int main_of(int argc, char** argv) {
  Options o;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto next = [&] {
      if (++i >= argc) throw std::runtime_error(word + ": expected a value");
      return std::string(argv[i]);
    };
    if (word == "--edges")
      o.edges = static_cast<std::uint32_t>(std::stoul(next()));
    else if (word == "--compared")
      o.compared = static_cast<std::uint32_t>(std::stoul(next()));
    else if (word == "--margin")
      o.margin = std::stod(next());
    else if (word == "--threads")
      o.threads = std::stoi(next());
    else if (word == "--repeats")
      o.repeats = std::stoi(next());
    else if (word == "--csv")
      o.csv = next();
    else
      o.folders.push_back(word);
  }
  if (!cuda::device_info().present) {
    std::fprintf(stderr, "no device: %s\n", cuda::device_info().reason.c_str());
    return 2;
  }
  Sums sums[std::size(kColumns)];
  std::ofstream csv(o.csv);  // nothing is written without a name
  csv << "# device: " << cuda::device_info().name << "\n# command: make gpu-bench\nscene,columns,pairs,margin_m,edges,"
      << "million_edges_s,million_edges_s_in_kernels,million_edges_s_cpu,free,finished_by_cpu,undecided,compared,"
      << "undecided_by_cpu,wrong\n";
  for (const std::string& folder : o.folders) {
    const engine::Scene scene = engine::Scene::load(folder + "/scene.yaml", true);
    const Edges edges(scene, folder, o.edges);
    for (std::size_t c = 0; c < std::size(kColumns); ++c) run(folder, scene, edges, kColumns[c], o, csv, sums[c]);
  }
  std::uint64_t wrong = 0;
  for (std::size_t c = 0; c < std::size(kColumns); ++c) {
    const Sums& s = sums[c];
    write(csv, "all", kColumns[c], 0, o.margin, s);
    const double million = 1e-6 * static_cast<double>(s.edges);
    std::printf(
        "all, %s: %.2f M edges/s host to host, %.2f M in kernels; CPU %.4f M; finished by the CPU %.3f %%; undecided "
        "%llu of %llu; wrong %llu of %llu\n",
        kColumns[c].name, million / s.wall_s, million / s.kernel_s, 1e-6 * static_cast<double>(s.compared) / s.cpu_s,
        100.0 * static_cast<double>(s.on_cpu) / static_cast<double>(s.edges),
        static_cast<unsigned long long>(s.undecided), static_cast<unsigned long long>(s.edges),
        static_cast<unsigned long long>(s.wrong), static_cast<unsigned long long>(s.compared));
    wrong += s.wrong;
  }
  return wrong > 0;
}

}  // namespace
}  // namespace clearance::test

int main(int argc, char** argv) {
  try {
    return clearance::test::main_of(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
