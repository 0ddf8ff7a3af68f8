/* Reads times.csv row by row; each fault is named with its line. */
#include "tools/v4l2_shim/times_csv.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Times are nanoseconds; whatever the clock's origin, they stay far from where sums overflow. */
static const long long t_ns_max = 1LL << 62;
static const long long exposure_ns_max = 3600000000000LL;

/* Where the columns are; -1 where a column is not there. */
struct columns {
    int file;
    int t_ns;
    int exposure_ns;
};

static struct folder_frame *find(struct folder_frame *frames, size_t count, const char *name)
{
    size_t low = 0;
    size_t high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const int order = folder_compare_names(name, frames[middle].name);
        if (order == 0) {
            return &frames[middle];
        }
        if (order < 0) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return NULL;
}

static struct columns read_header(char *line)
{
    struct columns at = {.file = -1, .t_ns = -1, .exposure_ns = -1};
    int column = 0;
    for (char *field = strsep(&line, ","); field != NULL; field = strsep(&line, ",")) {
        if (strcmp(field, "file") == 0) {
            at.file = column;
        } else if (strcmp(field, "t_ns") == 0) {
            at.t_ns = column;
        } else if (strcmp(field, "exposure_ns") == 0) {
            at.exposure_ns = column;
        }
        column++;
    }
    return at;
}

static bool read_integer(const char *text, long long low, long long high, int64_t *out)
{
    char *end = NULL;
    errno = 0;
    const long long value = strtoll(text, &end, 10);
    if (errno != 0 || end == text || *end != '\0' || value < low || value > high) {
        return false;
    }
    *out = value;
    return true;
}

static bool read_row(char *line, const struct columns *at, struct folder_frame *out,
                     const char **fault)
{
    const char *t_ns = NULL;
    const char *exposure_ns = at->exposure_ns < 0 ? "0" : NULL;
    int column = 0;
    for (char *field = strsep(&line, ","); field != NULL; field = strsep(&line, ",")) {
        if (column == at->file) {
            out->name = field;
        } else if (column == at->t_ns) {
            t_ns = field;
        } else if (column == at->exposure_ns) {
            exposure_ns = field;
        }
        column++;
    }
    if (out->name == NULL || t_ns == NULL || exposure_ns == NULL) {
        *fault = "has fewer fields than the header line";
    } else if (!read_integer(t_ns, -t_ns_max, t_ns_max, &out->t_ns)) {
        *fault = "has a t_ns that is no whole number of nanoseconds";
    } else if (!read_integer(exposure_ns, 0, exposure_ns_max, &out->exposure_ns)) {
        *fault = "has an exposure_ns that is no whole number of nanoseconds from 0 to an hour";
    }
    return *fault == NULL;
}

static bool read_lines(FILE *file, const char *path, struct folder_frame *frames, size_t count,
                       bool *given, char sentence[SENTENCE_BYTES])
{
    struct columns at = {.file = -1, .t_ns = -1, .exposure_ns = -1};
    char line[4096];
    for (int number = 1; fgets(line, sizeof line, file) != NULL; number++) {
        if (strchr(line, '\n') == NULL && !feof(file)) {
            return sentence_say(sentence, "%s: line %d is too long", path, number);
        }
        line[strcspn(line, "\r\n")] = '\0';
        if (number == 1) {
            at = read_header(line);
            if (at.file < 0 || at.t_ns < 0) {
                return sentence_say(sentence, "%s: line 1 must name the columns file and t_ns",
                                    path);
            }
        } else if (line[0] != '\0') {
            struct folder_frame row = {0};
            const char *fault = NULL;
            if (!read_row(line, &at, &row, &fault)) {
                return sentence_say(sentence, "%s: line %d %s", path, number, fault);
            }
            struct folder_frame *const frame = find(frames, count, row.name);
            if (frame != NULL && given[frame - frames]) {
                return sentence_say(sentence, "%s: line %d gives %s a second time", path, number,
                                    row.name);
            }
            if (frame != NULL) {
                frame->t_ns = row.t_ns;
                frame->exposure_ns = row.exposure_ns;
                given[frame - frames] = true;
            }
        }
    }
    if (ferror(file)) {
        return sentence_say(sentence, "%s: cannot be read", path);
    }
    for (size_t i = 0; i < count; i++) {
        if (!given[i]) {
            return sentence_say(sentence, "%s: has no row for %s", path, frames[i].name);
        }
    }
    return true;
}

bool times_csv_read(const char *path, struct folder_frame *frames, size_t count,
                    char sentence[SENTENCE_BYTES])
{
    FILE *const file = fopen(path, "re");
    if (file == NULL) {
        return sentence_say(sentence, "%s: cannot be opened: %s", path, strerror(errno));
    }
    bool *const given = calloc(count, sizeof given[0]);
    const bool fine = given == NULL ? sentence_say(sentence, "%s: no memory to read it", path)
                                    : read_lines(file, path, frames, count, given, sentence);
    free(given);
    (void)fclose(file);
    return fine;
}
