/* Pictures, contours and noise with known truth: see synth.h. */
#include "tests/unit/synth.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

void synth_near(double tolerance, double expected, double actual, int line)
{
    if (!(fabs(actual - expected) <= tolerance)) {
        static char text[160];
        snprintf(text, sizeof text, "line %d: %.9g is not within %.3g of %.9g", line, actual, tolerance,
                 expected);
        TEST_FAIL_MESSAGE(text);
    }
}

uint64_t synth_u64(uint64_t *state)
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double synth_uniform(uint64_t *state)
{
    return (double)(synth_u64(state) >> 11) / 9007199254740992.0;
}

double synth_normal(uint64_t *state, double sigma)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        sum += synth_uniform(state);
    }
    return sigma * sum;
}

struct synth_image synth_image_new(unsigned width, unsigned height, double grey)
{
    struct synth_image image = {width, height, malloc((size_t)width * height * sizeof(double))};
    TEST_ASSERT_NOT_NULL(image.pixels);
    for (size_t i = 0; i < (size_t)width * height; i++) {
        image.pixels[i] = grey;
    }
    return image;
}

void synth_image_free(struct synth_image *image)
{
    free(image->pixels);
    image->pixels = NULL;
}

void synth_edge(struct synth_image *image, double nx, double ny, double offset, double dark,
                double bright, double blur)
{
    /* Gauss-Legendre with 4 points each way. */
    static const double at[4] = {-0.430568155797026, -0.169990521792428, 0.169990521792428,
                                 0.430568155797026};
    static const double weight[4] = {0.173927422568727, 0.326072577431273, 0.326072577431273,
                                     0.173927422568727};
    for (unsigned y = 0; y < image->height; y++) {
        for (unsigned x = 0; x < image->width; x++) {
            double sum = 0;
            for (int j = 0; j < 4; j++) {
                for (int i = 0; i < 4; i++) {
                    const double n = nx * (x + at[i]) + ny * (y + at[j]) - offset;
                    sum += weight[i] * weight[j] * 0.5 * erfc(-n / (blur * sqrt(2.0)));
                }
            }
            image->pixels[(size_t)y * image->width + x] = dark + (bright - dark) * sum;
        }
    }
}

void synth_ellipse(struct synth_image *image, double x, double y, double major, double minor,
                   double angle_rad, double grey)
{
    const double c = cos(angle_rad);
    const double s = sin(angle_rad);
    for (unsigned row = 0; row < image->height; row++) {
        for (unsigned col = 0; col < image->width; col++) {
            if (fabs(col - x) > major + 1 || fabs(row - y) > major + 1) {
                continue;
            }
            int inside = 0;
            for (int j = 0; j < 16; j++) {
                for (int i = 0; i < 16; i++) {
                    const double dx = col + (i - 7.5) / 16 - x;
                    const double dy = row + (j - 7.5) / 16 - y;
                    const double p = (c * dx + s * dy) / major;
                    const double q = (c * dy - s * dx) / minor;
                    inside += p * p + q * q < 1;
                }
            }
            double *pixel = &image->pixels[(size_t)row * image->width + col];
            *pixel += (grey - *pixel) * inside / 256.0;
        }
    }
}

static void blur_line(double *values, unsigned count, size_t step, const double *taps, int radius,
                      double *line)
{
    for (unsigned i = 0; i < count; i++) {
        line[i] = values[i * step];
    }
    for (int i = 0; i < (int)count; i++) {
        double sum = 0;
        for (int k = -radius; k <= radius; k++) {
            const int j = i + k < 0 ? 0 : i + k >= (int)count ? (int)count - 1 : i + k;
            sum += taps[abs(k)] * line[j];
        }
        values[(size_t)i * step] = sum;
    }
}

void synth_blur(struct synth_image *image, double blur)
{
    double taps[33];
    const int radius = (int)ceil(5 * blur);
    assert(radius <= 32);
    double total = 0;
    for (int k = 0; k <= radius; k++) {
        taps[k] = exp(-k * k / (2 * blur * blur));
        total += k == 0 ? taps[k] : 2 * taps[k];
    }
    for (int k = 0; k <= radius; k++) {
        taps[k] /= total;
    }
    const unsigned longest = image->width > image->height ? image->width : image->height;
    double *line = malloc(longest * sizeof *line);
    TEST_ASSERT_NOT_NULL(line);
    for (unsigned y = 0; y < image->height; y++) {
        blur_line(image->pixels + (size_t)y * image->width, image->width, 1, taps, radius, line);
    }
    for (unsigned x = 0; x < image->width; x++) {
        blur_line(image->pixels + x, image->height, image->width, taps, radius, line);
    }
    free(line);
}

void synth_noise(struct synth_image *image, double sigma, uint64_t seed)
{
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        image->pixels[i] += synth_normal(&seed, sigma);
    }
}

struct frame_view synth_frame(const struct synth_image *image, enum frame_format format,
                              uint8_t *bytes)
{
    static const unsigned steps[] = {[FRAME_GREY8] = 1,    [FRAME_GREY10] = 4, [FRAME_GREY12] = 16,
                                     [FRAME_GREY16] = 256, [FRAME_YUYV] = 1,   [FRAME_UYVY] = 1,
                                     [FRAME_NV12] = 1};
    const double largest = 256.0 * steps[format] - 1;
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        double value = floor(image->pixels[i] * steps[format] + 0.5);
        value = value < 0 ? 0 : value > largest ? largest : value;
        const unsigned sample = (unsigned)value;
        const uint8_t junk = (uint8_t)(i * 37 + 11);
        switch (format) {
        case FRAME_GREY8:
        case FRAME_NV12:
            bytes[i] = (uint8_t)sample;
            break;
        case FRAME_YUYV:
            bytes[2 * i] = (uint8_t)sample;
            bytes[2 * i + 1] = junk;
            break;
        case FRAME_UYVY:
            bytes[2 * i] = junk;
            bytes[2 * i + 1] = (uint8_t)sample;
            break;
        case FRAME_GREY10:
        case FRAME_GREY12:
        case FRAME_GREY16:
            bytes[2 * i] = (uint8_t)(sample & 255);
            bytes[2 * i + 1] = (uint8_t)(sample >> 8);
            break;
        }
    }
    return (struct frame_view){.pixels = bytes,
                               .stride_bytes = frame_row_bytes(format, (uint16_t)image->width),
                               .width_px = (uint16_t)image->width,
                               .height_px = (uint16_t)image->height,
                               .format = format};
}
