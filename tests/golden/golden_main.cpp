// clearance-golden: digests of all bits of answers. Moving or merging code must not change them.
#include <CLI/CLI.hpp>
#include <bit>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <sstream>

#include "engine/base/digest.h"
#include "engine/engine.h"
#include "engine/selection/query.h"
#include "tests/engine/engine_test_util.h"
#include "tests/golden/golden_scenes.h"

namespace clearance::golden {
namespace {

struct GoldenQuery {
  const char* name;
  Reduce reduce;
  bool cut;  // with the scene's cut-off distance, which is the margin for kAny
};
constexpr GoldenQuery kQuestions[] = {{"none", Reduce::kNone, false},    {"none_near", Reduce::kNone, true},
                                      {"within", Reduce::kWithin, true}, {"nearest", Reduce::kNearest, false},
                                      {"min", Reduce::kMin, false},      {"any", Reduce::kAny, true},
                                      {"any_0", Reduce::kAny, false}};

struct Setting {
  GoldenQuery question;
  Precision precision;
  bool depth;

  std::string name() const {
    return std::string(question.name) + (precision == Precision::kF32 ? ",f32" : ",f64") + (depth ? ",depth" : ",");
  }
};

std::vector<Setting> all_settings() {
  std::vector<Setting> all;
  for (const GoldenQuery& question : kQuestions)
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const bool depth : {false, true}) {
        if (depth && precision == Precision::kF32) continue;     // depths are always float64
        if (depth && question.reduce == Reduce::kAny) continue;  // kAny has no depths
        all.push_back({question, precision, depth});
      }
  return all;
}

/// Of the columns with the interval, and of all others.
struct Digests {
  Digest interval, rest;
  std::uint64_t ok = 0, overlap = 0, contact = 0, beyond = 0, other = 0;  ///< rows by status
};

// Bits of a number, with one representation of NaN.
std::uint64_t bits_of(double x) {
  return std::isnan(x) ? ~std::uint64_t{0} : std::bit_cast<std::uint64_t>(x);
}
std::uint64_t bits_of(float x) {
  return std::isnan(x) ? ~std::uint64_t{0} : std::bit_cast<std::uint32_t>(x);
}
std::uint64_t bits_of(std::uint64_t x) {
  return x;
}
std::uint64_t bits_of(BodyPair pair) {
  return std::uint64_t{pair.a} << 32 | pair.b;
}

void add(const test::Answer& answer, Digests* to) {
  const ReplyView& view = answer.view;
  to->rest.add(answer.info.total);
  for (std::uint64_t i = 0; i < answer.info.rows; ++i) {
    const auto status = static_cast<Status>(view.status[i]);
    ++(status == Status::kOk        ? to->ok
       : status == Status::kOverlap ? to->overlap
       : status == Status::kContact ? to->contact
       : status == Status::kBeyond  ? to->beyond
                                    : to->other);
  }
  const auto column = [&](auto* values, std::uint64_t width) {
    const void* const begin = values;
    const bool gives_interval =
        begin && (begin == view.distance || begin == view.lower || begin == view.upper || begin == view.status);
    for (std::uint64_t i = 0; values && i < answer.info.rows * width; ++i) {
      if constexpr (std::is_integral_v<std::remove_pointer_t<decltype(values)>>) {
        (gives_interval ? to->interval : to->rest).add(bits_of(std::uint64_t{values[i]}));
      } else {
        (gives_interval ? to->interval : to->rest).add(bits_of(values[i]));
      }
    }
  };
  for_each_column(column, view);
}

Digests evaluate(const engine::Engine& engine, const GoldenScene& g, const Setting& s) {
  QueryView q;
  q.reduce = s.question.reduce;
  if (s.question.cut) (q.reduce == Reduce::kAny ? q.margin : q.max_distance) = g.cut_off;
  q.fields = test::kAllFields;
  q.precision = s.precision;
  q.signed_distance = s.depth;
  q.configuration_count = kConfigurations;
  q.bodies = g.moved;
  Digests digests;
  for (const std::vector<Pose>* poses : {&g.configurations, &g.next}) {
    q.configurations = *poses;
    add(test::evaluate(engine, q), &digests);
  }
  q.configuration_count = 0;  // the current poses
  q.bodies = {};
  q.configurations = {};
  add(test::evaluate(engine, q), &digests);
  return digests;
}

std::string line_of(const GoldenScene& g, const Setting& s, const Digests& d) {
  std::string line = g.name + ',' + s.name();
  for (const std::uint64_t count : {d.ok, d.overlap, d.contact, d.beyond, d.other}) line += ',' + std::to_string(count);
  char digests[40];
  std::snprintf(digests, sizeof digests, ",%016llx,%016llx", static_cast<unsigned long long>(d.interval.value()),
                static_cast<unsigned long long>(d.rest.value()));
  return line + digests;
}

constexpr const char* kHead = "scene,reduce,precision,depth,ok,overlap,contact,beyond,other,interval,rest";

// The lines for each instruction set and number of threads, which must agree.
std::vector<std::string> lines_of(const std::string& instruction_set, int threads) {
  std::vector<std::string> lines{kHead};
  for (const GoldenScene& g : golden_scenes()) {
    engine::Engine::Options options{"cpu", threads};
    options.instruction_set = instruction_set;
    const engine::Engine engine(g.scene, options);
    for (const Setting& s : all_settings()) lines.push_back(line_of(g, s, evaluate(engine, g, s)));
  }
  return lines;
}

// Prints where lines differ from the expected ones. Returns the number of differences.
int compare(const std::vector<std::string>& expected, const std::vector<std::string>& got, const std::string& who) {
  int different = expected.size() == got.size() ? 0 : 1;
  if (different) std::cerr << who << ": " << got.size() << " lines, " << expected.size() << " are expected\n";
  for (std::size_t i = 0; i < std::min(expected.size(), got.size()); ++i) {
    if (expected[i] == got[i]) continue;
    if (++different <= 10) std::cerr << who << ": expected " << expected[i] << "\n  got " << got[i] << '\n';
  }
  return different;
}

std::vector<std::string> read_lines(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  if (lines.empty()) throw std::runtime_error(path + " holds no digests");
  return lines;
}

int run(const std::string& check, const std::string& write) {
  std::vector<std::string> expected;
  if (!check.empty()) expected = read_lines(check);
  int different = 0, ways = 0;
  for (const std::string& instruction_set : engine::Engine::instruction_sets())
    for (const int threads : {1, 3}) {
      const std::vector<std::string> got = lines_of(instruction_set, threads);
      if (expected.empty()) expected = got;
      different += compare(expected, got, instruction_set + ", " + std::to_string(threads) + " threads");
      ++ways;
    }
  std::cout << expected.size() - 1 << " digests, " << ways << " ways of computing each: " << different << " differ\n";
  if (different > 0) return 1;
  if (write.empty()) return 0;
  std::ofstream out(write);
  for (const std::string& line : expected) out << line << '\n';
  if (!out.flush()) throw std::runtime_error("cannot write " + write);
  return 0;
}

}  // namespace
}  // namespace clearance::golden

int main(int argc, char** argv) {
  std::string check, write;
  CLI::App app{
      "Digests of answers, every bit of them, by every instruction set of this machine and with 1 and 3 threads."};
  auto* to_check = app.add_option("--check", check, "file of digests that must come out");
  app.add_option("--write", write, "file to write them to")->excludes(to_check);
  CLI11_PARSE(app, argc, argv);
  try {
    return clearance::golden::run(check, write);
  } catch (const std::exception& error) {
    std::cerr << "clearance-golden: " << error.what() << '\n';
    return 2;
  }
}
