/* What the files of interposed calls share: exporting one, and finding the one behind it. */
#ifndef TESSERA_V4L2_SHIM_INTERPOSED_H
#define TESSERA_V4L2_SHIM_INTERPOSED_H

#include <dlfcn.h>
#include <stdatomic.h>

/* The library hides everything but the calls that it puts in front of libc's. */
#define INTERPOSED __attribute__((visibility("default")))

/* The function of that name that would have been called without us. A pointer to it is kept, as
 * dlsym() is too slow for every read. */
#define NEXT(name)                                                                                 \
    (__extension__({                                                                               \
        static _Atomic(void *) kept;                                                               \
        void *found = atomic_load_explicit(&kept, memory_order_relaxed);                           \
        if (found == NULL) {                                                                       \
            found = dlsym(RTLD_NEXT, #name);                                                       \
            atomic_store_explicit(&kept, found, memory_order_relaxed);                             \
        }                                                                                          \
        (__typeof__(&name))found;                                                                  \
    }))

#endif
