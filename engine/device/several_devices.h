// Several devices of one host, used as one. Each holds the whole scene; a query's chunks are distributed in turn.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "engine/base/counters.h"
#include "engine/device/device.h"

namespace clearance::cuda {

struct NumberedDevice {
  int number;
  std::shared_ptr<Device> device;  ///< null if it could not be opened
};

/// The error with the device's number in its message.
DeviceError of_device(int number, const DeviceError& error);

/// A lost device is excluded from then on. The query that was using it gets kOneLost (kLost if it was the last) and
/// restarts.
class SeveralDevices final : public Device, public std::enable_shared_from_this<SeveralDevices> {
 public:
  /// \param devices of which at least one was opened
  explicit SeveralDevices(std::vector<NumberedDevice> devices);

  int chunks_wanted() const override;
  std::uint32_t hull_of(std::uint32_t body) const override;
  bool shares(std::uint32_t hull) const override;
  std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs, std::span<const std::uint32_t> position,
                                              std::span<const Group> group_of_tile) override;
  std::shared_ptr<const ResidentTable> upload(const PairTable& table) override;
  /// Memory for all rows on every device, since the distribution of rows is decided when the query begins.
  std::shared_ptr<Workspace> borrow() override;
  std::shared_ptr<ReducedWorkspace> borrow_reduced() override;
  /// Sums.
  DeviceCounters counters() const override;
  /// Adds the counters of each device shown by stats().
  void append(Counters& counters) const;

  struct Member {
    NumberedDevice opened;
    std::atomic<bool> usable{false};
  };
  std::vector<std::unique_ptr<Member>>& members() { return members_; }
  /// Calls f(), which uses this member.
  template <class F>
  auto call(Member& member, F f) {
    try {
      return f();
    } catch (const DeviceError& error) {
      fail(member, error);
    }
  }
  /// The usable members, each time starting with the next one.
  std::vector<std::size_t> in_turn() { return usable_from(turn_++); }

 private:
  std::vector<std::size_t> usable_from(std::size_t turn) const;
  const Device& any() const;  // for scene data, which is the same on each
  [[noreturn]] void fail(Member& member, const DeviceError& error);

  std::vector<std::unique_ptr<Member>> members_;
  std::atomic<std::size_t> turn_{0};  // index of the next first member
};

}  // namespace clearance::cuda
