/* Whether a pointer of the program can be followed: the kernel would answer EFAULT, not crash. */
#ifndef TESSERA_V4L2_SHIM_USER_MEMORY_H
#define TESSERA_V4L2_SHIM_USER_MEMORY_H

#include <stdbool.h>
#include <stddef.h>

/* Copies bytes from the program's memory; false where that is not mapped. */
bool user_memory_copy(void *to, const void *from, size_t bytes);

/* The first and the last of these bytes are mapped. */
bool user_memory_is_mapped(const void *from, size_t bytes);

#endif
