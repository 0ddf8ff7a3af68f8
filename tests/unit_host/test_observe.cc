// From journals and targets to observations: which packets make a frame, and whose point is whose.
#include "host/obs/observe.h"

#include <stdlib.h>

#include <cstdio>
#include <fstream>

#include "common/wire/wire.h"
#include "host/journal/journal.h"
#include "unity.h"

using namespace rig;

namespace {

std::string folder;
std::vector<std::string> made;

std::string path_of(const std::string& name)
{
    made.push_back(folder + "/" + name);
    return made.back();
}

std::string make_target(const std::string& name, const std::string& ids, const std::string& turns = "[[0, 0]]")
{
    const std::string path = path_of(name);
    std::ofstream(path) << R"({"format": "tessera-target", "version": 1, "rows": 1, "cols": 2, "patch_mm": 50.0,)"
                        << R"("ids": )" << ids << R"(, "turns": )" << turns << "}";
    return path;
}

struct Shot {
    std::string camera;
    std::int64_t t_ns;
    std::uint16_t patch = 7;
    std::uint32_t number = 0;
    double x = 100.25;
    double y = 50.5;
    std::uint32_t row_time_ns = 0;
};

std::vector<std::uint8_t> packet_of(const Shot& shot)
{
    wire_header header = {};
    std::snprintf(header.camera_serial, sizeof header.camera_serial, "%s", shot.camera.c_str());
    header.t_capture_ns = shot.t_ns;
    header.packet_index = shot.number;
    header.clock_kind = WIRE_CLOCK_MONOTONIC;
    header.row_time_ns = shot.row_time_ns;
    header.width_px = 640;
    header.height_px = 480;
    wire_feature feature = {};
    feature.index = 3;
    feature.x_px_q16 = static_cast<std::int32_t>(shot.x * 65536);
    feature.y_px_q16 = static_cast<std::int32_t>(shot.y * 65536);
    feature.sigma_px_q24 = 1 << 18;  // 2^-6 px: code 15 exactly
    feature.size_px_q16 = 8 << 16;
    std::vector<std::uint8_t> bytes(400);
    wire_writer writer;
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_begin(&writer, bytes.data(), bytes.size(), &header));
    TEST_ASSERT_EQUAL_INT(WIRE_OK, wire_put_patch(&writer, shot.patch, &feature, 1));
    bytes.resize(wire_finish(&writer));
    return bytes;
}

std::string make_journal(const std::string& name, const std::vector<Shot>& shots)
{
    const std::string path = path_of(name);
    auto writer = JournalWriter::create(path);
    TEST_ASSERT_TRUE(writer.ok());
    for (const Shot& shot : shots) {
        const std::vector<std::uint8_t> bytes = packet_of(shot);
        TEST_ASSERT_TRUE(writer.value().write(1, 1, "peer", bytes.data(), bytes.size()).ok());
    }
    TEST_ASSERT_TRUE(writer.value().close().ok());
    return path;
}

Scene observed(const std::vector<std::string>& journals, const std::vector<std::string>& targets,
               std::int64_t tolerance_ns = -1)
{
    ObserveOptions options;
    options.tolerance_ns = tolerance_ns;
    Result<Scene> scene = observe(journals, targets, options);
    TEST_ASSERT_TRUE_MESSAGE(scene.ok(), scene.ok() ? "" : scene.sentence().c_str());
    return scene.value();
}

void row_times_and_stamps_within_an_instant_are_kept()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const Scene scene = observed({make_journal("j", {{"left", 1000, 7, 0, 9.0, 9.0, 12000},
                                                     {"right", 1400, 7, 0, 9.0, 9.0, 0},
                                                     {"left", 900000, 7, 1, 9.0, 9.0, 12000}})},
                                 {target}, 500);
    TEST_ASSERT_TRUE(scene.cameras[0].row_time_ns == 12000.0 && !scene.cameras[0].estimate_row_time);
    TEST_ASSERT_TRUE(scene.cameras[1].row_time_ns == 0.0);
    TEST_ASSERT_EQUAL_INT64(0, scene.stamps_ns.at({0, 0}));
    TEST_ASSERT_EQUAL_INT64(400, scene.stamps_ns.at({1, 0}));
    TEST_ASSERT_EQUAL_INT64(0, scene.stamps_ns.at({0, 1}));
}

void a_camera_that_changes_its_row_time_is_refused()
{
    const std::string journal = make_journal("j", {{"left", 1000, 7, 0, 9.0, 9.0, 12000},
                                                   {"left", 2000, 7, 1, 9.0, 9.0, 13000}});
    const Result<Scene> scene = observe({journal}, {make_target("t.json", "[[7, 9]]")}, ObserveOptions());
    TEST_ASSERT_FALSE(scene.ok());
    TEST_ASSERT_EQUAL_STRING("camera 'left' changed its row time from 12000 to 13000 ns: solve recordings of each "
                             "apart", scene.sentence().c_str());
}

void a_feature_becomes_an_observation_of_its_board_point()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const Scene scene = observed({make_journal("j", {{"left", 1000, 9}})}, {target});
    TEST_ASSERT_EQUAL_UINT(1, scene.cameras.size());
    TEST_ASSERT_EQUAL_STRING("left", scene.cameras[0].name.c_str());
    TEST_ASSERT_EQUAL_INT(640, scene.cameras[0].width_px);
    TEST_ASSERT_EQUAL_INT(480, scene.cameras[0].height_px);
    TEST_ASSERT_EQUAL_UINT(1, scene.observations.size());
    const Observation& seen = scene.observations[0];
    TEST_ASSERT_EQUAL_INT64(0, seen.frame);
    // Quarters of a pixel are whole steps of the wire's 2^-13 px at this width.
    TEST_ASSERT_TRUE(seen.pixel.x() == 100.25 && seen.pixel.y() == 50.5);
    TEST_ASSERT_TRUE(seen.sigma_px > 0.0155 && seen.sigma_px < 0.0157);
    const BoardPoint& point = scene.boards[0].points[seen.point];
    TEST_ASSERT_EQUAL_INT64(9 * 128 + 3, point.id);
    // TARGET.md: feature 3, bit 2, is the third circle (3/4, h) of quarter 1: turned once (1 - h, 3/4); the
    // second patch's u begins at 50 mm; the radius is half of its inradius h.
    const double h = 0.10355339059327379;
    TEST_ASSERT_TRUE(std::abs(point.at_mm.x() - 50 * (2 - h)) < 1e-6);
    TEST_ASSERT_TRUE(std::abs(point.at_mm.y() - 50 * 0.75) < 1e-6);
    TEST_ASSERT_TRUE(std::abs(point.radius_mm - 50 * h / 2) < 1e-6);
    TEST_ASSERT_TRUE(scene.boards[0].faces_minus_z);
}

void a_turned_patch_has_its_points_turned()
{
    const std::string target = make_target("t.json", "[[7, 9]]", "[[0, 1]]");
    const Scene scene = observed({make_journal("j", {{"left", 1000, 9}})}, {target});
    const BoardPoint& point = scene.boards[0].points[scene.observations[0].point];
    const double h = 0.10355339059327379;
    TEST_ASSERT_TRUE(std::abs(point.at_mm.x() - 50 * (1 + h)) < 1e-6);
    TEST_ASSERT_TRUE(std::abs(point.at_mm.y() - 50 * 0.25) < 1e-6);
}

void cameras_are_sorted_by_name_and_instants_by_time()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const Scene scene = observed({make_journal("j", {{"right", 2'000'300, 7, 1},
                                                     {"left", 2'000'000, 7, 1},
                                                     {"right", 1'000'000, 7, 0},
                                                     {"left", 1'000'200, 7, 0},
                                                     {"left", 3'000'000, 7, 2}})},
                                 {target});
    TEST_ASSERT_EQUAL_STRING("left", scene.cameras[0].name.c_str());
    TEST_ASSERT_EQUAL_STRING("right", scene.cameras[1].name.c_str());
    const int cameras[] = {0, 0, 0, 1, 1};
    const std::int64_t frames[] = {0, 1, 2, 0, 1};
    TEST_ASSERT_EQUAL_UINT(5, scene.observations.size());
    for (std::size_t i = 0; i < 5; ++i) {
        TEST_ASSERT_EQUAL_INT(cameras[i], scene.observations[i].camera);
        TEST_ASSERT_EQUAL_INT64(frames[i], scene.observations[i].frame);
    }
}

void the_tolerance_given_decides_what_is_one_instant()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const std::string journal = make_journal("j", {{"a", 1000}, {"b", 1500}});
    TEST_ASSERT_EQUAL_INT64(0, observed({journal}, {target}, 500).observations[1].frame);
    TEST_ASSERT_EQUAL_INT64(1, observed({journal}, {target}, 499).observations[1].frame);
    TEST_ASSERT_EQUAL_INT64(1, observed({journal}, {target}, 0).observations[1].frame);
}

void the_same_packet_from_two_journals_counts_once()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const Shot shot{"a", 1000, 7, 5};
    Shot next = shot;
    next.number = 6;
    next.t_ns = 90'000'000;
    const Scene scene =
        observed({make_journal("j", {shot, next, shot}), make_journal("k", {shot})}, {target});
    TEST_ASSERT_EQUAL_UINT(2, scene.observations.size());
    TEST_ASSERT_EQUAL_UINT(2, scene.rejected.at("packet that came twice"));
    TEST_ASSERT_EQUAL_UINT(3, scene.inputs.size());
}

void patches_belong_to_the_target_that_has_them()
{
    const std::string first = make_target("t.json", "[[7, 9]]");
    const std::string second = make_target("u.json", "[[11, 13]]");
    const std::string journal =
        make_journal("j", {{"a", 0, 13, 0}, {"a", 1'000'000, 7, 1}, {"a", 2'000'000, 8, 2}});
    const Scene scene = observed({journal}, {first, second});
    TEST_ASSERT_EQUAL_UINT(2, scene.boards.size());
    TEST_ASSERT_EQUAL_UINT(2, scene.observations.size());
    TEST_ASSERT_EQUAL_INT(1, scene.observations[0].board);
    TEST_ASSERT_EQUAL_INT(0, scene.observations[1].board);
    TEST_ASSERT_EQUAL_UINT(1, scene.rejected.at("patch on none of the targets"));
}

void records_that_hold_no_packet_are_counted_and_passed_over()
{
    const std::string target = make_target("t.json", "[[7, 9]]");
    const std::string journal = make_journal("j", {{"left", 1000, 9}});
    auto writer = JournalWriter::append(journal);
    TEST_ASSERT_TRUE(writer.ok());
    const std::uint8_t one = 7;
    TEST_ASSERT_TRUE(writer.value().write(1, 1, "peer", &one, 0).ok());
    TEST_ASSERT_TRUE(writer.value().write(1, 1, "peer", &one, 1).ok());
    TEST_ASSERT_TRUE(writer.value().close().ok());
    Scene scene = observed({journal}, {target});
    TEST_ASSERT_EQUAL_UINT(1, scene.observations.size());
    TEST_ASSERT_EQUAL_UINT(2, scene.rejected["packet that does not decode"]);
}

void what_cannot_be_put_together_is_refused_with_names()
{
    const std::string first = make_target("t.json", "[[7, 9]]");
    const std::string second = make_target("u.json", "[[9, 13]]");
    const std::string journal = make_journal("j", {{"a", 0}});
    const ObserveOptions options;
    const std::string shared = observe({journal}, {first, second}, options).sentence();
    TEST_ASSERT_TRUE(shared.find("u.json") != std::string::npos);
    TEST_ASSERT_TRUE(shared.find("patch 9") != std::string::npos);
    const std::string empty = observe({make_journal("k", {})}, {first}, options).sentence();
    TEST_ASSERT_TRUE(empty.find("k holds no packets") != std::string::npos);
    TEST_ASSERT_TRUE(observe({folder + "/none"}, {first}, options).sentence().find("none")
                     != std::string::npos);
}

}  // namespace

void setUp()
{
    char name[] = "/tmp/test_observe_XXXXXX";
    TEST_ASSERT_NOT_NULL(mkdtemp(name));
    folder = name;
}

void tearDown()
{
    for (const std::string& path : made) {
        std::remove(path.c_str());
    }
    made.clear();
    std::remove(folder.c_str());
}

int main()
{
    UNITY_BEGIN();
    RUN_TEST(a_feature_becomes_an_observation_of_its_board_point);
    RUN_TEST(row_times_and_stamps_within_an_instant_are_kept);
    RUN_TEST(a_camera_that_changes_its_row_time_is_refused);
    RUN_TEST(a_turned_patch_has_its_points_turned);
    RUN_TEST(cameras_are_sorted_by_name_and_instants_by_time);
    RUN_TEST(the_tolerance_given_decides_what_is_one_instant);
    RUN_TEST(the_same_packet_from_two_journals_counts_once);
    RUN_TEST(patches_belong_to_the_target_that_has_them);
    RUN_TEST(records_that_hold_no_packet_are_counted_and_passed_over);
    RUN_TEST(what_cannot_be_put_together_is_refused_with_names);
    return UNITY_END();
}
