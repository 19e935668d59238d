// The floating-point state that the bounds' proofs assume, independent of the state of the caller's thread.
//
// A thread may round upward, flush denormals to zero or trap on an invalid operation: games, codecs, interval
// libraries and -ffast-math set such states, and threads inherit them. No bound is valid there. So each public function
// sets the default state for its duration, and so does each OpenMP worker, whose thread can be the caller's.
#pragma once

#include <cstdint>

#if !defined(__x86_64__) && !defined(__aarch64__)
#include <cfenv>
#endif

namespace clearance {

/// Sets the IEEE 754 default state for its lifetime: round to nearest, keep denormals, no exception traps. The
/// destructor restores the thread's state including the sticky exception flags, so that ours do not reach the caller.
/// Costs a read and a comparison if the state is the default already. The compiler moves no load across it.
class FpEnvironment {
 public:
  FpEnvironment() : callers_(State::now()) {
    if (!callers_.is_default()) State().load();
  }
  ~FpEnvironment() {
    if (!(State::now() == callers_)) callers_.load();
  }
  FpEnvironment(const FpEnvironment&) = delete;
  FpEnvironment& operator=(const FpEnvironment&) = delete;

 private:
#if defined(__x86_64__)
  // MXCSR controls arithmetic on doubles and floats. The x87 unit is not used for arithmetic, but the C library reads
  // its control word to round when it reads and prints decimal numbers.
  struct State {
    std::uint32_t mxcsr = 0x1F80;
    std::uint16_t x87 = 0x037F;

    static State now() {
      State s;
      asm volatile("stmxcsr %0\n\tfnstcw %1" : "=m"(s.mxcsr), "=m"(s.x87) : : "memory");
      return s;
    }
    void load() const {
      asm volatile("ldmxcsr %0" : : "m"(mxcsr) : "memory");
      if (now().x87 != x87) asm volatile("fldcw %0" : : "m"(x87) : "memory");
    }
    bool is_default() const { return (mxcsr & ~kRaised) == State().mxcsr && x87 == State().x87; }
    bool operator==(const State&) const = default;

    static constexpr std::uint32_t kRaised = 0x3F;  // the sticky flags
  };
#elif defined(__aarch64__)
  struct State {
    std::uint64_t fpcr = 0, fpsr = 0;  // control; sticky flags

    static State now() {
      State s;
      asm volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(s.fpcr), "=r"(s.fpsr) : : "memory");
      return s;
    }
    void load() const { asm volatile("msr fpcr, %0\n\tmsr fpsr, %1" : : "r"(fpcr), "r"(fpsr) : "memory"); }
    bool is_default() const { return fpcr == 0; }
    bool operator==(const State&) const = default;
  };
#else
  struct State {
    std::fenv_t whole;
    bool is_ours = true;

    static State now() {
      State s;
      std::fegetenv(&s.whole);
      s.is_ours = false;
      return s;
    }
    void load() const { std::fesetenv(is_ours ? FE_DFL_ENV : &whole); }
    bool is_default() const { return false; }
    bool operator==(const State&) const { return false; }
  };
#endif

  const State callers_;
};

}  // namespace clearance
