/* What capture makes of the frames that a device gives: times, gaps, what is not handed out. */
#include "tests/unit/fake_v4l2.h"

static void frames_come_as_views_of_the_drivers_memory(void)
{
    struct capture *const capture = started(&plain);
    TEST_ASSERT_EQUAL_INT(CAPTURE_CLOCK_MONOTONIC, capture->info.clock);
    TEST_ASSERT_EQUAL_STRING("usb-1.2", capture->info.serial);
    for (uint32_t i = 0; i < 9; i++) {
        struct frame_view frame;
        TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
        TEST_ASSERT_TRUE(frame.pixels == fake.memory[i % 4]);
        TEST_ASSERT_EQUAL_INT(FRAME_GREY8, frame.format);
        TEST_ASSERT_EQUAL_UINT16(16, frame.width_px);
        TEST_ASSERT_EQUAL_UINT16(8, frame.height_px);
        TEST_ASSERT_EQUAL_UINT32(16, frame.stride_bytes);
        TEST_ASSERT_EQUAL_UINT32(i, frame.sequence);
        TEST_ASSERT_EQUAL_INT64(1000000000 + 40000000 * (int64_t)i, frame.t_capture_ns);
        capture_release(capture);
    }
    TEST_ASSERT_EQUAL_UINT64(9, capture->counters.frames);
    TEST_ASSERT_EQUAL_UINT64(0, capture->counters.dropped);
    capture_close(capture);
    TEST_ASSERT_EQUAL_INT(0, fake.open_count);
    TEST_ASSERT_EQUAL_INT(0, fake.mapped);
}

static void a_stamp_of_the_start_is_moved_by_half_the_exposure(void)
{
    struct capture_options options = plain;
    options.exposure_ns = 8000000;
    options.row_time_ns = 10000;
    struct capture *const capture = started(&options);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    TEST_ASSERT_EQUAL_INT64(1004000000, frame.t_capture_ns);
    capture_close(capture);
}

static void a_stamp_of_the_end_is_moved_back_to_the_first_row(void)
{
    struct capture_options options = plain;
    options.exposure_ns = 8000000;
    options.row_time_ns = 10000;
    fake.arrivals[0].flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
    struct capture *const capture = started(&options);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    /* Seven rows after the first, and half the exposure. */
    TEST_ASSERT_EQUAL_INT64(1000000000 - 7 * 10000 - 4000000, frame.t_capture_ns);
    capture_close(capture);
}

static void a_clock_that_the_driver_does_not_name_is_unknown(void)
{
    fake.buffer_flags = 0;
    struct capture *const capture = started(&plain);
    TEST_ASSERT_EQUAL_INT(CAPTURE_CLOCK_UNKNOWN, capture->info.clock);
    capture_close(capture);
}

static void gaps_in_the_sequence_are_counted_as_dropped(void)
{
    /* Starts at 5, loses 2, stands still, wraps around with 1 lost, goes back. */
    static const uint32_t sequences[] = { 5, 6, 9, 9, UINT32_MAX, 1, 0 };
    static const uint64_t dropped[] = { 0, 0, 2, 2, 2, 3, 3 };
    struct capture *const capture = started(&plain);
    for (uint32_t i = 0; i < 7; i++) {
        fake.arrivals[i].sequence = sequences[i];
    }
    for (uint32_t i = 0; i < 7; i++) {
        struct frame_view frame;
        TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
        capture_release(capture);
        TEST_ASSERT_EQUAL_UINT64(dropped[i], capture->counters.dropped);
    }
    capture_close(capture);
}

static void broken_frames_are_counted_and_given_back_unseen(void)
{
    fake.arrivals[0].flags |= V4L2_BUF_FLAG_ERROR;
    fake.arrivals[1].bytes_used = 127;
    fake.arrivals[2].bytes_used = 0;
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    for (int i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
    }
    TEST_ASSERT_EQUAL_UINT64(3, capture->counters.broken);
    TEST_ASSERT_EQUAL_UINT64(0xf, fake.queued);
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    TEST_ASSERT_EQUAL_UINT32(3, frame.sequence);
    TEST_ASSERT_EQUAL_UINT64(0, capture->counters.dropped);
    capture_close(capture);
}

static void padding_may_miss_after_the_last_row(void)
{
    fake.pretend_stride = 20;
    fake.arrivals[0].bytes_used = 7 * 20 + 16;
    fake.arrivals[1].bytes_used = 7 * 20 + 15;
    struct capture *const capture = started(&plain);
    struct frame_view frame;
    TEST_ASSERT_EQUAL_INT(CAPTURE_FRAME, capture_next(capture, 10, &frame));
    TEST_ASSERT_EQUAL_UINT32(20, frame.stride_bytes);
    capture_release(capture);
    TEST_ASSERT_EQUAL_INT(CAPTURE_NONE, capture_next(capture, 10, &frame));
    TEST_ASSERT_EQUAL_UINT64(1, capture->counters.broken);
    capture_close(capture);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(frames_come_as_views_of_the_drivers_memory);
    RUN_TEST(a_stamp_of_the_start_is_moved_by_half_the_exposure);
    RUN_TEST(a_stamp_of_the_end_is_moved_back_to_the_first_row);
    RUN_TEST(a_clock_that_the_driver_does_not_name_is_unknown);
    RUN_TEST(gaps_in_the_sequence_are_counted_as_dropped);
    RUN_TEST(broken_frames_are_counted_and_given_back_unseen);
    RUN_TEST(padding_may_miss_after_the_last_row);
    return UNITY_END();
}
