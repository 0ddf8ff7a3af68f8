/* Reads format.json, strictly: an unknown key or a wrong type is a fault, not a default. */
#include "tools/v4l2_shim/raw_kind.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>

static bool read_fourcc(const cJSON *item, uint32_t *out)
{
    static const struct {
        const char *name;
        uint32_t fourcc;
    } known[] = {
        {"GREY", V4L2_PIX_FMT_GREY}, {"Y10", V4L2_PIX_FMT_Y10},   {"Y12", V4L2_PIX_FMT_Y12},
        {"Y16", V4L2_PIX_FMT_Y16},   {"YUYV", V4L2_PIX_FMT_YUYV}, {"UYVY", V4L2_PIX_FMT_UYVY},
        {"NV12", V4L2_PIX_FMT_NV12},
    };
    for (size_t i = 0; cJSON_IsString(item) && i < sizeof known / sizeof known[0]; i++) {
        if (strcmp(item->valuestring, known[i].name) == 0) {
            *out = known[i].fourcc;
            return true;
        }
    }
    return false;
}

static bool read_size(const cJSON *item, int max, uint32_t *out)
{
    if (!cJSON_IsNumber(item) || item->valuedouble != (double)item->valueint ||
        item->valueint < 1 || item->valueint > max) {
        return false;
    }
    *out = (uint32_t)item->valueint;
    return true;
}

static bool read_object(const cJSON *root, const char *path, struct folder_format *out,
                        char sentence[SENTENCE_BYTES])
{
    if (!cJSON_IsObject(root)) {
        return sentence_say(sentence, "%s: is not a JSON object", path);
    }
    for (const cJSON *item = root->child; item != NULL; item = item->next) {
        const char *const key = item->string;
        if (strcmp(key, "fourcc") == 0 || strcmp(key, "format") == 0 ||
            strcmp(key, "pixelformat") == 0) {
            if (!read_fourcc(item, &out->fourcc)) {
                return sentence_say(sentence,
                                    "%s: \"%s\" must be GREY, Y10, Y12, Y16, YUYV, UYVY or NV12",
                                    path, key);
            }
        } else if (strcmp(key, "width") == 0 || strcmp(key, "height") == 0) {
            if (!read_size(item, 65535, key[0] == 'w' ? &out->width_px : &out->height_px)) {
                return sentence_say(sentence, "%s: \"%s\" must be a whole number in 1..65535", path,
                                    key);
            }
        } else if (strcmp(key, "bytesperline") == 0) {
            if (!read_size(item, 1 << 20, &out->stride_bytes)) {
                return sentence_say(sentence, "%s: \"%s\" must be a whole number of bytes", path,
                                    key);
            }
        } else {
            return sentence_say(
                sentence,
                "%s: the key \"%.100s\" is not known (known: fourcc, width, height, "
                "bytesperline)",
                path, key);
        }
    }
    if (out->fourcc == 0 || out->width_px == 0 || out->height_px == 0) {
        return sentence_say(sentence, "%s: \"fourcc\", \"width\" and \"height\" are all needed",
                            path);
    }
    char detail[SENTENCE_BYTES];
    return folder_complete_format(out, detail) || sentence_say(sentence, "%s: %s", path, detail);
}

bool raw_kind_read(const char *path, struct folder_format *out, bool *found,
                   char sentence[SENTENCE_BYTES])
{
    *out = (struct folder_format){0};
    *found = false;
    FILE *const file = fopen(path, "re");
    if (file == NULL) {
        return errno == ENOENT || errno == ENOTDIR ||
               sentence_say(sentence, "%s: cannot be opened: %s", path, strerror(errno));
    }
    *found = true;
    char text[4096];
    const size_t bytes = fread(text, 1, sizeof text, file);
    const bool whole = !ferror(file) && bytes < sizeof text;
    (void)fclose(file);
    if (!whole) {
        return sentence_say(sentence, "%s: cannot be read, or is longer than 4 kB", path);
    }
    cJSON *const root = cJSON_ParseWithLength(text, bytes);
    const bool fine = root == NULL ? sentence_say(sentence, "%s: is not valid JSON", path)
                                   : read_object(root, path, out, sentence);
    cJSON_Delete(root);
    return fine;
}
