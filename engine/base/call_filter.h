// Takes system calls away from a process that others may have taken over (seccomp).
#pragma once

#include <seccomp.h>

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>

namespace clearance {

/// A list of system calls that this process may still make, once it is in force. For good: nothing can take it away.
class CallFilter {
 public:
  /// A list that has what any program of ours needs: to take memory that does not become code, to wait for locks, to
  /// read clocks, and to end, by abort() too. \param who for messages: "the mesh loader".
  explicit CallFilter(std::string who);

  /// \param call may be one that this architecture does not have.
  template <class... Conditions>
  void allow(int call, Conditions... conditions) {
    const scmp_arg_cmp all[sizeof...(conditions) + 1] = {conditions..., {}};
    add(SCMP_ACT_ALLOW, call, sizeof...(conditions), all);
  }
  void allow_each(std::initializer_list<int> calls) {
    for (const int call : calls) allow(call);
  }
  /// A call that is answered by an error, and ends nothing.
  void answer(int call, unsigned short error);
  /// Has enforce() bind threads that run already, too; later ones are bound in any case.
  void bind_all_threads();
  /// Puts it in force. The first call that is not on the list is not carried out:
  /// `refuse` gets its number on the thread that made it, must end the process, and may take no memory.
  ///
  /// Returns why the kernel refuses such filters (too old, or a container that forbids them), and an empty text if it
  /// is in force. Throws std::runtime_error if it cannot be had for any other reason.
  std::string enforce(void (*refuse)(int call));

 private:
  void add(std::uint32_t action, int call, unsigned count, const scmp_arg_cmp* conditions);
  void check(int error, const char* what) const;

  std::string who_;
  std::unique_ptr<void, decltype(&::seccomp_release)> context_;
};

}  // namespace clearance
