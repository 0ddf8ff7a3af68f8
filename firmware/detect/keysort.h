/* Sorts keys by rising value; heap sort: no recursion, no extra memory. */
#ifndef TESSERA_FIRMWARE_DETECT_KEYSORT_H
#define TESSERA_FIRMWARE_DETECT_KEYSORT_H

#include <stdint.h>

void keysort(uint32_t keys[], uint32_t count);

#endif
