// A priority queue for searches that take the best, find some more below it and go on with the best of all.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <vector>

namespace clearance {

/// A heap of four children a node, beside which the best of what was put last waits: mostly it is taken next, and
/// where it is not it takes the place of what is.
/// \tparam ComesLater a strict weak order: whether its first argument comes after its second
template <class T, class ComesLater>
class BestFirst {
 public:
  void clear() {
    heap_.clear();
    has_last_ = false;
  }
  bool empty() const { return heap_.empty() && !has_last_; }
  std::size_t size() const { return heap_.size() + has_last_; }
  const T& front() const {
    assert(!empty());
    return is_last_first() ? last_ : heap_.front();
  }
  void put(const T& x) {
    if (!has_last_) {
      last_ = x;
      has_last_ = true;
    } else if (comes_later_(last_, x)) {
      rise(last_);
      last_ = x;
    } else {
      rise(x);
    }
  }
  T pop() {
    assert(!empty());
    if (is_last_first()) {
      has_last_ = false;
      return last_;
    }
    const T first = heap_.front();
    if (has_last_) {
      has_last_ = false;
      sink(last_);
    } else {
      const T end = heap_.back();
      heap_.pop_back();
      if (!heap_.empty()) sink(end);
    }
    return first;
  }
  /// All but the front, in any order.
  template <class Each>
  void each_behind(const Each& each) const {
    const T* const front = &this->front();
    for (const T& x : heap_)
      if (&x != front) each(x);
    if (has_last_ && front != &last_) each(last_);
  }

 private:
  static constexpr std::size_t kChildren = 4;

  bool is_last_first() const { return has_last_ && (heap_.empty() || !comes_later_(last_, heap_.front())); }
  // Into the heap, from its end.
  void rise(const T& x) {
    std::size_t hole = heap_.size();
    heap_.push_back(x);
    for (std::size_t parent; hole > 0 && comes_later_(heap_[parent = (hole - 1) / kChildren], x); hole = parent)
      heap_[hole] = heap_[parent];
    heap_[hole] = x;
  }
  // In place of the first.
  void sink(const T& x) {
    std::size_t hole = 0;
    for (std::size_t child; (child = kChildren * hole + 1) < heap_.size();) {
      const std::size_t end = std::min(child + kChildren, heap_.size());
      for (std::size_t k = child + 1; k < end; ++k)
        if (comes_later_(heap_[child], heap_[k])) child = k;
      if (!comes_later_(x, heap_[child])) break;
      heap_[hole] = heap_[child];
      hole = child;
    }
    heap_[hole] = x;
  }

  std::vector<T> heap_;
  T last_{};
  bool has_last_ = false;
  [[no_unique_address]] ComesLater comes_later_;
};

}  // namespace clearance
