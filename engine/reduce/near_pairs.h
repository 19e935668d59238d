// Which pairs of a query may be near, without a look at each: a tree over the bodies' boxes where it pays.
//
// The pairs are found by probes: bodies of which every pair of the query has one. Of a scene's whole table all bodies
// ask; of moved bodies or a group against everything, those few do. A probe looks among bodies that stay where the
// snapshot has them, in a tree that the engine keeps from query to query, and among those that a configuration moves,
// in a tree of the worker's own.
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

/// How near pairs are found.
enum class NearBy { kAuto, kBrute, kTree };
/// "auto", "brute" or "tree"; throws std::invalid_argument for another name.
NearBy near_by_name(std::string_view name);

/// The policy of kAuto: whether a tree is expected to be faster than comparing the boxes of all pairs, eight at a time.
/// Measured by clearance-broad (docs/performance.md).
bool tree_pays(std::uint64_t bodies, std::uint64_t pairs, std::uint64_t probes);

/// The trees of the last queries, which fit to the next ones if bodies have moved but a little. Thread-safe; a tree
/// belongs to one job at a time.
class BoxTreeStore {
 public:
  static constexpr std::size_t kTrees = 4;  ///< of jobs that ran at a time; about 60 bytes a body each

  /// The tree that was put back last, or an empty one.
  std::unique_ptr<BoxTree> take();
  /// \param builds made while it was away.
  void put_back(std::unique_ptr<BoxTree> tree, std::uint64_t builds);
  std::uint64_t bytes() const;
  std::uint64_t builds() const;  ///< new orders made so far

 private:
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<BoxTree>> trees_;
  std::uint64_t builds_ = 0;
};

/// Of one job; read by all its workers.
class NearPairs {
 public:
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

  /// \param boxes of all bodies in the snapshot; empty: none were made, and there is no tree.
  NearPairs(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes, BoxTreeStore& store, NearBy by);
  ~NearPairs();
  NearPairs(const NearPairs&) = delete;
  NearPairs& operator=(const NearPairs&) = delete;

  bool by_tree() const { return tree_ != nullptr; }
  /// Whether the pairs are all of the scene's table, and nothing moves.
  bool whole_table() const { return table_ != nullptr; }
  const BoxTree& tree() const { return *tree_; }                     ///< of bodies that stay
  std::span<const std::uint32_t> probes() const { return probes_; }  ///< neighbours near each other
  bool asks(std::uint32_t body) const { return asks_[body]; }
  /// Where the query has a pair, in either order; kNowhere: it does not ask for it.
  std::uint64_t position(std::uint32_t a, std::uint32_t b) const;
  /// Where a whole table has a body's first pair; kNowhere: it has none.
  std::uint64_t first_position(std::uint32_t body) const;

 private:
  bool find_probes(const Plan& plan, bool always);

  BoxTreeStore& store_;
  const PairTable* table_ = nullptr;
  std::uint32_t bodies_;
  std::span<const BodyPair> list_;
  std::vector<std::uint64_t> row_begin_;  // (N + 1,) of list_
  std::vector<std::uint32_t> probes_;
  std::vector<std::uint8_t> asks_;
  std::unique_ptr<BoxTree> tree_;
  std::uint64_t builds_before_ = 0;
};

/// The trees as one worker asks them, in one configuration after another.
class TreeSearch {
 public:
  TreeSearch(const Scene& scene, const Plan& plan, const NearPairs& near_pairs)
      : scene_(scene), plan_(plan), near_pairs_(near_pairs) {}

  /// Before anything is asked of a configuration.
  void stand(const BodyPoses& placement);
  /// Bodies that cannot be placed: no tree knows them.
  std::span<const std::uint32_t> unplaced() const { return unplaced_; }

  struct Seed {
    double gap;
    std::uint64_t position;
    friend auto operator<=>(const Seed&, const Seed&) = default;
  };
  /// The least of `best` and of the query's pairs of a body.
  Seed nearest(std::uint32_t body, Seed best) const;
  /// Appends where the query has the pairs of a probe whose gap is <= margin. \param all false: only those that no
  /// other probe finds as well.
  void around(std::uint32_t body, double margin, bool all, std::vector<std::uint64_t>& positions) const;
  /// Appends where a whole table has the pairs of a body in blocks [first, last) of the tree and a body there or in a
  /// later one, whose gap is <= margin.
  void pairs(std::uint32_t first, std::uint32_t last, double margin, std::vector<std::uint64_t>& positions);

 private:
  template <class Offer>
  void ask(std::uint32_t body, double bound, Offer&& offer) const;

  const Scene& scene_;
  const Plan& plan_;
  const NearPairs& near_pairs_;
  const BodyPoses* placement_ = nullptr;
  std::uint64_t stood_at_ = 0;  // meaningful if there is a placement
  std::vector<std::uint32_t> unplaced_, slots_;
  std::size_t staying_unplaced_ = 0;  // of unplaced_, the first
  std::vector<Aabb> boxes_;           // of plan_.moved
  BoxTree moving_;
  std::vector<BodyPair> room_;
};

}  // namespace clearance
