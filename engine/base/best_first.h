// Priority queue for best-first searches, which pop the best element and push some of its children.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance {

/// 4-ary heap with a separate front slot for the best of the most recently pushed elements. The front is usually popped
/// next; otherwise it replaces the element that is.
///
/// Compares and moves only ranks, and finds the least of four without an unpredictable branch. Ranks of siblings share
/// a cache line.
/// \tparam RankOf the rank of an element, less than kNoRank; the least is popped first. The order of equal ranks is
/// unspecified but deterministic.
template <class T, class RankOf>
class BestFirst {
 public:
  using Rank = unsigned __int128;
  static constexpr Rank kNoRank = ~Rank{0};

  void clear() {
    std::fill_n(ranks(), size_, kNoRank);
    size_ = 0;
    free_.clear();
    elements_.clear();
    has_last_ = false;
  }
  bool empty() const { return size_ == 0 && !has_last_; }
  std::size_t size() const { return size_ + has_last_; }
  const T& front() const {
    assert(!empty());
    return is_last_first() ? last_ : elements_[places_[0]];
  }
  void put(const T& x) {
    const Rank rank = RankOf()(x);
    if (has_last_ && !(rank < last_rank_)) return rise(x, rank);
    if (has_last_) rise(last_, last_rank_);
    last_ = x;
    last_rank_ = rank;
    has_last_ = true;
  }
  T pop() {
    assert(!empty());
    if (is_last_first()) {
      has_last_ = false;
      return last_;
    }
    const std::uint32_t place = places_[0];
    const T first = elements_[place];
    if (has_last_) {
      has_last_ = false;
      elements_[place] = last_;
      sink(place, last_rank_);
    } else {
      free_.push_back(place);
      --size_;
      const Rank rank = ranks()[size_];
      ranks()[size_] = kNoRank;
      if (size_ > 0) sink(places_[size_], rank);
    }
    return first;
  }
  /// All elements except the front, in any order.
  template <class Each>
  void each_behind(const Each& each) const {
    const T* const front = &this->front();
    for (std::size_t i = 0; i < size_; ++i)
      if (const T& x = elements_[places_[i]]; &x != front) each(x);
    if (has_last_ && front != &last_) each(last_);
  }

 private:
  static constexpr std::size_t kChildren = 4;
  // The root's first child starts a cache line.
  struct alignas(kChildren * sizeof(Rank)) Line {
    Rank of[kChildren] = {kNoRank, kNoRank, kNoRank, kNoRank};
  };

  Rank* ranks() { return &lines_[0].of[kChildren - 1]; }
  const Rank* ranks() const { return &lines_[0].of[kChildren - 1]; }
  bool is_last_first() const { return has_last_ && (size_ == 0 || !(ranks()[0] < last_rank_)); }
  // Inserts at the end of the heap, and sifts up.
  void rise(const T& x, Rank rank) {
    std::uint32_t place = static_cast<std::uint32_t>(elements_.size());
    if (free_.empty()) {
      elements_.push_back(x);
    } else {
      place = free_.back();
      free_.pop_back();
      elements_[place] = x;
    }
    std::size_t hole = size_++;
    if (places_.size() < size_) places_.resize(size_);
    if (kChildren - 1 + size_ > kChildren * lines_.size()) lines_.emplace_back();
    Rank* const rank_at = ranks();
    for (std::size_t parent; hole > 0 && rank < rank_at[parent = (hole - 1) / kChildren]; hole = parent)
      move(parent, hole);
    rank_at[hole] = rank;
    places_[hole] = place;
  }
  // Replaces the root, and sifts down.
  void sink(std::uint32_t place, Rank rank) {
    Rank* const rank_at = ranks();
    std::size_t hole = 0;
    for (std::size_t first; (first = kChildren * hole + 1) < size_;) {
      const std::size_t p = first + (rank_at[first + 1] < rank_at[first]),
                        q = first + 2 + (rank_at[first + 3] < rank_at[first + 2]),
                        child = p + (q - p) * (rank_at[q] < rank_at[p]);
      if (!(rank_at[child] < rank)) break;
      move(child, hole);
      hole = child;
    }
    rank_at[hole] = rank;
    places_[hole] = place;
  }
  void move(std::size_t from, std::size_t to) {
    ranks()[to] = ranks()[from];
    places_[to] = places_[from];
  }

  std::vector<Line> lines_ = std::vector<Line>(1);  // ranks, with kNoRank after the last
  std::vector<std::uint32_t> places_, free_;        // indices into elements_: of each rank; unused
  std::vector<T> elements_;
  std::size_t size_ = 0;
  T last_{};
  Rank last_rank_ = 0;
  bool has_last_ = false;
};

}  // namespace clearance
