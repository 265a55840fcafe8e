/* What all kernels need. Exported functions take C-contiguous arrays and keep no state, so that threads may call them
   at the same time; results are the same to the bit everywhere, as no operation is reordered or fused. */
#ifndef TOPOSEAM_KERNELS_H
#define TOPOSEAM_KERNELS_H

#include <stdint.h>

#ifdef _WIN32
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

/* Compiles a function for processors with wide registers as well; the best is taken when the library is loaded. The
   results are the same. */
#if defined(__GLIBC__) && defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_PROCESSOR
#endif

#endif
