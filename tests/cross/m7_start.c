/* What stands before main on a bare Cortex-M7: vectors, memory, semihosting. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

extern char data_from[];
extern char data_begin[];
extern char data_end[];
extern char bss_begin[];
extern char bss_end[];
extern char stack_top[];

int main(void);
void initialise_monitor_handles(void);
void m7_start(void);
void _init(void);
void _fini(void);

/* The C library calls these; start files that were left out would define them. */
void _init(void) {}
void _fini(void) {}

static void stop(void)
{
    exit(EXIT_FAILURE);
}

void m7_start(void)
{
    memcpy(data_begin, data_from, (size_t)(data_end - data_begin));
    memset(bss_begin, 0, (size_t)(bss_end - bss_begin));
    initialise_monitor_handles();
    exit(main());
}

__attribute__((section(".vectors"), used)) static const struct {
    void *stack;
    void (*entries[15])(void);
} vectors = {stack_top, {m7_start, stop, stop, stop, stop, stop}};
