// Runs the engine on many cases at once, and checks its answers with the oracle.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/hull/convex_part.h"
#include "engine/selection/query.h"
#include "tests/oracle/check_result.h"

namespace clearance {
namespace engine {
class Engine;
}
}  // namespace clearance

namespace clearance::exact {

/// The convex part of a body in the engine.
ConvexPartPtr part_of(const Solid& s);

/// Replaces a part that was loaded for body a or b of a case: damage unknown to the engine.
using Surgery = std::function<ConvexPartPtr(const ConvexPartPtr& part, std::size_t index, bool is_b)>;

/// Some cases as one scene, two bodies per case, loaded into one engine.
class Bench {
 public:
  /// \param threads of the engine
  /// \param surgery applied to every part, if not null
  Bench(std::span<const Case> cases, const std::string& backend, int threads = 1, const Surgery& surgery = nullptr);
  ~Bench();
  Bench(Bench&&) noexcept;

  /// All pairs in one query, every column. `setting.backend` must be the bench's. Throws QueryError.
  std::vector<Answer> evaluate(const Setting& setting) const;
  /// The certificate of all pairs. Throws QueryError.
  std::string certificate(const Setting& setting) const;
  const engine::Engine& engine() const { return *engine_; }

 private:
  std::vector<BodyPair> pairs() const;
  static QueryView query(const Setting& setting, std::span<const BodyPair> pairs);

  std::size_t count_;
  std::unique_ptr<engine::Engine> engine_;
};

/// Published results of one class under one setting.
struct Tally {
  std::int64_t cases = 0;
  std::int64_t violations = 0;  ///< answers with a wrong bound, status or column
  std::int64_t inaccurate = 0;  ///< correct, but with an error or a witness worse than documented
  std::int64_t apart = 0, touching = 0, overlapping = 0;  ///< exact results
  std::int64_t contact = 0;                               ///< answers
  std::int64_t unconverged = 0;                           ///< wider than tolerance and rounding require
  std::int64_t rounding_limited = 0;                      ///< wider than the tolerance, from rounding alone
  double worst_error = 0;                                 ///< relative to the allowed error
  double worst_width = 0;
  void add(const Result& exact_value, const Answer& answer, const CheckResult& verdict);
  void add(const Tally& other);
};

/// The settings of tests and oracle runs for each backend: float64 and float32; with and without depth; columns in
/// float64 and float32; default, zero and loose tolerances; cut-off distances. The reference runs with and without depth only.
/// \param with_depth false for bodies with triangles, which have none
std::vector<Setting> standard_settings(const std::vector<std::string>& backends = {"cpu", "reference"},
                                       bool with_depth = true);

/// A setting as the columns backend to max_distance of docs/results/accuracy.csv.
std::string csv_key(const Setting& s);

/// Runs `cases` under each setting, and compares every answer with the exact result. Returns one tally per setting.
/// \param columns prove witness points and normals, too
/// \param report called with a description of every bad answer
std::vector<Tally> try_cases(
    std::span<const Case> cases, std::span<const Setting> settings, int threads, bool columns,
    const std::function<void(std::size_t index, const Setting&, const CheckResult&, const std::string&)>& report);

}  // namespace clearance::exact
