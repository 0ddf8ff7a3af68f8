/* Whole frames: rendered patches with known truth, all formats, limits, borders, determinism. */
#include "firmware/app/pipeline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "firmware/limits.h"
#include "tests/unit/synth.h"

#define WIDTH  440u
#define HEIGHT 330u
#define BOARD  12u

static struct pipeline pipeline;
static struct target target;
static uint8_t *memory;
static uint8_t bytes[WIDTH * HEIGHT * 2];
static struct synth_image picture; /* the board, blurred, in double */
static struct synth_map map;
static struct synth_patch board[BOARD];
static const struct wire_header about = {.camera_serial = "test", .sequence = 3};

void setUp(void) {}
void tearDown(void)
{
    free(memory);
    memory = NULL;
}

/* A pipeline on memory that holds `junk`, exactly as much as it asks for. */
static void start(unsigned width, unsigned height, const struct pipeline_settings *settings, int junk)
{
    const size_t size = pipeline_bytes((uint16_t)width, (uint16_t)height);
    free(memory);
    memory = malloc(size);
    TEST_ASSERT_NOT_NULL(memory);
    memset(memory, junk, size);
    memset(&pipeline, junk, sizeof pipeline);
    pipeline_init(&pipeline, memory, size, (uint16_t)width, (uint16_t)height, settings);
}

/* Runs a frame and checks that its packet is one. */
static struct wire_packet_view run(const struct frame_view *frame)
{
    struct wire_packet_view view;
    pipeline_run(&pipeline, frame);
    const struct packet *packet = pipeline_packet(&pipeline, &about);
    TEST_ASSERT_NOT_NULL(packet);
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_decode(packet->bytes, packet->used, &view));
    TEST_ASSERT_EQUAL_UINT16(pipeline_truncated(&pipeline), view.header.truncated);
    return view;
}

/* Four by three patches of about 75 px: circles of 4 and 8 px radius. */
static void draw_board(double roll, double tilt)
{
    for (unsigned i = 0; i < BOARD; i++) {
        if (board[i].id == 0) {
            board[i].id = (uint16_t)(100 + 331 * i);
        }
        board[i].col = (int)(i % 4);
        board[i].row = (int)(i / 4);
        board[i].turned = i % 3 == 1;
    }
    map = synth_view(750, 10, roll, tilt, 2, 1.5, WIDTH / 2.0 - 0.3, HEIGHT / 2.0 + 0.2);
    free(picture.pixels);
    picture = synth_image_new(WIDTH, HEIGHT, 210);
    synth_patches(&picture, &map, 2, board, BOARD, 40, 210);
    synth_blur(&picture, 0.8);
}

static void plain_board(double roll, double tilt)
{
    memset(board, 0, sizeof board);
    draw_board(roll, tilt);
}

/* Every feature of the patches in view `expected` is in the packet: returns the root mean square of the
 * centres' errors over both axes, and of errors over sigma in *whitened. */
static double errors(const struct wire_packet_view *view, double *whitened)
{
    struct wire_patch_cursor cursor = wire_patches(view);
    double squares = 0;
    double white = 0;
    unsigned count = 0;
    while (wire_next_patch(&cursor)) {
        const struct synth_patch *patch = NULL;
        for (unsigned i = 0; i < BOARD; i++) {
            patch = board[i].id == cursor.patch_id ? &board[i] : patch;
        }
        TEST_ASSERT_NOT_NULL(patch); /* no wrong id */
        TEST_ASSERT_EQUAL_UINT8(13, cursor.feature_count);
        struct wire_feature f;
        while (wire_next_feature(&cursor, &f)) {
            const struct synth_circle c = synth_feature(&map, 2, patch, f.index);
            const double dx = f.x_px_q16 / 65536.0 - c.x;
            const double dy = f.y_px_q16 / 65536.0 - c.y;
            SYNTH_NEAR(0.3, 0, hypot(dx, dy)); /* the right circle at all */
            const double sigma = f.sigma_px_q24 / 16777216.0;
            squares += dx * dx + dy * dy;
            white += (dx * dx + dy * dy) / (sigma * sigma);
            count++;
        }
    }
    TEST_ASSERT_TRUE(count > 0);
    if (whitened != NULL) {
        *whitened = sqrt(white / (2 * count));
    }
    return sqrt(squares / (2 * count));
}

static void clean_board_is_found_whole_and_centred(void)
{
    static const double views[][2] = {{0, 0}, {0.4, 0.5}, {1.5, 0.8}, {SYNTH_PI, 0.2}, {-2, 0.6}};
    const struct pipeline_settings settings = pipeline_defaults();
    for (unsigned i = 0; i < 5; i++) {
        plain_board(views[i][0], views[i][1]);
        const struct frame_view frame = synth_frame(&picture, FRAME_GREY12, bytes);
        start(WIDTH, HEIGHT, &settings, 0x5a);
        const struct wire_packet_view view = run(&frame);
        TEST_ASSERT_EQUAL_UINT16(0, view.header.truncated);
        TEST_ASSERT_EQUAL_UINT16(BOARD, view.header.patch_count);
        TEST_ASSERT_EQUAL_UINT32(BOARD * 13, view.header.feature_count);
        /* No noise but rounding (1/55 grey level); 16 x 16 points a pixel place an edge to 0.004 px, some 25
         * edge pixels average that to 0.001; blur over the curved edge under perspective moves the
         * centre by some thousandths more. */
        TEST_ASSERT_TRUE(errors(&view, NULL) < 0.01);
    }
}

/* Noise n at contrast C and blur s: an edge pixel's position errs by about n s sqrt(2 pi) / C / 0.8 px; a
 * circle of r = 4 has 25 of them along its edge: sigma = 0.05 px at n = 4, s = 1, C = 130 in the worst case,
 * the radius of 8 less. Whitened errors are 1 if sigma is honest: 156 x 2 values a frame, 3 frames: 2.3 % a
 * sigma; 30 % allows for the codes' steps (4 % RMS), small samples and the model's own approximations. */
static void noisy_board_is_found_and_sigma_is_honest(void)
{
    const struct pipeline_settings settings = pipeline_defaults();
    plain_board(0.4, 0.5);
    double sum = 0;
    for (unsigned i = 0; i < 3; i++) {
        struct synth_image noisy = synth_image_new(WIDTH, HEIGHT, 0);
        memcpy(noisy.pixels, picture.pixels, sizeof(double) * WIDTH * HEIGHT);
        synth_noise(&noisy, 3, 100 + i);
        const struct frame_view frame = synth_frame(&noisy, FRAME_GREY12, bytes);
        start(WIDTH, HEIGHT, &settings, 0x5a);
        const struct wire_packet_view view = run(&frame);
        synth_image_free(&noisy);
        TEST_ASSERT_EQUAL_UINT16(BOARD, view.header.patch_count);
        double whitened;
        TEST_ASSERT_TRUE(errors(&view, &whitened) < 0.05);
        sum += whitened * whitened;
    }
    SYNTH_NEAR(0.3, 1, sqrt(sum / 3));
}

static void every_kernel_size_finds_the_board(void)
{
    struct pipeline_settings settings = pipeline_defaults();
    plain_board(0.4, 0.3);
    const struct frame_view frame = synth_frame(&picture, FRAME_GREY8, bytes);
    for (unsigned radius = 2; radius <= 5; radius++) {
        settings.kernel_radius_px = (uint8_t)radius;
        start(WIDTH, HEIGHT, &settings, 0x5a); /* the same memory must do for all of them */
        const struct wire_packet_view view = run(&frame);
        TEST_ASSERT_EQUAL_UINT16(BOARD, view.header.patch_count);
    }
}

/* The picture in whole 8-bit grey levels has the same value in every format, so it must give the same bytes,
 * whatever the rows' stride and the chroma. */
static void all_formats_and_strides_give_the_same_packet(void)
{
    static uint8_t wide[(WIDTH * 2 + 13) * HEIGHT];
    static uint8_t expected[WIRE_HEADER_BYTES + BOARD * 100];
    size_t size = 0;
    const struct pipeline_settings settings = pipeline_defaults();
    plain_board(0.4, 0.5);
    for (unsigned i = 0; i < WIDTH * HEIGHT; i++) {
        picture.pixels[i] = floor(picture.pixels[i] + 0.5);
    }
    for (int format = FRAME_GREY8; format <= FRAME_NV12; format++) {
        for (unsigned extra = 0; extra <= 13; extra += 13) {
            struct frame_view frame = synth_frame(&picture, (enum frame_format)format, bytes);
            const uint32_t row = frame.stride_bytes;
            memset(wide, 0xee, sizeof wide);
            for (unsigned y = 0; y < HEIGHT; y++) {
                memcpy(wide + y * (row + extra), bytes + y * row, row);
            }
            frame.pixels = wide;
            frame.stride_bytes = row + extra;
            start(WIDTH, HEIGHT, &settings, format * 17);
            const struct wire_packet_view view = run(&frame);
            TEST_ASSERT_EQUAL_UINT16(BOARD, view.header.patch_count);
            if (size == 0) {
                size = pipeline.packet.used;
                TEST_ASSERT_TRUE(size <= sizeof expected);
                memcpy(expected, pipeline.packet.bytes, size);
            }
            TEST_ASSERT_EQUAL_UINT64(size, pipeline.packet.used);
            TEST_ASSERT_EQUAL_MEMORY(expected, pipeline.packet.bytes, size);
        }
    }
}

static void same_frame_gives_the_same_bytes_whatever_came_before(void)
{
    static uint8_t first[WIRE_HEADER_BYTES + BOARD * 100];
    static uint8_t junk[WIDTH * HEIGHT];
    const struct pipeline_settings settings = pipeline_defaults();
    plain_board(0.4, 0.5);
    synth_noise(&picture, 3, 5);
    const struct frame_view frame = synth_frame(&picture, FRAME_GREY8, bytes);
    start(WIDTH, HEIGHT, &settings, 0);
    run(&frame);
    const size_t size = pipeline.packet.used;
    TEST_ASSERT_TRUE(size <= sizeof first);
    memcpy(first, pipeline.packet.bytes, size);

    uint64_t seed = 6;
    for (size_t i = 0; i < sizeof junk; i++) {
        junk[i] = (uint8_t)synth_u64(&seed);
    }
    struct frame_view noise = frame;
    noise.pixels = junk;
    run(&noise);
    run(&frame);
    TEST_ASSERT_EQUAL_UINT64(size, pipeline.packet.used);
    TEST_ASSERT_EQUAL_MEMORY(first, pipeline.packet.bytes, size);

    start(WIDTH, HEIGHT, &settings, 0xff);
    run(&frame);
    TEST_ASSERT_EQUAL_UINT64(size, pipeline.packet.used);
    TEST_ASSERT_EQUAL_MEMORY(first, pipeline.packet.bytes, size);
}

static void wrong_parity_is_refused_in_a_picture(void)
{
    const struct pipeline_settings settings = pipeline_defaults();
    memset(board, 0, sizeof board);
    board[5].bad_parity = true;
    draw_board(0.4, 0.3);
    const struct frame_view frame = synth_frame(&picture, FRAME_GREY8, bytes);
    start(WIDTH, HEIGHT, &settings, 0x5a);
    const struct wire_packet_view view = run(&frame);
    TEST_ASSERT_EQUAL_UINT16(BOARD - 1, view.header.patch_count);
    TEST_ASSERT_TRUE(pipeline.patches.bad_parity >= 1);
    errors(&view, NULL);
}

static void id_seen_twice_is_refused_in_a_picture(void)
{
    const struct pipeline_settings settings = pipeline_defaults();
    memset(board, 0, sizeof board);
    board[2].id = 777;
    board[9].id = 777;
    draw_board(0.4, 0.3);
    const struct frame_view frame = synth_frame(&picture, FRAME_GREY8, bytes);
    start(WIDTH, HEIGHT, &settings, 0x5a);
    const struct wire_packet_view view = run(&frame);
    TEST_ASSERT_EQUAL_UINT16(BOARD - 2, view.header.patch_count);
    TEST_ASSERT_TRUE(pipeline.patches.twice >= 1);
}

static void target_names_itself_in_the_packet_and_refuses_strangers(void)
{
    struct pipeline_settings settings = pipeline_defaults();
    plain_board(0.4, 0.3);
    /* The upper two rows; the third row's patches are strangers. */
    target = (struct target){.rows = 2, .cols = 4, .levels = 2, .circle_ratio_q16 = 32768,
                             .edge_level_q16 = 52429, .gauss_sigma_q16 = 26214, .patch_nm = 100000000};
    for (unsigned i = 0; i < 8; i++) {
        target.ids[i] = board[i].id;
        target.turns[i] = board[i].turned;
    }
    unsigned bad;
    TEST_ASSERT_EQUAL_INT(TARGET_OK, target_prepare(&target, &bad));
    settings.patches.target = &target;
    const struct frame_view frame = synth_frame(&picture, FRAME_GREY8, bytes);
    start(WIDTH, HEIGHT, &settings, 0x5a);
    const struct wire_packet_view view = run(&frame);
    TEST_ASSERT_EQUAL_UINT16(8, view.header.patch_count);
    TEST_ASSERT_TRUE(pipeline.seen_in_full); /* half the size leaves the strangers unexplained */
    TEST_ASSERT_TRUE(pipeline.patches.not_on_target >= 1);
    TEST_ASSERT_EQUAL_HEX64(target_digest(&target), view.header.target_digest);
    TEST_ASSERT_EQUAL_HEX64(pipeline_settings_digest(&settings), view.header.settings_digest);
}

static void settings_digest_names_each_setting_and_not_the_target(void)
{
    const struct pipeline_settings plain = pipeline_defaults();
    struct pipeline_settings other[5] = {plain, plain, plain, plain, plain};
    other[0].kernel_radius_px++;
    other[1].gradient_min_q3++;
    other[2].patches.levels++;
    other[3].patches.circle_ratio_q16++;
    other[4].patches.target = &target;
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE(pipeline_settings_digest(&plain) != pipeline_settings_digest(&other[i]));
    }
    TEST_ASSERT_EQUAL_HEX64(pipeline_settings_digest(&plain), pipeline_settings_digest(&other[4]));
}

static void frames_of_extreme_shapes_run_through(void)
{
    static const uint16_t shapes[][2] = {{1, 1}, {1, 64}, {64, 1}, {2, 3}, {8192, 9}, {9, 8192}};
    const struct pipeline_settings settings = pipeline_defaults();
    for (unsigned i = 0; i < 6; i++) {
        /* Exactly as many bytes as the frame has, so that a sanitizer sees any read beyond. */
        const size_t count = (size_t)shapes[i][0] * shapes[i][1];
        uint8_t *pixels = malloc(count);
        TEST_ASSERT_NOT_NULL(pixels);
        const struct frame_view frame = {.pixels = pixels, .stride_bytes = shapes[i][0],
                                         .width_px = shapes[i][0], .height_px = shapes[i][1],
                                         .format = FRAME_GREY8};
        for (unsigned kind = 0; kind < 3; kind++) {
            uint64_t seed = 7;
            for (size_t k = 0; k < count; k++) {
                pixels[k] = kind == 0 ? 255 : kind == 1 ? (uint8_t)(k % 2 * 255)
                                                        : (uint8_t)synth_u64(&seed);
            }
            start(shapes[i][0], shapes[i][1], &settings, 0xa5);
            const struct wire_packet_view view = run(&frame);
            TEST_ASSERT_EQUAL_UINT16(0, view.header.patch_count);
        }
        free(pixels);
    }
}

/* Patterns between black and white that drive filters and lists to their bounds. */
static void patterns_of_full_contrast_run_through_and_give_no_patch(void)
{
    struct pipeline_settings settings = pipeline_defaults();
    settings.gradient_min_q3 = 64;
    struct frame_view frame = {.pixels = bytes, .stride_bytes = WIDTH * 2, .width_px = WIDTH,
                               .height_px = HEIGHT, .format = FRAME_GREY12};
    uint64_t seed = 8;
    for (unsigned radius = 2; radius <= 5; radius++) {
        settings.kernel_radius_px = (uint8_t)radius;
        start(WIDTH, HEIGHT, &settings, 0x5a);
        for (unsigned kind = 0; kind < 9; kind++) {
            const unsigned period = 1 + kind / 3 * 3;
            for (unsigned i = 0; i < WIDTH * HEIGHT; i++) {
                const unsigned x = i % WIDTH / period;
                const unsigned y = i / WIDTH / period;
                const unsigned odd = kind == 8 ? (unsigned)(synth_u64(&seed) & 1)
                                               : (kind % 3 == 0 ? x : kind % 3 == 1 ? y : x + y) % 2;
                bytes[2 * i] = odd ? 0xff : 0;
                bytes[2 * i + 1] = odd ? 0x0f : 0;
            }
            TEST_ASSERT_EQUAL_UINT16(0, run(&frame).header.patch_count);
        }
    }
}

/* Rings in a tight grid: more contours than ellipses have room for. 17 px a disc is one on 289 px, below the
 * limit of one on 160; at 8 px a disc it is one on 64. */
static void lists_that_are_full_are_named_in_the_packet(void)
{
    enum { SIDE = 1000 };
    const struct pipeline_settings settings = pipeline_defaults();
    uint8_t *pixels = malloc(SIDE * SIDE);
    TEST_ASSERT_NOT_NULL(pixels);
    for (unsigned i = 0; i < SIDE * SIDE; i++) {
        const double x = i % SIDE % 8 - 3.5;
        const double y = i / SIDE % 8 - 3.5;
        pixels[i] = (uint8_t)(128 + 100 * cos(SYNTH_PI * fmin(1, hypot(x, y) / 4)));
    }
    const struct frame_view frame = {.pixels = pixels, .stride_bytes = SIDE, .width_px = SIDE,
                                     .height_px = SIDE, .format = FRAME_GREY8};
    start(SIDE, SIDE, &settings, 0x5a);
    const struct wire_packet_view view = run(&frame);
    TEST_ASSERT_TRUE((view.header.truncated & WIRE_TRUNCATED_ELLIPSES) != 0);
    free(pixels);

    /* Vertical stripes stay open from the first row to the last: more points than the pool has. */
    const unsigned high = 4000;
    const unsigned wide = 256;
    pixels = malloc(high * wide);
    TEST_ASSERT_NOT_NULL(pixels);
    for (unsigned i = 0; i < high * wide; i++) {
        pixels[i] = i % wide / 4 % 2 ? 255 : 0;
    }
    TEST_ASSERT_TRUE(limit_points(256, 4000) < 60u * 4000u);
    const struct frame_view stripes = {.pixels = pixels, .stride_bytes = wide, .width_px = 256,
                                       .height_px = 4000, .format = FRAME_GREY8};
    start(wide, high, &settings, 0x5a);
    TEST_ASSERT_TRUE((run(&stripes).header.truncated & WIRE_TRUNCATED_EDGES) != 0);
    free(pixels);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(clean_board_is_found_whole_and_centred);
    RUN_TEST(noisy_board_is_found_and_sigma_is_honest);
    RUN_TEST(every_kernel_size_finds_the_board);
    RUN_TEST(all_formats_and_strides_give_the_same_packet);
    RUN_TEST(same_frame_gives_the_same_bytes_whatever_came_before);
    RUN_TEST(wrong_parity_is_refused_in_a_picture);
    RUN_TEST(id_seen_twice_is_refused_in_a_picture);
    RUN_TEST(target_names_itself_in_the_packet_and_refuses_strangers);
    RUN_TEST(settings_digest_names_each_setting_and_not_the_target);
    RUN_TEST(frames_of_extreme_shapes_run_through);
    RUN_TEST(patterns_of_full_contrast_run_through_and_give_no_patch);
    RUN_TEST(lists_that_are_full_are_named_in_the_packet);
    free(picture.pixels);
    return UNITY_END();
}
