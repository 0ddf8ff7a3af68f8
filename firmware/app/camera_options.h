/* tessera-cam's command line. */
#ifndef TESSERA_FIRMWARE_APP_CAMERA_OPTIONS_H
#define TESSERA_FIRMWARE_APP_CAMERA_OPTIONS_H

#include "firmware/app/detector_options.h"
#include "firmware/capture/capture.h"

struct camera_options {
    struct detector_options detector;
    struct capture_options  capture;
    /* What the sensor's driver cannot say and the user may know; the rest stays 0. */
    struct wire_header      about;
    const char             *to;
    uint32_t                frames;     /* stop after so many; 0: never        */
    uint32_t                give_up_ms; /* without a receiver; 0: never        */
    bool                    wait;       /* hold the source rather than drop packets */
    bool                    clock_given;
};

enum camera_options_result {
    CAMERA_OPTIONS_RUN,
    CAMERA_OPTIONS_DONE,   /* help or version was printed: exit 0           */
    CAMERA_OPTIONS_USAGE,  /* wrong use: exit 2, the sentence was printed   */
    CAMERA_OPTIONS_FAILED, /* a file is at fault: exit 1, sentence printed */
};

/* Reads the command line into *options, which stays at its place: settings point into it. */
enum camera_options_result camera_options_read(int argc, char **argv,
                                               struct camera_options *options);

#endif
