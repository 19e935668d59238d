#include "failing_new.h"

#include <cstdlib>
#include <new>

namespace clearance {
thread_local int allocations_left = -1;
}

void* operator new(std::size_t bytes) {
  if (clearance::allocations_left >= 0 && clearance::allocations_left-- == 0) throw std::bad_alloc();
  if (void* memory = std::malloc(bytes ? bytes : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
