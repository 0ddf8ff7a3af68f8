/* Words into numbers, each checked where it is read. */
#include "firmware/app/camera_options.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/version.h"

static const char help[] =
    "Usage: tessera-cam --to HOST:PORT [options]\n"
    "\n"
    "Captures from a V4L2 camera, finds the features of a Tessera target in every frame and streams them\n"
    "as compact packets to `tessera-rig receive`. No image leaves the camera.\n"
    "\n"
    "Where to:\n"
    "  --to HOST:PORT       the receiver; a name, an IPv4 address or [IPv6]\n"
    "  --give-up S          fail after S seconds without a receiver (default 10; 0: never)\n"
    "  --wait               hold the source rather than drop packets (for recordings)\n"
    "Camera:\n"
    "  --device PATH        default /dev/video0\n"
    "  --serial NAME        names the camera, 1 to 32 bytes (default: what the device says of itself)\n"
    "  --format KIND        GREY, Y10, Y12, Y16, YUYV, UYVY or NV12 (default: the device's own)\n"
    "  --size WxH           default: the device's own\n"
    "  --buffers N          2 to 32 (default 4)\n"
    "  --frames N           stop after N frames\n"
    "What the driver cannot say:\n"
    "  --exposure-us T      exposure time; capture times then mean its middle\n"
    "  --row-time-ns T      read-out time from row to row of a rolling shutter\n"
    "  --region X,Y,W,H     the image's part of the sensor, in sensor pixels\n"
    "  --binning XxY        sensor pixels to one image pixel\n"
    "  --flip x|y|xy        the image is mirrored against the sensor\n"
    "  --clock KIND         what capture times count: monotonic, realtime, tai or file (a recording)\n"
    "  --clock-ns T         standard deviation of capture times, nanoseconds\n"
    "Detector:\n"
    DETECTOR_OPTIONS_HELP
    "  --help, --version\n";

enum {
    OPTION_TO = 1,
    OPTION_GIVE_UP,
    OPTION_WAIT,
    OPTION_DEVICE,
    OPTION_SERIAL,
    OPTION_FORMAT,
    OPTION_SIZE,
    OPTION_BUFFERS,
    OPTION_FRAMES,
    OPTION_EXPOSURE,
    OPTION_ROW_TIME,
    OPTION_REGION,
    OPTION_BINNING,
    OPTION_FLIP,
    OPTION_CLOCK,
    OPTION_CLOCK_NS,
    OPTION_HELP,
    OPTION_VERSION,
};

static const struct option options_known[] = {
    DETECTOR_OPTIONS,
    {"to", required_argument, NULL, OPTION_TO},
    {"give-up", required_argument, NULL, OPTION_GIVE_UP},
    {"wait", no_argument, NULL, OPTION_WAIT},
    {"device", required_argument, NULL, OPTION_DEVICE},
    {"serial", required_argument, NULL, OPTION_SERIAL},
    {"format", required_argument, NULL, OPTION_FORMAT},
    {"size", required_argument, NULL, OPTION_SIZE},
    {"buffers", required_argument, NULL, OPTION_BUFFERS},
    {"frames", required_argument, NULL, OPTION_FRAMES},
    {"exposure-us", required_argument, NULL, OPTION_EXPOSURE},
    {"row-time-ns", required_argument, NULL, OPTION_ROW_TIME},
    {"region", required_argument, NULL, OPTION_REGION},
    {"binning", required_argument, NULL, OPTION_BINNING},
    {"flip", required_argument, NULL, OPTION_FLIP},
    {"clock", required_argument, NULL, OPTION_CLOCK},
    {"clock-ns", required_argument, NULL, OPTION_CLOCK_NS},
    {"help", no_argument, NULL, OPTION_HELP},
    {"version", no_argument, NULL, OPTION_VERSION},
    {0},
};

/* Reads `count` whole numbers parted by `separator`, each at most `most`, and nothing else. */
static bool read_numbers(const char *text, char separator, unsigned count, uint32_t most,
                         uint32_t out[])
{
    for (unsigned i = 0; i < count; i++) {
        char *end;
        if (*text < '0' || *text > '9') {
            return false;
        }
        errno = 0;
        const unsigned long long number = strtoull(text, &end, 10);
        if (errno != 0 || number > most || *end != (i + 1 < count ? separator : '\0')) {
            return false;
        }
        out[i] = (uint32_t)number;
        text = end + 1;
    }
    return true;
}

static bool take_sensor(struct wire_header *about, int option, const char *value)
{
    uint32_t n[4];
    switch (option) {
    case OPTION_REGION:
        if (!read_numbers(value, ',', 4, 65535, n) || n[2] == 0 || n[3] == 0) {
            return false;
        }
        about->region_x = (uint16_t)n[0];
        about->region_y = (uint16_t)n[1];
        about->region_width = (uint16_t)n[2];
        about->region_height = (uint16_t)n[3];
        return true;
    case OPTION_BINNING:
        if (!read_numbers(value, 'x', 2, 16, n) || n[0] == 0 || n[1] == 0) {
            return false;
        }
        about->binning_x = (uint8_t)n[0];
        about->binning_y = (uint8_t)n[1];
        return true;
    default: /* OPTION_FLIP */
        about->flips = (uint8_t)((strchr(value, 'x') != NULL ? WIRE_FLIP_COLUMNS : 0) |
                                 (strchr(value, 'y') != NULL ? WIRE_FLIP_ROWS : 0));
        return strcmp(value, "x") == 0 || strcmp(value, "y") == 0 || strcmp(value, "xy") == 0;
    }
}

static bool take_clock(struct camera_options *options, const char *value)
{
    static const struct {
        const char *name;
        uint8_t     kind;
    } kinds[] = {
        {"monotonic", WIRE_CLOCK_MONOTONIC},
        {"realtime", WIRE_CLOCK_REALTIME},
        {"tai", WIRE_CLOCK_TAI},
        {"file", WIRE_CLOCK_FILE},
    };
    for (unsigned i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (strcmp(value, kinds[i].name) == 0) {
            options->about.clock_kind = kinds[i].kind;
            options->clock_given = true;
            return true;
        }
    }
    return false;
}

/* One option that is tessera-cam's own; false where its value is no good. */
static bool take_option(struct camera_options *options, int option, const char *value)
{
    uint32_t n[2] = {0};
    switch (option) {
    case OPTION_TO:
        options->to = value;
        return true;
    case OPTION_GIVE_UP:
        if (!read_numbers(value, 0, 1, 1000000, n)) {
            return false;
        }
        options->give_up_ms = n[0] * 1000;
        return true;
    case OPTION_WAIT:
        options->wait = true;
        return true;
    case OPTION_DEVICE:
        options->capture.device = value;
        return true;
    case OPTION_SERIAL:
        options->capture.serial = value;
        return value[0] != '\0' && strlen(value) <= WIRE_SERIAL_BYTES;
    case OPTION_FORMAT:
        options->capture.format = value;
        return true;
    case OPTION_SIZE:
        if (!read_numbers(value, 'x', 2, 8192, n) || n[0] == 0 || n[1] == 0) {
            return false;
        }
        options->capture.width_px = n[0];
        options->capture.height_px = n[1];
        return true;
    case OPTION_BUFFERS:
        return read_numbers(value, 0, 1, 32, &options->capture.buffers) &&
               options->capture.buffers >= 2;
    case OPTION_FRAMES:
        return read_numbers(value, 0, 1, UINT32_MAX, &options->frames) && options->frames > 0;
    case OPTION_EXPOSURE:
        if (!read_numbers(value, 0, 1, 4000000, n)) {
            return false;
        }
        options->capture.exposure_ns = n[0] * 1000;
        return true;
    case OPTION_ROW_TIME:
        return read_numbers(value, 0, 1, 1000000000, &options->capture.row_time_ns);
    case OPTION_CLOCK:
        return take_clock(options, value);
    case OPTION_CLOCK_NS:
        return read_numbers(value, 0, 1, UINT32_MAX - 1, &options->about.clock_uncertainty_ns);
    default:
        return take_sensor(&options->about, option, value);
    }
}

static const char *option_name(int option)
{
    for (unsigned i = 0; options_known[i].name != NULL; i++) {
        if (options_known[i].val == option) {
            return options_known[i].name;
        }
    }
    return "?";
}

enum camera_options_result camera_options_read(int argc, char **argv,
                                               struct camera_options *options)
{
    *options = (struct camera_options){
        .capture.device = "/dev/video0",
        .about.clock_uncertainty_ns = WIRE_CLOCK_UNCERTAINTY_UNKNOWN,
        .give_up_ms = 10000,
    };
    detector_options_init(&options->detector);
    int option;
    while ((option = getopt_long(argc, argv, "", options_known, NULL)) != -1) {
        if (option == OPTION_HELP) {
            (void)fputs(help, stdout);
            return CAMERA_OPTIONS_DONE;
        } else if (option == OPTION_VERSION) {
            (void)puts("tessera-cam " TESSERA_VERSION);
            return CAMERA_OPTIONS_DONE;
        } else if (option == '?') {
            return CAMERA_OPTIONS_USAGE; /* getopt has said why */
        } else if (option >= DETECTOR_OPTION_TARGET) {
            char error[TARGETFILE_ERROR_BYTES];
            bool usage;
            if (!detector_options_take(&options->detector, option, optarg, &usage, error)) {
                (void)fprintf(stderr, "tessera-cam: %s\n", error);
                return usage ? CAMERA_OPTIONS_USAGE : CAMERA_OPTIONS_FAILED;
            }
        } else if (!take_option(options, option, optarg)) {
            (void)fprintf(stderr, "tessera-cam: --%s %s is not a value for this option; see "
                                  "tessera-cam --help\n", option_name(option), optarg);
            return CAMERA_OPTIONS_USAGE;
        }
    }
    if (optind < argc) {
        (void)fprintf(stderr, "tessera-cam: %s is no option; see tessera-cam --help\n",
                      argv[optind]);
        return CAMERA_OPTIONS_USAGE;
    }
    if (options->to == NULL) {
        (void)fprintf(stderr, "tessera-cam: --to HOST:PORT is missing: who receives the packets?\n");
        return CAMERA_OPTIONS_USAGE;
    }
    options->about.exposure_ns = options->capture.exposure_ns;
    options->about.row_time_ns = options->capture.row_time_ns;
    return CAMERA_OPTIONS_RUN;
}
