// clearance-certificates: certificates of seeded pairs of every case class, and of motions of every kind, for
// tools/check_certificate.py.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "campaign.h"
#include "tests/motion/motion_cases.h"

namespace clearance::exact {
namespace {

struct Options {
  std::uint64_t cases = 1000, motions = 0, seed = 1;
  std::string out = "out/certificates", only;
};

// The cases of a class are shared out among these.
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

// Some motions of robots of all kinds of joints, and of bodies beside and on them, in a scene of their own.
void write_motions(const Options& o, test::MotionKind kind, std::uint64_t number) {
  constexpr int kAtOnce = 2;
  constexpr Reduce kReduces[] = {Reduce::kNone, Reduce::kMin, Reduce::kAny};
  const auto k = static_cast<std::uint64_t>(kind), kinds = static_cast<std::uint64_t>(test::kMotionKinds);
  test::Random random(o.seed * 1'000'003 + number * kinds + k);
  const test::MotionCase made(random, kind, kAtOnce, o.out);
  const Engine engine(Scene(made.scene), {.backend = "cpu", .threads = 1});
  test::Motions asked = made.motions;
  asked.pairs.clear();
  for (const BodyPair pair : engine.pairs(made.motions.view(Reduce::kNone)))
    if (made.exact.answers(pair)) asked.pairs.push_back(pair);
  if (asked.pairs.empty()) return;
  QueryView query = asked.view(kReduces[number % 3]);
  query.abs_tol = 1e-3;
  query.margin = 1e-3;
  write_file(o.out + "/motion_" + test::name_of(kind) + "_" + std::to_string(number) + ".json",
             engine.certificate(query));
}

int write(const Options& o) {
  std::filesystem::create_directories(o.out);
  for (const CaseClass& c : case_classes()) {
    if (c.name.find(o.only) == std::string::npos) continue;
    const std::uint64_t each = std::max<std::uint64_t>(o.cases / settings().size() / static_cast<unsigned>(c.cost), 1);
    std::uint64_t next = 0;
    for (const auto& [name, setting] : settings()) {
      std::vector<Case> cases;
      for (std::uint64_t i = 0; i < each; ++i) cases.push_back(make_case(c, o.seed, next++));
      const std::string path = o.out + "/" + c.name + "_" + name + ".json";
      write_file(path, Bench(cases, setting.backend).certificate(setting));
    }
  }
  for (int kind = 0; kind < test::kMotionKinds; ++kind)
    for (std::uint64_t i = 0; i < o.motions; ++i) write_motions(o, static_cast<test::MotionKind>(kind), i);
  return 0;
}

}  // namespace
}  // namespace clearance::exact

int main(int argc, char** argv) {
  clearance::exact::Options o;
  CLI::App app{"Writes certificates of seeded pairs of every class, one file for each class and setting."};
  app.add_option("--cases", o.cases, "of each class, fewer of those that take long")->check(CLI::PositiveNumber);
  app.add_option("--motions", o.motions, "scenes with two motions each, of each kind");
  app.add_option("--seed", o.seed, "of the cases");
  app.add_option("--class", o.only, "only classes whose names hold this");
  app.add_option("--out", o.out, "folder to write to");
  CLI11_PARSE(app, argc, argv);
  try {
    return clearance::exact::write(o);
  } catch (const std::exception& e) {
    std::cerr << "clearance-certificates: " << e.what() << '\n';
    return 2;
  }
}
