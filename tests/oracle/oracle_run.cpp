#include "tests/oracle/oracle_run.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <sstream>

#include "engine/bvh/surface.h"
#include "engine/engine.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/hull/hull.h"
#include "engine/hull/primitive.h"

namespace clearance::exact {

ConvexPartPtr part_of(const Solid& s) {
  if (s.is_half_space) return make_primitive_part({Primitive::Kind::kHalfSpace}, s.radius);
  if (!s.cloud.empty()) return make_cloud_part(s.cloud, s.voxel, s.radius);
  if (s.triangles.empty()) return make_hull_part(s.vertices, {}, s.radius);
  auto surface = std::make_shared<const Surface>(s.vertices, s.triangles, s.is_solid);
  const std::uint64_t digest = surface->digest();
  return make_convex_part(reduce_to_hull(s.vertices).vertices, s.radius, s.vertices.size(), digest, nullptr,
                          std::move(surface));
}

Bench::Bench(std::span<const Case> cases, const std::string& backend, int threads, const Surgery& surgery)
    : count_(cases.size()) {
  engine::Scene scene;
  std::map<const Solid*, ConvexPartPtr> parts;  // shared shapes are made once
  const auto add = [&](std::size_t i, bool is_b, const SolidPtr& solid, const Pose& X) {
    ConvexPartPtr& part = parts[solid.get()];
    if (!part) part = part_of(*solid);
    Body body;
    body.name = (is_b ? "b" : "a") + std::to_string(i);
    body.parts = {surgery ? surgery(part, i, is_b) : part};
    body.pose = X;
    scene.add_body(std::move(body));
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    add(i, false, cases[i].a, cases[i].X_wa);
    add(i, true, cases[i].b, cases[i].X_wb);
  }
  engine::Engine::Options options;
  options.backend = backend;
  options.threads = threads;
  options.covers = engine::Covers::kOff;  // rows need none
  options.self_test = false;              // the oracle also tests wrong builds
  engine_ = std::make_unique<engine::Engine>(std::move(scene), options);
}
Bench::~Bench() = default;
Bench::Bench(Bench&&) noexcept = default;

std::vector<BodyPair> Bench::pairs() const {
  std::vector<BodyPair> pairs;
  for (std::size_t i = 0; i < count_; ++i)
    pairs.push_back({static_cast<std::uint32_t>(2 * i), static_cast<std::uint32_t>(2 * i + 1)});
  return pairs;
}

QueryView Bench::query(const Setting& setting, std::span<const BodyPair> pairs) {
  QueryView query;
  query.pairs = pairs;
  query.all_pairs = false;
  query.max_distance = setting.max_distance;
  query.rel_tol = setting.rel_tol;
  query.abs_tol = setting.abs_tol;
  query.precision = setting.precision;
  query.signed_distance = setting.signed_distance;
  query.fields = kFieldStatus | kFieldFlags |
                 (setting.float32 ? kFieldBounds | kFieldPoints32
                                  : kFieldDistance | kFieldLower | kFieldUpper | kFieldPoints | kFieldNormal);
  return query;
}

std::string Bench::certificate(const Setting& setting) const {
  const std::vector<BodyPair> pairs = this->pairs();
  std::vector<std::uint64_t> rows(count_);
  std::iota(rows.begin(), rows.end(), std::uint64_t{0});
  return engine_->certificate(query(setting, pairs), rows);
}

std::vector<Answer> Bench::evaluate(const Setting& setting) const {
  const std::vector<BodyPair> pairs = this->pairs();
  const QueryView query = Bench::query(setting, pairs);
  std::vector<double> distance(count_), lower(count_), upper(count_), points_a(3 * count_), points_b(3 * count_),
      normals(3 * count_);
  std::vector<std::uint8_t> status(count_);
  std::vector<std::uint16_t> flags(count_);
  std::vector<float> bounds(2 * count_), points(6 * count_);
  ReplyView reply;
  reply.status = status.data();
  reply.flags = flags.data();
  if (setting.float32) {
    reply.bounds = bounds.data(), reply.points32 = points.data();
  } else {
    reply.distance = distance.data(), reply.lower = lower.data(), reply.upper = upper.data();
    reply.point_a = points_a.data(), reply.point_b = points_b.data(), reply.normal = normals.data();
  }
  Job job = engine_->start(query, reply);
  while (!job.advance()) {
  }
  const auto at = [](const std::vector<double>& v, std::size_t i) {
    return Vec3d{v[3 * i], v[3 * i + 1], v[3 * i + 2]};
  };
  std::vector<Answer> answers(count_);
  for (std::size_t i = 0; i < count_; ++i) {
    Answer& a = answers[i];
    a.status = static_cast<Status>(status[i]);
    a.flags = flags[i];
    if (setting.float32) {
      const float* const p = &points[6 * i];
      a.lower = bounds[2 * i], a.upper = bounds[2 * i + 1];
      a.point_a = {p[0], p[1], p[2]};
      a.point_b = {p[3], p[4], p[5]};
    } else {
      a.distance = distance[i], a.lower = lower[i], a.upper = upper[i];
      a.point_a = at(points_a, i), a.point_b = at(points_b, i), a.normal = at(normals, i);
    }
  }
  return answers;
}

void Tally::add(const Result& exact_value, const Answer& answer, const CheckResult& verdict) {
  ++cases;
  violations += !verdict.violation.empty();
  inaccurate += !verdict.inaccuracy.empty();
  const int side = exact_value.distance.compare(0);
  (side > 0 ? apart : side == 0 ? touching : overlapping)++;
  contact += answer.status == Status::kContact;
  const bool limited = answer.flags & kFlagRoundingLimited;
  unconverged += answer.status == Status::kUnconverged && !limited;
  rounding_limited += limited;
  worst_error = std::max(worst_error, verdict.error);
  worst_width = std::max(worst_width, verdict.width);
}

void Tally::add(const Tally& o) {
  cases += o.cases;
  violations += o.violations;
  inaccurate += o.inaccurate;
  apart += o.apart, touching += o.touching, overlapping += o.overlapping;
  contact += o.contact;
  unconverged += o.unconverged;
  rounding_limited += o.rounding_limited;
  worst_error = std::max(worst_error, o.worst_error);
  worst_width = std::max(worst_width, o.worst_width);
}

std::vector<Setting> standard_settings(const std::vector<std::string>& backends, bool with_depth) {
  std::vector<Setting> settings;
  for (const std::string& backend : backends) {
    for (const bool depth : {false, true}) {
      if (depth && !with_depth) continue;
      Setting s;
      s.backend = backend;
      s.signed_distance = depth;
      settings.push_back(s);
      if (s.backend == "reference") continue;
      const Setting plain = s;
      s.rel_tol = 0;
      settings.push_back(s);
      s.rel_tol = 1e-3;
      settings.push_back(s);
      s = plain;
      s.precision = Precision::kF32;
      settings.push_back(s);
      s = plain;
      s.float32 = true;
      settings.push_back(s);
      s = plain;
      s.max_distance = 0.1;
      settings.push_back(s);
    }
  }
  return settings;
}

std::string csv_key(const Setting& s) {
  std::ostringstream out;
  out << s.backend << ',' << (s.precision == Precision::kF64 ? "f64" : "f32") << ','
      << (s.signed_distance ? "signed" : "unsigned") << ',' << (s.float32 ? "float32" : "float64") << ','
      << s.wanted_rel_tol() << ',';
  if (s.max_distance < 1e300) out << s.max_distance;
  return out.str();
}

std::vector<Tally> try_cases(
    std::span<const Case> cases, std::span<const Setting> settings, int threads, bool columns,
    const std::function<void(std::size_t, const Setting&, const CheckResult&, const std::string&)>& report) {
  std::vector<Result> exact_value;
  for (const Case& c : cases) exact_value.push_back(exact_answer(c));
  std::map<std::string, Bench> benches;
  std::vector<Tally> tallies;
  for (const Setting& s : settings) {
    auto bench = benches.find(s.backend);
    if (bench == benches.end()) bench = benches.emplace(s.backend, Bench(cases, s.backend, threads)).first;
    const std::vector<Answer> answers = bench->second.evaluate(s);
    Tally& tally = tallies.emplace_back();
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const CheckResult v = hold_against(cases[i], exact_value[i], s, answers[i], columns);
      tally.add(exact_value[i], answers[i], v);
      if (!v.good() && report) report(i, s, v, in_words(answers[i]));
    }
  }
  return tallies;
}

}  // namespace clearance::exact
