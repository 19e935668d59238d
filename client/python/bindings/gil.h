// The GIL around C++ work, safe if the interpreter ends while a daemon thread runs.
//
// CPython before 3.14 calls pthread_exit() in a daemon thread that requests the GIL during finalization. The unwinding
// aborts the process in noexcept destructors and in nanobind's catch (...). So this code suspends such a thread
// forever, as CPython 3.14 does, and the process ends without it.
#pragma once

#include <nanobind/nanobind.h>
#include <unistd.h>

namespace clearance::python {

/// Calls a function of CPython that may release or acquire the GIL, and does not throw. A thread that CPython ends
/// within it is suspended forever.
template <class Call>
[[gnu::noinline]] auto or_park(const Call& call) {
  struct Parking {
    bool returned = false;
    ~Parking() noexcept(false) {
      while (!returned) ::pause();
    }
  } parking;
  const auto result = call();
  parking.returned = true;
  return result;
}

/// Releases the GIL for its lifetime.
class GilRelease {
 public:
  GilRelease() : state_(PyEval_SaveThread()) {}
  ~GilRelease() {
    or_park([this] {
      PyEval_RestoreThread(state_);
      return true;
    });
  }
  GilRelease(const GilRelease&) = delete;
  GilRelease& operator=(const GilRelease&) = delete;

 private:
  PyThreadState* state_;
};

/// Runs the handlers of pending signals. Throws their exceptions as nanobind::python_error.
inline void check_signals() {
  if (or_park([] { return PyErr_CheckSignals(); }) != 0) throw nanobind::python_error();
}

}  // namespace clearance::python
