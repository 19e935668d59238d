// Waiting items of several clients, taken turn by turn: a client with many of them delays no other.
// Those of one client are taken in the order of `Before`, equal ones as they came.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <deque>
#include <unordered_map>
#include <utility>
#include <vector>

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

  /// Offers the clients' first items, in turns, until none is taken: `take(item)` moves from the item and returns true, or leaves
  /// it and returns false; it does not throw. Clients that gave one go behind the others.
  template <class Take>
  void take_each(Take take) {
    kept_.reserve(order_.size());
    gave_.reserve(order_.size());
    for (bool any = true; any;) {
      any = false;
      kept_.clear();
      gave_.clear();
      for (const std::uint64_t client : order_) {
        auto& items = items_.find(client)->second;
        if (!take(items.front())) {
          kept_.push_back(client);
          continue;
        }
        any = true;
        items.pop_front();
        --size_;
        if (!items.empty()) gave_.push_back(client);
      }
      const auto end = std::copy(gave_.begin(), gave_.end(), std::copy(kept_.begin(), kept_.end(), order_.begin()));
      order_.erase(end, order_.end());
    }
  }

  /// Takes out what `unwanted(item)` says, calling `dropped(item)` on each.
  template <class Predicate, class Dropped>
  void remove_if(Predicate unwanted, Dropped dropped) {
    FairQueue kept;
    for (const std::uint64_t client : order_)
      for (T& item : items_[client]) {
        if (unwanted(item))
          dropped(item);
        else
          kept.push(client, std::move(item));
      }
    *this = std::move(kept);
  }

 private:
  /// Clients without items that keep their place in the map: one that asks again and again allocates nothing.
  static constexpr std::size_t kIdleClientsKept = 256;
  std::unordered_map<std::uint64_t, std::deque<T>> items_;
  std::deque<std::uint64_t> order_;  // clients with items, the next one first
  std::size_t size_ = 0;
  std::vector<std::uint64_t> kept_, gave_;  // take_each()'s own: clients
};

}  // namespace clearance
