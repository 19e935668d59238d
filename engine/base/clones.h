// Plain loops compiled for several instruction sets, selected when the program starts.
#pragma once

#include "engine/base/sanitizers.h"

// No version fuses or reorders operations (-ffp-contract=off, one sum per lane), so all give the same bits. Disabled
// with sanitizers, which run before the selection.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(CLEARANCE_ASAN) && \
    !defined(CLEARANCE_TSAN)
#define CLEARANCE_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLEARANCE_CLONES
#endif
