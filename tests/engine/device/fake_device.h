// A fake device that leaves all rows to the CPU and fails on request.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "engine/device/device.h"
#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {

// Fails at one of its calls; if it is lost, also at all later calls.
struct Fault {
  int at = -1;
  cuda::DeviceError::Kind kind = cuda::DeviceError::kLost;
  int calls = 0;
  int launches = 0;              // chunks started
  std::vector<double> bodies{};  // of the query begun last: components

  void call(const char* what) {
    const int now = calls++;
    if (now == at || (kind == cuda::DeviceError::kLost && at >= 0 && now > at))
      throw cuda::DeviceError(kind, std::string("a planted fault while ") + what);
  }
};

// Small bodies at random poses.
inline engine::Scene spheres(int count) {
  engine::Scene s;
  Random random(7);
  for (int i = 0; i < count; ++i) s.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(3)});
  return s;
}

// All columns, with two of the bodies moved.
struct DeviceTestQuery {
  explicit DeviceTestQuery(std::uint32_t configurations, Reduce reduce = Reduce::kNone) {
    Random random(5);
    for (std::size_t i = 0; i < configurations * moved.size(); ++i) poses.push_back(random.pose(3));
    q.fields = kAllFields;
    q.configuration_count = configurations;
    q.bodies = moved;
    q.configurations = poses;
    q.reduce = reduce;
  }
  DeviceTestQuery(const DeviceTestQuery&) = delete;
  DeviceTestQuery(DeviceTestQuery&&) = default;  // moved vectors keep their memory, so the query's spans stay valid
  std::vector<std::uint32_t> moved{3, 10};
  std::vector<Pose> poses;
  QueryView q;
};

// Runs a query twice; the device has memory only for the second one.
inline void expect_memory_for_the_second(const engine::Engine& device, const DeviceTestQuery& device_query,
                                         const Answer& expected) {
  const Answer first = evaluate(device, device_query.q), second = evaluate(device, device_query.q);
  expect_same(first, expected, "without memory");
  expect_same(second, expected, "with memory");
  EXPECT_EQ(first.info.backend, "cpu");
  EXPECT_EQ(second.info.backend, "cuda");
  EXPECT_EQ(counter(device, "cuda.queries_without_memory"), 1u);
}

// The owner: a device must not get another device's pairs.
struct IdlePairs : cuda::ResidentPairs {
  const Fault* of = nullptr;
};
struct IdleTable : cuda::ResidentTable {
  const Fault* of = nullptr;
};

// Common part of all kinds of workspaces.
template <class Interface>
class IdleSide : public Interface {
 public:
  explicit IdleSide(Fault& fault) : fault_(fault) {}

  cuda::FixedBodies body_buffers(std::size_t bodies) override {
    components_.resize(bodies * cuda::kPoseComponents);
    state_.resize(bodies);
    return {components_.data(), state_.data()};
  }
  void begin(const cuda::QuerySetup& setup) override {
    fault_.call("beginning");
    fault_.bodies = components_;
    EXPECT_NE(setup.pairs == nullptr, setup.table == nullptr) << "one of the two";
    EXPECT_EQ(
        setup.pairs ? static_cast<const IdlePairs*>(setup.pairs)->of : static_cast<const IdleTable*>(setup.table)->of,
        &fault_);
  }
  std::byte* chunk_input_buffer(cuda::Given given, int slot, std::size_t bytes) override {
    return buffer_of(given_[static_cast<int>(given)][slot], bytes);
  }
  std::byte* query_input_buffer(cuda::Given given, std::size_t bytes) override {
    return buffer_of(all_given_[static_cast<int>(given)], bytes);
  }

 protected:
  Fault& fault_;

 private:
  static std::byte* buffer_of(std::vector<Pose>& memory, std::size_t bytes) {
    memory.resize(bytes / sizeof(Pose) + 1);
    return reinterpret_cast<std::byte*>(memory.data());
  }
  std::vector<double> components_;
  std::vector<std::uint8_t> state_;
  std::vector<Pose> given_[2][cuda::kChunksUnderWay], all_given_[2];  // by kind of input
};

template <class Interface>
class IdleWorkspace : public IdleSide<Interface> {
 public:
  using IdleSide<Interface>::IdleSide;
  void launch(int slot, const cuda::ChunkSetup& chunk, const ReplyView&) override {
    this->fault_.call("launching");
    ++this->fault_.launches;
    EXPECT_TRUE(slot >= 0 && slot < cuda::kChunksUnderWay && rows_[slot].empty()) << "slot " << slot;
    rows_[slot].resize(chunk.rows());
    for (std::uint32_t i = 0; i < rows_[slot].size(); ++i) rows_[slot][i] = i;
  }

 protected:
  std::span<const std::uint32_t> all_rows(int slot) {
    this->fault_.call("waiting");
    EXPECT_FALSE(rows_[slot].empty()) << "slot " << slot;
    finished_[slot] = std::exchange(rows_[slot], {});
    return finished_[slot];
  }

 private:
  std::vector<std::uint32_t> rows_[cuda::kChunksUnderWay], finished_[cuda::kChunksUnderWay];
};

class IdleDense : public IdleWorkspace<cuda::Workspace> {
 public:
  using IdleWorkspace::IdleWorkspace;
  cuda::ChunkResult finish(int slot) override {
    cuda::ChunkResult r;
    r.rest = all_rows(slot);
    return r;
  }
};
// Has no reductions: `finish_with()` is called and must fail.
class IdleReduced final : public IdleWorkspace<cuda::ReducedWorkspace> {
 public:
  using IdleWorkspace::IdleWorkspace;
  cuda::ReducedResult finish(int slot) override {
    cuda::ReducedResult r;
    r.rest = all_rows(slot);
    return r;
  }
  cuda::ReducedResult finish_with(int, std::span<const PairAnswer>) override {
    throw cuda::DeviceError(cuda::DeviceError::kNoMemory, "a planted fault while settling");
  }
};

class IdleDevice : public cuda::Device {
 public:
  explicit IdleDevice(Fault& fault) : fault_(fault) {}
  std::uint32_t hull_of(std::uint32_t body) const override { return body; }
  std::shared_ptr<const cuda::ResidentPairs> upload(std::span<const cuda::PairRef>, std::span<const std::uint32_t>,
                                                    std::span<const cuda::Group>) override {
    fault_.call("uploading");
    auto pairs = std::make_shared<IdlePairs>();
    pairs->of = &fault_;
    return pairs;
  }
  std::shared_ptr<const cuda::ResidentTable> upload(const PairTable&) override {
    fault_.call("uploading");
    auto table = std::make_shared<IdleTable>();
    table->of = &fault_;
    return table;
  }
  std::shared_ptr<cuda::Workspace> borrow() override {
    fault_.call("making a workspace");
    return std::make_shared<IdleDense>(fault_);
  }
  std::shared_ptr<cuda::ReducedWorkspace> borrow_reduced() override {
    fault_.call("making a workspace");
    return std::make_shared<IdleReduced>(fault_);
  }
  cuda::DeviceCounters counters() const override { return {}; }

 private:
  Fault& fault_;
};

}  // namespace clearance::test
