/* Any bytes as a target file: refused with a sentence that names it, or a target whose every point has a place. */
#include <math.h>
#include <string.h>

#include "common/target/layout.h"
#include "common/targetfile/targetfile.h"
#include "tests/fuzz/fuzz_input.h"

static void check_points(const struct targetfile *file)
{
    const struct target *target = &file->target;
    fuzz_require(target_digest(target) != 0);
    for (unsigned place = 0; place < (unsigned)target->rows * target->cols; place++) {
        uint16_t row;
        uint16_t col;
        uint8_t turn;
        fuzz_require(target_find(target, target->ids[place], &row, &col, &turn));
        fuzz_require(row * (unsigned)target->cols + col == place && turn < 4);
        double at[3];
        double radius;
        const unsigned last = layout_feature_count(target->levels) - 1;
        fuzz_require(targetfile_point_mm(file, target->ids[place], last, at, &radius));
        fuzz_require(isfinite(at[0]) && isfinite(at[1]) && at[2] == 0 && radius > 0);
        fuzz_require(!targetfile_point_mm(file, target->ids[place], last + 1, at, &radius));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t count)
{
    static struct targetfile file;
    char error[TARGETFILE_ERROR_BYTES] = "";
    if (targetfile_parse((const char *)data, count, "some.json", &file, error)) {
        check_points(&file);
    } else {
        fuzz_require(strncmp(error, "some.json", 9) == 0 && strlen(error) > 12);
    }
    return 0;
}
