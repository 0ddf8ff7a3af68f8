/* PGM by hand (its header is four words), PNG by libpng. */
#include "firmware/app/image_file.h"

#include <ctype.h>
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware/limits.h"

static bool fail(char *error, const char *path, const char *what)
{
    (void)snprintf(error, IMAGE_FILE_ERROR_BYTES, "%s: %s", path, what);
    return false;
}

static bool make_room(struct image_file *out, const char *path, unsigned long width,
                      unsigned long height, unsigned bytes_a_pixel, char *error)
{
    if (width < 1 || height < 1 || width > LIMIT_SIDE_PX || height > LIMIT_SIDE_PX) {
        char what[128];
        (void)snprintf(what, sizeof what, "%lu x %lu pixels; sides of 1 to %u can be read", width,
                       height, LIMIT_SIDE_PX);
        return fail(error, path, what);
    }
    out->frame.width_px = (uint16_t)width;
    out->frame.height_px = (uint16_t)height;
    out->frame.stride_bytes = (uint32_t)width * bytes_a_pixel;
    out->pixels = malloc((size_t)out->frame.stride_bytes * height);
    out->frame.pixels = out->pixels;
    return out->pixels != NULL || fail(error, path, "not enough memory for this image");
}

/* The next number of a PGM header; comments run from # to the end of the line. */
static bool read_number(FILE *file, unsigned long *number)
{
    int c = getc(file);
    while (c == '#' || isspace(c)) {
        if (c == '#') {
            while (c != '\n' && c != EOF) {
                c = getc(file);
            }
        }
        c = getc(file);
    }
    if (!isdigit(c)) {
        return false;
    }
    *number = 0;
    for (; isdigit(c); c = getc(file)) {
        *number = *number * 10 + (unsigned long)(c - '0');
        if (*number > 1000000) {
            return false;
        }
    }
    /* One white space ends the number; after the last it is the only one. */
    return isspace(c);
}

static bool read_pgm(FILE *file, const char *path, struct image_file *out, char *error)
{
    unsigned long width;
    unsigned long height;
    unsigned long maximum;
    if (!read_number(file, &width) || !read_number(file, &height) ||
        !read_number(file, &maximum)) {
        return fail(error, path, "the PGM header is not `P5 width height maximum`");
    }
    switch (maximum) {
    case 255:
        out->frame.format = FRAME_GREY8;
        break;
    case 1023:
        out->frame.format = FRAME_GREY10;
        break;
    case 4095:
        out->frame.format = FRAME_GREY12;
        break;
    case 65535:
        out->frame.format = FRAME_GREY16;
        break;
    default:
        return fail(error, path, "the PGM maximum is not 255, 1023, 4095 or 65535");
    }
    const unsigned bytes_a_pixel = maximum == 255 ? 1 : 2;
    if (!make_room(out, path, width, height, bytes_a_pixel, error)) {
        return false;
    }
    const size_t wanted = (size_t)out->frame.stride_bytes * height;
    if (fread(out->pixels, 1, wanted, file) != wanted) {
        return fail(error, path, "the PGM file ends before its last pixel");
    }
    if (bytes_a_pixel == 2) { /* PGM is big-endian, frames are little-endian */
        for (size_t i = 0; i + 1 < wanted; i += 2) {
            const uint8_t swap = out->pixels[i];
            out->pixels[i] = out->pixels[i + 1];
            out->pixels[i + 1] = swap;
        }
    }
    return true;
}

struct png_reader {
    png_structp png;
    png_infop   info;
    char        message[128];
};

static void on_png_error(png_structp png, png_const_charp message)
{
    struct png_reader *reader = png_get_error_ptr(png);
    (void)snprintf(reader->message, sizeof reader->message, "not a whole PNG image (%s)", message);
    png_longjmp(png, 1);
}

static void on_png_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* Runs under libpng's setjmp: what must outlive an error is in *reader and *out. */
static bool decode_png(struct png_reader *reader, FILE *file, const char *path,
                       struct image_file *out, char *error)
{
    png_structp png = reader->png;
    png_infop info = reader->info;
    png_init_io(png, file);
    png_set_user_limits(png, 1000000, 1000000);
    png_read_info(png, info);
    const unsigned depth = png_get_bit_depth(png, info) == 16 ? 16 : 8;
    png_set_expand(png);
    png_set_strip_alpha(png);
    if ((png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0) {
        png_set_rgb_to_gray(png, PNG_ERROR_ACTION_NONE, PNG_RGB_TO_GRAY_DEFAULT,
                            PNG_RGB_TO_GRAY_DEFAULT);
    }
    if (depth == 16) {
        png_set_swap(png);
    }
    const int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    if (!make_room(out, path, png_get_image_width(png, info), png_get_image_height(png, info),
                   depth / 8, error)) {
        return false;
    }
    if (png_get_rowbytes(png, info) != out->frame.stride_bytes) {
        return fail(error, path, "this kind of PNG cannot be turned to grey");
    }
    out->frame.format = depth == 16 ? FRAME_GREY16 : FRAME_GREY8;
    for (int pass = 0; pass < passes; pass++) {
        for (size_t y = 0; y < out->frame.height_px; y++) {
            png_read_row(png, out->pixels + y * out->frame.stride_bytes, NULL);
        }
    }
    png_read_end(png, NULL);
    return true;
}

static bool read_png(FILE *file, const char *path, struct image_file *out, char *error)
{
    struct png_reader reader = {0};
    reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reader, on_png_error,
                                        on_png_warning);
    reader.info = reader.png != NULL ? png_create_info_struct(reader.png) : NULL;
    bool good = false;
    if (reader.info == NULL) {
        good = fail(error, path, "not enough memory for this image");
    } else if (setjmp(png_jmpbuf(reader.png)) != 0) {
        good = fail(error, path, reader.message);
    } else {
        good = decode_png(&reader, file, path, out, error);
    }
    png_destroy_read_struct(&reader.png, &reader.info, NULL);
    return good;
}

bool image_file_read(const char *path, struct image_file *out, char error[IMAGE_FILE_ERROR_BYTES])
{
    *out = (struct image_file){0};
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return fail(error, path, strerror(errno));
    }
    uint8_t magic[2] = {0};
    bool good = false;
    if (fread(magic, 1, 2, file) != 2) {
        good = fail(error, path, ferror(file) ? strerror(errno) : "is empty");
    } else if (magic[0] == 'P' && magic[1] == '5') {
        good = read_pgm(file, path, out, error);
    } else if (magic[0] == 0x89 && magic[1] == 'P') {
        rewind(file);
        good = read_png(file, path, out, error);
    } else {
        good = fail(error, path, "is neither a PGM (P5) nor a PNG image");
    }
    (void)fclose(file);
    if (!good) {
        image_file_free(out);
    }
    return good;
}

void image_file_free(struct image_file *image)
{
    free(image->pixels);
    *image = (struct image_file){0};
}
