#pragma once

// DS_DISPATCH_POPCNT before a function compiles it twice, with and without the processor's bit count, and picks at run
// time. The results are the same. Sanitizers start after the pick, so they get the plain version.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define DS_DISPATCH_POPCNT __attribute__((target_clones("popcnt", "default")))
#else
#define DS_DISPATCH_POPCNT
#endif
