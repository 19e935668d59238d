// Several devices of one host as one: each holds the whole scene, and a query's chunks go to them in turn.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "engine/base/counters.h"
#include "engine/device/device.h"

namespace clearance::cuda {

struct NumberedDevice {
  int number;
  std::shared_ptr<Device> device;  ///< null: it could not be opened
};

/// The error with the device's number in its words.
DeviceError of_device(int number, const DeviceError& error);

/// A device that is lost is left out from then on. Whoever was using it is told so (kOneLost; kLost if it was the last)
/// and begins again.
class SeveralDevices final : public Device, public std::enable_shared_from_this<SeveralDevices> {
 public:
  /// \param devices at least one of them was opened.
  explicit SeveralDevices(std::vector<NumberedDevice> devices);

  int chunks_wanted() const override;
  std::uint32_t hull_of(std::uint32_t body) const override;
  bool shares(std::uint32_t hull) const override;
  std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs, std::span<const std::uint32_t> position,
                                              std::span<const Group> group_of_tile) override;
  std::shared_ptr<const ResidentTable> upload(const PairTable& table) override;
  /// For all rows on every device: which of them go where is known when the query begins.
  std::unique_ptr<ResidentWarm> make_warm(std::uint64_t rows) override;
  std::shared_ptr<Workspace> borrow() override;
  std::shared_ptr<ReducedWorkspace> borrow_reduced() override;
  /// Sums.
  DeviceCounters counters() const override;
  /// Adds what stats() shows of each device.
  void append(Counters& counters) const;

  struct Member {
    NumberedDevice opened;
    std::atomic<bool> usable{false};
  };
  std::vector<std::unique_ptr<Member>>& members() { return members_; }
  /// Calls f(), which asks this member.
  template <class F>
  auto ask(Member& member, F f) {
    try {
      return f();
    } catch (const DeviceError& error) {
      fail(member, error);
    }
  }
  /// The members that can be asked, another one first each time.
  std::vector<std::size_t> in_turn() { return usable_from(turn_++); }

 private:
  std::vector<std::size_t> usable_from(std::size_t turn) const;
  const Device& any() const;  // what is known of the scene is the same on each
  [[noreturn]] void fail(Member& member, const DeviceError& error);

  std::vector<std::unique_ptr<Member>> members_;
  std::atomic<std::size_t> turn_{0}, warm_turn_{0};  // who comes first
};

}  // namespace clearance::cuda
