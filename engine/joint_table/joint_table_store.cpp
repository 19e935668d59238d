#include "engine/joint_table/joint_table_store.h"

#include <algorithm>
#include <utility>

#include "engine/base/digest.h"
#include "engine/cover/cover_record.h"
#include "engine/joint_table/joint_table_record.h"

namespace clearance {

namespace {

std::uint64_t hash_of_links(const SceneRobot& robot, const Body& a, const Body& b) {
  Digest digest;
  digest.add(robot.digest);
  for (const Body* body : {&a, &b}) {
    digest.add(std::uint64_t{body->link});
    for (const ConvexPartPtr& part : body->parts) digest.add(part->digest);
  }
  return digest.value();
}

}  // namespace

class JointTableStore::Entry final : public BackgroundTask {
 public:
  Entry(TablePair pair, JointTableStore& store) : pair_(std::move(pair)), store_(store), cache_(store.cache_) {}
  ~Entry() override { store_.bytes_ -= is_there_ ? table_->resident_bytes() : 0; }

  bool is_of(const SceneRobot& robot, const Body& a, const Body& b) const {
    return pair_.robot->digest == robot.digest && pair_.a.link == a.link && pair_.b.link == b.link &&
           same_parts(pair_.a.parts, a.parts) && same_parts(pair_.b.parts, b.parts);
  }
  std::shared_ptr<const JointTable> table() const {
    return is_there_.load(std::memory_order_acquire) ? table_ : nullptr;
  }
  TaskOwners owners;

  Result read() const override {
    const auto record = cache_.read(joint_table_name(pair_));
    auto table = record ? joint_table_of_record(pair_, *record) : std::nullopt;
    return table ? std::make_shared<const JointTable>(std::move(*table)) : nullptr;
  }
  Result make(const std::atomic<bool>& stopped) const override {
    auto table = make_joint_table(pair_, &stopped);
    if (!table) return nullptr;
    if (cache_.is_on()) cache_.write(joint_table_name(pair_), joint_table_record(*table));
    return std::make_shared<const JointTable>(std::move(*table));
  }
  void take(Result result, std::chrono::nanoseconds) override {
    if (!result) return;
    table_ = std::static_pointer_cast<const JointTable>(result);
    store_.bytes_ += table_->resident_bytes();
    is_there_.store(true, std::memory_order_release);
    store_.arrived_.fetch_add(1, std::memory_order_release);
  }

 private:
  const TablePair pair_;
  JointTableStore& store_;
  const Cache& cache_;
  std::shared_ptr<const JointTable> table_;
  std::atomic<bool> is_there_{false};  // set after `table_`
};

JointTableStore::Entry* JointTableStore::find_entry(std::uint64_t hash, const SceneRobot& robot, const Body& a,
                                                    const Body& b) const {
  const auto [begin, end] = entries_.equal_range(hash);
  const auto it = std::find_if(begin, end, [&](const auto& entry) { return entry.second->is_of(robot, a, b); });
  return it == end ? nullptr : it->second.get();
}

std::shared_ptr<const JointTable> JointTableStore::find(const SceneRobot& robot, const Body& a, const Body& b) const {
  const std::uint64_t hash = hash_of_links(robot, a, b);
  const std::lock_guard lock(mutex_);
  const Entry* const entry = find_entry(hash, robot, a, b);
  return entry ? entry->table() : nullptr;
}

std::uint64_t JointTableStore::count() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::uint64_t>(std::count_if(entries_.begin(), entries_.end(),
                                                  [](const auto& entry) { return entry.second->table() != nullptr; }));
}

void JointTableStore::add(TablePair pair, const Body& a, const Body& b, const TaskOwner& owner,
                          std::vector<std::shared_ptr<BackgroundTask>>& tasks) {
  const std::uint64_t hash = hash_of_links(*pair.robot, a, b);
  if (Entry* const known = find_entry(hash, *pair.robot, a, b)) return known->owners.add(owner);
  if (entries_.size() >= kMostTables) return;
  const auto entry = std::make_shared<Entry>(std::move(pair), *this);
  entry->owners.add(owner);
  entries_.emplace(hash, entry);
  tasks.push_back(entry);
}

namespace {

struct RequestedPair {
  TablePair pair;
  const Body *a, *b;
};

}  // namespace

void JointTableStore::request(const engine::Scene& scene, const TaskOwner& owner) {
  const auto& ignored = scene.ignored();
  const std::lock_guard requests(requests_);
  std::vector<std::shared_ptr<BackgroundTask>> tasks;
  std::unique_lock lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) { return entry.second->owners.are_gone(); });
  for (const auto& robot : scene.robots()) {
    std::vector<std::uint32_t> links = robot->bodies;
    std::sort(links.begin(), links.end());
    std::vector<RequestedPair> pairs;
    for (std::size_t j = 0; j < links.size(); ++j)
      for (std::size_t i = 0; i < j; ++i) {
        if (std::binary_search(ignored.begin(), ignored.end(), std::pair(links[i], links[j]))) continue;
        const Body &a = scene.bodies()[links[i]], &b = scene.bodies()[links[j]];
        if (auto pair = table_pair(robot, a, b)) pairs.push_back({std::move(*pair), &a, &b});
      }
    std::stable_sort(pairs.begin(), pairs.end(), [](const RequestedPair& p, const RequestedPair& q) {
      return p.pair.columns.size() < q.pair.columns.size();
    });
    pairs.resize(std::min(pairs.size(), kMostOfRobot));
    for (RequestedPair& requested : pairs) add(std::move(requested.pair), *requested.a, *requested.b, owner, tasks);
  }
  lock.unlock();
  worker_.add(tasks);
}

}  // namespace clearance
