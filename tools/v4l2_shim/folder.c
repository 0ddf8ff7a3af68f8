/* Lists a folder's frames, checks that they belong together, and reads them. */
#include "tools/v4l2_shim/folder.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "tools/v4l2_shim/pgm_head.h"
#include "tools/v4l2_shim/times_csv.h"

/* Larger than any sensor's frame, and small enough that 32 buffers of it fit an address space. */
enum { IMAGE_BYTES_MAX = 1 << 29 };

int folder_compare_names(const char *a, const char *b)
{
    const char *const whole_a = a;
    const char *const whole_b = b;
    while (*a != '\0' && *b != '\0') {
        if (isdigit((unsigned char)*a) && isdigit((unsigned char)*b)) {
            /* Equal values of unequal length (7 and 007) are settled at the end. */
            a += strspn(a, "0");
            b += strspn(b, "0");
            const size_t digits_a = strspn(a, "0123456789");
            const size_t digits_b = strspn(b, "0123456789");
            if (digits_a != digits_b) {
                return digits_a < digits_b ? -1 : 1;
            }
            const int order = strncmp(a, b, digits_a);
            if (order != 0) {
                return order;
            }
            a += digits_a;
            b += digits_b;
        } else {
            if (*a != *b) {
                return (unsigned char)*a < (unsigned char)*b ? -1 : 1;
            }
            a++;
            b++;
        }
    }
    if (*a != *b) {
        return *a == '\0' ? -1 : 1;
    }
    return strcmp(whole_a, whole_b);
}

static int compare_frames(const void *a, const void *b)
{
    return folder_compare_names(((const struct folder_frame *)a)->name,
                                ((const struct folder_frame *)b)->name);
}

bool folder_complete_format(struct folder_format *format, char sentence[SENTENCE_BYTES])
{
    if (format->width_px < 1 || format->width_px > 65535 || format->height_px < 1 ||
        format->height_px > 65535) {
        return sentence_say(sentence, "width and height must be 1..65535, not %u x %u",
                            format->width_px, format->height_px);
    }
    uint32_t row_bytes = 0;
    uint64_t rows = format->height_px;
    switch (format->fourcc) {
    case V4L2_PIX_FMT_GREY:
        row_bytes = format->width_px;
        break;
    case V4L2_PIX_FMT_Y10:
    case V4L2_PIX_FMT_Y12:
    case V4L2_PIX_FMT_Y16:
        row_bytes = 2 * format->width_px;
        break;
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_UYVY:
        if (format->width_px % 2 != 0) {
            return sentence_say(sentence, "width must be even for YUYV and UYVY, not %u",
                                format->width_px);
        }
        row_bytes = 2 * format->width_px;
        break;
    case V4L2_PIX_FMT_NV12:
        if (format->width_px % 2 != 0 || format->height_px % 2 != 0) {
            return sentence_say(sentence, "width and height must be even for NV12, not %u x %u",
                                format->width_px, format->height_px);
        }
        row_bytes = format->width_px;
        rows += format->height_px / 2;
        break;
    default:
        return sentence_say(sentence, "the format must be GREY, Y10, Y12, Y16, YUYV, UYVY or NV12");
    }
    if (format->stride_bytes == 0) {
        format->stride_bytes = row_bytes;
    }
    if (format->stride_bytes < row_bytes) {
        return sentence_say(sentence, "bytesperline %u is less than a row's %u bytes",
                            format->stride_bytes, row_bytes);
    }
    const uint64_t image_bytes = rows * format->stride_bytes;
    if (image_bytes > IMAGE_BYTES_MAX) {
        return sentence_say(sentence, "a frame of %llu bytes is too large",
                            (unsigned long long)image_bytes);
    }
    format->image_bytes = (uint32_t)image_bytes;
    return true;
}

static bool is_notes_file(const char *name)
{
    static const char *const endings[] = {".json", ".csv", ".txt", ".md", ".log"};
    const size_t length = strlen(name);
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++) {
        const size_t ending = strlen(endings[i]);
        if (length >= ending && strcmp(name + length - ending, endings[i]) == 0) {
            return true;
        }
    }
    return name[0] == '.';
}

static void join(char *to, size_t bytes, const char *folder, const char *name)
{
    (void)snprintf(to, bytes, "%s/%s", folder, name);
}

/* Every regular file that is neither hidden nor notes is taken for a frame, so that a stray file is
 * named instead of being skipped. */
static bool list_files(struct folder *folder, char sentence[SENTENCE_BYTES])
{
    DIR *const dir = opendir(folder->path);
    if (dir == NULL) {
        return sentence_say(sentence, "%s: cannot read the folder of frames: %s", folder->path,
                            strerror(errno));
    }
    bool fine = true;
    size_t room = 0;
    for (const struct dirent *entry = readdir(dir); fine && entry != NULL; entry = readdir(dir)) {
        char path[4096];
        struct stat info;
        join(path, sizeof path, folder->path, entry->d_name);
        if (is_notes_file(entry->d_name) || stat(path, &info) != 0 || !S_ISREG(info.st_mode)) {
            continue;
        }
        if (folder->count == room) {
            room = room == 0 ? 64 : 2 * room;
            struct folder_frame *const more =
                realloc(folder->frames, room * sizeof folder->frames[0]);
            if (more == NULL) {
                fine = sentence_say(sentence, "%s: no memory for the list of frames", folder->path);
                break;
            }
            folder->frames = more;
        }
        struct folder_frame *const frame = &folder->frames[folder->count];
        *frame = (struct folder_frame){.name = strdup(entry->d_name)};
        fine = frame->name != NULL ||
               sentence_say(sentence, "%s: no memory for the list of frames", folder->path);
        folder->count += fine ? 1 : 0;
    }
    (void)closedir(dir);
    if (fine && folder->count == 0) {
        fine = sentence_say(
            sentence, "%s: the folder holds no frames (PGM files, or raw files with a format.json)",
            folder->path);
    }
    return fine;
}

static bool pgm_format(const char *path, FILE *file, struct folder_format *format,
                       struct pgm_head *head, char sentence[SENTENCE_BYTES])
{
    const char *const fault = pgm_head_read(file, head);
    if (fault != NULL) {
        return sentence_say(sentence, "%s: %s", path, fault);
    }
    *format = (struct folder_format){.width_px = head->width_px, .height_px = head->height_px};
    switch (head->maxval) {
    case 1023:
        format->fourcc = V4L2_PIX_FMT_Y10;
        break;
    case 4095:
        format->fourcc = V4L2_PIX_FMT_Y12;
        break;
    case 65535:
        format->fourcc = V4L2_PIX_FMT_Y16;
        break;
    default:
        if (head->maxval > 255) {
            return sentence_say(sentence,
                                "%s: maxval %u is none of 255 and less, 1023, 4095, 65535", path,
                                head->maxval);
        }
        format->fourcc = V4L2_PIX_FMT_GREY;
        break;
    }
    char detail[SENTENCE_BYTES];
    return folder_complete_format(format, detail) || sentence_say(sentence, "%s: %s", path, detail);
}

static bool check_size(const char *path, FILE *file, uint64_t expected_bytes,
                       char sentence[SENTENCE_BYTES])
{
    struct stat info;
    if (fstat(fileno(file), &info) != 0) {
        return sentence_say(sentence, "%s: cannot be examined: %s", path, strerror(errno));
    }
    if ((uint64_t)info.st_size != expected_bytes) {
        return sentence_say(sentence,
                            "%s: the file has %lld bytes where its format and size ask for %llu",
                            path, (long long)info.st_size, (unsigned long long)expected_bytes);
    }
    return true;
}

/* Opens frame index, positioned at its first pixel, after checking all but the pixels. */
static FILE *open_frame(const struct folder *folder, size_t index, struct folder_format *format,
                        struct pgm_head *head, char sentence[SENTENCE_BYTES])
{
    char path[4096];
    join(path, sizeof path, folder->path, folder->frames[index].name);
    FILE *const file = fopen(path, "rbe");
    if (file == NULL) {
        (void)sentence_say(sentence, "%s: cannot be opened: %s", path, strerror(errno));
        return NULL;
    }
    bool fine = true;
    if (folder->raw) {
        *format = folder->format;
        fine = check_size(path, file, format->image_bytes, sentence);
    } else {
        fine =
            pgm_format(path, file, format, head, sentence) &&
            check_size(path, file, (uint64_t)head->pixels_offset + format->image_bytes, sentence);
    }
    if (!fine) {
        (void)fclose(file);
        return NULL;
    }
    return file;
}

static bool same_format(const struct folder *folder, size_t index, const struct folder_format *is,
                        char sentence[SENTENCE_BYTES])
{
    const struct folder_format *const first = &folder->format;
    if (is->fourcc != first->fourcc || is->width_px != first->width_px ||
        is->height_px != first->height_px) {
        return sentence_say(
            sentence,
            "%s/%s: %u x %u %.4s differs from the first frame's %u x %u %.4s; all frames of "
            "a folder must have one format and size",
            folder->path, folder->frames[index].name, is->width_px, is->height_px,
            (const char *)&is->fourcc, first->width_px, first->height_px,
            (const char *)&first->fourcc);
    }
    return true;
}

static bool check_frames(struct folder *folder, char sentence[SENTENCE_BYTES])
{
    for (size_t i = 0; i < folder->count; i++) {
        struct folder_format format;
        struct pgm_head head;
        FILE *const file = open_frame(folder, i, &format, &head, sentence);
        if (file == NULL) {
            return false;
        }
        (void)fclose(file);
        if (i == 0) {
            folder->format = format;
        }
        if (!same_format(folder, i, &format, sentence)) {
            return false;
        }
    }
    return true;
}

/* A second pass goes on where the first one ended, one mean frame interval later. */
static int64_t loop_span_ns(const struct folder *folder)
{
    const int64_t span_ns = folder->frames[folder->count - 1].t_ns - folder->frames[0].t_ns;
    if (folder->count < 2 || span_ns <= 0) {
        return 1000000000;
    } else {
        return span_ns + span_ns / (int64_t)(folder->count - 1);
    }
}

static bool read_times(struct folder *folder, char sentence[SENTENCE_BYTES])
{
    char path[4096];
    struct stat info;
    join(path, sizeof path, folder->path, "times.csv");
    if (stat(path, &info) != 0 && errno == ENOENT) {
        return true;
    }
    if (!times_csv_read(path, folder->frames, folder->count, sentence)) {
        return false;
    }
    folder->timed = true;
    folder->loop_ns = loop_span_ns(folder);
    return true;
}

bool folder_open(struct folder *out, const char *path, const struct folder_format *raw,
                 char sentence[SENTENCE_BYTES])
{
    *out = (struct folder){.path = strdup(path), .raw = raw != NULL};
    if (raw != NULL) {
        out->format = *raw;
    }
    if (out->path == NULL) {
        return sentence_say(sentence, "%s: no memory for the list of frames", path);
    }
    bool fine = list_files(out, sentence);
    if (fine) {
        qsort(out->frames, out->count, sizeof out->frames[0], compare_frames);
        fine = check_frames(out, sentence) && read_times(out, sentence);
    }
    if (!fine) {
        folder_close(out);
    }
    return fine;
}

/* PGM's big-endian samples become V4L2's little-endian ones. False where one exceeds maxval. */
static bool swap_samples(uint8_t *at, size_t bytes, uint32_t maxval)
{
    uint32_t largest = 0;
    for (size_t i = 0; i + 1 < bytes; i += 2) {
        const uint8_t high = at[i];
        at[i] = at[i + 1];
        at[i + 1] = high;
        const uint32_t sample = (uint32_t)high << 8 | at[i];
        largest = sample > largest ? sample : largest;
    }
    return largest <= maxval;
}

bool folder_read(const struct folder *folder, size_t index, uint8_t *to,
                 char sentence[SENTENCE_BYTES])
{
    struct folder_format format;
    struct pgm_head head;
    const char *const name = folder->frames[index].name;
    FILE *const file = open_frame(folder, index, &format, &head, sentence);
    if (file == NULL) {
        return false;
    }
    /* The file may have changed since the folder was opened; the buffer has not. */
    bool fine = same_format(folder, index, &format, sentence);
    if (fine && fread(to, 1, format.image_bytes, file) != format.image_bytes) {
        fine = sentence_say(sentence, "%s/%s: cannot be read whole", folder->path, name);
    }
    (void)fclose(file);
    if (fine && !folder->raw && head.maxval > 255 &&
        !swap_samples(to, format.image_bytes, head.maxval)) {
        fine = sentence_say(sentence, "%s/%s: a sample is larger than maxval %u", folder->path,
                            name, head.maxval);
    }
    return fine;
}

void folder_close(struct folder *folder)
{
    for (size_t i = 0; i < folder->count; i++) {
        free(folder->frames[i].name);
    }
    free(folder->frames);
    free(folder->path);
    *folder = (struct folder){0};
}
