// Errors for handles that are used after a fork.
#pragma once

#include <unistd.h>

#include <stdexcept>
#include <string>

#include "wire/fork_guard.h"

namespace clearance::python {

/// A handle is valid only in the process that created it, since threads and locks do not survive a fork.
class ProcessGuard {
 public:
  void check(const char* what) const {
    if (!guard_.forked()) return;
    throw std::runtime_error(std::string(what) + " was made by process " + std::to_string(pid_) +
                             " and cannot be used after a fork; make a new one in the child");
  }

 private:
  ForkGuard guard_;
  pid_t pid_ = ::getpid();
};

}  // namespace clearance::python
