/* Reads a script of faults, line by line. */
#include "tools/v4l2_shim/faults.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static enum fault fault_named(const char *name)
{
    static const char *const names[] = {
        [FAULT_ERROR] = "error",
        [FAULT_SHORT] = "short",
        [FAULT_LOST] = "lost",
        [FAULT_UNPLUG] = "unplug",
    };
    for (size_t i = 1; i < sizeof names / sizeof names[0]; i++) {
        if (strcmp(names[i], name) == 0) {
            return (enum fault)i;
        }
    }
    return FAULT_NONE;
}

static bool read_row(const char *line, uint64_t *frame, enum fault *fault)
{
    char *end = NULL;
    errno = 0;
    *frame = strtoull(line, &end, 10);
    if (errno != 0 || end == line || line[0] == '-' || *end != ',') {
        return false;
    }
    *fault = fault_named(end + 1);
    return *fault != FAULT_NONE;
}

bool faults_read(const char *path, struct faults *out, char sentence[SENTENCE_BYTES])
{
    out->count = 0;
    FILE *const file = fopen(path, "re");
    if (file == NULL) {
        return sentence_say(sentence, "%s: cannot be opened: %s", path, strerror(errno));
    }
    char line[128];
    bool fine = true;
    int number = 0;
    while (fine && fgets(line, sizeof line, file) != NULL) {
        number++;
        line[strcspn(line, "\r\n")] = '\0';
        if (number == 1) {
            fine = strcmp(line, "frame,fault") == 0 ||
                   sentence_say(sentence, "%s: line 1 must be frame,fault", path);
        } else if (out->count == FAULTS_MAX) {
            fine = sentence_say(sentence, "%s: has more than %d faults", path, FAULTS_MAX);
        } else if (line[0] != '\0') {
            fine = read_row(line, &out->at[out->count].frame, &out->at[out->count].fault) ||
                   sentence_say(sentence,
                                "%s: line %d must be a frame's number, a comma and error, short, "
                                "lost or unplug",
                                path, number);
            out->count += fine ? 1 : 0;
        }
    }
    if (fine && (ferror(file) || number == 0)) {
        fine = sentence_say(sentence, "%s: cannot be read, or is empty", path);
    }
    (void)fclose(file);
    return fine;
}

enum fault faults_of(const struct faults *faults, uint64_t frame)
{
    for (uint32_t i = 0; i < faults->count; i++) {
        if (faults->at[i].frame == frame) {
            return faults->at[i].fault;
        }
    }
    return FAULT_NONE;
}
