// The GIL around C++ work, safe where the interpreter ends while a daemon thread is at work.
//
// CPython before 3.14 ends a daemon thread that wants the GIL during finalization by pthread_exit(). Its unwinding
// passes neither a noexcept destructor nor nanobind's catch (...): both abort the process. So such a thread is parked
// where it is, as CPython 3.14 does; the process then ends without it.
#pragma once

#include <nanobind/nanobind.h>
#include <unistd.h>

namespace clearance::python {

/// Calls a function of CPython that may give up or take the GIL, and that throws nothing. A thread that CPython ends
/// within it stays here for ever.
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

/// Releases the GIL for as long as it lives.
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

/// Runs the handlers of signals that have come. Throws what they raise, as nanobind::python_error.
inline void check_signals() {
  if (or_park([] { return PyErr_CheckSignals(); }) != 0) throw nanobind::python_error();
}

}  // namespace clearance::python
