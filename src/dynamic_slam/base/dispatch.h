#pragma once

// Before a function, these compile it plain and for later x86-64 processors; the machine picks one when it loads the
// program. All give the same bits: floating point sums keep their order, and products are not fused into them, as
// AVX2 alone cannot. Sanitizers are not ready when the choice is made, so they get the plain version.
//
//   DS_DISPATCH_AVX2    wide loops
//   DS_DISPATCH_POPCNT  counting bits, which the plain version does by a call, and short vectors
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define DS_DISPATCH_AVX2 __attribute__((target_clones("default", "avx2")))
#define DS_DISPATCH_POPCNT __attribute__((target_clones("default", "popcnt", "avx2")))
#else
#define DS_DISPATCH_AVX2
#define DS_DISPATCH_POPCNT
#endif
