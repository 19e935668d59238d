// The pairs that a query names, listed in slices: a few bytes can name many millions.
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
  /// Of an explicit list.
  std::span<const BodyPair> list() const { return pairs_ ? std::span(*pairs_) : std::span<const BodyPair>(); }
  std::uint64_t size() const { return table_ ? table_->size() : list().size(); }
  BodyPair at(std::uint64_t position) const;
  /// Writes the pairs at [begin, begin + count).
  void copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;
  /// The pairs at [begin, begin + count); `room` serves where they are not stored.
  std::span<const BodyPair> slice(std::uint64_t begin, std::uint64_t count, std::vector<BodyPair>& room) const;

 private:
  std::shared_ptr<const PairTable> table_;
  std::shared_ptr<const std::vector<BodyPair>> pairs_;  // so that copies cost nothing
};

/// Explicit pairs as given; a pair with a group becomes its enabled pairs, each once, in lexicographic order. Without
/// pairs: all enabled ones, or those with a moved body.
class PairLister {
 public:
  /// \param query its pairs must stay until all are listed. \param moved bodies and their followers. \param scene must
  /// outlive this.
  PairLister(const QueryView& query, const Scene& scene, std::shared_ptr<const PairTable> table,
             std::span<const std::uint32_t> moved);
  /// Goes on until the slice is over. Returns true once all pairs are listed. Throws QueryError.
  bool advance(WorkMeter& meter);
  /// Once advance() has returned true.
  PairList take() { return step_ == Step::kTable ? PairList(std::move(table_)) : PairList(std::move(pairs_)); }

 private:
  enum class Step { kCompare, kCount, kList, kExpand, kTable, kDone };

  bool is_done() const { return step_ == Step::kTable || step_ == Step::kDone; }
  // Each does a little of its step, and says how many pairs it has looked at.
  std::uint64_t compare_some();
  std::uint64_t count_some();
  std::uint64_t list_some();
  std::uint64_t expand_some();
  void begin_expanding(std::vector<std::uint32_t> as, std::vector<std::uint32_t> bs);
  std::vector<std::uint32_t> members(std::uint32_t selector) const;
  std::uint64_t bodies_named(std::uint32_t selector) const;

  std::span<const BodyPair> named_;
  const Scene& scene_;
  std::shared_ptr<const PairTable> table_;
  Step step_ = Step::kCount;
  std::uint64_t next_ = 0;  // of named_, in this step
  std::uint64_t most_ = 0;  // pairs that those counted so far name at most
  bool has_group_ = false;  // among them
  std::vector<BodyPair> pairs_;
  // The pair with a group that is being expanded.
  std::vector<std::uint32_t> as_, bs_, both_;  // ascending, each once
  std::size_t body_ = 0, other_ = 0;           // of both_; of those that it is paired with
};

}  // namespace clearance
