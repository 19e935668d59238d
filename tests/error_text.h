// The text of the error that a call ends with.
#pragma once

#include <string>

namespace clearance {

/// Text of the exception of type E that f() throws; empty if it throws none. Others pass through and fail the test.
template <class E, class F>
std::string error_text(F&& f) {
  try {
    f();
  } catch (const E& e) {
    return e.what();
  }
  return "";
}

}  // namespace clearance
