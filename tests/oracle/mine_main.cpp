// clearance-mine: searches for pairs that are hard for the engine. Starts from the case classes and climbs: small
// changes to vertices, poses and gap are kept if they make the engine's interval wider or its answer worse. Prints the
// results in the form of mined_cases.inc, for manual review.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>

#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

struct Options {
  std::uint64_t seed = 1;
  double seconds = 60;
  int generations = 30;
  int offspring = 48;
  double keep = 1.0;
  std::size_t max_vertices = 16;
  std::string only;
};

/// One small change of a pair, of a kind that a modeller, a planner or rounding could make.
Case changed(Random& random, const Case& from) {
  Case c = from;
  const auto change_solid = [&](SolidPtr& solid) {
    Solid s = *solid;
    Vec3d& v = s.vertices[static_cast<std::size_t>(random.integer(0, static_cast<int>(s.vertices.size()) - 1))];
    const Vec3d other =
        s.vertices[static_cast<std::size_t>(random.integer(0, static_cast<int>(s.vertices.size()) - 1))];
    const int k = random.integer(0, 2);
    switch (random.integer(0, 6)) {
      case 0:
        v[k] += random.sign() * random.log_uniform(1e-17, 1) * (std::abs(v[k]) + 1e-3 * norm(v));
        break;
      case 1:
        v[k] = std::nextafter(v[k], random.sign() * std::numeric_limits<double>::infinity());
        break;
      case 2:
        v[k] = other[k];
        break;  // aligned
      case 3:
        v = other + (v - other) * random.log_uniform(1e-9, 2);
        break;  // slivers
      case 4:
        v[k] *= random.log_uniform(1e-6, 1e3);
        break;
      case 5:
        if (s.vertices.size() > 1) v = s.vertices.back(), s.vertices.pop_back();
        break;
      default:
        for (Vec3d& w : s.vertices) w[k] *= random.chance(0.5) ? 0.5 : random.log_uniform(0.1, 10);
    }
    solid = std::make_shared<const Solid>(std::move(s));
  };
  const auto change_pose = [&](Pose& X) {
    double* q[4] = {&X.qw, &X.qx, &X.qy, &X.qz};
    const int k = random.integer(0, 3);
    switch (random.integer(0, 3)) {
      case 0:
        *q[k] += random.sign() * random.log_uniform(1e-17, 0.1);
        break;
      case 1:
        X.translation[k % 3] += random.sign() * random.log_uniform(1e-17, 1) * (scale_of(c) + 1e-300);
        break;
      case 2:
        X.translation[k % 3] =
            std::nextafter(X.translation[k % 3], random.sign() * std::numeric_limits<double>::infinity());
        break;
      default:
        *q[k] = random.chance(0.5) ? 0 : *q[(k + 1) % 4];
    }
    if (check(X) == PoseQuality::kBad) X = Pose{X.translation};
  };
  for (int changes = random.integer(1, 3); changes > 0; --changes) switch (random.integer(0, 4)) {
      case 0:
        change_solid(c.a);
        break;
      case 1:
        change_solid(c.b);
        break;
      case 2:
        change_pose(c.X_wa);
        break;
      case 3:
        change_pose(c.X_wb);
        break;
      default:
        set_gap(c, random.sign() * scale_of(c) * random.log_uniform(1e-17, 1));
    }
  const double s = scale_of(c);
  return s > 1e-12 && s < 1e15 ? c : from;
}

struct Found {
  double score = 0;
  std::string why;
};

/// Hardness of each case: the width without a tolerance (as a share of 32 eps S), since with a tolerance the engine
/// stops there and leaves no slope to climb; far more if an answer under any setting is wrong.
std::vector<Found> score(const std::vector<Case>& cases, const std::vector<Setting>& settings) {
  std::vector<Found> found(cases.size());
  std::vector<Result> exact_value;
  for (const Case& c : cases) exact_value.push_back(exact_answer(c));
  const Bench cpu(cases, "cpu"), reference(cases, "reference");
  for (const Setting& s : settings) {
    const std::vector<Answer> answers = (s.backend == "cpu" ? cpu : reference).evaluate(s);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const CheckResult v = hold_against(cases[i], exact_value[i], s, answers[i]);
      double x = s.rel_tol == 0 ? std::min(v.width, 1e6) : 0;
      if (!v.inaccuracy.empty()) x += 1e6;
      if (!v.violation.empty()) x += 1e9;
      if (x > found[i].score) found[i] = {x, s.name() + ": " + v.violation + v.inaccuracy + " " + in_words(answers[i])};
    }
  }
  return found;
}

void mine(const Options& o) {
  std::vector<Setting> settings;
  for (const Setting& s : standard_settings())
    if (!s.float32 && s.max_distance > 1e299) settings.push_back(s);
  Random random(o.seed);
  const auto start = std::chrono::steady_clock::now();
  const auto spent = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  std::int64_t tried = 0, kept = 0;
  double best_ever = 0;
  for (std::uint64_t climb = 0; spent() < o.seconds; ++climb) {
    const CaseClass& cls =
        case_classes()[static_cast<std::size_t>(random.integer(0, static_cast<int>(case_classes().size()) - 1))];
    if (!o.only.empty() && cls.name.find(o.only) == std::string::npos) continue;
    Case best = make_case(cls, o.seed, climb);
    if (best.a->vertices.size() > o.max_vertices || best.b->vertices.size() > o.max_vertices) continue;
    double best_score = 0;
    std::string why;
    for (int g = 0; g < o.generations && best_score < 1e6 && spent() < o.seconds; ++g) {
      std::vector<Case> offspring;
      for (int i = 0; i < o.offspring; ++i) offspring.push_back(g == 0 && i == 0 ? best : changed(random, best));
      const std::vector<Found> found = score(offspring, settings);
      tried += o.offspring;
      const auto top = std::max_element(found.begin(), found.end(),
                                        [](const Found& a, const Found& b) { return a.score < b.score; });
      if (top->score > best_score) {
        best_score = top->score;
        best = offspring[static_cast<std::size_t>(top - found.begin())];
        why = top->why;
      }
    }
    best_ever = std::max(best_ever, best_score);
    if (best_score < o.keep) continue;
    ++kept;
    std::cout << "// from " << cls.name << ", " << best_score << " x 32 eps S, " << why << '\n'
              << as_initialiser(best) << std::flush;
  }
  std::cerr << tried << " pairs tried, " << kept << " kept, hardest " << best_ever << " x 32 eps S\n";
}

}  // namespace
}  // namespace clearance::exact

int main(int argc, char** argv) {
  clearance::exact::Options o;
  CLI::App app{"Searches for pairs on which the engine's interval is wide or its answer is wrong."};
  app.add_option("--seed", o.seed);
  app.add_option("--seconds", o.seconds, "how long to search");
  app.add_option("--generations", o.generations, "of each climb");
  app.add_option("--offspring", o.offspring, "changes tried in each generation");
  app.add_option("--keep", o.keep, "print pairs whose width without tolerance is at least this share of 32 eps S");
  app.add_option("--max-vertices", o.max_vertices, "of each piece");
  app.add_option("--class", o.only, "start only from classes whose names hold this");
  CLI11_PARSE(app, argc, argv);
  try {
    clearance::exact::mine(o);
  } catch (const std::exception& e) {
    std::cerr << "clearance-mine: " << e.what() << '\n';
    return 2;
  }
}
