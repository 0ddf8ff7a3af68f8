/* Reads the program's memory through the kernel, which checks the address. */
#include "tools/v4l2_shim/user_memory.h"

#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

bool user_memory_copy(void *to, const void *from, size_t bytes)
{
    const struct iovec local = {.iov_base = to, .iov_len = bytes};
    const struct iovec remote = {.iov_base = (void *)(uintptr_t)from, .iov_len = bytes};
    if (from == NULL) {
        return false;
    }
    const ssize_t copied = process_vm_readv(getpid(), &local, 1, &remote, 1, 0);
    if (copied < 0 && errno != EFAULT) {
        /* The call itself is forbidden here (a sandbox): trust the program. */
        memcpy(to, from, bytes);
        return true;
    }
    return copied == (ssize_t)bytes;
}

bool user_memory_is_mapped(const void *from, size_t bytes)
{
    char byte;
    return bytes > 0 && user_memory_copy(&byte, from, 1) &&
           user_memory_copy(&byte, (const char *)from + bytes - 1, 1);
}
