// Lists the pairs of a query in slices: a few bytes can name many millions.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/narrow/work_meter.h"
#include "engine/selection/query.h"
#include "engine/state/pair_table.h"

namespace clearance {

/// The pairs of a query: the scene's whole table, or an explicit list. Copies share it.
class PairList {
 public:
  PairList() = default;
  explicit PairList(std::shared_ptr<const PairTable> table) : table_(std::move(table)) {}
  explicit PairList(std::vector<BodyPair> pairs)
      : pairs_(std::make_shared<const std::vector<BodyPair>>(std::move(pairs))) {}

  bool is_whole_table() const { return table_ != nullptr; }
  const PairTable* table() const { return table_.get(); }
  /// The pairs of an explicit list.
  std::span<const BodyPair> list() const { return pairs_ ? std::span(*pairs_) : std::span<const BodyPair>(); }
  std::uint64_t size() const { return table_ ? table_->size() : list().size(); }
  BodyPair at(std::uint64_t position) const;
  /// Writes the pairs at [begin, begin + count).
  void copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;
  /// The pairs at [begin, begin + count).
  /// \param storage receives them if they are not stored
  std::span<const BodyPair> slice(std::uint64_t begin, std::uint64_t count, std::vector<BodyPair>& storage) const;

 private:
  std::shared_ptr<const PairTable> table_;
  std::shared_ptr<const std::vector<BodyPair>> pairs_;  // so that copies cost nothing
};

/// Lists explicit pairs as given, and expands a pair with a group to its enabled pairs, each once, in lexicographic
/// order. Without pairs, lists all enabled ones, or those with a moved body.
class PairLister {
 public:
  /// \param query its pairs must stay valid until all are listed
  /// \param scene must outlive this
  /// \param moved bodies and their followers
  PairLister(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PairTable> table,
             std::span<const std::uint32_t> moved);
  /// Continues until the slice is over. Returns true once all pairs are listed. Throws QueryError.
  bool advance(WorkMeter& meter);
  /// Returns the pairs after advance() has returned true.
  PairList take() { return step_ == ListingStep::kTable ? PairList(std::move(table_)) : PairList(std::move(pairs_)); }

 private:
  enum class ListingStep { kCompare, kCount, kList, kExpand, kTable, kDone };

  bool is_done() const { return step_ == ListingStep::kTable || step_ == ListingStep::kDone; }
  // Each of these does a part of its step, and returns the number of pairs it visited.
  std::uint64_t compare_some();
  std::uint64_t count_some();
  std::uint64_t list_some();
  std::uint64_t expand_some();
  void begin_expanding(std::vector<std::uint32_t> as, std::vector<std::uint32_t> bs);
  std::vector<std::uint32_t> members(std::uint32_t selector) const;
  std::uint64_t bodies_named(std::uint32_t selector) const;

  std::span<const BodyPair> named_;
  const engine::Scene& scene_;
  std::shared_ptr<const PairTable> table_;
  ListingStep step_ = ListingStep::kCount;
  std::uint64_t next_ = 0;  // in named_, in this step
  std::uint64_t most_ = 0;  // bound on the pairs named by those counted so far
  bool has_group_ = false;  // whether any of them has a group
  std::vector<BodyPair> pairs_;
  // The pair with a group that is being expanded.
  std::vector<std::uint32_t> as_, bs_, both_;  // ascending, each once
  std::size_t body_ = 0, other_ = 0;           // of both_; of those that it is paired with
};

}  // namespace clearance
