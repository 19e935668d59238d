// Lock-free queue from many threads to one: neither side waits for the other, even if the system suspends it.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>
#include <vector>

namespace clearance {

template <class T>
class Mailbox {
 public:
  Mailbox() = default;
  ~Mailbox() { take(); }
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;

  /// Adds an item and returns whether the mailbox was empty. From any thread.
  bool put(T item) {
    Node* const node = new Node{std::move(item), nullptr};
    Node* before = newest_.load(std::memory_order_relaxed);
    do node->before = before;
    while (!newest_.compare_exchange_weak(before, node, std::memory_order_release, std::memory_order_relaxed));
    return before == nullptr;  // the node may be gone by now
  }
  bool empty() const { return newest_.load(std::memory_order_acquire) == nullptr; }
  /// Takes all items in the order of their arrival. From one thread.
  std::vector<T> take() {
    std::vector<T> items;
    for (std::unique_ptr<Node> node(newest_.exchange(nullptr, std::memory_order_acquire)); node;
         node.reset(node->before))
      items.push_back(std::move(node->item));
    std::reverse(items.begin(), items.end());
    return items;
  }

 private:
  struct Node {
    T item;
    Node* before;
  };
  std::atomic<Node*> newest_{nullptr};
};

}  // namespace clearance
