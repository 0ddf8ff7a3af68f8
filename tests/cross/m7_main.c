/* One golden frame from memory on a bare Cortex-M7: prints what golden_digest prints. */
#include <stdio.h>
#include <stdlib.h>

#include "tests/golden/golden_run.h"

__asm__(".section .rodata\n"
        ".global m7_frame_begin\n"
        "m7_frame_begin: .incbin \"tests/golden/frames/tilted.pgm\"\n"
        ".global m7_frame_end\n"
        "m7_frame_end:\n"
        ".previous\n");
extern uint8_t m7_frame_begin[];
extern uint8_t m7_frame_end[];

int main(void)
{
    struct frame_view frame;
    struct golden_result result;
    /* An 8-bit frame is not written to, so it may lie in ROM. */
    if (!golden_parse(m7_frame_begin, (unsigned long)(m7_frame_end - m7_frame_begin), &frame) ||
        !golden_run(&frame, &dsp_scalar, &result)) {
        (void)printf("the golden frame could not be detected\n");
        return EXIT_FAILURE;
    }
    (void)printf("tilted.pgm %08lx%08lx %u\n", (unsigned long)(result.digest >> 32),
                 (unsigned long)(result.digest & 0xffffffffu), result.features);
    return EXIT_SUCCESS;
}
