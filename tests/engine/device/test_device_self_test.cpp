// The self-test of devices: it detects a device with wrong rows, and accepts one that leaves rows to the CPU or fails.
#include "engine/device/device_self_test.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

// Answers every row with the same interval.
class LyingDense final : public IdleWorkspace<cuda::Workspace> {
 public:
  using IdleWorkspace::IdleWorkspace;
  cuda::ChunkResult finish(int slot) override {
    const std::size_t rows = all_rows(slot).size();
    bounds_.assign(rows, 0.25);
    status_.assign(rows, static_cast<std::uint8_t>(Status::kOk));
    cuda::ChunkResult r;
    r.rows.lower = r.rows.upper = bounds_.data();
    r.rows.status = status_.data();
    r.converged = rows;
    return r;
  }

 private:
  std::vector<double> bounds_;
  std::vector<std::uint8_t> status_;
};
class LyingDevice final : public IdleDevice {
 public:
  explicit LyingDevice(Fault& fault) : IdleDevice(fault), mine_(fault) {}
  std::shared_ptr<cuda::Workspace> borrow() override { return std::make_shared<LyingDense>(mine_); }

 private:
  Fault& mine_;
};

template <class Device>
SelfTest test_of(Fault fault) {
  const cuda::FakeDevice fake_device({true, "a stand-in", ""}, [&](const engine::Scene&, int, std::uint64_t) {
    fault.call("opening");
    return std::make_shared<Device>(fault);
  });
  return cuda::self_test_devices({});
}

TEST(DeviceSelfTest, FindsADeviceThatAnswersWrongly) {
  const SelfTest test = test_of<LyingDevice>({});
  EXPECT_FALSE(test.passed());
  EXPECT_GT(test.wrong, 200u);
  EXPECT_NE(test.first_wrong.find("[0.25, 0.25] misses it"), std::string::npos) << test.first_wrong;
}

TEST(DeviceSelfTest, TakesWhatTheCpuAnswersInstead) {
  const SelfTest test = test_of<IdleDevice>({});
  EXPECT_TRUE(test.passed()) << test.first_wrong;
  EXPECT_GT(test.answers, 300u);
}

TEST(DeviceSelfTest, BlamesNoDeviceThatCannotBeTested) {
  for (int at = 0; at < 6; ++at)
    for (const cuda::DeviceError::Kind kind : {cuda::DeviceError::kLost, cuda::DeviceError::kNoMemory}) {
      Fault fault;
      fault.at = at;
      fault.kind = kind;
      const SelfTest test = test_of<IdleDevice>(fault);
      EXPECT_TRUE(test.passed()) << at << ": " << test.first_wrong;
    }
}

}  // namespace
}  // namespace clearance::test
