// Detects the sanitizers of this compilation, which GCC and Clang announce differently.
#pragma once

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CLEARANCE_ASAN
#elif __has_feature(thread_sanitizer)
#define CLEARANCE_TSAN
#endif
#endif
#if defined(__SANITIZE_ADDRESS__)
#define CLEARANCE_ASAN
#elif defined(__SANITIZE_THREAD__)
#define CLEARANCE_TSAN
#endif
