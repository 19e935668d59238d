// Plain loops compiled for several instruction sets, the right one chosen when the program starts.
#pragma once

#include "engine/base/sanitizers.h"

// No set fuses or reorders anything (-ffp-contract=off, one lane one sum), so all give the same bits. Sanitizers run
// before such a choice can.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(CLEARANCE_ASAN) && \
    !defined(CLEARANCE_TSAN)
#define CLEARANCE_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#define CLEARANCE_VERSIONS  // there may be several definitions of a function, each with its own target
#else
#define CLEARANCE_CLONES
#endif
