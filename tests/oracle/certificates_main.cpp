// clearance-certificates: checks certificates of seeded pairs of every case class, and of motions of every kind, with
// the oracle, and keeps some of them for tools/check_certificate.py.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <mutex>
#include <sstream>
#include <thread>

#include "tests/engine/motion/motion_cases.h"
#include "tests/oracle/certificate/certificate_oracle.h"
#include "tests/oracle/in_parallel.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

struct Options {
  std::uint64_t cases = 1000, meshes = 0, motions = 0, first_motion = 0, python = 1000, python_motions = 0, seed = 1;
  int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::string out = "out/certificates", only;
};

// The cases of a class are divided among these.
const std::vector<std::pair<std::string, Setting>>& settings() {
  static const std::vector<std::pair<std::string, Setting>> all = [] {
    Setting plain, depth, single, cut_off, narrow;
    depth.signed_distance = true;
    single.precision = Precision::kF32;
    cut_off.max_distance = 0.1;
    narrow.rel_tol = 1e-15;  // in double-double
    return std::vector<std::pair<std::string, Setting>>{
        {"f64", plain}, {"depth", depth}, {"f32", single}, {"cut_off", cut_off}, {"narrow", narrow}};
  }();
  return all;
}

void write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
}

double seconds_of_this_thread() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Results of the documents. prove_document() is thread-safe.
class Count {
 public:
  // Also keeps documents that fail.
  void prove_document(const std::string& path, const std::string& document, std::size_t expected_rows, bool keep) {
    const double start = seconds_of_this_thread();
    const certificate_oracle::Findings findings = certificate_oracle::prove_certificate(document);
    const double took = seconds_of_this_thread() - start;
    const std::lock_guard lock(mutex_);
    seconds_ += took;
    ++documents_;
    bytes_ += document.size();
    rows_ += findings.why.size();
    proved_ += findings.proved();
    const bool is_good = findings.all_proved() && findings.why.size() == expected_rows;
    if (!is_good) say_why(path, findings, expected_rows);
    if (!keep && is_good) return;
    ++kept_;
    write_file(path, document);
  }

  bool all_proved() const { return rows_ > 0 && failed_ == 0; }
  std::string text() const {
    std::ostringstream text;
    text << proved_ << " of " << rows_ << " rows are proved, of " << documents_ << " documents of "
         << bytes_ / 1'000'000 << " MB; the judge took " << seconds_ << " s; " << kept_ << " are kept";
    return text.str();
  }

 private:
  void say_why(const std::string& path, const certificate_oracle::Findings& findings, std::size_t expected_rows) {
    ++failed_;
    for (std::size_t k = 0; k < findings.why.size(); ++k)
      if (!findings.why[k].empty()) std::cerr << path << ": rows[" << k << "]: NOT PROVED: " << findings.why[k] << '\n';
    std::cerr << path << ": " << findings.proved() << " of " << expected_rows << " rows are proved "
              << findings.no_certificate << '\n';
  }

  std::mutex mutex_;
  std::size_t documents_ = 0, rows_ = 0, proved_ = 0, kept_ = 0, failed_ = 0, bytes_ = 0;
  double seconds_ = 0;  // of the oracle
};

// One of the two bodies of a case, and in place of the other a half-space at a gap of about none, little, or more: in
// any orientation, or level, and with its origin at some distance along the plane.
Case beside_plane(const Case& c, Random& random) {
  const bool is_a = random.chance(0.5);
  const SolidPtr& solid = is_a ? c.a : c.b;
  const Pose &X_ws = is_a ? c.X_wa : c.X_wb, X_wp = random.chance(0.3) ? Pose() : random.rotation();
  const Mat3d R_ws = rotation_of(X_ws), R_wp = rotation_of(X_wp);
  double lowest = std::numeric_limits<double>::infinity(), size = solid->radius;
  for (const Vec3d& v : solid->vertices) {
    lowest = std::min(lowest, (R_wp.transpose_times(R_ws * v + X_ws.translation)).z);
    size = std::max(size, solid->radius + norm(v));
  }
  Solid plane;
  plane.is_half_space = true;
  plane.radius = random.chance(0.5) ? 0 : size * random.log_uniform(1e-3, 1);
  const double gaps[] = {0, 1e-15, 1e-9, 1e-3, 0.1, 1}, gap = size * random.sign() * gaps[random.integer(0, 5)];
  const Vec3d foot = R_wp.transpose_times(X_ws.translation);
  const double aside = random.chance(0.5) ? 0 : size * random.log_uniform(0.1, 1e6);
  Pose X = X_wp;
  X.translation = R_wp * Vec3d{foot.x + aside, foot.y, lowest - solid->radius - plane.radius - gap};
  const auto shared = std::make_shared<const Solid>(std::move(plane));
  return is_a ? Case{solid, shared, X_ws, X} : Case{shared, solid, X, X_ws};
}

// Moves the bodies of a case over a half-space through a place next to one of them.
void check_motions_over_plane(const Options& o, const test::MotionCase& made, test::MotionKind kind,
                              std::uint64_t number, Count& count) {
  constexpr std::size_t kMostPairs = 4;
  Random random(o.seed * 1'000'003 + 10 * number + static_cast<std::uint64_t>(kind));
  engine::Scene scene(made.scene);
  std::vector<Vec3d> places;
  for (const Body& body : scene.bodies())
    if (body.robot == kNone && body.parent == kNone && body.pose) places.push_back(body.pose->translation);
  if (places.empty()) return;
  Pose X = random.rotation();
  X.translation = places[static_cast<std::size_t>(random.integer(0, static_cast<int>(places.size()) - 1))];
  const std::uint32_t plane = scene.add_half_space("plane", {.radius = random.chance(0.5) ? 0 : 0.01, .pose = X});
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  test::Motions requested = made.motions;
  requested.pairs.clear();
  for (const BodyPair pair : engine.pairs(made.motions.view(Reduce::kNone)))
    if ((pair.a == plane || pair.b == plane) && requested.pairs.size() < kMostPairs)
      requested.pairs.push_back(random.chance(0.5) ? pair : BodyPair{pair.b, pair.a});
  if (requested.pairs.empty()) return;
  const Reduce reduce = number % 2 == 0 ? Reduce::kNone : Reduce::kAny;
  QueryView query = requested.view(reduce);
  query.abs_tol = 1e-3;
  query.margin = 1e-3;
  query.fields |= kFieldFirstContact;
  count.prove_document(
      o.out + "/plane_" + test::name_of(kind) + "_" + std::to_string(number) + ".json", engine.certificate(query),
      requested.count() * (reduce == Reduce::kNone ? requested.pairs.size() : 1), number < o.python_motions);
}

// Some motions of robots with all kinds of joints, and of bodies next to and on them, in a scene of their own.
void check_motions(const Options& o, test::MotionKind kind, std::uint64_t number, Count& count) {
  constexpr int kAtOnce = 2;
  constexpr Reduce kReduces[] = {Reduce::kNone, Reduce::kMin, Reduce::kAny};
  const auto k = static_cast<std::uint64_t>(kind), kinds = static_cast<std::uint64_t>(test::kAllKinds);
  test::Random random(o.seed * 1'000'003 + number * kinds + k);
  const std::string folder = o.out + "/robots_" + test::name_of(kind);  // for its robots' file
  std::filesystem::create_directories(folder);
  const test::MotionCase made(random, kind, kAtOnce, folder);
  check_motions_over_plane(o, made, kind, number, count);
  const engine::Engine engine(engine::Scene(made.scene),
                              {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  test::Motions requested = made.motions;
  requested.pairs.clear();
  for (const BodyPair pair : engine.pairs(made.motions.view(Reduce::kNone)))
    if (made.exact.answers(pair)) requested.pairs.push_back(pair);
  if (requested.pairs.empty()) return;
  const Reduce reduce = kReduces[number % 3];
  QueryView query = requested.view(reduce);
  query.abs_tol = 1e-3;
  query.margin = 1e-3;
  query.fields |= kFieldFirstContact;
  count.prove_document(o.out + "/motion_" + test::name_of(kind) + "_" + std::to_string(number) + ".json",
                       engine.certificate(query), kAtOnce * (reduce == Reduce::kNone ? requested.pairs.size() : 1),
                       number < o.python_motions);
}

// Whether a setting suits a class: clouds have no depth.
bool fits(const Setting& setting, const CaseClass& c) {
  return !setting.signed_distance || c.name.find("cloud") == std::string::npos;
}

// Number of a class's `cases` for each setting.
std::uint64_t share(const CaseClass& c, std::uint64_t cases) {
  return std::max<std::uint64_t>(cases / settings().size() / static_cast<unsigned>(c.cost), 1);
}

// Checks the cases of a class under one setting, in batches, and keeps the first of them.
// \param cases of the class, of which `python` are kept
// \param beside_planes replaces one of the two bodies of each by a half-space
void check_cases(const Options& o, const CaseClass& c, std::uint64_t cases, std::uint64_t python, std::size_t setting,
                 bool beside_planes, Count& count) {
  constexpr std::uint64_t kAtOnce = 100;
  const auto& [name, requested] = settings()[setting];
  const std::uint64_t each = share(c, cases), kept = python == 0 ? 0 : std::min(share(c, python), each);
  for (std::uint64_t begin = 0; begin < each;) {
    const std::uint64_t end = std::min(begin + kAtOnce, begin < kept ? kept : each);
    std::vector<Case> made;
    for (std::uint64_t i = begin; i < end; ++i) {
      made.push_back(make_case(c, o.seed, setting * each + i));
      if (!beside_planes) continue;
      Random random(o.seed * 7'919 + setting * each + i);
      made.back() = beside_plane(made.back(), random);
    }
    count.prove_document(
        o.out + "/" + c.name + (beside_planes ? "_plane_" : "_") + name + "_" + std::to_string(begin) + ".json",
        Bench(made, requested.backend).certificate(requested), made.size(), begin < kept);
    begin = end;
  }
}

bool check_all(const Options& o) {
  constexpr std::uint64_t kFewerPlanes = 3;
  std::filesystem::create_directories(o.out);
  Count count;
  std::vector<std::function<void()>> tasks;
  for (int kind = 0; kind < test::kAllKinds; ++kind) {
    if (static_cast<test::MotionKind>(kind) == test::MotionKind::kMeanwhile) continue;  // has no certificates
    tasks.emplace_back([&o, &count, kind] {
      for (std::uint64_t i = 0; i < o.motions; ++i)
        check_motions(o, static_cast<test::MotionKind>(kind), o.first_motion + i, count);
    });
  }
  const auto add = [&](const CaseClass& c, std::uint64_t cases, std::uint64_t python) {
    for (std::size_t k = 0; k < settings().size() && c.name.find(o.only) != std::string::npos; ++k)
      for (const bool beside_planes : {false, true}) {
        if (!fits(settings()[k].second, c)) continue;
        tasks.emplace_back([&o, &c, &count, cases, python, beside_planes, k] {
          const std::uint64_t every = beside_planes ? kFewerPlanes : 1;
          check_cases(o, c, cases / every, python / every, k, beside_planes, count);
        });
      }
  };
  for (const CaseClass& c : case_classes()) add(c, o.cases, o.python);
  for (const CaseClass& c : mesh_classes())
    if (o.meshes > 0) add(c, o.meshes, std::min(o.python, o.meshes));
  in_parallel(tasks.size(), o.threads, [&](std::size_t k) { tasks[k](); });
  std::cout << count.text() << '\n';
  return count.all_proved();
}

}  // namespace
}  // namespace clearance::exact

int main(int argc, char** argv) {
  clearance::exact::Options o;
  CLI::App app{"Makes certificates of seeded pairs of every class, and judges them. Exit code 0: all rows are proved."};
  app.add_option("--cases", o.cases, "of each class, fewer of those that take long")->check(CLI::PositiveNumber);
  app.add_option("--meshes", o.meshes, "of each class of bodies that are not convex");
  app.add_option("--motions", o.motions, "scenes with two motions each, of each kind");
  app.add_option("--first-motion", o.first_motion, "number of the first of these scenes");
  app.add_option("--python", o.python, "cases of each class to keep for tools/check_certificate.py");
  app.add_option("--python-motions", o.python_motions, "scenes of each kind of motion to keep for it");
  app.add_option("--seed", o.seed, "of the cases");
  app.add_option("--threads", o.threads, "classes at a time")->check(CLI::Range(1, 256));
  app.add_option("--class", o.only, "only classes whose names hold this");
  app.add_option("--out", o.out, "folder for those that are kept, and those that fail");
  CLI11_PARSE(app, argc, argv);
  try {
    return clearance::exact::check_all(o) ? 0 : 1;
  } catch (const std::exception& e) {
    std::cerr << "clearance-certificates: " << e.what() << '\n';
    return 2;
  }
}
