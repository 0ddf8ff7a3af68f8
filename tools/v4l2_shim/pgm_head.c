/* Reads a PGM header: numbers apart by white space, and comments from # to the line's end. */
#include "tools/v4l2_shim/pgm_head.h"

#include <ctype.h>
#include <stdbool.h>

static bool read_number(FILE *file, uint32_t *out)
{
    int c = getc(file);
    while (c == '#' || isspace(c)) {
        if (c == '#') {
            while (c != '\n' && c != EOF) {
                c = getc(file);
            }
        } else {
            c = getc(file);
        }
    }
    uint32_t number = 0;
    bool digits = false;
    while (isdigit(c) && number <= 100000) {
        number = number * 10 + (uint32_t)(c - '0');
        digits = true;
        c = getc(file);
    }
    *out = number;
    /* The one white space after the number is taken too: after the last one, pixels begin. */
    return digits && isspace(c);
}

const char *pgm_head_read(FILE *file, struct pgm_head *out)
{
    *out = (struct pgm_head){0};
    if (getc(file) != 'P' || getc(file) != '5') {
        return "is not a binary PGM (P5) file, and no format.json says what else it is";
    }
    if (!read_number(file, &out->width_px) || !read_number(file, &out->height_px) ||
        !read_number(file, &out->maxval)) {
        return "the PGM header is broken: width, height and maxval are expected after P5";
    }
    if (out->width_px == 0 || out->width_px > 65535 || out->height_px == 0 ||
        out->height_px > 65535) {
        return "the PGM header's width or height is not in 1..65535";
    }
    if (out->maxval == 0 || out->maxval > 65535) {
        return "the PGM header's maxval is not in 1..65535";
    }
    const long offset = ftell(file);
    if (offset < 0 || offset > 1 << 20) {
        return "the PGM header is longer than a megabyte, or the file cannot be positioned";
    }
    out->pixels_offset = (uint32_t)offset;
    return NULL;
}
