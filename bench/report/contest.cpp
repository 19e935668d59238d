#include "bench/report/contest.h"

#include <omp.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <sstream>

#include "bench/peers/problem.h"
#include "bench/report/narrow.h"
#include "engine/device/device.h"

namespace clearance::report {

namespace {

constexpr std::uint64_t kWithPoints = 1 << 24;  // maximum rows of an answer with witness points: 1.2 GB

struct Interval {
  std::vector<double> lower, upper;
};

/// The reference backend's interval over all these pairs.
Interval exact_value_of(const engine::Engine& engine, const std::vector<BodyPair>& pairs) {
  Interval exact_value{std::vector<double>(pairs.size()), std::vector<double>(pairs.size())};
  QueryView query;
  query.all_pairs = false;
  query.pairs = pairs;
  query.rel_tol = 1e-12;
  query.fields = kFieldLower | kFieldUpper;
  ReplyView reply;
  reply.lower = exact_value.lower.data(), reply.upper = exact_value.upper.data();
  Job job = engine.start(query, reply);
  while (!job.advance()) {
  }
  return exact_value;
}

/// Output of Coal's program for some lines of input.
std::vector<std::string> talk(const std::string& program, const std::string& problem, const std::string& lines) {
  const std::string command = "printf '" + lines + "' | '" + program + "' '" + problem + "' 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) throw std::runtime_error("cannot run " + program);
  std::string text;
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe)) text += buffer;
  pclose(pipe);
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

peers::Problem problem_of(const engine::Scene& scene, const baselines::World& world,
                          const std::vector<BodyPair>& pairs) {
  peers::Problem p;
  std::map<const DisplayMesh*, std::uint32_t> shapes;
  for (std::uint32_t b = 0; b < world.size(); ++b) {
    const DisplayMesh& mesh = *world.body_mesh(b);
    const auto [at, fresh] = shapes.try_emplace(&mesh, static_cast<std::uint32_t>(p.shapes.size()));
    if (fresh) {
      peers::Shape shape;
      for (const Vec3d& v : mesh.vertices) shape.vertices.push_back({v.x, v.y, v.z});
      shape.triangles = mesh.triangles;
      p.shapes.push_back(std::move(shape));
    }
    p.bodies.push_back({at->second});
    const Pose X = scene.bodies()[b].pose.value_or(Pose{});
    p.poses.push_back({X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz});
  }
  for (const BodyPair& pair : pairs) p.pairs.push_back({pair.a, pair.b});
  p.exact_value.assign(pairs.size(), std::numeric_limits<double>::quiet_NaN());
  p.scale.assign(pairs.size(), 0);
  return p;
}

}  // namespace

Contest::Contest(Sheet& sheet, const ContestOptions& options, std::string experiment, std::string name,
                 const engine::Scene& scene)
    : sheet_(sheet),
      options_(options),
      experiment_(std::move(experiment)),
      name_(std::move(name)),
      scene_(scene),
      world_(scene),
      all_(std::uint64_t{scene.bodies().size()} * (scene.bodies().size() - 1) / 2) {}

std::vector<BodyPair> Contest::sample(std::uint64_t most) const {
  const std::uint64_t stride = (all_ + most - 1) / std::max<std::uint64_t>(1, most);
  std::vector<BodyPair> pairs;
  std::uint64_t at = 0;
  for (std::uint32_t a = 0; a < world_.size(); ++a)
    for (std::uint32_t b = a + 1; b < world_.size(); ++b)
      if (at++ % std::max<std::uint64_t>(1, stride) == 0) pairs.push_back({a, b});
  return pairs;
}

double Contest::worst_error(const std::vector<BodyPair>& pairs, const std::vector<double>& distances) {
  std::vector<BodyPair> checked;  // a sample suffices for many pairs
  std::vector<double> answers;
  for (std::size_t i = 0; i < pairs.size(); i += 1 + pairs.size() / 50'000) {
    checked.push_back(pairs[i]);
    answers.push_back(distances[i]);
  }
  const Interval exact_value = exact_value_of(engine::Engine(scene_), checked);
  double worst = 0;
  for (std::size_t i = 0; i < checked.size(); ++i) {
    if (std::isnan(answers[i])) return answers[i];
    worst = std::max({worst, exact_value.lower[i] - answers[i], answers[i] - exact_value.upper[i]});
  }
  return worst;
}

Row Contest::row(const std::string& method, std::uint64_t measured, double us) const {
  Row r;
  r.experiment = experiment_;
  r.name = name_;
  r.method = method;
  r.pairs = all_;
  r.measured = measured;
  r.wall_us = us * static_cast<double>(all_) / static_cast<double>(measured);
  return r;
}

void Contest::baseline(const std::string& method, std::uint64_t most, int block_size) {
  baselines::NarrowOptions options;
  options.threads = options_.threads;
  if (block_size > 0) options.block_size = block_size;
  const bool cuda = method.starts_with("cuda_");
  if (cuda && !options_.gpu) return;
  const auto system = baselines::make_narrow(method, options);
  const std::vector<BodyPair> pairs = sample(most);
  std::vector<baselines::PairAnswer> answers(pairs.size());
  const double us = least_us([&] { system->distances(world_, pairs, answers); }, options_.once);
  Row r = row(method, pairs.size(), us);
  r.kernel_us = system->kernel_us() * r.wall_us / us;
  r.threads = method.ends_with("_omp") ? (options.threads ? options.threads : omp_get_max_threads()) : 1;
  std::vector<double> distances;
  double iterations = 0;
  for (const auto& a : answers) {
    distances.push_back(a.distance);
    iterations += a.iterations;
  }
  r.worst_error = worst_error(pairs, distances);
  char note[80] = "";
  if (iterations > 0)
    std::snprintf(note, sizeof note, "%.2f iterations", iterations / static_cast<double>(pairs.size()));
  r.note = note;
  if (block_size > 0) r.note = "block " + std::to_string(block_size);
  sheet_.add(r);
}

void Contest::engine(const std::string& method, const std::string& backend, int threads) {
  if (backend == "cuda" && !options_.gpu) return;
  engine::Engine::Options options;
  options.backend = backend;
  options.threads = threads;
  const engine::Engine engine(scene_, options);
  QueryView query;
  query.fields = all_ <= kWithPoints ? kDefaultFields | kFieldPoints : kDefaultFields;
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, all_, query.fields, &bytes);
  // Replies that a GPU writes itself are in pinned memory, as in the daemon's shared memory.
  std::unique_ptr<cuda::PinnedMemory> pinned;
  std::vector<std::byte> pageable;
  void* base;
  if (backend == "cuda") {
    pinned = std::make_unique<cuda::PinnedMemory>(bytes);
    base = pinned->data();
  } else {
    std::size_t space = bytes + 64;
    pageable.resize(space);
    base = pageable.data();
    std::align(64, bytes, base, space);
  }
  const ReplyView reply = reply_view_over(static_cast<std::byte*>(base), all_, query.fields);
  const auto kernel_ns = [&] {
    for (const auto& [key, value] : engine.stats())
      if (key == "cuda.kernel_ns") return static_cast<double>(value);
    return 0.0;
  };
  double kernels = 0;  // of the last call
  const double us = least_us(
      [&] {
        const double before = kernel_ns();
        Job job = engine.start(query, reply);
        while (!job.advance()) {
        }
        kernels = kernel_ns() - before;
      },
      options_.once);
  Row r = row(method, all_, us);
  r.threads = threads ? threads : omp_get_max_threads();
  r.kernel_us = 1e-3 * kernels;
  if (!(query.fields & kFieldPoints)) r.note = "without points";
  sheet_.add(r);
}

void Contest::nearest(const std::string& method) {
  engine::Engine::Options options;
  options.threads = options_.threads;
  const engine::Engine engine(scene_, options);
  QueryView query;
  query.reduce = Reduce::kNearest;
  query.fields = kDefaultFields | kFieldPoints | kFieldPair;
  const QuerySize size = engine.size(query);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  std::vector<std::byte> memory(bytes + 64);
  void* base = memory.data();
  std::size_t space = memory.size();
  std::align(64, bytes, base, space);
  const ReplyView reply = reply_view_over(static_cast<std::byte*>(base), size.rows, size.fields);
  const double us = least_us(
      [&] {
        Job job = engine.start(query, reply);
        while (!job.advance()) {
        }
      },
      options_.once);
  Row r = row(method, all_, us);
  r.threads = options.threads ? options.threads : omp_get_max_threads();
  r.note = "each body's nearest";
  sheet_.add(r);
}

void Contest::coal(std::uint64_t most) {
  if (options_.coal.empty()) return;
  const std::vector<BodyPair> pairs = sample(most);
  const std::string problem = options_.scratch + "/report_problem.bin",
                    answers_file = options_.scratch + "/report_answers.bin";
  peers::write_problem(problem_of(scene_, world_, pairs), problem);
  Row best;
  std::string rejection = "no answer";
  for (const std::string setting : {"default", "bounding volume", "default 1e-12", "bounding volume 1e-12"}) {
    const auto lines =
        talk(options_.coal, problem,
             "time 0.1 " + setting + "\\ntime 0.5 " + setting + "\\nwrite " + answers_file + " " + setting + "\\n");
    if (lines.empty() || !lines[0].starts_with("settings")) {
      if (!lines.empty())
        rejection = lines[0].substr(lines[0].find(": ") == std::string::npos ? 0 : lines[0].find(": ") + 2);
      break;
    }
    if (lines.size() < 4) throw std::runtime_error("Coal ended on the setting \"" + setting + "\"");
    Row r = row("coal", pairs.size(), 1e6 * std::stod(lines[2].substr(lines[2].find('\t') + 1)));
    std::vector<double> answers(pairs.size());
    std::ifstream in(answers_file, std::ios::binary);
    peers::detail::get(in, answers.data(), answers.size());
    for (double& d : answers) d = std::max(d, 0.0);
    r.worst_error = worst_error(pairs, answers);
    r.note = setting;
    if (r.worst_error < 1e-5 && (best.method.empty() || r.wall_us < best.wall_us)) best = r;
  }
  std::remove(problem.c_str());
  std::remove(answers_file.c_str());
  if (best.method.empty()) {
    best = row("coal", pairs.size(), std::numeric_limits<double>::quiet_NaN());
    best.note = "refused: " + rejection;
    std::replace(best.note.begin(), best.note.end(), ',', ';');
  }
  sheet_.add(best);
}

}  // namespace clearance::report
