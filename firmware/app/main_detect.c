/* tessera-detect: the device's detector on image files, as CSV. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/version.h"
#include "firmware/app/detector_options.h"
#include "firmware/app/image_file.h"

enum { EXIT_USAGE = 2 };

static const char help[] =
    "Usage: tessera-detect [--target TARGET.json] [--csv OUT.csv] FRAME...\n"
    "\n"
    "Finds the features of a Tessera target in image files (PGM P5 of 8 or 16 bit, PNG) with the very\n"
    "detector that runs on the camera, and writes them as CSV, one feature a row:\n"
    "\n"
    "  file,patch,feature,x,y,sigma,major,minor,angle,polarity\n"
    "\n"
    "x, y: centre, in pixels, of the ellipse that the circle's edge makes in the image (not the image of\n"
    "the circle's centre); (0,0) is the centre of the top-left pixel. sigma: its standard deviation per\n"
    "axis. major, minor: semi-axes in pixels; angle: of the major axis, degrees from +x towards +y.\n"
    "polarity: 1 white circle, 0 black.\n"
    "\n"
    "Options:\n"
    DETECTOR_OPTIONS_HELP
    "  --csv FILE           write there instead of to standard output\n"
    "  --packets FILE       also write the frames' feature packets, one after the other\n"
    "  --help, --version\n";

static int usage_error(const char *sentence)
{
    (void)fprintf(stderr, "tessera-detect: %s; see tessera-detect --help\n", sentence);
    return EXIT_USAGE;
}

static int failure(const char *sentence)
{
    (void)fprintf(stderr, "tessera-detect: %s\n", sentence);
    return EXIT_FAILURE;
}

/* A result file: written beside its place and moved there when whole, so that a failure loses nothing
 * that was there before. What is no regular file, a pipe or a device, is written to directly. */
struct result {
    const char *path;
    char        temporary[PATH_MAX]; /* empty: written to directly */
    FILE       *file;
};

static bool open_result(struct result *result, const char *path)
{
    struct stat there;
    result->path = path;
    result->temporary[0] = '\0';
    if (stat(path, &there) == 0 && !S_ISREG(there.st_mode)) {
        result->file = fopen(path, "wb");
        return result->file != NULL;
    }
    const int length = snprintf(result->temporary, sizeof result->temporary, "%s.part", path);
    if (length < 0 || (size_t)length >= sizeof result->temporary) {
        errno = ENAMETOOLONG;
        return false;
    }
    result->file = fopen(result->temporary, "wb");
    return result->file != NULL;
}

/* Ends an unfinished result; what was in its place before stays. */
static void drop_result(struct result *result)
{
    (void)fclose(result->file);
    if (result->temporary[0] != '\0') {
        (void)unlink(result->temporary);
    }
}

static bool close_result(struct result *result)
{
    errno = 0;
    if (fflush(result->file) != 0 || ferror(result->file) != 0) {
        const int why = errno;
        drop_result(result);
        errno = why != 0 ? why : EIO;
        return false;
    }
    if (fclose(result->file) != 0) {
        return false;
    }
    return result->temporary[0] == '\0' || rename(result->temporary, result->path) == 0;
}

/* A CSV field, quoted where it has to be (RFC 4180). */
static void put_text(FILE *out, const char *text)
{
    if (strpbrk(text, ",\"\r\n") == NULL) {
        (void)fputs(text, out);
        return;
    }
    (void)putc('"', out);
    for (; *text != '\0'; text++) {
        if (*text == '"') {
            (void)putc('"', out);
        }
        (void)putc(*text, out);
    }
    (void)putc('"', out);
}

static void put_features(FILE *out, const char *path, const struct pipeline *pipeline)
{
    for (uint32_t i = 0; i < pipeline->patches.count; i++) {
        const struct patch *patch = &pipeline->patches.at[i];
        for (unsigned feature = 0; feature < LAYOUT_FEATURES_MAX; feature++) {
            if (patch->marks[feature] == MARKS_NONE) {
                continue;
            }
            const struct mark *mark = &pipeline->marks.at[patch->marks[feature]];
            uint32_t major_px_q16;
            uint32_t minor_px_q16;
            uint16_t angle_turn_q16;
            ellipse_axes(&mark->ellipse, &major_px_q16, &minor_px_q16, &angle_turn_q16);
            put_text(out, path);
            (void)fprintf(out, ",%u,%u,%.6f,%.6f,%.6f,%.5f,%.5f,%.5f,%d\n", patch->id, feature,
                          mark->ellipse.x_px_q16 / 65536.0, mark->ellipse.y_px_q16 / 65536.0,
                          mark->sigma_px_q20 / 1048576.0, major_px_q16 / 65536.0,
                          minor_px_q16 / 65536.0, angle_turn_q16 * (360.0 / 65536.0),
                          mark->white ? 1 : 0);
        }
    }
}

static bool put_packet(FILE *out, struct pipeline *pipeline, uint32_t sequence)
{
    const struct wire_header about = {
        .camera_serial = "file",
        .sequence = sequence,
        .packet_index = sequence,
        .clock_kind = WIRE_CLOCK_FILE,
        .clock_uncertainty_ns = WIRE_CLOCK_UNCERTAINTY_UNKNOWN,
    };
    const struct packet *packet = pipeline_packet(pipeline, &about);
    return packet != NULL && fwrite(packet->bytes, 1, packet->used, out) == packet->used;
}

/* A pipeline for frames of the size at hand; made anew only where the size changes. */
static bool fit_pipeline(struct pipeline *pipeline, void **memory, const struct frame_view *frame,
                         const struct pipeline_settings *settings)
{
    if (*memory != NULL && pipeline->width_px == frame->width_px &&
        pipeline->height_px == frame->height_px) {
        return true;
    }
    free(*memory);
    const size_t bytes = pipeline_bytes(frame->width_px, frame->height_px);
    *memory = malloc(bytes);
    if (*memory == NULL) {
        return false;
    }
    pipeline_init(pipeline, *memory, bytes, frame->width_px, frame->height_px, settings);
    return true;
}

static int detect_files(char *const paths[], int count, const struct pipeline_settings *settings,
                        FILE *csv, FILE *packets)
{
    static struct pipeline pipeline;
    void *memory = NULL;
    int exit_code = EXIT_SUCCESS;
    (void)fputs("file,patch,feature,x,y,sigma,major,minor,angle,polarity\n", csv);
    for (int i = 0; i < count && exit_code == EXIT_SUCCESS; i++) {
        struct image_file image;
        char error[IMAGE_FILE_ERROR_BYTES];
        if (!image_file_read(paths[i], &image, error)) {
            exit_code = failure(error);
            break;
        }
        if (!fit_pipeline(&pipeline, &memory, &image.frame, settings)) {
            exit_code = failure("not enough memory for a frame of this size");
        } else {
            pipeline_run(&pipeline, &image.frame);
            put_features(csv, paths[i], &pipeline);
            if (pipeline_truncated(&pipeline) != 0) {
                (void)fprintf(stderr, "tessera-detect: %s: more edges than the detector keeps; some "
                                      "features may be missing\n", paths[i]);
            }
            if (packets != NULL && !put_packet(packets, &pipeline, (uint32_t)i)) {
                exit_code = failure("the packet could not be written");
            }
        }
        image_file_free(&image);
    }
    free(memory);
    return exit_code;
}

static int run(char *const paths[], int count, const struct pipeline_settings *settings,
               const char *csv_path, const char *packets_path)
{
    struct result csv = {.file = stdout};
    struct result packets = {.file = NULL};
    if (csv_path != NULL && !open_result(&csv, csv_path)) {
        (void)fprintf(stderr, "tessera-detect: %s: %s\n", csv_path, strerror(errno));
        return EXIT_FAILURE;
    }
    if (packets_path != NULL && !open_result(&packets, packets_path)) {
        (void)fprintf(stderr, "tessera-detect: %s: %s\n", packets_path, strerror(errno));
        return EXIT_FAILURE;
    }
    int exit_code = detect_files(paths, count, settings, csv.file, packets.file);
    if (exit_code != EXIT_SUCCESS) {
        /* What was there before stays; what is unfinished goes. */
        if (csv_path != NULL) {
            drop_result(&csv);
        }
        if (packets_path != NULL) {
            drop_result(&packets);
        }
        return exit_code;
    }
    errno = 0;
    if (csv_path == NULL ? fflush(stdout) != 0 || ferror(stdout) != 0 : !close_result(&csv)) {
        (void)fprintf(stderr, "tessera-detect: %s: %s\n",
                      csv_path == NULL ? "standard output" : csv_path, strerror(errno));
        exit_code = EXIT_FAILURE;
    }
    if (packets_path != NULL && !close_result(&packets)) {
        (void)fprintf(stderr, "tessera-detect: %s: %s\n", packets_path, strerror(errno));
        exit_code = EXIT_FAILURE;
    }
    return exit_code;
}

int main(int argc, char **argv)
{
    enum { OPTION_CSV = 1, OPTION_PACKETS, OPTION_HELP, OPTION_VERSION };
    static const struct option options[] = {
        DETECTOR_OPTIONS,
        {"csv", required_argument, NULL, OPTION_CSV},
        {"packets", required_argument, NULL, OPTION_PACKETS},
        {"help", no_argument, NULL, OPTION_HELP},
        {"version", no_argument, NULL, OPTION_VERSION},
        {0},
    };
    static struct detector_options detector;
    detector_options_init(&detector);
    const char *csv_path = NULL;
    const char *packets_path = NULL;
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        char error[TARGETFILE_ERROR_BYTES];
        bool usage;
        switch (option) {
        case OPTION_CSV:
            csv_path = optarg;
            break;
        case OPTION_PACKETS:
            packets_path = optarg;
            break;
        case OPTION_HELP:
            (void)fputs(help, stdout);
            return EXIT_SUCCESS;
        case OPTION_VERSION:
            (void)puts("tessera-detect " TESSERA_VERSION);
            return EXIT_SUCCESS;
        case '?':
            return EXIT_USAGE; /* getopt has said why */
        default:
            if (!detector_options_take(&detector, option, optarg, &usage, error)) {
                return usage ? usage_error(error) : failure(error);
            }
        }
    }
    if (optind >= argc) {
        return usage_error("no frame was named");
    }
    return run(argv + optind, argc - optind, detector_options_settings(&detector), csv_path,
               packets_path);
}
