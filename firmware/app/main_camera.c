/* tessera-cam: the device. One thread: take a frame, run the pipeline, offer the packet, give the frame
 * back, let the socket work. All memory is taken before the first frame. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "firmware/app/camera_options.h"
#include "firmware/capture/v4l2.h"
#include "firmware/limits.h"
#include "firmware/net/sender.h"

enum {
    EXIT_USAGE = 2,
    FRAME_WAIT_MS = 200,
    DRAIN_MS = 10000,
    QUEUE_PACKETS = 8, /* of the largest size; of the usual size a hundred and more */
};

static volatile sig_atomic_t stop_asked;

static void ask_stop(int signal_number)
{
    (void)signal_number;
    stop_asked = 1;
}

/* Everything that runs, in one place. */
struct camera {
    struct camera_options options;
    struct v4l2_camera    device;
    struct capture       *capture;
    struct pipeline       pipeline;
    struct sender         sender;
    struct wire_header    about;
    void                 *pipeline_memory;
    uint8_t              *sender_memory;
    uint64_t              features;
    time_t                last_report;
};

static bool say(const char *sentence)
{
    (void)fprintf(stderr, "tessera-cam: %s\n", sentence);
    return false;
}

static bool open_source(struct camera *camera)
{
    camera->capture = v4l2_capture(&camera->device, &v4l2_sys_linux);
    if (!capture_open(camera->capture, &camera->options.capture)) {
        return say(camera->capture->sentence);
    }
    const struct capture_info *info = &camera->capture->info;
    if (info->width_px > LIMIT_SIDE_PX || info->height_px > LIMIT_SIDE_PX) {
        capture_close(camera->capture);
        return say("the camera's frames are larger than 8192 pixels; choose a smaller --size");
    }
    return true;
}

static bool take_memory(struct camera *camera)
{
    const struct capture_info *info = &camera->capture->info;
    const size_t bytes = pipeline_bytes(info->width_px, info->height_px);
    camera->pipeline_memory = malloc(bytes);
    if (camera->pipeline_memory == NULL) {
        return say("not enough memory for frames of this size");
    }
    pipeline_init(&camera->pipeline, camera->pipeline_memory, bytes, info->width_px,
                  info->height_px, detector_options_settings(&camera->options.detector));

    const size_t packet_bytes = camera->pipeline.packet.size;
    const size_t sender_bytes = packet_bytes + QUEUE_PACKETS * (packet_bytes + 4);
    camera->sender_memory = malloc(sender_bytes);
    if (camera->sender_memory == NULL) {
        return say("not enough memory for the queue of packets");
    }
    const struct sender_options sender = {
        .to = camera->options.to,
        .give_up_ms = camera->options.give_up_ms,
        .packet_bytes_max = packet_bytes,
        .memory = camera->sender_memory,
        .memory_bytes = sender_bytes,
    };
    return sender_open(&camera->sender, &sock_sys_linux, &sender) ||
           say(sender_sentence(&camera->sender));
}

/* What every packet of this run says of the camera. */
static void introduce(struct camera *camera)
{
    const struct capture_info *info = &camera->capture->info;
    camera->about = camera->options.about;
    (void)snprintf(camera->about.camera_serial, sizeof camera->about.camera_serial, "%s",
                   info->serial);
    if (!camera->options.clock_given) {
        camera->about.clock_kind = info->clock == CAPTURE_CLOCK_MONOTONIC ? WIRE_CLOCK_MONOTONIC
                                                                         : WIRE_CLOCK_UNKNOWN;
    }
    /* A number of its own for each start: sequence numbers of two starts are never mixed up. */
    if (getrandom(&camera->about.boot_id, sizeof camera->about.boot_id, 0) !=
        (ssize_t)sizeof camera->about.boot_id) {
        camera->about.boot_id = ((uint64_t)time(NULL) << 20) ^ (uint64_t)getpid();
    }
}

static uint32_t cut_u32(uint64_t value)
{
    return value > UINT32_MAX ? UINT32_MAX : (uint32_t)value;
}

static void handle_frame(struct camera *camera, const struct frame_view *frame)
{
    pipeline_run(&camera->pipeline, frame);
    camera->about.sequence = frame->sequence;
    camera->about.t_capture_ns = frame->t_capture_ns;
    camera->about.frames_dropped =
        cut_u32(camera->capture->counters.dropped + camera->capture->counters.broken);
    camera->about.packets_dropped = cut_u32(camera->sender.counters.packets_dropped);
    const struct packet *packet = pipeline_packet(&camera->pipeline, &camera->about);
    capture_release(camera->capture);
    if (packet != NULL) {
        camera->about.packet_index++;
        camera->features += packet->features;
        sender_offer(&camera->sender, packet->bytes, packet->used);
    }
}

static void report(struct camera *camera, bool last)
{
    const time_t now = time(NULL);
    if (!last && (isatty(STDERR_FILENO) == 0 || now == camera->last_report)) {
        return;
    }
    camera->last_report = now;
    const struct capture_counters *frames = &camera->capture->counters;
    const struct sender_counters *packets = &camera->sender.counters;
    (void)fprintf(stderr,
                  "%s%s: %llu frames (%llu dropped, %llu broken), %llu features, %llu packets sent "
                  "(%llu dropped)%s",
                  isatty(STDERR_FILENO) != 0 ? "\r" : "", camera->about.camera_serial,
                  (unsigned long long)frames->frames, (unsigned long long)frames->dropped,
                  (unsigned long long)frames->broken, (unsigned long long)camera->features,
                  (unsigned long long)packets->packets_sent,
                  (unsigned long long)packets->packets_dropped, last ? "\n" : "");
}

/* True when the run ended in good order. */
static bool run(struct camera *camera)
{
    const size_t packet_bytes = camera->pipeline.packet.size;
    while (stop_asked == 0) {
        if (camera->options.frames > 0 &&
            camera->capture->counters.frames >= camera->options.frames) {
            return true;
        }
        const bool full = camera->options.wait && !sender_has_room(&camera->sender, packet_bytes);
        if (!sender_poll(&camera->sender, full ? FRAME_WAIT_MS : 0)) {
            return say(sender_sentence(&camera->sender));
        }
        if (full) {
            continue;
        }
        struct frame_view frame;
        switch (capture_next(camera->capture, FRAME_WAIT_MS, &frame)) {
        case CAPTURE_FRAME:
            handle_frame(camera, &frame);
            report(camera, false);
            break;
        case CAPTURE_NONE:
            break;
        case CAPTURE_ENDED:
            return true;
        case CAPTURE_UNPLUGGED:
        case CAPTURE_FAILED:
            return say(camera->capture->sentence);
        }
    }
    return true;
}

/* Sends what waits; the packets of a run that ended badly count too. */
static bool deliver(struct camera *camera)
{
    if (camera->sender.state == SENDER_GAVE_UP) {
        return false;
    }
    if (sender_drain(&camera->sender, DRAIN_MS)) {
        return true;
    }
    const char *why = sender_sentence(&camera->sender);
    return say(why[0] != '\0' ? why : "the receiver did not take the last packets in ten seconds");
}

int main(int argc, char **argv)
{
    static struct camera camera; /* large: not for the stack */
    switch (camera_options_read(argc, argv, &camera.options)) {
    case CAMERA_OPTIONS_DONE:
        return EXIT_SUCCESS;
    case CAMERA_OPTIONS_USAGE:
        return EXIT_USAGE;
    case CAMERA_OPTIONS_FAILED:
        return EXIT_FAILURE;
    case CAMERA_OPTIONS_RUN:
        break;
    }
    const struct sigaction stop = {.sa_handler = ask_stop};
    (void)sigaction(SIGINT, &stop, NULL);
    (void)sigaction(SIGTERM, &stop, NULL);
    (void)signal(SIGPIPE, SIG_IGN);

    if (!open_source(&camera)) {
        return EXIT_FAILURE;
    }
    bool good = take_memory(&camera);
    if (good) {
        introduce(&camera);
        good = capture_start(camera.capture) || say(camera.capture->sentence);
        good = good && run(&camera);
        good = deliver(&camera) && good;
        report(&camera, true);
        sender_close(&camera.sender);
    }
    capture_close(camera.capture);
    free(camera.pipeline_memory);
    free(camera.sender_memory);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
