/* The V4L2 backend: which devices and formats it takes, how a stream ends, and that nothing
 * leaks. */
#include "tests/unit/fake_v4l2.h"

/* Opening fails with a sentence that names the device and this word, and leaks nothing. */
static void refuses(const struct capture_options *options, const char *word)
{
    struct capture *const capture = fresh();
    TEST_ASSERT_FALSE(capture_open(capture, options));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(capture->sentence, "/dev/video7: "), capture->sentence);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(capture->sentence, word), capture->sentence);
    TEST_ASSERT_EQUAL_INT(0, fake.open_count);
    TEST_ASSERT_EQUAL_INT(0, fake.mapped);
}

static void no_frame_in_time_is_no_failure(void)
{
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    fake.wait_answer = 0;
    TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
    fake.wait_answer = 1;
    fake.arrival_count = 0;
    TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
    capture_close(capture);
}

static void the_ways_to_end_are_told_apart(void)
{
    static const struct {
        int                 error;
        enum capture_status status;
        const char         *word;
    } ends[] = {
        { EPIPE, CAPTURE_ENDED, "ended" },
        { ENODEV, CAPTURE_UNPLUGGED, "unplugged" },
        { EINVAL, CAPTURE_FAILED, "stopped" },
    };
    for (int i = 0; i < 3; i++) {
        setUp();
        fake.arrivals[0].error = ends[i].error;
        struct capture *const capture = started(&plain);
        struct frame_view frame;
        TEST_ASSERT_EQUAL_INT(ends[i].status, capture_next(capture, 10, &frame));
        TEST_ASSERT_NOT_NULL(strstr(capture->sentence, ends[i].word));
        capture_close(capture);
        TEST_ASSERT_EQUAL_INT(0, fake.open_count);
    }
}

static void a_passing_fault_passes_and_a_lasting_one_ends(void)
{
    fake.arrivals[0].error = EIO;
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    capture_release(capture);
    fake.wait_answer = -EIO;
    fake.arrival_count = 0;
    enum capture_status status = CAPTURE_NONE;
    for (int i = 0; i < 1000 && status == CAPTURE_NONE; i++) {
        status = capture_next(capture, 10, &frame);
    }
    TEST_ASSERT_EQUAL_INT(CAPTURE_FAILED, status);
    capture_close(capture);
}

static void an_index_that_is_not_ours_is_a_failure(void)
{
    fake.dequeued_index = 20;
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_FAILED, capture_next(capture, 10, &frame));
    capture_close(capture);
}

static void a_camera_unplugged_while_a_frame_is_out_is_told_next(void)
{
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    fake.fail_call = fake.calls + 1;
    fake.fail_error = ENODEV;
    capture_release(capture);
    TEST_ASSERT_EQUAL_INT(CAPTURE_UNPLUGGED, capture_next(capture, 10, &frame));
    capture_close(capture);
}

static void the_wanted_format_is_chosen_then_the_present_then_the_first(void)
{
    struct capture_options options = plain;
    options.format = "YUYV";
    fake.buffer_flags = 0;
    struct capture *capture = started(&options);
    TEST_ASSERT_EQUAL_INT(FRAME_YUYV, capture->info.format);
    TEST_ASSERT_EQUAL_UINT32(32, capture->info.stride_bytes);
    capture_close(capture);
    capture = started(&plain);
    TEST_ASSERT_EQUAL_INT(FRAME_GREY8, capture->info.format);
    capture_close(capture);
    fake.pix.pixelformat = V4L2_PIX_FMT_MJPEG;
    capture = started(&plain);
    TEST_ASSERT_EQUAL_INT(FRAME_YUYV, capture->info.format);
    capture_close(capture);
}

static void every_format_has_its_size(void)
{
    static const struct {
        const char       *name;
        uint32_t          fourcc;
        enum frame_format format;
        uint32_t          frame_bytes; /* of 16 x 8 pixels */
    } all[] = {
        { "GREY", V4L2_PIX_FMT_GREY, FRAME_GREY8, 128 },
        { "Y10", V4L2_PIX_FMT_Y10, FRAME_GREY10, 256 },
        { "Y12", V4L2_PIX_FMT_Y12, FRAME_GREY12, 256 },
        { "Y16", V4L2_PIX_FMT_Y16, FRAME_GREY16, 256 },
        { "YUYV", V4L2_PIX_FMT_YUYV, FRAME_YUYV, 256 },
        { "UYVY", V4L2_PIX_FMT_UYVY, FRAME_UYVY, 256 },
        { "NV12", V4L2_PIX_FMT_NV12, FRAME_NV12, 192 },
    };
    for (uint32_t i = 0; i < 7; i++) {
        setUp();
        struct capture_options options = plain;
        options.format = all[i].name;
        fake.offered[2] = all[i].fourcc;
        fake.offered_count = 3;
        fake.arrivals[0].bytes_used = all[i].frame_bytes;
        fake.arrivals[1].bytes_used = all[i].frame_bytes - 1;
        struct capture *const capture = started(&options);
        struct frame_view frame;
        TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
        TEST_ASSERT_EQUAL_INT(all[i].format, frame.format);
        capture_release(capture);
        TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
        capture_close(capture);
    }
}

static void what_cannot_be_opened_gets_a_sentence(void)
{
    static const struct {
        int         error;
        const char *word;
    } all[] = {
        { ENOENT, "no such device" }, { ENODEV, "no such device" }, { EACCES, "group" },
        { EBUSY, "another program" }, { EMFILE, "some reason" },
    };
    for (int i = 0; i < 5; i++) {
        setUp();
        fake.open_error = all[i].error;
        refuses(&plain, all[i].word);
    }
}

static void what_is_no_camera_gets_a_sentence(void)
{
    fake.fail_call = 2;
    fake.fail_error = ENOTTY;
    refuses(&plain, "not a V4L2 device");
    setUp();
    fake.device.device_caps = V4L2_CAP_STREAMING;
    fake.device.capabilities |= V4L2_CAP_DEVICE_CAPS;
    refuses(&plain, "does not capture");
    setUp();
    fake.device.capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
    refuses(&plain, "several planes");
    setUp();
    fake.device.capabilities = V4L2_CAP_VIDEO_CAPTURE;
    refuses(&plain, "cannot stream");
}

static void a_format_or_size_that_is_not_offered_is_listed(void)
{
    struct capture_options options = plain;
    options.format = "Y12";
    refuses(&options, "does not offer Y12; it offers: YUYV GREY");
    setUp();
    fake.offered[0] = V4L2_PIX_FMT_MJPEG;
    fake.offered_count = 1;
    refuses(&plain, "but: MJPG");
    setUp();
    fake.offered_count = 0;
    refuses(&plain, "nothing");
    setUp();
    options = plain;
    options.width_px = 20;
    options.height_px = 10;
    fake.fixed_width = 16;
    fake.fixed_height = 8;
    refuses(&options, "20x10; nearest is 16x8, all are: 16x8 32x16");
}

static void answers_that_make_no_sense_are_refused(void)
{
    fake.pretend_fourcc = V4L2_PIX_FMT_MJPEG;
    refuses(&plain, "does not deliver");
    setUp();
    fake.pretend_stride = 15;
    refuses(&plain, "row length");
    setUp();
    fake.pretend_stride = UINT32_MAX;
    refuses(&plain, "row length");
    setUp();
    fake.pix.width = 70000;
    refuses(&plain, "out of range");
    setUp();
    fake.pix.height = 0;
    refuses(&plain, "out of range");
    setUp();
    fake.pix.field = V4L2_FIELD_INTERLACED;
    refuses(&plain, "interlaced");
    setUp();
    fake.buffer_bytes = 127;
    refuses(&plain, "hold no frame");
    setUp();
    fake.buffers_given = 1;
    refuses(&plain, "two buffers");
}

static void more_buffers_than_we_keep_are_left_to_the_driver(void)
{
    fake.buffers_given = 40;
    struct capture *const capture = started(&plain);
    TEST_ASSERT_EQUAL_INT(V4L2_BUFFERS_MAX, fake.mapped);
    capture_close(capture);
    struct capture_options options = plain;
    options.buffers = 33;
    refuses(&options, "2..32");
}

static void the_serial_is_the_users_or_the_devices(void)
{
    struct capture_options options = plain;
    options.serial = "left\tcamera with a name that is far too long for it";
    struct capture *capture = started(&options);
    TEST_ASSERT_EQUAL_STRING("left_camera_with_a_name_that_is_", capture->info.serial);
    capture_close(capture);
    fake.device.bus_info[0] = 0;
    capture = started(&plain);
    TEST_ASSERT_EQUAL_STRING("Some_Camera", capture->info.serial);
    capture_close(capture);
    fake.device.card[0] = 0;
    capture = started(&plain);
    TEST_ASSERT_EQUAL_STRING("/dev/video7", capture->info.serial);
    capture_close(capture);
}

/* One session of three frames; true when all went well. */
static bool session(void)
{
    struct capture *const capture = fresh();
    bool fine = capture_open(capture, &plain);
    if (fine) {
        fine = capture_start(capture);
        for (int i = 0; fine && i < 3; i++) {
            struct frame_view frame;
            fine = capture_next(capture, 10, &frame) == CAPTURE_FRAME;
            if (fine) {
                capture_release(capture);
            }
        }
        capture_close(capture);
    }
    return fine;
}

static void each_call_may_fail_and_nothing_leaks(void)
{
    static const int errors[] = { EIO, ENODEV, EBUSY, ENOMEM };
    for (int e = 0; e < 4; e++) {
        int failed = 0;
        int n = 0;
        do {
            setUp();
            n++;
            fake.fail_call = n;
            fake.fail_error = errors[e];
            const bool fine = session();
            TEST_ASSERT_EQUAL_INT(0, fake.open_count);
            TEST_ASSERT_EQUAL_INT(0, fake.mapped);
            failed += fine ? 0 : 1;
            /* What ends a session without a frame must say why; EIO may also just pass. */
            if (!fine && errors[e] != EIO) {
                TEST_ASSERT_TRUE(strlen(camera.base.sentence) > 0);
            }
        } while (fake.calls >= n);
        /* Open, QUERYCAP, G_FMT, S_FMT, REQBUFS, four times QUERYBUF and map, four times QBUF,
         * STREAMON, three times wait, DQBUF and QBUF: 27 calls. The last QBUF's failure would be
         * told by a next that does not come; a wait in error (EIO) still dequeues. */
        TEST_ASSERT_EQUAL_INT(27, n - 1);
        TEST_ASSERT_EQUAL_INT(errors[e] == EIO ? 23 : 26, failed);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(no_frame_in_time_is_no_failure);
    RUN_TEST(the_ways_to_end_are_told_apart);
    RUN_TEST(a_passing_fault_passes_and_a_lasting_one_ends);
    RUN_TEST(an_index_that_is_not_ours_is_a_failure);
    RUN_TEST(a_camera_unplugged_while_a_frame_is_out_is_told_next);
    RUN_TEST(the_wanted_format_is_chosen_then_the_present_then_the_first);
    RUN_TEST(every_format_has_its_size);
    RUN_TEST(what_cannot_be_opened_gets_a_sentence);
    RUN_TEST(what_is_no_camera_gets_a_sentence);
    RUN_TEST(a_format_or_size_that_is_not_offered_is_listed);
    RUN_TEST(answers_that_make_no_sense_are_refused);
    RUN_TEST(more_buffers_than_we_keep_are_left_to_the_driver);
    RUN_TEST(the_serial_is_the_users_or_the_devices);
    RUN_TEST(each_call_may_fail_and_nothing_leaks);
    return UNITY_END();
}
