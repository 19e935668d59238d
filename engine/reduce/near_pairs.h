// Near pairs of a query, found without comparing all pairs: by a tree over the bodies' boxes where it pays.
//
// Pairs are found by probes: bodies that have a pair of the query each. For the scene's whole table all bodies are
// probes; for moved bodies or a group against everything, only those few. A probe searches two trees: the engine's tree
// of bodies that stay, kept between queries, and the worker's tree of bodies that a configuration moves.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string_view>
#include <vector>

#include "engine/broad/box_tree.h"
#include "engine/evaluate/evaluate.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Method of finding near pairs.
enum class NearBy { kAuto, kBrute, kTree };
/// "auto", "brute" or "tree"; throws std::invalid_argument for another name.
NearBy near_by_name(std::string_view name);

/// Policy of kAuto: whether a tree is expected to be faster than comparing the boxes of all pairs, eight at a time.
/// Measured by clearance-broad (docs/notes/performance.md).
bool tree_pays(std::uint64_t bodies, std::uint64_t pairs, std::uint64_t probes);

/// Trees of the last queries, which fit the next ones if bodies have moved little. Thread-safe; a tree belongs to one
/// job at a time. Made by std::make_shared(), as jobs with a tree share it.
class BoxTreeStore : public std::enable_shared_from_this<BoxTreeStore> {
 public:
  static constexpr std::size_t kTrees = 4;  ///< of concurrent jobs; about 60 bytes per body each

  /// The last tree put back, or an empty one.
  std::unique_ptr<BoxTree> take();
  /// \param builds made since take()
  void put_back(std::unique_ptr<BoxTree> tree, std::uint64_t builds);
  std::uint64_t bytes() const;
  std::uint64_t builds() const;  ///< number of builds so far

 private:
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<BoxTree>> trees_;
  std::uint64_t builds_ = 0;
};

/// Near pairs of one job, shared by its workers.
class NearPairs {
 public:
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

  /// \param boxes of all bodies in the snapshot; without them there is no tree
  NearPairs(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes, BoxTreeStore& store, NearBy by);
  ~NearPairs();
  NearPairs(const NearPairs&) = delete;
  NearPairs& operator=(const NearPairs&) = delete;

  bool by_tree() const { return tree_ != nullptr; }
  /// Whether the pairs are the scene's whole table, and nothing moves.
  bool whole_table() const { return table_ != nullptr; }
  const BoxTree& tree() const { return *tree_; }                     ///< of bodies that stay
  std::span<const std::uint32_t> probes() const { return probes_; }  ///< spatial neighbours are near each other
  bool is_probe(std::uint32_t body) const { return is_probe_[body]; }
  /// Position of a pair, in either order, in the query, or kNowhere.
  std::uint64_t position(std::uint32_t a, std::uint32_t b) const;
  /// Position of a body's first pair in a whole table, or kNowhere.
  std::uint64_t first_position(std::uint32_t body) const;

 private:
  bool find_probes(const Plan& plan, bool always);

  std::shared_ptr<BoxTreeStore> store_;  // of tree_
  const PairTable* table_ = nullptr;
  std::uint32_t bodies_;
  std::span<const BodyPair> list_;
  std::vector<std::uint64_t> row_begin_;  // (N + 1,) of list_
  std::vector<std::uint32_t> probes_;
  std::vector<std::uint8_t> is_probe_;
  std::unique_ptr<BoxTree> tree_;
  std::uint64_t builds_before_ = 0;
};

/// Search of the trees by one worker, in one configuration after another.
class TreeSearch {
 public:
  TreeSearch(const engine::Scene& scene, const Plan& plan, const NearPairs& near_pairs)
      : scene_(scene), plan_(plan), near_pairs_(near_pairs) {}

  /// Sets the configuration. Call this before any search in it.
  void place(const BodyPoses& placement);
  /// Bodies without a usable pose, which no tree contains.
  std::span<const std::uint32_t> unplaced() const { return unplaced_; }

  struct Seed {
    double gap;
    std::uint64_t position;
    friend auto operator<=>(const Seed&, const Seed&) = default;
  };
  /// The least of `best` and the pairs of a body.
  Seed nearest(std::uint32_t body, Seed best) const;
  /// Appends the positions of a probe's pairs whose gap is <= margin.
  /// \param all false for only those that no other probe finds as well
  void around(std::uint32_t body, double margin, bool all, std::vector<std::uint64_t>& positions) const;
  /// Appends the positions in a whole table of pairs whose gap is <= margin, of a body in blocks [first, last) of the
  /// tree with a body there or in a later block.
  void pairs(std::uint32_t first, std::uint32_t last, double margin, std::vector<std::uint64_t>& positions);

 private:
  template <class Offer>
  void evaluate(std::uint32_t body, double bound, Offer&& offer) const;

  const engine::Scene& scene_;
  const Plan& plan_;
  const NearPairs& near_pairs_;
  const BodyPoses* placement_ = nullptr;
  std::uint64_t stood_at_ = 0;  // BodyPoses::number() of placement_; valid if that is set
  std::vector<std::uint32_t> unplaced_, slots_;
  std::size_t staying_unplaced_ = 0;  // first entries of unplaced_
  std::vector<Aabb> boxes_;           // of plan_.moved
  BoxTree moving_;
  std::vector<BodyPair> found_pairs_;
};

}  // namespace clearance
