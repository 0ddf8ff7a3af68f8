/* Integer square roots. */
#ifndef TESSERA_COMMON_FX_ROOT_H
#define TESSERA_COMMON_FX_ROOT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The largest r with r * r <= value: exact for every input. */
uint32_t root_u64(uint64_t value);
uint32_t root_u32(uint32_t value);

#ifdef __cplusplus
}
#endif

#endif
