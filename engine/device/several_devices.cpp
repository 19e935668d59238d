#include "engine/device/several_devices.h"

#include <algorithm>
#include <cstring>
#include <functional>

namespace clearance::cuda {

namespace {

struct PairsOfAll final : ResidentPairs {
  std::vector<std::shared_ptr<const ResidentPairs>> of;  // per member; null if lost
};
struct TablesOfAll final : ResidentTable {
  std::vector<std::shared_ptr<const ResidentTable>> of;
};
/// \tparam Interface Workspace or ReducedWorkspace
template <class Interface>
class WorkspaceOfAll : public Interface {
 public:
  using Borrow = std::shared_ptr<Interface> (Device::*)();
  WorkspaceOfAll(std::shared_ptr<SeveralDevices> owner, Borrow borrow)
      : owner_(std::move(owner)), borrow_(borrow), parts_(owner_->members().size()), order_(owner_->in_turn()) {
    source_ = order_.front();
  }

  int slots() const override { return kChunksUnderWay * static_cast<int>(order_.size()); }

  FixedBodies body_buffers(std::size_t bodies) override {
    bodies_ = bodies;
    return source_bodies_ = call(source_, [&](Interface& w) { return w.body_buffers(bodies); });
  }
  std::byte* query_input_buffer(Given given, std::size_t bytes) override {  // pinned memory is usable by all devices
    return call(source_, [&](Interface& w) { return w.query_input_buffer(given, bytes); });
  }
  std::byte* chunk_input_buffer(Given given, int slot, std::size_t bytes) override {
    return call(member_of(slot), [&](Interface& w) { return w.chunk_input_buffer(given, slot_of(slot), bytes); });
  }

  void begin(const QuerySetup& all) override {
    order_.resize(std::min<std::uint64_t>(order_.size(), std::max<std::uint64_t>(all.chunks, 1)));
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const std::size_t m = order_[i];
      QuerySetup s = all;
      if (all.pairs) s.pairs = static_cast<const PairsOfAll*>(all.pairs)->of[m].get();
      if (all.table) s.table = static_cast<const TablesOfAll*>(all.table)->of[m].get();
      s.chunks = (all.chunks - i + order_.size() - 1) / order_.size();
      call(m, [&](Interface& w) {
        if (m != source_) copy_bodies(w.body_buffers(bodies_));
        w.begin(s);
      });
    }
  }
  void launch(int slot, const ChunkSetup& chunk, const ReplyView& direct) override {
    call(member_of(slot), [&](Interface& w) { w.launch(slot_of(slot), chunk, direct); });
  }

 protected:
  std::size_t member_of(int slot) const { return order_[static_cast<std::size_t>(slot) % order_.size()]; }
  int slot_of(int slot) const { return slot / static_cast<int>(order_.size()); }
  template <class F>
  auto call(std::size_t m, F f) {
    SeveralDevices::Member& member = *owner_->members()[m];
    return owner_->call(member, [&] {
      if (!parts_[m]) parts_[m] = std::invoke(borrow_, *member.opened.device);
      return f(*parts_[m]);
    });
  }

 private:
  void copy_bodies(const FixedBodies& to) const {
    std::copy_n(source_bodies_.components, bodies_ * kPoseComponents, to.components);
    std::copy_n(source_bodies_.state, bodies_, to.state);
  }

  std::shared_ptr<SeveralDevices> owner_;
  Borrow borrow_;
  std::vector<std::shared_ptr<Interface>> parts_;  // per member; null if not used yet
  std::vector<std::size_t> order_;                 // members that get chunks
  std::size_t source_ = 0;                         // the member whose pinned memory the caller writes to
  FixedBodies source_bodies_{};
  std::size_t bodies_ = 0;
};

class DenseOfAll final : public WorkspaceOfAll<Workspace> {
 public:
  using WorkspaceOfAll::WorkspaceOfAll;
  ChunkResult finish(int slot) override {
    return call(member_of(slot), [&](Workspace& w) { return w.finish(slot_of(slot)); });
  }
};
class ReducedOfAll final : public WorkspaceOfAll<ReducedWorkspace> {
 public:
  using WorkspaceOfAll::WorkspaceOfAll;
  ReducedResult finish(int slot) override {
    return call(member_of(slot), [&](ReducedWorkspace& w) { return w.finish(slot_of(slot)); });
  }
  ReducedResult finish_with(int slot, std::span<const PairAnswer> answers) override {
    return call(member_of(slot), [&](ReducedWorkspace& w) { return w.finish_with(slot_of(slot), answers); });
  }
};

}  // namespace

DeviceError of_device(int number, const DeviceError& error) {
  return {error.kind, "device " + std::to_string(number) + ": " + error.what()};
}

SeveralDevices::SeveralDevices(std::vector<NumberedDevice> devices) {
  for (NumberedDevice& d : devices) {
    members_.push_back(std::make_unique<Member>());
    members_.back()->usable = d.device != nullptr;
    members_.back()->opened = std::move(d);
  }
}

void SeveralDevices::fail(Member& member, const DeviceError& error) {
  DeviceError named = of_device(member.opened.number, error);
  if (named.kind == DeviceError::kLost) {
    member.usable = false;
    const bool others = std::any_of(members_.begin(), members_.end(), [](const auto& m) { return m->usable.load(); });
    if (others) named.kind = DeviceError::kOneLost;
  }
  throw named;
}

std::vector<std::size_t> SeveralDevices::usable_from(std::size_t turn) const {
  std::vector<std::size_t> usable;
  for (std::size_t m = 0; m < members_.size(); ++m)
    if (members_[m]->usable) usable.push_back(m);
  if (usable.empty()) throw DeviceError(DeviceError::kLost, "all devices are lost");
  std::rotate(usable.begin(), usable.begin() + static_cast<std::ptrdiff_t>(turn % usable.size()), usable.end());
  return usable;
}

// Each chunk takes time of the single host thread, so there are just enough for each device to start a second chunk
// while its first ends.
int SeveralDevices::chunks_wanted() const {
  return std::max(kChunksUnderWay, 2 * static_cast<int>(members_.size()));
}

const Device& SeveralDevices::any() const {
  return *(*std::find_if(members_.begin(), members_.end(), [](const auto& m) {
            return m->opened.device != nullptr;
          }))->opened.device;
}
std::uint32_t SeveralDevices::hull_of(std::uint32_t body) const {
  return any().hull_of(body);
}
bool SeveralDevices::shares(std::uint32_t hull) const {
  return any().shares(hull);
}

std::shared_ptr<const ResidentPairs> SeveralDevices::upload(std::span<const PairRef> pairs,
                                                            std::span<const std::uint32_t> position,
                                                            std::span<const Group> group_of_tile) {
  auto all = std::make_shared<PairsOfAll>();
  all->of.resize(members_.size());
  for (const std::size_t m : usable_from(0))
    all->of[m] = call(*members_[m], [&] { return members_[m]->opened.device->upload(pairs, position, group_of_tile); });
  return all;
}

std::shared_ptr<const ResidentTable> SeveralDevices::upload(const PairTable& table) {
  auto all = std::make_shared<TablesOfAll>();
  all->of.resize(members_.size());
  for (const std::size_t m : usable_from(0))
    all->of[m] = call(*members_[m], [&] { return members_[m]->opened.device->upload(table); });
  return all;
}

std::shared_ptr<Workspace> SeveralDevices::borrow() {
  return std::make_shared<DenseOfAll>(shared_from_this(), &Device::borrow);
}
std::shared_ptr<ReducedWorkspace> SeveralDevices::borrow_reduced() {
  return std::make_shared<ReducedOfAll>(shared_from_this(), &Device::borrow_reduced);
}

DeviceCounters SeveralDevices::counters() const {
  DeviceCounters sum;
  for (const auto& m : members_) {
    if (!m->opened.device) continue;
    const DeviceCounters c = m->opened.device->counters();
    sum.scene_bytes += c.scene_bytes;
    sum.scene_bytes_uploaded += c.scene_bytes_uploaded;
    sum.query_bytes += c.query_bytes;
    sum.pinned_bytes += c.pinned_bytes;
    sum.allocations += c.allocations;
    sum.kernel_ns += c.kernel_ns;
    sum.broad_phase_ns += c.broad_phase_ns;
    sum.launches += c.launches;
  }
  return sum;
}

void SeveralDevices::append(Counters& counters) const {
  for (const auto& m : members_) {
    const DeviceCounters c = m->opened.device ? m->opened.device->counters() : DeviceCounters();
    const std::string name = "cuda." + std::to_string(m->opened.number) + ".";
    counters.emplace_back(name + "usable", m->usable ? 1u : 0u);
    counters.emplace_back(name + "chunks", c.launches);
    counters.emplace_back(name + "kernel_ns", c.kernel_ns);
    counters.emplace_back(name + "scene_bytes", c.scene_bytes);
    counters.emplace_back(name + "query_bytes", c.query_bytes);
  }
}

}  // namespace clearance::cuda
