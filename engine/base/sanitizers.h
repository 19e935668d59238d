// Which sanitizer this file is compiled with: GCC and Clang say it in two ways.
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
