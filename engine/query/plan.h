// A query made ready: validated, its pairs resolved, its size known.
#pragma once

#include <memory>
#include <vector>

#include "engine/query/query.h"
#include "engine/scene/pose_store.h"

namespace clearance {

/// The pairs of a query: the scene's whole table, or an explicit list.
class PairList {
 public:
  PairList() = default;
  explicit PairList(std::shared_ptr<const PairTable> table) : table_(std::move(table)) {}
  explicit PairList(std::vector<BodyPair> pairs) : pairs_(std::move(pairs)) {}

  bool is_whole_table() const { return table_ != nullptr; }
  const PairTable* table() const { return table_.get(); }
  std::span<const BodyPair> list() const { return pairs_; }  ///< of an explicit list
  std::uint64_t size() const { return table_ ? table_->size() : pairs_.size(); }
  BodyPair at(std::uint64_t position) const;
  /// The pairs at [begin, begin + count); `room` serves where they are not stored.
  std::span<const BodyPair> slice(std::uint64_t begin, std::uint64_t count, std::vector<BodyPair>& room) const;

 private:
  std::shared_ptr<const PairTable> table_;
  std::vector<BodyPair> pairs_;
};

/// A query, copied and resolved against one snapshot.
struct Plan {
  QueryView query;                       ///< its spans point into the members below
  std::vector<std::uint32_t> bodies;     ///< (M,)
  std::span<const Pose> configurations;  ///< (K, M); the caller's until they are kept
  std::vector<Pose> kept_configurations;
  std::vector<std::uint32_t> moved;  ///< bodies and their followers, parents first
  std::shared_ptr<const PoseSnapshot> snapshot;
  PairList pairs;
  QuerySize size;

  /// Copies the configurations, whose memory is the caller's.
  void keep_configurations();
};

/// Throws QueryError. \param with_configurations false: only sizes and pairs are wanted.
Plan make_plan(const QueryView& query, const Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
               std::uint64_t max_rows, bool with_configurations);

/// What warm state is kept for: the same pairs in as many configurations. A false match would cost time only.
std::uint64_t warm_question(const Plan& plan);

}  // namespace clearance
