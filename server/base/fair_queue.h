// Waiting items of several clients, taken turn by turn: a client with many of them delays no other.
// Those of one client are taken in the order of `Before`, equal ones as they came.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <deque>
#include <unordered_map>
#include <utility>

namespace clearance {

struct AsTheyCame {
  template <class T>
  bool operator()(const T&, const T&) const {
    return false;
  }
};

template <class T, class Before = AsTheyCame>
class FairQueue {
 public:
  bool empty() const { return order_.empty(); }
  std::size_t size() const { return size_; }

  /// Among the client's own items; a client that had none goes behind the others.
  void push(std::uint64_t client, T item) {
    auto& items = items_[client];
    if (items.empty()) order_.push_back(client);
    if (items.empty() || !Before()(item, items.back()))
      items.push_back(std::move(item));
    else
      items.insert(std::upper_bound(items.begin(), items.end(), item, Before()), std::move(item));
    ++size_;
  }

  /// The first item of the client whose turn it is. Not to be called on an empty queue.
  T pop() {
    assert(!empty() && size_ > 0);
    const std::uint64_t client = order_.front();
    order_.pop_front();
    const auto found = items_.find(client);
    assert(found != items_.end() && !found->second.empty());
    T item = std::move(found->second.front());
    found->second.pop_front();
    if (!found->second.empty())
      order_.push_back(client);
    else if (items_.size() > kIdleClientsKept)
      items_.erase(found);
    --size_;
    return item;
  }

 private:
  /// Clients without items that keep their place in the map: one that asks again and again allocates nothing.
  static constexpr std::size_t kIdleClientsKept = 256;
  std::unordered_map<std::uint64_t, std::deque<T>> items_;
  std::deque<std::uint64_t> order_;  // clients with items, the next one first
  std::size_t size_ = 0;
};

}  // namespace clearance
