// What reductions keep on a device: lists of pairs, clouds and meshes, and the table of pairs.
#include <algorithm>
#include <numeric>
#include <utility>

#include "engine/device/device_job.h"
#include "engine/device/query/body_kinds.h"
#include "engine/device/query/extents_around.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

namespace {

// Lists the pairs in their order. Lists none if the device can evaluate none of them or lacks the pose of a body.
void list_in_order(const engine::Scene& scene, const Device& device, const Plan& plan, std::vector<PairRef>& refs,
                   PairListOnDevice& list) {
  std::vector<std::uint32_t> ref(scene.bodies().size());
  std::iota(ref.begin(), ref.end(), 0u);
  if (plan.query.configuration_count > 0)
    for (std::uint32_t slot = 0; slot < plan.moved.size(); ++slot) ref[plan.moved[slot]] = slot | kMovedBit;
  refs.reserve(plan.pairs.size());
  std::vector<std::uint8_t> is_listed(ref.size(), 0);
  std::vector<BodyPair> storage;
  std::uint64_t left = 0;
  constexpr std::uint64_t kSlice = 1u << 16;
  for (std::uint64_t first = 0; first < plan.pairs.size(); first += kSlice)
    for (const auto [a, b] : plan.pairs.slice(first, std::min(kSlice, plan.pairs.size() - first), storage)) {
      const BodyKind of_a = kind_of(scene, device, a), of_b = kind_of(scene, device, b);
      if (of_a == BodyKind::kUnknown || of_b == BodyKind::kUnknown) return refs.clear();
      refs.push_back({ref[a], ref[b]});
      if (of_a == BodyKind::kHull && of_b == BodyKind::kHull) continue;
      is_listed[a] = is_listed[b] = 1;
      if (bool ElementKinds::* const kernel = kernel_for(of_a, of_b))
        list.kinds.*kernel = true;
      else
        ++left;
    }
  if (left == plan.pairs.size()) return refs.clear();
  for (std::uint32_t body = 0; body < ref.size(); ++body)
    if (is_listed[body] && device.hull_of(body) == kNone) list.of_elements.push_back(body);
}

}  // namespace

std::shared_ptr<const PairListOnDevice> DeviceBackend::list(const Plan& plan) {
  {
    const std::lock_guard lock(mutex_);
    if (last_list_ && last_list_->key.matches(plan)) return last_list_;
  }
  auto next = std::make_shared<PairListOnDevice>();
  next->key = PairSelectionKey(plan);
  std::vector<PairRef> refs;
  list_in_order(scene_, *device_, plan, refs, *next);
  if (!refs.empty()) next->resident = device_->upload(refs, {}, {});
  const std::lock_guard lock(mutex_);
  last_list_ = next;
  return next;
}

std::shared_ptr<const ElementsOnDevice> DeviceBackend::elements(const engine::Scene& scene,
                                                                std::span<const std::uint32_t> bodies) {
  auto all = std::make_shared<ElementsOnDevice>();
  const std::lock_guard lock(elements_mutex_);
  for (const std::uint32_t body : bodies) {
    const Body& of = scene.bodies()[body];
    const bool is_empty = is_cloud(of) && of.cloud != CloudState::kPoints;
    all->bodies.push_back({body, extents_around(of), is_empty, nullptr});
    if (is_empty || of.parts.size() != 1) continue;
    KnownElements& known = elements_[body];
    if (known.surface != of.parts[0]->surface) {
      // A query still in flight keeps the previous points in place.
      std::shared_ptr<ResidentElements> reused = std::exchange(known.resident, nullptr);
      known.surface = nullptr;
      if (reused.use_count() > 1) reused = nullptr;
      known.resident = device_->upload(*of.parts[0]->surface, std::move(reused));
      if (!known.resident) return nullptr;
      known.surface = of.parts[0]->surface;
    }
    all->bodies.back().resident = known.resident.get();
    all->resident.push_back(known.resident);
  }
  return all;
}

std::shared_ptr<const TableOnDevice> DeviceBackend::table(const Plan& plan) {
  const std::shared_ptr<const PairTable>& wanted = plan.snapshot->pairs;
  {
    const std::lock_guard lock(mutex_);
    if (last_table_ && last_table_->table == wanted) return last_table_;
  }
  auto next = std::make_shared<TableOnDevice>();
  next->table = wanted;
  bool all_known = true;
  for (std::uint32_t b = 0; b < scene_.bodies().size(); ++b) all_known = all_known && device_->hull_of(b) != kNone;
  if (all_known) next->resident = device_->upload(*wanted);
  const std::lock_guard lock(mutex_);
  last_table_ = next;
  return next;
}

}  // namespace clearance::cuda
