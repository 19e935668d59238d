// Instruction sets of this machine, among those that lanes are compiled for (lanes_avx512.cpp etc.).
#pragma once

namespace clearance {

#if defined(__x86_64__)
inline bool has_avx512_lanes() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
inline bool has_avx2_lanes() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
}
#endif

}  // namespace clearance
