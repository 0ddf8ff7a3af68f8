/* Reads target files with cJSON. cJSON is lenient, so everything that it lets pass and the format
 * does not (unknown and repeated keys, text after the end, bytes that are not UTF-8, numbers out of
 * range) is refused here. */
#include "common/targetfile/targetfile.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One reading: what is read, what is written, and where the sentence goes. */
struct reading {
    const char *source;
    const cJSON *root;
    struct targetfile *out;
    char *error;
};

static const char *const known_keys[] = {
    "format",       "version",    "name",        "rows",   "cols", "patch_mm", "levels",
    "circle_ratio", "edge_level", "gauss_sigma", "margin", "ids",  "turns",    "measured_scale",
};

__attribute__((format(printf, 2, 3)))
static bool refuse(struct reading *reading, const char *format, ...)
{
    int used = snprintf(reading->error, TARGETFILE_ERROR_BYTES, "%s: ", reading->source);
    if (used < 0 || used >= TARGETFILE_ERROR_BYTES) {
        used = 0; /* an absurd path: the sentence matters more */
    }
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(reading->error + used, (size_t)(TARGETFILE_ERROR_BYTES - used), format,
                    arguments);
    va_end(arguments);
    return false;
}

/* Length of the well-formed UTF-8 sequence at `at` (shortest form, no surrogates), or 0. */
static size_t utf8_sequence_bytes(const unsigned char *at, size_t left)
{
    if (at[0] < 0x80) {
        return 1;
    }
    size_t bytes = 0;
    unsigned char second_min = 0x80;
    unsigned char second_max = 0xbf;
    if (at[0] >= 0xc2 && at[0] <= 0xdf) {
        bytes = 2;
    } else if (at[0] >= 0xe0 && at[0] <= 0xef) {
        bytes = 3;
        second_min = at[0] == 0xe0 ? 0xa0 : 0x80;
        second_max = at[0] == 0xed ? 0x9f : 0xbf;
    } else if (at[0] >= 0xf0 && at[0] <= 0xf4) {
        bytes = 4;
        second_min = at[0] == 0xf0 ? 0x90 : 0x80;
        second_max = at[0] == 0xf4 ? 0x8f : 0xbf;
    }
    if (bytes == 0 || bytes > left || at[1] < second_min || at[1] > second_max) {
        return 0;
    }
    for (size_t i = 2; i < bytes; i++) {
        if ((at[i] & 0xc0) != 0x80) {
            return 0;
        }
    }
    return bytes;
}

static unsigned line_of(const char *text, const char *at)
{
    unsigned line = 1;
    for (const char *p = text; p < at; p++) {
        line += *p == '\n' ? 1u : 0u;
    }
    return line;
}

static bool check_utf8(struct reading *reading, const char *text, size_t bytes)
{
    for (size_t i = 0; i < bytes;) {
        const size_t step = utf8_sequence_bytes((const unsigned char *)text + i, bytes - i);
        if (step == 0 || text[i] == '\0') {
            return refuse(reading, "line %u is not UTF-8 text; is this a target file?",
                          line_of(text, text + i));
        }
        i += step;
    }
    return true;
}

static bool check_keys(struct reading *reading)
{
    unsigned count = 0;
    const cJSON *item = NULL;
    cJSON_ArrayForEach(item, reading->root)
    {
        if (++count > TARGETFILE_KEYS_MAX) {
            return refuse(reading, "has more than %d keys", TARGETFILE_KEYS_MAX);
        }
        bool known = strncmp(item->string, "x_", 2) == 0;
        for (size_t i = 0; i < sizeof known_keys / sizeof known_keys[0]; i++) {
            known = known || strcmp(item->string, known_keys[i]) == 0;
        }
        if (!known) {
            return refuse(reading,
                          "key \"%.60s\" is not known; remove it, or begin its name with x_ if it "
                          "is a note of your own",
                          item->string);
        }
        for (const cJSON *other = reading->root->child; other != item; other = other->next) {
            if (strcmp(item->string, other->string) == 0) {
                return refuse(reading, "key \"%.60s\" stands twice; keep one", item->string);
            }
        }
    }
    return true;
}

static const cJSON *find(const struct reading *reading, const char *key)
{
    return cJSON_GetObjectItemCaseSensitive(reading->root, key);
}

/* A number in [min, max]; `fallback` when the key is absent and NaN stands for "required". */
static bool get_number(struct reading *reading, const char *key, double min, double max,
                       double fallback, double *out)
{
    const cJSON *item = find(reading, key);
    if (item == NULL && isnan(fallback)) {
        return refuse(reading, "key \"%s\" is missing", key);
    }
    const double value = item == NULL ? fallback : item->valuedouble;
    if ((item != NULL && !cJSON_IsNumber(item)) || !(value >= min && value <= max)) {
        return refuse(reading, "key \"%s\" must be a number from %g to %g", key, min, max);
    }
    *out = value;
    return true;
}

static bool is_whole(const cJSON *item, unsigned max)
{
    return cJSON_IsNumber(item) && item->valuedouble >= 0 && item->valuedouble <= max &&
           item->valuedouble == floor(item->valuedouble);
}

static bool get_count(struct reading *reading, const char *key, unsigned min, unsigned max,
                      unsigned fallback, unsigned *out)
{
    const cJSON *item = find(reading, key);
    if (item == NULL && fallback == 0) {
        return refuse(reading, "key \"%s\" is missing", key);
    }
    if (item != NULL && (!is_whole(item, max) || item->valuedouble < min)) {
        return refuse(reading, "key \"%s\" must be a whole number from %u to %u", key, min, max);
    }
    *out = item == NULL ? fallback : (unsigned)item->valuedouble;
    return true;
}

static bool read_format(struct reading *reading)
{
    const cJSON *format = find(reading, "format");
    if (!cJSON_IsString(format) || strcmp(format->valuestring, "tessera-target") != 0) {
        return refuse(reading, "key \"format\" must be \"tessera-target\"; is this a target file?");
    }
    const cJSON *version = find(reading, "version");
    if (version == NULL) {
        return refuse(reading, "key \"version\" is missing");
    }
    if (!is_whole(version, 1000000) || version->valuedouble < 1) {
        return refuse(reading, "key \"version\" must be a whole number from 1");
    }
    if (version->valuedouble > 1) {
        return refuse(reading,
                      "key \"version\" is %.0f, but this program knows only 1; use a newer program",
                      version->valuedouble);
    }
    return true;
}

static bool read_name(struct reading *reading)
{
    const cJSON *item = find(reading, "name");
    if (item == NULL) {
        return true;
    }
    if (!cJSON_IsString(item) || strlen(item->valuestring) >= TARGET_NAME_BYTES) {
        return refuse(reading, "key \"name\" must be a text of at most %d bytes",
                      TARGET_NAME_BYTES - 1);
    }
    for (const unsigned char *p = (const unsigned char *)item->valuestring; *p != '\0'; p++) {
        if (*p < 0x20 || *p == 0x7f) {
            return refuse(reading, "key \"name\" must not hold control characters");
        }
    }
    strcpy(reading->out->target.name, item->valuestring);
    return true;
}

static bool read_measured_scale(struct reading *reading)
{
    const cJSON *item = find(reading, "measured_scale");
    reading->out->measured_scale[0] = 1;
    reading->out->measured_scale[1] = 1;
    if (item == NULL) {
        return true;
    }
    bool right = cJSON_IsArray(item) && cJSON_GetArraySize(item) == 2;
    for (int axis = 0; right && axis < 2; axis++) {
        const cJSON *number = cJSON_GetArrayItem(item, axis);
        right = cJSON_IsNumber(number) && number->valuedouble >= 0.5 && number->valuedouble <= 2;
        reading->out->measured_scale[axis] = number->valuedouble;
    }
    return right ||
           refuse(reading, "key \"measured_scale\" must be two numbers, [x, y], from 0.5 to 2");
}

/* Fills `put` with each number of rows x cols. */
static bool read_grid(struct reading *reading, const char *key, unsigned max,
                      void (*put)(struct target *target, unsigned place, unsigned value))
{
    struct target *target = &reading->out->target;
    const cJSON *grid = find(reading, key);
    if (grid == NULL) {
        return refuse(reading, "key \"%s\" is missing", key);
    }
    if (!cJSON_IsArray(grid) || cJSON_GetArraySize(grid) != target->rows) {
        return refuse(reading, "key \"%s\" must be a list of %u rows, as \"rows\" says", key,
                      target->rows);
    }
    unsigned place = 0;
    const cJSON *line = NULL;
    cJSON_ArrayForEach(line, grid)
    {
        if (!cJSON_IsArray(line) || cJSON_GetArraySize(line) != target->cols) {
            return refuse(reading,
                          "key \"%s\", row %u: must be a list of %u numbers, as \"cols\" says", key,
                          place / target->cols, target->cols);
        }
        const cJSON *item = NULL;
        cJSON_ArrayForEach(item, line)
        {
            if (!is_whole(item, max)) {
                return refuse(reading,
                              "key \"%s\", row %u, column %u: must be a whole number from 0 to %u",
                              key, place / target->cols, place % target->cols, max);
            }
            put(target, place++, (unsigned)item->valuedouble);
        }
    }
    return true;
}

static void put_id(struct target *target, unsigned place, unsigned value)
{
    target->ids[place] = (uint16_t)value;
}

static void put_turn(struct target *target, unsigned place, unsigned value)
{
    target->turns[place] = (uint8_t)value;
}

static bool read_shape(struct reading *reading)
{
    struct targetfile *out = reading->out;
    unsigned rows = 0;
    unsigned cols = 0;
    unsigned levels = 0;
    if (!get_count(reading, "rows", 1, TARGET_PATCHES_MAX, 0, &rows) ||
        !get_count(reading, "cols", 1, TARGET_PATCHES_MAX, 0, &cols) ||
        !get_count(reading, "levels", LAYOUT_LEVELS_MIN, LAYOUT_LEVELS_MAX, 2, &levels)) {
        return false;
    }
    if (rows * cols > TARGET_PATCHES_MAX) {
        return refuse(reading,
                      "keys \"rows\" and \"cols\" ask for %u patches, but there are only %d ids",
                      rows * cols, TARGET_PATCHES_MAX);
    }
    out->target.rows = (uint16_t)rows;
    out->target.cols = (uint16_t)cols;
    out->target.levels = (uint8_t)levels;
    return get_number(reading, "patch_mm", 0.01, 100000, NAN, &out->patch_mm) &&
           get_number(reading, "circle_ratio", 0.05, 1, 0.5, &out->circle_ratio) &&
           get_number(reading, "edge_level", 0.05, 1, 0.8, &out->edge_level) &&
           get_number(reading, "gauss_sigma", 0.01, 100, 0.4, &out->gauss_sigma) &&
           get_number(reading, "margin", 0, 10, 0.5, &out->margin);
}

/* The integers that the detector works with, and the map. */
static bool prepare(struct reading *reading)
{
    struct targetfile *out = reading->out;
    struct target *target = &out->target;
    target->circle_ratio_q16 = (uint32_t)lround(out->circle_ratio * 65536);
    target->edge_level_q16 = (uint32_t)lround(out->edge_level * 65536);
    target->gauss_sigma_q16 = (uint32_t)lround(out->gauss_sigma * 65536);
    target->patch_nm = llround(out->patch_mm * 1e6);
    unsigned place = 0;
    const enum target_status status = target_prepare(target, &place);
    if (status == TARGET_SAME_ID) {
        return refuse(reading,
                      "key \"ids\", row %u, column %u: id %u stands twice; use each once",
                      place / target->cols, place % target->cols, target->ids[place]);
    }
    return status == TARGET_OK ||
           refuse(reading, "is not a target that can be used (status %d)", (int)status);
}

static bool read_root(struct reading *reading)
{
    if (!cJSON_IsObject(reading->root)) {
        return refuse(reading, "must hold one JSON object; is this a target file?");
    }
    return read_format(reading) && check_keys(reading) && read_name(reading) &&
           read_shape(reading) && read_measured_scale(reading) &&
           read_grid(reading, "ids", LAYOUT_IDS - 1, put_id) &&
           read_grid(reading, "turns", 1, put_turn) && prepare(reading);
}

bool targetfile_parse(const char *text, size_t bytes, const char *source, struct targetfile *out,
                      char error[TARGETFILE_ERROR_BYTES])
{
    struct reading reading = {source, NULL, out, error};
    memset(out, 0, sizeof *out);
    error[0] = '\0';
    if (bytes > TARGETFILE_BYTES_MAX) {
        return refuse(&reading, "is larger than %d bytes; is this a target file?",
                      TARGETFILE_BYTES_MAX);
    }
    if (!check_utf8(&reading, text, bytes)) {
        return false;
    }
    const char *end = text;
    cJSON *root = cJSON_ParseWithLengthOpts(text, bytes, &end, false);
    if (root == NULL) {
        return refuse(&reading, "line %u is not valid JSON", line_of(text, end));
    }
    while (end < text + bytes && strchr(" \t\r\n", *end) != NULL) {
        end++;
    }
    reading.root = root;
    const bool right = end == text + bytes
                           ? read_root(&reading)
                           : refuse(&reading, "line %u goes on after the end of the JSON object",
                                    line_of(text, end));
    cJSON_Delete(root);
    return right;
}

bool targetfile_read(const char *path, struct targetfile *out,
                     char error[TARGETFILE_ERROR_BYTES])
{
    struct reading reading = {path, NULL, out, error};
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        return refuse(&reading, "cannot be opened: %s", strerror(errno));
    }
    /* One byte more than allowed is read, to see that there is more. */
    char *text = malloc(TARGETFILE_BYTES_MAX + 1);
    bool right = false;
    if (text == NULL) {
        (void)refuse(&reading, "cannot be read: out of memory");
    } else {
        errno = 0;
        const size_t bytes = fread(text, 1, TARGETFILE_BYTES_MAX + 1, file);
        right = ferror(file) ? refuse(&reading, "cannot be read: %s", strerror(errno))
                             : targetfile_parse(text, bytes, path, out, error);
    }
    free(text);
    (void)fclose(file);
    return right;
}

bool targetfile_point_mm(const struct targetfile *file, unsigned patch_id, unsigned feature,
                         double xyz_mm[3], double *radius_mm)
{
    const struct layout_feature *place = layout_feature(file->target.levels, feature);
    uint16_t row = 0;
    uint16_t col = 0;
    uint8_t turn = 0;
    if (place == NULL || patch_id >= LAYOUT_IDS ||
        !target_find(&file->target, (uint16_t)patch_id, &row, &col, &turn)) {
        return false;
    }
    const double q30 = 1073741824.0;
    const double u = turn != 0 ? 1 - place->u_q30 / q30 : place->u_q30 / q30;
    const double v = turn != 0 ? 1 - place->v_q30 / q30 : place->v_q30 / q30;
    xyz_mm[0] = (col + u) * file->patch_mm * file->measured_scale[0];
    xyz_mm[1] = (row + v) * file->patch_mm * file->measured_scale[1];
    xyz_mm[2] = 0;
    if (radius_mm != NULL) {
        *radius_mm = file->circle_ratio * place->inradius_q30 / q30 * file->patch_mm *
                     sqrt(file->measured_scale[0] * file->measured_scale[1]);
    }
    return true;
}
