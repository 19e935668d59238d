// The pairs that decide many configurations, looked for in all of them at once.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/query/block_boxes.h"
#include "engine/query/evaluate.h"

namespace clearance {

/// A pair that was answered in a configuration.
struct FoundPair {
  std::uint64_t position;  ///< in the query
  BodyPair pair;
  double gap;  ///< of their boxes, metres
  PairAnswer answer;
};

/// What Evaluator and Reduction do pair by pair and configuration by configuration, for the plain case: bodies of
/// convex pieces that are known exactly, all placed, and no depth asked for. Boxes of pieces are compared for one pair
/// of bodies in all configurations that it may matter in, and the pairs of pieces that are left go to the lanes
/// together, round after round, the nearest of each configuration first. An answer's bits are those that Evaluator
/// gives: a pair of pieces more or less that is proved to lose changes nothing. Each worker has its own.
class BlockSearch {
 public:
  /// Whether a plan's configurations can be searched so, where the boxes of all bodies are made.
  static bool fits(const Scene& scene, const Plan& plan, const EvaluateOptions& options);

  /// How many pairs of pieces a block may have, so that its memory is bounded: some 30 MB if all are near.
  static constexpr std::uint64_t kMostPiecePairs = std::uint64_t{1} << 20;
  /// Those of a configuration.
  static std::uint64_t piece_pairs(const Scene& scene, const Plan& plan);

  /// All must outlive this.
  BlockSearch(const Scene& scene, const Plan& plan, const EvaluateOptions& options)
      : scene_(scene), plan_(plan), options_(options), batch_(options) {}

  /// \param placed configurations. \param boxes of them. \param gaps (pairs, placed.size()) of bodies' boxes. All must
  /// stay.
  void begin(std::span<const Placement> placed, const BlockBoxes& boxes, std::span<const double> gaps);
  /// Goes on until the slice is over. Returns true once all are searched.
  bool advance(WorkMeter& meter);

  /// Whether a configuration was searched. If not, somebody else must: a body of it has no usable pose, or its nearest
  /// pair is beyond max_distance.
  bool is_searched(std::size_t i) const { return searched_[i] != 0; }
  /// What was found in it, in the order of the query: every pair that its rows depend on. Good until begin().
  std::span<const FoundPair> found(std::size_t i) const {
    return std::span(found_).subspan(found_begin_[i], found_begin_[i + 1] - found_begin_[i]);
  }

 private:
  static constexpr std::uint32_t kNotAsked = ~std::uint32_t{0};
  struct Candidate {  // a pair of pieces
    double gap;       // of their boxes
    std::uint32_t position, a, b;
    std::uint32_t answer;  // in narrow_, or kNotAsked
    bool by_lanes;
  };
  // Candidates that compete: those of a configuration, of Reduce::kWithin those of a pair of bodies in it.
  struct Unit {
    std::uint32_t configuration;
    std::uint32_t begin, next, end, asked;  // of candidates_, in their order: those of this round are asked
    std::uint32_t round;
    bool over;
    double upper;  // the least so far, metres
  };
  // A piece in all configurations: its boxes, or the one that they share.
  struct PieceSide {
    Aabb box;
    bool moves;
    BoxColumnsView columns;

    Aabb at(std::size_t k) const { return moves ? columns.at(k) : box; }
  };
  // The candidates of a pair of bodies in a configuration, before they are sorted.
  struct Near {
    std::uint32_t configuration, begin, end;
  };

  bool within() const { return plan_.query.reduce == Reduce::kWithin; }
  bool any() const { return plan_.query.reduce == Reduce::kAny; }
  void look_for_unplaced();
  void find_seeds();
  void end_seeds();
  bool filter(WorkMeter& meter);
  void filter_pair(std::uint32_t position, std::span<const std::uint32_t> where, WorkMeter& meter);
  void make_units();
  bool ask_round();
  void take_round();
  double cut_off(const Unit& unit, const Candidate& c) const;
  bool goes_before(const Candidate& p, const Candidate& q) const;
  void list_boxes(std::uint32_t body, std::vector<PieceSide>& sides);
  void sort_units();
  std::uint32_t end_that_counts(const Unit& unit) const;
  bool finish_all(WorkMeter& meter);
  void finish_pair(std::size_t configuration, std::span<const Candidate> all);

  const Scene& scene_;
  const Plan& plan_;
  EvaluateOptions options_;
  PieceBatch batch_;
  std::span<const Placement> placed_;
  const BlockBoxes* boxes_ = nullptr;
  std::span<const double> gaps_;
  enum class Stage { kBegin, kSeeds, kFilter, kRest, kFinish, kDone } stage_ = Stage::kDone;
  bool in_round_ = false;
  std::uint64_t next_ = 0;              // of a stage that the slice has ended in
  std::vector<std::uint8_t> searched_;  // of each configuration
  std::vector<double> cut_;             // likewise: how far boxes of bodies may be apart, metres
  std::vector<double> least_;           // likewise: the least gap of boxes
  std::vector<std::uint32_t> last_;     // likewise: the last position that counts
  std::vector<std::uint32_t> where_;
  std::vector<Near> near_;
  std::vector<Candidate> candidates_, sorted_, seeds_;
  std::vector<Unit> units_;
  std::vector<PieceTask> tasks_;
  std::vector<std::uint32_t> begins_, unit_order_;
  std::vector<NarrowAnswer> narrow_;
  std::vector<FoundPair> found_;
  std::vector<std::size_t> found_begin_;
  std::vector<PieceSide> sides_a_, sides_b_;
  Piece rooms_[2];  // finish() wants them
};

}  // namespace clearance
