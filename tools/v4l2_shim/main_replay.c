/* tessera-replay: runs a command that sees a folder of frames as a V4L2 camera.
 *
 * Checks the folder, so that a bad one is named before the command starts, then hands it to the
 * preloaded library through the environment and becomes the command. */
#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/version.h"
#include "tools/v4l2_shim/faults.h"
#include "tools/v4l2_shim/raw_kind.h"
#include "tools/v4l2_shim/shim_env.h"

enum { EXIT_WRONG_USE = 2, EXIT_CANNOT_RUN = 126, EXIT_NO_COMMAND = 127 };

static const char help[] =
    "Usage: tessera-replay --frames DIR [--fps N] [--device /dev/video0] [--once]\n"
    "                      [--faults FILE] -- COMMAND...\n"
    "\n"
    "Runs COMMAND, unmodified, so that it sees the frames of DIR as a V4L2 camera.\n"
    "\n"
    "  --frames DIR   the frames, in natural name order, from the first at each STREAMON; all of\n"
    "                 one format and size. 8-bit PGM is GREY; 16-bit PGM with maxval 1023, 4095\n"
    "                 or 65535 is Y10, Y12 or Y16; raw files need a format.json such as\n"
    "                 {\"fourcc\": \"YUYV\", \"width\": 640, \"height\": 480}\n"
    "                 (GREY, Y10, Y12, Y16, YUYV, UYVY, NV12; optional: bytesperline).\n"
    "                 An optional times.csv (file,t_ns[,exposure_ns]) gives capture times: the\n"
    "                 middle of the first row's exposure. Buffers are stamped with its start,\n"
    "                 t_ns - exposure_ns / 2; a second pass goes on one frame interval after the\n"
    "                 first. Hidden files and .json .csv .txt .md .log are not frames.\n"
    "  --fps N        paced: N frames a second; a frame that finds no queued buffer is dropped\n"
    "                 and counted in the sequence. Without it lockstep: each queued buffer gets\n"
    "                 the next frame and none is dropped.\n"
    "  --device PATH  the device's name, /dev/video0 to /dev/video255; default /dev/video0\n"
    "  --once         the stream ends with EPIPE after the last frame; else it starts over\n"
    "  --faults FILE  what goes wrong: CSV with the header line frame,fault and then a row a\n"
    "                 fault; frame counts from 0 at STREAMON; fault is error (marked broken),\n"
    "                 short (half its bytes), lost (skipped, but counted) or unplug\n"
    "  --help         this text\n"
    "  --version      the version\n"
    "\n"
    "Every process of COMMAND has a device of its own. Static programs and scripts that reset\n"
    "LD_PRELOAD do not see it. Programs built with AddressSanitizer work.\n"
    "The exit status is COMMAND's; 127 where there is no such command, 126 where it cannot be\n"
    "run, 1 where the frames cannot be shown, 2 for wrong use.\n";

struct options {
    const char *frames;
    const char *fps;
    const char *device;
    const char *faults;
    bool        once;
};

__attribute__((noreturn, format(printf, 2, 3))) static void fail(int status, const char *format,
                                                                 ...)
{
    va_list rest;
    va_start(rest, format);
    (void)fputs("tessera-replay: error: ", stderr);
    (void)vfprintf(stderr, format, rest);
    (void)fputc('\n', stderr);
    va_end(rest);
    exit(status);
}

static struct options read_options(int argc, char **argv)
{
    static const struct option known[] = {
        {"frames", required_argument, NULL, 'f'}, {"fps", required_argument, NULL, 'r'},
        {"device", required_argument, NULL, 'd'}, {"once", no_argument, NULL, 'o'},
        {"help", no_argument, NULL, 'h'},         {"version", no_argument, NULL, 'v'},
        {"faults", required_argument, NULL, 'x'}, {NULL, 0, NULL, 0},
    };
    struct options options = {.device = "/dev/video0"};
    /* '+': the command's options are its own; ':': the sentences are ours. */
    for (int c = getopt_long(argc, argv, "+:", known, NULL); c != -1;
         c = getopt_long(argc, argv, "+:", known, NULL)) {
        switch (c) {
        case 'f':
            options.frames = optarg;
            break;
        case 'r':
            options.fps = optarg;
            break;
        case 'd':
            options.device = optarg;
            break;
        case 'x':
            options.faults = optarg;
            break;
        case 'o':
            options.once = true;
            break;
        case 'h':
            (void)fputs(help, stdout);
            exit(EXIT_SUCCESS);
        case 'v':
            (void)puts("tessera-replay " TESSERA_VERSION);
            exit(EXIT_SUCCESS);
        case ':':
            fail(EXIT_WRONG_USE, "%s needs a value; see --help", argv[optind - 1]);
        default:
            fail(EXIT_WRONG_USE, "%s is not an option; see --help", argv[optind - 1]);
        }
    }
    if (options.frames == NULL) {
        fail(EXIT_WRONG_USE, "--frames DIR is missing; see --help");
    }
    if (options.fps != NULL && shim_env_period_ns(options.fps) == 0) {
        fail(EXIT_WRONG_USE, "--fps %s is not a number from 0.001 to 100000", options.fps);
    }
    if (shim_env_device_number(options.device) < 0) {
        fail(EXIT_WRONG_USE, "--device %s is not /dev/video0 to /dev/video255", options.device);
    }
    if (optind == argc) {
        fail(EXIT_WRONG_USE, "there is no command after the options; see --help");
    }
    return options;
}

/* The script's absolute path, or NULL where there is none. */
static const char *check_faults(const char *given)
{
    static char path[PATH_MAX];
    static struct faults faults;
    char sentence[SENTENCE_BYTES];
    if (given == NULL) {
        return NULL;
    }
    if (realpath(given, path) == NULL) {
        fail(EXIT_FAILURE, "%s: cannot be opened: %s", given, strerror(errno));
    }
    if (!faults_read(path, &faults, sentence)) {
        fail(EXIT_FAILURE, "%s", sentence);
    }
    return path;
}

static struct shim_env check_frames(const struct options *options)
{
    static char path[PATH_MAX];
    static char description[PATH_MAX + 16];
    char sentence[SENTENCE_BYTES];
    struct shim_env settings = {.device = options->device, .once = options->once};
    /* Absolute, because the command may change its folder before it opens the device. */
    if (realpath(options->frames, path) == NULL) {
        fail(EXIT_FAILURE, "%s: cannot read the folder of frames: %s", options->frames,
             strerror(errno));
    }
    settings.frames = path;
    (void)snprintf(description, sizeof description, "%s/format.json", path);
    struct folder folder;
    if (!raw_kind_read(description, &settings.raw_format, &settings.raw, sentence) ||
        !folder_open(&folder, path, settings.raw ? &settings.raw_format : NULL, sentence)) {
        fail(EXIT_FAILURE, "%s", sentence);
    }
    folder_close(&folder);
    settings.faults = check_faults(options->faults);
    return settings;
}

/* The library lies beside this program, or in ../lib/tessera where it is installed. */
static void find_library(char out[PATH_MAX])
{
    char self[PATH_MAX];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    if (length < 0) {
        fail(EXIT_FAILURE, "/proc/self/exe: cannot be read: %s", strerror(errno));
    }
    self[length] = '\0';
    *strrchr(self, '/') = '\0';
    static const char *const places[] = {"", "/../lib/tessera"};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        const int written =
            snprintf(out, PATH_MAX, "%s%s/%s", self, places[i], SHIM_ENV_LIBRARY);
        if (written < PATH_MAX && access(out, R_OK) == 0) {
            return;
        }
    }
    fail(EXIT_FAILURE, "%s/%s: the shim library is not there; build it with `make all`", self,
         SHIM_ENV_LIBRARY);
}

/* Puts word in front of a variable that holds words apart by ':'. */
static void prepend(const char *name, const char *word)
{
    const char *const before = getenv(name);
    char *joined = NULL;
    if (before == NULL || before[0] == '\0') {
        joined = strdup(word);
    } else if (asprintf(&joined, "%s:%s", word, before) < 0) {
        joined = NULL;
    }
    if (joined == NULL || setenv(name, joined, 1) != 0) {
        fail(EXIT_FAILURE, "no memory to set %s", name);
    }
    free(joined);
}

int main(int argc, char **argv)
{
    const struct options options = read_options(argc, argv);
    const struct shim_env settings = check_frames(&options);
    char library[PATH_MAX];
    find_library(library);
    if (strpbrk(library, " :") != NULL) {
        fail(EXIT_FAILURE, "%s: the loader cannot preload from a path with spaces or colons; "
                           "move the build", library);
    }
    if (!shim_env_put(&settings, options.fps)) {
        fail(EXIT_FAILURE, "no memory for the environment");
    }
    prepend("LD_PRELOAD", library);
    /* A program built with AddressSanitizer refuses to start behind another library, unless told
     * that this is meant. */
    prepend("ASAN_OPTIONS", "verify_asan_link_order=0");
    (void)execvp(argv[optind], argv + optind);
    const int reason = errno;
    fail(reason == ENOENT ? EXIT_NO_COMMAND : EXIT_CANNOT_RUN, "%s: cannot run the command: %s",
         argv[optind], strerror(reason));
}
