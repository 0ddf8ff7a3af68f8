/* An ellipse, as the fits pass it on. */
#ifndef TESSERA_FIRMWARE_DETECT_ELLIPSE_H
#define TESSERA_FIRMWARE_DETECT_ELLIPSE_H

#include <stdbool.h>
#include <stdint.h>

/* The points p with (p - c)' S^-1 (p - c) = 1. S is the shape matrix: for a circle r^2 times the unit
 * matrix; its eigenvalues are the squared semi-axes. */
struct ellipse {
    int32_t x_px_q16; /* centre; (0,0) is the centre of the top-left pixel */
    int32_t y_px_q16;
    int32_t shape_xx_px2_q12;
    int32_t shape_xy_px2_q12;
    int32_t shape_yy_px2_q12;
};

/* Semi-axes from 0.5 px to 512 px are representable; the fits refuse what is outside. */
#define ELLIPSE_SHAPE_MIN_PX2_Q12 1024
#define ELLIPSE_SHAPE_MAX_PX2_Q12 ((int32_t)1 << 30)

/* The lower triangular root of the shape matrix, S = B B'; maps the unit circle to the ellipse. */
struct ellipse_root {
    int32_t xx_px_q16; /* > 0 */
    int32_t yx_px_q16;
    int32_t yy_px_q16; /* > 0 */
};

/* False when S is not positive definite or xx or yy would be below 1/4 px. */
bool ellipse_take_root(const struct ellipse *ellipse, struct ellipse_root *root);

/* Semi-axes and the angle of the major one from +x towards +y, in [0, 1/2) turn. */
void ellipse_axes(const struct ellipse *ellipse, uint32_t *major_px_q16, uint32_t *minor_px_q16,
                  uint16_t *angle_turn_q16);

/* The geometric mean of the semi-axes. */
uint32_t ellipse_size_px_q16(const struct ellipse *ellipse);

/* A change in the unit frame (B^-1 (x - c), where the ellipse is the unit circle): of the centre by
 * (t0, t1), and of the radius by t2 + t3 cos 2a + t4 sin 2a in the direction a. */
#define ELLIPSE_UNKNOWNS 5u

/* Applies such a change: c += B (t0, t1), S = B (I + 2 (t2 + t3, t4; t4, t2 - t3)) B'. False, and nothing
 * changed, for changes above a quarter or shapes out of range. */
bool ellipse_step(struct ellipse *ellipse, const struct ellipse_root *root,
                  const int64_t step_q36[ELLIPSE_UNKNOWNS]);

#endif
