/* Patches of the target under a homography, and the truth about them: see synth.h. */
#include "tests/unit/synth.h"

#include <math.h>
#include <unity.h>

static const double circle_ratio = 0.5;
static const double edge_level = 0.8;
static const double gauss_sigma = 0.4;

struct synth_map synth_view(double f, double away, double roll_rad, double tilt_rad, double u0,
                            double v0, double x0, double y0)
{
    const double c = cos(roll_rad);
    const double s = sin(roll_rad);
    const double ct = cos(tilt_rad);
    const double st = sin(tilt_rad);
    /* Camera coordinates of the board's point (u, v): X = r (u - u0), Z += away. */
    const double r[3][2] = {{c, -s}, {ct * s, ct * c}, {st * s, st * c}};
    struct synth_map map;
    double *h = map.at;
    for (int i = 0; i < 3; i++) {
        h[3 * i] = r[i][0];
        h[3 * i + 1] = r[i][1];
        h[3 * i + 2] = -r[i][0] * u0 - r[i][1] * v0 + (i == 2 ? away : 0);
    }
    for (int i = 0; i < 3; i++) {
        h[i] = f * h[i] + x0 * h[6 + i];
        h[3 + i] = f * h[3 + i] + y0 * h[6 + i];
    }
    return map;
}

void synth_map_point(const struct synth_map *map, double u, double v, double *x, double *y)
{
    const double *h = map->at;
    const double w = h[6] * u + h[7] * v + h[8];
    *x = (h[0] * u + h[1] * v + h[2]) / w;
    *y = (h[3] * u + h[4] * v + h[5]) / w;
}

/* Up to a factor, which a homography does not have. */
static struct synth_map inverse(const struct synth_map *map)
{
    const double *a = map->at;
    return (struct synth_map){{a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8],
                               a[1] * a[5] - a[2] * a[4], a[5] * a[6] - a[3] * a[8],
                               a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
                               a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7],
                               a[0] * a[4] - a[1] * a[3]}};
}

static bool in_triangle(const struct layout_feature *f, double u, double v)
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3;
        const double au = f->corner_u_8th[i] / 8.0;
        const double av = f->corner_v_8th[i] / 8.0;
        const double bu = f->corner_u_8th[j] / 8.0;
        const double bv = f->corner_v_8th[j] / 8.0;
        if ((bu - au) * (v - av) - (bv - av) * (u - au) < 0) {
            return false;
        }
    }
    return true;
}

/* Reflectance at (u, v) of the patch's own frame. */
static double reflectance(unsigned levels, const struct synth_patch *patch, double u, double v)
{
    for (unsigned i = 0; i < layout_feature_count(levels); i++) {
        const struct layout_feature *f = layout_feature(levels, i);
        if (!in_triangle(f, u, v)) {
            continue;
        }
        const bool white =
            layout_circle_is_white(levels, patch->id, i) != (patch->bad_parity && i == LAYOUT_ANCHOR);
        const double radius = circle_ratio * f->inradius_q30 / 1073741824.0;
        const double t = hypot(u - f->u_q30 / 1073741824.0, v - f->v_q30 / 1073741824.0) / radius;
        const double inside =
            t < 1 ? edge_level + (1 - edge_level) * exp(-t * t / (2 * gauss_sigma * gauss_sigma)) : 0;
        return white ? inside : 1 - inside;
    }
    return 1;
}

/* Reflectance of the board where the image has (x, y); -1 beside the patches. */
static double seen(const struct synth_map *board_from_image, unsigned levels,
                   const struct synth_patch patches[], unsigned count, double x, double y)
{
    double u;
    double v;
    synth_map_point(board_from_image, x, y, &u, &v);
    for (unsigned i = 0; i < count; i++) {
        double pu = u - patches[i].col;
        double pv = v - patches[i].row;
        if (pu >= 0 && pu < 1 && pv >= 0 && pv < 1) {
            if (patches[i].turned) {
                pu = 1 - pu;
                pv = 1 - pv;
            }
            return reflectance(levels, &patches[i], pu, pv);
        }
    }
    return -1;
}

void synth_patches(struct synth_image *image, const struct synth_map *map, unsigned levels,
                   const struct synth_patch patches[], unsigned count, double black, double white)
{
    const struct synth_map back = inverse(map);
    for (unsigned row = 0; row < image->height; row++) {
        for (unsigned col = 0; col < image->width; col++) {
            double *pixel = &image->pixels[(size_t)row * image->width + col];
            const double paper = *pixel;
            double sum = 0;
            double low = 2;
            double high = -2;
            for (int side = 4; side <= 16; side += 12) {
                sum = 0;
                for (int j = 0; j < side; j++) {
                    for (int i = 0; i < side; i++) {
                        const double x = col + (i + 0.5) / side - 0.5;
                        const double y = row + (j + 0.5) / side - 0.5;
                        const double level = seen(&back, levels, patches, count, x, y);
                        low = fmin(low, level);
                        high = fmax(high, level);
                        sum += level < 0 ? paper : black + (white - black) * level;
                    }
                }
                sum /= side * side;
                if (high - low < 0.3) { /* no edge here: four by four will do */
                    break;
                }
            }
            *pixel = sum;
        }
    }
}

struct synth_circle synth_feature(const struct synth_map *map, unsigned levels,
                                  const struct synth_patch *patch, unsigned index)
{
    const struct layout_feature *f = layout_feature(levels, index);
    const double radius = circle_ratio * f->inradius_q30 / 1073741824.0;
    double u = f->u_q30 / 1073741824.0;
    double v = f->v_q30 / 1073741824.0;
    if (patch->turned) {
        u = 1 - u;
        v = 1 - v;
    }
    u += patch->col;
    v += patch->row;
    /* The dual conic of the circle, D = diag-like in (u, v, 1), goes to H D H': its last column is the
     * centre (times D'_22), and S = c c' - D' / D'_22. */
    const double d[3][3] = {{u * u - radius * radius, u * v, u}, {u * v, v * v - radius * radius, v},
                            {u, v, 1}};
    double hd[3][3];
    double out[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            hd[i][j] = 0;
            for (int k = 0; k < 3; k++) {
                hd[i][j] += map->at[3 * i + k] * d[k][j];
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out[i][j] = 0;
            for (int k = 0; k < 3; k++) {
                out[i][j] += hd[i][k] * map->at[3 * j + k];
            }
        }
    }
    const double x = out[0][2] / out[2][2];
    const double y = out[1][2] / out[2][2];
    struct synth_circle circle = {.x = x, .y = y};
    circle.shape_xx = x * x - out[0][0] / out[2][2];
    circle.shape_xy = x * y - out[0][1] / out[2][2];
    circle.shape_yy = y * y - out[1][1] / out[2][2];
    circle.size =
        pow(circle.shape_xx * circle.shape_yy - circle.shape_xy * circle.shape_xy, 0.25);
    return circle;
}
