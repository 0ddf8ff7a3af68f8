/* A smooth map from the board to the image, of second order, through named features near one place. Over two
 * or three patches perspective and distortion leave it by a few hundredths of a pixel. */
#ifndef TESSERA_FIRMWARE_DETECT_BOARDMAP_H
#define TESSERA_FIRMWARE_DETECT_BOARDMAP_H

#include <stdbool.h>
#include <stdint.h>

#define BOARDMAP_TERMS     6u
#define BOARDMAP_PAIRS_MIN 9u

/* A feature's place on the board, in patch sides, and in the image. */
struct boardmap_pair {
    int64_t u_q24;
    int64_t v_q24;
    int32_t x_px_q16;
    int32_t y_px_q16;
};

/* x = sum_k coefficient_k term_k, terms 1, u, v, u^2, u v, v^2. */
struct boardmap {
    int64_t middle_u_q24;
    int64_t middle_v_q24;
    int64_t middle_x_q16;
    int64_t middle_y_q16;
    int64_t x_q24[BOARDMAP_TERMS]; /* of 2^12 px; terms from the middle, in 4 sides */
    int64_t y_q24[BOARDMAP_TERMS];
};

struct boardmap_point {
    int64_t x_q16; /* pixels */
    int64_t y_q16;
};

struct boardmap_slopes {
    int64_t x_by_u_q16; /* pixels a patch side */
    int64_t x_by_v_q16;
    int64_t y_by_u_q16;
    int64_t y_by_v_q16;
};

/* Least squares; false for fewer than BOARDMAP_PAIRS_MIN pairs or pairs on one line. At most 256 pairs, within 4
 * sides and 2^12 px of their middle. */
bool boardmap_fit(const struct boardmap_pair pairs[], uint32_t count, struct boardmap *map);

struct boardmap_point boardmap_point_at(const struct boardmap *map, int64_t u_q24, int64_t v_q24);

void boardmap_slopes_at(const struct boardmap *map, int64_t u_q24, int64_t v_q24,
                        struct boardmap_slopes *out);

#endif
