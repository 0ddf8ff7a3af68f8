/* Any bytes as one of the files of a recording that the V4L2 shim reads: refused with a sentence, or within the
 * bounds that its reader promises. The first byte picks the file: an image's head, times.csv or format.json. */
#include <string.h>

#include "tests/fuzz/fuzz_input.h"
#include "tools/v4l2_shim/pgm_head.h"
#include "tools/v4l2_shim/raw_kind.h"
#include "tools/v4l2_shim/times_csv.h"

static void read_head(const char *path, size_t count)
{
    FILE *file = fopen(path, "rb");
    fuzz_require(file != NULL);
    struct pgm_head head;
    const char *why = pgm_head_read(file, &head);
    if (why == NULL) {
        fuzz_require(head.maxval >= 1 && head.maxval <= 65535 && head.pixels_offset <= count);
        fuzz_require(head.width_px >= 1 && head.height_px >= 1);
    } else {
        fuzz_require(why[0] != '\0');
    }
    (void)fclose(file);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count)
{
    static char names[3][8] = {"a.pgm", "b2.pgm", "b10.pgm"};
    static char sentence[SENTENCE_BYTES];
    if (count < 1) {
        return 0;
    }
    const char *path = fuzz_file(data + 1, count - 1);
    struct folder_frame frames[3] = {{names[0], 0, 0}, {names[1], 0, 0}, {names[2], 0, 0}};
    struct folder_format format = {0};
    bool found = false;
    sentence[0] = '\0';
    switch (data[0] % 3) {
    case 0:
        read_head(path, count - 1);
        break;
    case 1:
        fuzz_require(times_csv_read(path, frames, 3, sentence) || strstr(sentence, path) != NULL);
        break;
    default:
        if (raw_kind_read(path, &format, &found, sentence)) {
            fuzz_require(found && format.width_px >= 1 && format.width_px <= 65535);
            fuzz_require(format.height_px >= 1 && format.height_px <= 65535);
            fuzz_require(format.image_bytes / format.height_px >= format.width_px);
        } else {
            fuzz_require(strstr(sentence, path) != NULL);
        }
        break;
    }
    return 0;
}
