#include "bench/tradeoff/sweep.h"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ostream>

#include "bench/timing.h"

namespace clearance::tradeoff {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kTurn = 8;  // settings between two timings of the default query

// If the calling thread does all the work, its processor time equals that of an idle machine; a device is timed by the
// wall clock.
double now_ns(bool by_thread) {
  if (!by_thread)
    return static_cast<double>(
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
            .count());
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

/// Accumulates the accuracy of a setting's answers.
class Quality {
 public:
  void add(const Interval& exact, double distance, double lower, double upper, Status status) {
    ++answers_;
    if (!(lower <= exact.upper && upper >= exact.lower)) ++violations_;
    ++count_[static_cast<std::size_t>(status)];
    if (status == Status::kBeyond) return;
    const double exact_value = 0.5 * exact.lower + 0.5 * exact.upper;
    const double error = std::abs(distance - exact_value), width = upper - lower;
    error_.push_back(error);
    width_.push_back(width);
    if (exact.lower > 0) {
      rel_error_.push_back(error / exact_value);
      rel_width_.push_back(width / exact_value);
    }
  }

  void finish(Point& p) {
    p.error = spread_of(std::move(error_));
    p.width = spread_of(std::move(width_));
    p.rel_error = spread_of(std::move(rel_error_));
    p.rel_width = spread_of(std::move(rel_width_));
    const auto share = [&](Status s) { return count_[static_cast<std::size_t>(s)] / answers_; };
    p.ok = share(Status::kOk);
    p.overlap = share(Status::kOverlap);
    p.contact = share(Status::kContact);
    p.beyond = share(Status::kBeyond);
    p.unconverged = share(Status::kUnconverged);
    p.violations = violations_;
  }

 private:
  double answers_ = 0;
  std::size_t violations_ = 0;
  double count_[16] = {};
  std::vector<double> error_, width_, rel_error_, rel_width_;
};

/// The scene in one backend, ready for queries in any setting.
class Bench {
 public:
  Bench(const MovingScene& scene, const ExactDistances& exact_value, const SweepOptions& options)
      : scene_(scene),
        exact_value_(exact_value),
        engine_(scene.scene, {options.backend, 1}),
        answers_(scene.pairs.size() * scene.steps.size()),
        by_thread_(options.backend == "cpu" || options.backend == "reference") {
    for (const BodyPose& b : scene.steps[0]) bodies_.push_back(b.body);
    for (const std::vector<BodyPose>& step : scene.steps)
      for (const BodyPose& b : step) configurations_.push_back(b.pose);
  }

  /// Runs all steps. Returns nanoseconds per pair.
  /// \param quality null if only the time is wanted
  double run(const Setting& s, Quality* quality, double* evaluated) {
    QueryView query;
    query.all_pairs = false;
    query.pairs = scene_.pairs;
    query.fields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;
    query.precision = s.precision;
    query.rel_tol = s.rel_tol;
    query.abs_tol = s.abs_tol;
    query.max_distance = s.reach < kInf ? s.reach * exact_value_.median : kInf;
    const std::size_t pairs = scene_.pairs.size(), steps = scene_.steps.size();
    const auto check = [&](std::size_t step, std::size_t first) {
      for (std::size_t i = 0; quality && i < pairs; ++i)
        quality->add(exact_value_.exact[step][i], answers_.distance[first + i], answers_.lower[first + i],
                     answers_.upper[first + i], static_cast<Status>(answers_.status[first + i]));
    };
    double total = 0;
    std::uint64_t looked_at = 0;
    const auto evaluate = [&](bool counts) {
      const double begin = now_ns(by_thread_);
      Job job = engine_.start(query, answers_.view());
      job.advance();
      const double time = now_ns(by_thread_) - begin;
      if (!counts) return;
      total += time;
      looked_at += job.info().pairs_evaluated;
    };
    engine_.set_poses(scene_.steps[0]);
    evaluate(false);  // fills caches, as a loop would
    if (s.requested == Requested::kBatch) {
      query.bodies = bodies_;
      query.configurations = configurations_;
      query.configuration_count = static_cast<std::uint32_t>(steps);
      evaluate(true);
      for (std::size_t step = 0; step < steps; ++step) check(step, step * pairs);
    } else {
      for (std::size_t step = 0; step < steps; ++step) {
        engine_.set_poses(scene_.steps[step]);
        evaluate(true);
        check(step, 0);
      }
    }
    const auto rows = static_cast<double>(steps * pairs);
    if (evaluated) *evaluated = static_cast<double>(looked_at) / rows;
    return total / rows;
  }

 private:
  const MovingScene& scene_;
  const ExactDistances& exact_value_;
  engine::Engine engine_;
  Answers answers_;
  std::vector<std::uint32_t> bodies_;  // that move
  std::vector<Pose> configurations_;   // of each step, of each moving body
  bool by_thread_;
};

const char* name_of(Requested requested) {
  switch (requested) {
    case Requested::kSteps:
      return "steps";
    case Requested::kBatch:
      return "batch";
  }
  return "";
}

}  // namespace

std::vector<Setting> all_settings(bool brief) {
  struct Tolerance {
    double rel, abs;
  };
  std::vector<Tolerance> tolerances;
  for (const double rel : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12}) tolerances.push_back({rel, 0});
  for (const double abs : {1e-1, 1e-2, 1e-3, 1e-4, 1e-6}) tolerances.push_back({0, abs});
  std::vector<double> reaches{kInf, 1, 0.1};
  if (brief) {
    tolerances = {{1e-1, 0}, {1e-6, 0}, {0, 1e-3}};
    reaches = {kInf, 1};
  }
  std::vector<Setting> settings;
  for (const Precision precision : {Precision::kF64, Precision::kF32})
    for (const Requested requested : {Requested::kSteps, Requested::kBatch})
      for (const double reach : reaches)
        for (const Tolerance t : tolerances) settings.push_back({precision, t.rel, t.abs, reach, requested});
  return settings;
}

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
  };
  return {at(0.5), at(0.99), values.back()};
}

std::vector<Point> sweep(const MovingScene& scene, const ExactDistances& exact_value, const SweepOptions& options) {
  Bench bench(scene, exact_value, options);
  const std::vector<Setting> settings = all_settings(options.brief);
  std::vector<Point> points(settings.size());
  std::vector<std::vector<double>> times(settings.size()), ratios(settings.size());
  bench.run(kDefault, nullptr, nullptr);
  for (int round = 0; round < options.rounds; ++round)
    for (std::size_t first = 0; first < settings.size(); first += kTurn) {
      const double before = bench.run(kDefault, nullptr, nullptr);
      const std::size_t end = std::min(settings.size(), first + kTurn);
      for (std::size_t i = first; i < end; ++i) {
        Quality quality;
        times[i].push_back(bench.run(settings[i], round == 0 ? &quality : nullptr, &points[i].evaluated));
        if (round == 0) quality.finish(points[i]);
      }
      const double usual = 0.5 * (before + bench.run(kDefault, nullptr, nullptr));
      for (std::size_t i = first; i < end; ++i) ratios[i].push_back(times[i].back() / usual);
    }
  for (std::size_t i = 0; i < settings.size(); ++i) {
    Point& p = points[i];
    p.setting = settings[i];
    p.ns_per_pair = bench::median(times[i]);
    std::sort(times[i].begin(), times[i].end());
    p.ns_quartiles = times[i][times[i].size() * 3 / 4] - times[i][times[i].size() / 4];
    p.ratio = bench::median(ratios[i]);
  }
  // The timing of the default query among the settings differs slightly from those between them: its own ratio is 1 by
  // definition.
  const auto usual = std::find_if(points.begin(), points.end(), [](const Point& p) { return p.setting == kDefault; });
  const double offset = usual->ratio;
  for (Point& p : points) p.ratio /= offset;
  return points;
}

void write_header(std::ostream& out) {
  out << "scene,backend,model,precision,asked,rel_tol,abs_tol,reach,max_distance,pairs,steps,ns_per_pair,ns_quartiles,"
         "ratio,"
         "evaluated";
  for (const char* what : {"error", "width", "rel_error", "rel_width"})
    for (const char* which : {"p50", "p99", "max"}) out << ',' << what << '_' << which;
  out << ",ok,overlap,contact,beyond,unconverged,violations\n";
}

void write_rows(std::ostream& out, const MovingScene& scene, const ExactDistances& exact_value,
                const SweepOptions& options, const std::vector<Point>& points) {
  const auto number = [&](double x) {
    char text[32];
    std::snprintf(text, sizeof text, ",%.4g", x);
    out << text;
  };
  for (const Point& p : points) {
    const Setting& s = p.setting;
    out << scene.name << ',' << options.backend << ",full," << (s.precision == Precision::kF32 ? "f32" : "f64") << ','
        << name_of(s.requested);
    for (const double x : {s.rel_tol, s.abs_tol, s.reach, s.reach < kInf ? s.reach * exact_value.median : kInf})
      number(x);
    out << ',' << scene.pairs.size() << ',' << scene.steps.size();
    for (const double x : {p.ns_per_pair, p.ns_quartiles, p.ratio, p.evaluated}) number(x);
    for (const Spread* spread : {&p.error, &p.width, &p.rel_error, &p.rel_width})
      for (const double x : {spread->p50, spread->p99, spread->max}) number(x);
    for (const double x : {p.ok, p.overlap, p.contact, p.beyond, p.unconverged}) number(x);
    out << ',' << p.violations << '\n';
  }
}

}  // namespace clearance::tradeoff
