/* Angles in turns: 65536 is one full turn, so that they wrap by themselves in 16 bits. */
#ifndef TESSERA_COMMON_FX_TURN_H
#define TESSERA_COMMON_FX_TURN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The angle of (x, y) from +x towards +y. Worst error 3/65536 turn (0.016 degrees), shown over all
 * directions by tests/unit/test_turn.c. (0, 0) gives 0. |x|, |y| < 2^62. */
uint16_t turn_atan2_q16(int64_t y, int64_t x);

/* Cosine and sine in Q30; worst error 1e-6. */
void turn_cos_sin_q30(uint16_t angle_turn_q16, int32_t *cos_q30, int32_t *sin_q30);

#ifdef __cplusplus
}
#endif

#endif
