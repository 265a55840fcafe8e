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

#endif
