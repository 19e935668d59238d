// Restricts the system calls of a process that may be compromised (seccomp).
#pragma once

#include <seccomp.h>

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>

namespace clearance {

/// Allow-list of system calls for this process. Once enforced, it cannot be removed.
class CallFilter {
 public:
  /// Starts with the calls that every Clearance program needs: allocating memory without execution rights, waiting for
  /// locks, reading clocks, and ending, including by abort().
  /// \param who name for messages, such as "the mesh loader"
  explicit CallFilter(std::string who);

  /// \param call ignored if this architecture does not have it
  template <class... Conditions>
  void allow(int call, Conditions... conditions) {
    const scmp_arg_cmp all[sizeof...(conditions) + 1] = {conditions..., {}};
    add(SCMP_ACT_ALLOW, call, sizeof...(conditions), all);
  }
  void allow_each(std::initializer_list<int> calls) {
    for (const int call : calls) allow(call);
  }
  /// Makes a call return an error instead of ending the process.
  void answer(int call, unsigned short error);
  /// Makes enforce() apply to running threads, too. It always applies to later ones.
  void bind_all_threads();
  /// Enforces the list. The first call outside it is not executed: `reject` receives its number on the calling thread,
  /// must end the process, and may not allocate memory.
  ///
  /// Returns the reason if the kernel does not support such filters (too old, or a container that forbids them),
  /// otherwise an empty text. Throws std::runtime_error for any other failure.
  std::string enforce(void (*reject)(int call));

 private:
  void add(std::uint32_t action, int call, unsigned count, const scmp_arg_cmp* conditions);
  void check(int error, const char* what) const;

  std::string who_;
  std::unique_ptr<void, decltype(&::seccomp_release)> context_;
};

}  // namespace clearance
