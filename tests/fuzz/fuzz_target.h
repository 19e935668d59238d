// A fuzz target: a function that accepts arbitrary bytes and must not fail. libFuzzer runs it under the sanitizers
// (preset "fuzz"); test_fuzz_replay runs it over the bytes in corpus/ and regressions/, with any compiler.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <span>
#include <string>

namespace clearance::fuzz {

using Bytes = std::span<const std::byte>;
/// Returns whether the bytes were accepted for their purpose: a request that is answered, a file that loads.
using Target = bool (*)(Bytes);

/// Every target of this program, by name.
inline std::map<std::string, Target>& targets() {
  static std::map<std::string, Target> all;
  return all;
}

/// Ends the run if a guarantee is broken that no sanitizer checks.
inline void require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

/// Reads an input from front to back; zeros follow its end.
class Input {
 public:
  explicit Input(Bytes bytes) : left_(bytes) {}
  bool empty() const { return left_.empty(); }
  /// Reads up to `size` bytes.
  Bytes take(std::size_t size) {
    const Bytes taken = left_.first(std::min(size, left_.size()));
    left_ = left_.subspan(taken.size());
    return taken;
  }
  Bytes rest() { return take(left_.size()); }
  template <class T>
  T number() {
    T value{};
    const Bytes bytes = take(sizeof value);
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }

 private:
  Bytes left_;
};

}  // namespace clearance::fuzz

/// Begins the function of a target; `bytes` is its input.
#define CLEARANCE_FUZZ_TARGET(name)                                    \
  static bool fuzz_##name(::clearance::fuzz::Bytes bytes);             \
  [[maybe_unused]] static const bool registered_##name =               \
      ::clearance::fuzz::targets().emplace(#name, fuzz_##name).second; \
  static bool fuzz_##name(::clearance::fuzz::Bytes bytes)
