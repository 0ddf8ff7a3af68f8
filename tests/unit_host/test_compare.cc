// Two calibrations of one rig, and of a rig that changed between them.
// TESSERA_DRAWS: twice as many as pairs; 60 where not given.
#include "host/report/compare.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/unit_host/small_rig.h"

using namespace rig;

void setUp() {}
void tearDown() {}

namespace {

Comparison compare_or_fail(const RigFile& a, const RigFile& b)
{
    const Result<Comparison> out = compare_rigs(a, b, CompareOptions());
    TEST_ASSERT_TRUE_MESSAGE(out.ok(), out.ok() ? "" : out.sentence().c_str());
    return out.value();
}

// Boards lie elsewhere in the second calibration.
RigState other_boards(const RigState& state, std::mt19937* random)
{
    RigState out = state;
    out.rig_from_body = small_rig::truth(random).rig_from_body;
    return out;
}

void two_calibrations_of_one_rig_differ_as_their_covariances_say()
{
    std::mt19937 random(31);
    const RigState state = small_rig::truth(&random);
    std::vector<double> chances;
    double pixels = 0.0;
    double millimetres = 0.0;
    int differ = 0;
    const int pairs = std::max(2, small_rig::draws() / 2);
    for (int pair = 0; pair < pairs; ++pair) {
        const RigFile a = small_rig::calibrated(state, &random);
        const Comparison found =
            compare_or_fail(a, small_rig::calibrated(other_boards(state, &random), &random));
        differ += found.differs ? 1 : 0;
        millimetres += std::pow(found.parts[0].rms_mm / found.parts[0].allowed_mm, 2) / pairs;
        for (const CameraComparison& camera : found.parts[0].cameras) {
            chances.push_back(camera.rig.chance);
            chances.push_back(camera.lens.chance);
            pixels += std::pow(camera.rig.rms_px / camera.rig.allowed_px, 2) / (3.0 * pairs);
        }
    }
    std::sort(chances.begin(), chances.end());
    const auto tenth = static_cast<double>(std::lower_bound(chances.begin(), chances.end(), 0.1)
                                           - chances.begin()) / static_cast<double>(chances.size());
    const double median = chances[chances.size() / 2];
    std::printf("differences squared over allowed squared: %.3f px, %.3f mm; chances below 0.1: %.3f, median "
                "%.3f; called different: %d of %d\n", pixels, millimetres, tenth, median, differ, pairs);
    // A pair gives some three independent chances, for lens and rig of a camera go together and cameras
    // share boards: the part below 0.1 scatters by sqrt(0.09 / (3 pairs)), the median by sqrt(0.25 / (3
    // pairs)); four of these. Squares are dominated by some four directions a camera: sqrt(2 / (4 pairs)).
    TEST_ASSERT_TRUE(std::abs(tenth - 0.1) < 4.0 * std::sqrt(0.09 / (3.0 * pairs)));
    TEST_ASSERT_TRUE(std::abs(median - 0.5) < 4.0 * std::sqrt(0.25 / (3.0 * pairs)));
    TEST_ASSERT_TRUE(std::abs(pixels - 1.0) < 4.0 * std::sqrt(2.0 / (4.0 * pairs)));
    TEST_ASSERT_TRUE(std::abs(millimetres - 1.0) < 4.0 * std::sqrt(2.0 / (4.0 * pairs)));
    // Once in a thousand pairs.
    TEST_ASSERT_TRUE(differ <= 1 + pairs / 250);
}

void a_camera_that_moved_is_named_with_how_far_and_no_other()
{
    std::mt19937 random(32);
    const RigState state = small_rig::truth(&random);
    for (const std::size_t moved : {std::size_t{0}, std::size_t{1}, std::size_t{2}}) {
        RigState later = state;
        // The camera's centre goes by 2 mm and it turns by 0.2 degrees about its x axis.
        Vector6 motion;
        motion << 0.0035, 0.0, 0.0, 0.0, 2.0, 0.0;
        const Pose change = pose_exp(motion);
        if (moved == 0) {
            // Camera 0 is the rig frame: all else moves the other way.
            for (Vector6& pose : later.cam_from_rig) {
                pose = pose_log(pose_exp(pose) * inverse(change));
            }
            for (Vector6& pose : later.rig_from_body) {
                pose = pose_log(change * pose_exp(pose));
            }
            later.cam_from_rig[0].setZero();
        } else {
            later.cam_from_rig[moved] = pose_log(change * pose_exp(state.cam_from_rig[moved]));
        }
        const RigFile a = small_rig::calibrated(state, &random);
        const Comparison found = compare_or_fail(a, small_rig::calibrated(later, &random));
        TEST_ASSERT_TRUE(found.differs);
        for (std::size_t c = 0; c < small_rig::kCameras; ++c) {
            TEST_ASSERT_FALSE(found.parts[0].cameras[c].lens.differs);
            TEST_ASSERT_EQUAL_INT(c == moved ? 1 : 0, found.parts[0].cameras[c].rig.differs ? 1 : 0);
        }
        // The rig's geometry is known to some 0.1 mm and 0.005 degrees in each calibration.
        TEST_ASSERT_TRUE(std::abs(found.parts[0].cameras[moved].shift_mm - 2.0) < 0.6);
        TEST_ASSERT_TRUE(std::abs(found.parts[0].cameras[moved].turn_deg - 0.2005) < 0.05);
        const std::string text = comparison_text(found, CompareOptions());
        const std::string sentence = "'cam" + std::to_string(moved) + "' has moved by";
        TEST_ASSERT_TRUE_MESSAGE(text.find(sentence) != std::string::npos, text.c_str());
    }
}

void a_lens_that_changed_is_named_and_no_other()
{
    std::mt19937 random(33);
    const RigState state = small_rig::truth(&random);
    RigState later = state;
    later.lenses[1].intrinsics[0] *= 1.002;  // a focal length that is known to a few parts in 10^4
    later.lenses[1].intrinsics[1] *= 1.002;
    const RigFile a = small_rig::calibrated(state, &random);
    const Comparison found = compare_or_fail(a, small_rig::calibrated(later, &random));
    TEST_ASSERT_TRUE(found.differs && found.parts[0].cameras[1].lens.differs);
    TEST_ASSERT_FALSE(found.parts[0].cameras[0].lens.differs || found.parts[0].cameras[2].lens.differs);
    TEST_ASSERT_TRUE(comparison_text(found, CompareOptions()).find("'cam1': its lens differs")
                     != std::string::npos);
}

void without_covariances_differences_are_told_but_not_judged()
{
    std::mt19937 random(34);
    const RigState state = small_rig::truth(&random);
    RigFile a = small_rig::calibrated(state, &random);
    a.covariance.reset();
    RigFile b = small_rig::file_of(state);
    b.cameras[2].lens.intrinsics[2] += 1.0;
    const Comparison found = compare_or_fail(a, b);
    TEST_ASSERT_FALSE(found.tested || found.differs);
    TEST_ASSERT_TRUE(found.parts[0].cameras[2].rig.rms_px > 0.0);
    TEST_ASSERT_TRUE(comparison_text(found, CompareOptions()).find("cannot be told") != std::string::npos);
}

// The file as `solve --partial` would leave it: the second camera's frame is that of a part of its own, and
// the third stands in it. Covariances stay as they are, so only one without is asked.
RigFile in_two_parts(RigFile rig)
{
    rig.covariance.reset();
    const Pose second = rig.cameras[1].cam_from_rig;
    for (const std::size_t c : {std::size_t{1}, std::size_t{2}}) {
        rig.cameras[c].part = 1;
        rig.cameras[c].cam_from_rig = rig.cameras[c].cam_from_rig * inverse(second);
    }
    return rig;
}

void parts_are_compared_each_after_a_motion_of_its_own()
{
    std::mt19937 random(35);
    const RigFile whole = small_rig::file_of(small_rig::truth(&random));
    RigFile apart = in_two_parts(whole);
    apart.cameras[2].cam_from_rig.translation_mm.y() += 3.0;
    for (const auto& [a, b] : {std::pair(whole, apart), {apart, whole}, {apart, in_two_parts(whole)}}) {
        const Comparison found = compare_or_fail(a, b);
        TEST_ASSERT_EQUAL_INT(2, found.parts.size());
        TEST_ASSERT_EQUAL_INT(1, found.parts[0].cameras.size());
        TEST_ASSERT_EQUAL_INT(2, found.parts[1].cameras.size());
        TEST_ASSERT_EQUAL_STRING("cam2", found.parts[1].cameras[1].name.c_str());
        // One camera alone has no place that could be another; of two that moved by 3 mm each takes a half,
        // in all 3 mm to within what turning makes up for: some tenths.
        TEST_ASSERT_TRUE(found.parts[0].cameras[0].rig.rms_px < 1e-6);
        TEST_ASSERT_TRUE(std::abs(found.parts[1].cameras[0].shift_mm + found.parts[1].cameras[1].shift_mm - 3.0)
                         < 0.5);
        TEST_ASSERT_TRUE(comparison_text(found, CompareOptions()).find("stand to each other was not compared")
                         != std::string::npos);
    }
}

}  // namespace

int main()
{
    UNITY_BEGIN();
    RUN_TEST(two_calibrations_of_one_rig_differ_as_their_covariances_say);
    RUN_TEST(a_camera_that_moved_is_named_with_how_far_and_no_other);
    RUN_TEST(a_lens_that_changed_is_named_and_no_other);
    RUN_TEST(without_covariances_differences_are_told_but_not_judged);
    RUN_TEST(parts_are_compared_each_after_a_motion_of_its_own);
    return UNITY_END();
}
