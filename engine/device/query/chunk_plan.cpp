// Assigns a query's pairs to chunks, and within a chunk to groups that share both hulls.
#include <algorithm>
#include <cassert>

#include "engine/device/device_job.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

namespace {

// Rows of a chunk: enough to fill a large device several times. Smaller queries still get a few chunks, so that the
// first answers are copied while the last are computed.
constexpr std::uint64_t kFewestRows = 1u << 16, kMostRows = 1u << 19;
constexpr std::uint64_t kCompany = kTile / 2;  // smaller groups of pair-configurations would waste a block

std::uint32_t tiles(std::uint64_t pairs, std::uint64_t configurations) {
  return static_cast<std::uint32_t>((pairs * configurations + kTile - 1) / kTile);
}

class ChunkPlanner {
 public:
  ChunkPlanner(const engine::Scene& scene, const Device& device, const Plan& plan, ChunkPlan& chunk_plan)
      : scene_(scene),
        device_(device),
        plan_(plan),
        chunk_plan_(chunk_plan),
        ref_(scene.bodies().size()),
        hull_(scene.bodies().size()) {
    for (std::uint32_t b = 0; b < ref_.size(); ++b) {
      ref_[b] = b;
      hull_[b] = device.hull_of(b);
    }
    if (plan.query.configuration_count > 0)
      for (std::uint32_t slot = 0; slot < plan.moved.size(); ++slot) ref_[plan.moved[slot]] = slot | kMovedBit;
  }

  /// \param growing whether the first of few chunks are small, since the caller waits for rows
  void run(std::uint64_t chunk_rows, bool growing) {
    const std::uint64_t P = plan_.size.pairs, K = plan_.size.configurations;
    const std::uint64_t parts = K == 1 || P >= chunk_rows ? (P + chunk_rows - 1) / chunk_rows : 1;
    const std::uint64_t per_part = parts == 0 ? 0 : (P + parts - 1) / parts;
    const std::uint64_t chunks = parts > 1 ? K : (K * P + chunk_rows - 1) / chunk_rows;
    chunk_plan_.configurations = chunks == 0 ? 1 : static_cast<std::uint32_t>((K + chunks - 1) / chunks);
    chunk_plan_.last_configurations =
        static_cast<std::uint32_t>(K - (K - 1) / chunk_plan_.configurations * chunk_plan_.configurations);
    // The first of few parts is small, so that its rows are copied early. Each later part is computed while the rows
    // before it are copied.
    const std::uint64_t shares = growing && K == 1 && parts <= kChunksUnderWay ? parts * (parts + 1) / 2 : 0;
    for (std::uint64_t first = 0, i = 1; first < P; ++i) {
      const std::uint64_t size = shares > 0 ? (i * P / shares + kTile - 1) / kTile * kTile : per_part;
      add_part(first, static_cast<std::uint32_t>(std::min(size, P - first)));
      first += size;
    }
    chunk_plan_.resident = const_cast<Device&>(device_).upload(refs_, position_, group_of_tile_);
  }

 private:
  void add_part(std::uint64_t first, std::uint32_t count) {
    assert(count > 0 && first + count <= plan_.size.pairs);
    ChunkPlan::Part part;
    part.first = first;
    part.count = count;
    part.first_pair = static_cast<std::uint32_t>(refs_.size());
    const std::span<const BodyPair> pairs = plan_.pairs.slice(first, count, slice_);
    order_by_hulls(pairs, part);
    // Groups first, then ungrouped pairs, then pairs of several convex parts.
    std::vector<Entry> ungrouped;
    std::vector<Group> groups;
    for (std::size_t begin = 0, end; begin < order_.size(); begin = end) {
      for (end = begin; end < order_.size() && order_[end].hulls == order_[begin].hulls;) ++end;
      const auto one = static_cast<std::uint32_t>(order_[begin].hulls >> 32),
                 other = static_cast<std::uint32_t>(order_[begin].hulls);
      if ((end - begin) * chunk_plan_.configurations < kCompany || !device_.shares(one) || !device_.shares(other)) {
        ungrouped.insert(ungrouped.end(), order_.begin() + static_cast<std::ptrdiff_t>(begin),
                         order_.begin() + static_cast<std::ptrdiff_t>(end));
        continue;
      }
      groups.push_back({one, other, static_cast<std::uint32_t>(refs_.size()) - part.first_pair,
                        static_cast<std::uint32_t>(end - begin), 0});
      for (std::size_t i = begin; i < end; ++i) add_pair(pairs, order_[i]);
    }
    const Group ungrouped_group = add_apart(part, pairs, ungrouped), several_group = add_apart(part, pairs, several_);
    part.whole = add_groups(groups, ungrouped_group, several_group, chunk_plan_.configurations);
    part.last = add_groups(groups, ungrouped_group, several_group, chunk_plan_.last_configurations);
    chunk_plan_.parts.push_back(std::move(part));
  }

  struct Entry {
    std::uint64_t hulls;  // the sort key
    std::uint32_t position;
    auto operator<=>(const Entry&) const = default;
  };

  // Sorts the pairs of a part into order_, several_ and those that the CPU answers.
  void order_by_hulls(std::span<const BodyPair> pairs, ChunkPlan::Part& part) {
    order_.clear();
    several_.clear();
    for (std::uint32_t i = 0; i < pairs.size(); ++i) {
      const auto [a, b] = pairs[i];
      if (a >= hull_.size() || b >= hull_.size() || hull_[a] == kNone || hull_[b] == kNone)
        part.on_cpu.push_back(i);
      else if (hull_[a] == kSeveral || hull_[b] == kSeveral)
        several_.push_back({std::uint64_t{convex_parts_of(a)} * convex_parts_of(b), i});
      else
        order_.push_back({std::uint64_t{hull_[a]} << 32 | hull_[b], i});
    }
    if (!std::is_sorted(order_.begin(), order_.end())) std::sort(order_.begin(), order_.end());
    std::sort(several_.begin(), several_.end());  // neighbouring threads get equal numbers of part pairs
  }

  void add_pair(std::span<const BodyPair> pairs, const Entry& e) {
    const auto [a, b] = pairs[e.position];
    refs_.push_back({ref_[a], ref_[b]});
    position_.push_back(e.position);
  }

  // A group of pairs that share no hulls.
  Group add_apart(const ChunkPlan::Part& part, std::span<const BodyPair> pairs, std::span<const Entry> entries) {
    const Group group{kNone, kNone, static_cast<std::uint32_t>(refs_.size()) - part.first_pair,
                      static_cast<std::uint32_t>(entries.size()), 0};
    for (const Entry& e : entries) add_pair(pairs, e);
    return group;
  }

  std::size_t convex_parts_of(std::uint32_t body) const { return scene_.bodies()[body].parts.size(); }

  ChunkPlan::Part::Groups add_groups(std::span<const Group> groups, const Group& ungrouped, const Group& several,
                                     std::uint32_t configurations) {
    ChunkPlan::Part::Groups g;
    g.first_tile = static_cast<std::uint32_t>(group_of_tile_.size());
    for (Group group : groups) {
      group.first_tile = g.tiles;
      g.tiles += tiles(group.count, configurations);
      group_of_tile_.insert(group_of_tile_.end(), g.tiles - group.first_tile, group);
    }
    g.ungrouped = ungrouped;
    g.ungrouped_tiles = tiles(ungrouped.count, configurations);
    g.several = several;
    g.several_tiles = tiles(several.count, configurations);
    return g;
  }

  const engine::Scene& scene_;
  const Device& device_;
  const Plan& plan_;
  ChunkPlan& chunk_plan_;
  std::vector<std::uint32_t> ref_, hull_;
  std::vector<BodyPair> slice_;
  std::vector<Entry> order_;    // pairs of two hulls
  std::vector<Entry> several_;  // pairs with a body of several convex parts
  std::vector<PairRef> refs_;
  std::vector<std::uint32_t> position_;
  std::vector<Group> group_of_tile_;
};

}  // namespace

PairSelectionKey::PairSelectionKey(const Plan& plan) {
  if (plan.query.configuration_count > 0) moved = plan.moved;
  if (plan.pairs.is_whole_table())
    table = plan.snapshot->pairs;
  else
    pairs.assign(plan.pairs.list().begin(), plan.pairs.list().end());
}

bool PairSelectionKey::matches(const Plan& plan) const {
  const bool moves = plan.query.configuration_count > 0;
  if (moves ? moved != plan.moved : !moved.empty()) return false;
  if (plan.pairs.is_whole_table()) return table.get() == plan.pairs.table();
  const std::span<const BodyPair> list = plan.pairs.list();
  return !table && std::equal(pairs.begin(), pairs.end(), list.begin(), list.end());
}

std::shared_ptr<const ChunkPlan> DeviceBackend::chunk_plan(const Plan& plan) {
  {
    const std::lock_guard lock(mutex_);
    if (last_ && last_->all_configurations == plan.size.configurations && last_->key.matches(plan)) return last_;
  }
  auto next = std::make_shared<ChunkPlan>();
  next->all_configurations = plan.size.configurations;
  next->key = PairSelectionKey(plan);
  const std::uint64_t rows = plan.size.configurations * plan.size.pairs;
  ChunkPlanner(scene_, *device_, plan, *next)
      .run(std::clamp(rows / static_cast<std::uint64_t>(device_->chunks_wanted()), kFewestRows, kMostRows), true);
  const std::lock_guard lock(mutex_);
  last_ = next;
  return next;
}

std::shared_ptr<const ChunkPlan> DeviceBackend::make_chunk_plan(const Plan& plan, std::uint64_t chunk_rows) const {
  auto chunk_plan = std::make_shared<ChunkPlan>();
  ChunkPlanner(scene_, *device_, plan, *chunk_plan).run(chunk_rows, false);
  return chunk_plan;
}

}  // namespace clearance::cuda
