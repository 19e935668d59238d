// Waiting items of several clients, taken in turn so that a client with many of them delays no other. Each client's
// items are ordered by `Before`, and equal ones by arrival.
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

  /// Adds an item to the client's own. A client without items goes behind the others.
  void push(std::uint64_t client, T item) {
    auto& items = items_[client];
    if (items.empty()) order_.push_back(client);
    if (items.empty() || !Before()(item, items.back()))
      items.push_back(std::move(item));
    else
      items.insert(std::upper_bound(items.begin(), items.end(), item, Before()), std::move(item));
    ++size_;
  }

  /// Removes the first item of the client whose turn it is. The queue must not be empty.
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
  /// Idle clients kept in the map, so that a client's repeated requests do not allocate.
  static constexpr std::size_t kIdleClientsKept = 256;
  std::unordered_map<std::uint64_t, std::deque<T>> items_;
  std::deque<std::uint64_t> order_;  // clients with items, the next one first
  std::size_t size_ = 0;
};

}  // namespace clearance
