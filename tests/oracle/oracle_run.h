// Puts cases before the engine, many at once, and its answers before the judge.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/hull/piece.h"
#include "engine/selection/query.h"
#include "tests/oracle/check_result.h"

namespace clearance {
class Engine;
}

namespace clearance::exact {

/// What stands for a body in the engine.
PiecePtr piece_of(const Solid& s);

/// Makes another piece of one that was loaded for body a or b of a case: damage, behind the engine's back.
using Surgery = std::function<PiecePtr(const PiecePtr& piece, std::size_t index, bool is_b)>;

/// Some cases as one scene, two bodies per case, loaded into one engine.
class Bench {
 public:
  /// \param threads of the engine. \param surgery done on every piece, if not null.
  Bench(std::span<const Case> cases, const std::string& backend, int threads = 1, const Surgery& surgery = nullptr);
  ~Bench();
  Bench(Bench&&) noexcept;

  /// All pairs in one query, every column. `setting.backend` must be the bench's. Throws QueryError.
  std::vector<Answer> ask(const Setting& setting) const;
  /// The certificate of all pairs. Throws QueryError.
  std::string certificate(const Setting& setting) const;
  const Engine& engine() const { return *engine_; }

 private:
  std::vector<BodyPair> pairs() const;
  static QueryView query(const Setting& setting, std::span<const BodyPair> pairs);

  std::size_t count_;
  std::unique_ptr<Engine> engine_;
};

/// What is published of one class under one setting.
struct Tally {
  std::int64_t cases = 0;
  std::int64_t violations = 0;  ///< answers of which a bound, a status or a column is not true
  std::int64_t inaccurate = 0;  ///< true, but an error or a witness is worse than promised
  std::int64_t apart = 0, touching = 0, overlapping = 0;  ///< the exact truth
  std::int64_t contact = 0;                               ///< answers
  std::int64_t unconverged = 0;                           ///< wider than asked, and wider than the arithmetic has to be
  std::int64_t rounding_limited = 0;                      ///< wider than asked, but as narrow as the arithmetic allows
  double worst_error = 0;                                 ///< over what the contract allows
  double worst_width = 0;
  void add(const Result& truth, const Answer& answer, const CheckResult& verdict);
  void add(const Tally& other);
};

/// The settings that tests and the campaign ask each backend with: float64 and float32; with and without depth; full
/// and compact; default, zero and loose tolerances; cut-off distances. The reference is asked with and without depth
/// alone. \param with_depth not of bodies with triangles, which have none
std::vector<Setting> standard_settings(const std::vector<std::string>& backends = {"cpu", "reference"},
                                       bool with_depth = true);

/// A setting as the columns backend to max_distance of docs/results/accuracy.csv.
std::string csv_key(const Setting& s);

/// Asks `cases` under each setting and holds every answer against the truth.
/// \param columns prove witness points and normals too. \param report is called for every answer that is not good, in
/// words. \returns one tally per setting.
std::vector<Tally> try_cases(
    std::span<const Case> cases, std::span<const Setting> settings, int threads, bool columns,
    const std::function<void(std::size_t index, const Setting&, const CheckResult&, const std::string&)>& report);

}  // namespace clearance::exact
