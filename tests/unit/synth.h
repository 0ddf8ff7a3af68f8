/* Pictures, contours and noise with known truth for the unit tests: everything in double, from the
 * mathematics alone. Link with libsynth. */
#ifndef TESSERA_TESTS_UNIT_SYNTH_H
#define TESSERA_TESTS_UNIT_SYNTH_H

#include <stdbool.h>
#include <stdint.h>

#include "common/target/layout.h"
#include "firmware/frame.h"

#define SYNTH_PI 3.14159265358979323846

/* Fails the test unless |actual - expected| <= tolerance; prints all three. (Unity's own comparison of
 * doubles is compiled out by default.) */
#define SYNTH_NEAR(tolerance, expected, actual) synth_near((tolerance), (expected), (actual), __LINE__)
void synth_near(double tolerance, double expected, double actual, int line);

/* Repeatable noise: splitmix64. */
uint64_t synth_u64(uint64_t *state);
double   synth_uniform(uint64_t *state);               /* [0, 1)                         */
double   synth_normal(uint64_t *state, double sigma);  /* sum of twelve uniforms: |.| < 6 sigma */

/* A picture in grey levels 0..255, row by row. `pixels` belongs to the picture. */
struct synth_image {
    unsigned width;
    unsigned height;
    double  *pixels;
};

struct synth_image synth_image_new(unsigned width, unsigned height, double grey);
void               synth_image_free(struct synth_image *image);

/* A straight step: `bright` where nx x + ny y > offset, else `dark`, blurred by a Gaussian of `blur` px and
 * integrated over pixels. (nx, ny) is a unit vector. */
void synth_edge(struct synth_image *image, double nx, double ny, double offset, double dark,
                double bright, double blur);

/* A filled ellipse over what is there: area-integrated on 16 x 16 points a pixel, not blurred. */
void synth_ellipse(struct synth_image *image, double x, double y, double major, double minor,
                   double angle_rad, double grey);

/* Blurs by a Gaussian of `blur` px, the border repeated. For blur >= 0.6 px the sampled Gaussian is as good
 * as the true one: its spectrum beyond the sampling limit is below exp(-(pi 0.6)^2 / 2) = 0.17 there. */
void synth_blur(struct synth_image *image, double blur);

/* Adds Gaussian noise of `sigma` grey levels. */
void synth_noise(struct synth_image *image, double sigma, uint64_t seed);

/* The picture as bytes of a frame, values rounded and clipped; `bytes` has room for
 * width * height * 2. Formats of all kinds; chroma is filled with junk. */
struct frame_view synth_frame(const struct synth_image *image, enum frame_format format,
                              uint8_t *bytes);

/* A plane homography, row by row: image = H (u, v, 1). */
struct synth_map {
    double at[9];
};

/* The map of the board (in patch sides) to the image: a camera of focal length f px looks from `away` patch
 * sides at the board's point (u0, v0), which it sees at (x0, y0); the board is turned by roll, then
 * tilted about the image's x axis. */
struct synth_map synth_view(double f, double away, double roll_rad, double tilt_rad, double u0,
                            double v0, double x0, double y0);
void synth_map_point(const struct synth_map *map, double u, double v, double *x, double *y);

/* One patch of a board. */
struct synth_patch {
    uint16_t id;
    int      col;
    int      row;
    bool     turned;      /* by half a turn */
    bool     bad_parity;  /* the anchor in the wrong colours */
};

/* Draws patches over what is there (white paper is the caller's business). The levels are as target.md has
 * them, between black and white; area-integrated, not blurred. */
void synth_patches(struct synth_image *image, const struct synth_map *map, unsigned levels,
                   const struct synth_patch patches[], unsigned count, double black, double white);

/* Where the image of a feature's circle has its centre, and its semi-axes' geometric mean. */
struct synth_circle {
    double x;
    double y;
    double size;
    double shape_xx; /* px^2, as in struct ellipse */
    double shape_xy;
    double shape_yy;
};
struct synth_circle synth_feature(const struct synth_map *map, unsigned levels,
                                  const struct synth_patch *patch, unsigned index);

#endif
