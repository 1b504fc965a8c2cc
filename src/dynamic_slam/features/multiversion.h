#pragma once

// DS_MULTIVERSION before a function: the compiler makes it twice, plain and for AVX2, and the machine it runs
// on picks one when the program is loaded. For integer loops only: there both give the same bits. Not with
// the sanitizers, whose runtime is not ready when the choice is made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define DS_MULTIVERSION __attribute__((target_clones("default", "avx2")))
#else
#define DS_MULTIVERSION
#endif
