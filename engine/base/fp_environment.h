// The floating-point state that bounds are proved for, whatever state a caller's thread is in.
//
// A thread may round upward, flush denormals to zero or die of an invalid operation: games, codecs, interval
// libraries and -ffast-math set such states, and threads inherit them. No bound holds there. So each function by which
// a caller comes in puts its thread into the default state and back, and so does each OpenMP worker, whose thread may
// be the caller's too.
#pragma once

#include <cstdint>

#if !defined(__x86_64__) && !defined(__aarch64__)
#include <cfenv>
#endif

namespace clearance {

/// While one lives, its thread computes as IEEE 754's defaults have it: to nearest, denormals kept, no exception traps.
/// Then the thread's state is again what it was, its sticky exception flags too: what we raise is nobody else's
/// business. Costs a read and a comparison where there is nothing to change. The compiler moves no load across it.
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
  // MXCSR is what doubles and floats are computed with. The x87 unit computes nothing of ours, but the C library asks
  // its control word how to round when it reads and prints decimal numbers.
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
    std::uint64_t fpcr = 0, fpsr = 0;  // how to compute; the sticky flags

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
