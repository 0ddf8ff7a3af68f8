"""Bad recordings: each is found, and the sentence says what to do. Nothing is written then."""
import json

import numpy as np
import pytest
from test_solve import NOISE_PX, assert_recovered, refused, run, simulate, solve

import journals


def make(cameras, frames, seed=3):
    """As in test_solve, of points without radius: they are made in a tenth of the time."""
    rng = np.random.default_rng(seed)
    rig = simulate.make_cameras(cameras, rng)
    board = simulate.grid_board(7, 12, 100.0, (0.0, 0.0))
    poses = simulate.make_path(frames, rng, board)
    return rig, board, poses, simulate.make_scene(rig, board, poses, NOISE_PX, seed=seed)


def refuse(tmp_path, cameras, board, rows, *words):
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), *words)
    assert not (tmp_path / "out").exists()


def seen_by_changed(cameras, board, poses, rows, frame, who, change):
    """Rows of a recording in which camera `who` is changed from `frame` on."""
    after = [dict(camera) for camera in cameras]
    after[who].update(change)
    later = simulate.make_scene(after, board, poses, NOISE_PX, seed=11)
    return [row for row in rows if row[1] < frame] + [row for row in later if row[1] >= frame]


def moved(camera, turn, shift):
    turn = simulate.rotation(turn)
    return {"cam_from_rig": (turn @ camera["cam_from_rig"][0], turn @ camera["cam_from_rig"][1] + shift)}


# 0.06 degrees are 1.4 px, the second 17 degrees: from what is just no noise to another set-up.
@pytest.mark.parametrize("who, frame, turn, shift", [(1, 8, [0.0, 0.001, 0], [0, 0, 0]),
                                                     (0, 5, [0.3, 0, 0], [100.0, 0, 0]),
                                                     (2, 12, [0, 0, 0], [0, 3.0, 0])])
def test_a_camera_that_moved_is_named_with_the_frame(who, frame, turn, shift, tmp_path):
    cameras, board, poses, rows = make(3, 16)
    rows = seen_by_changed(cameras, board, poses, rows, frame, who, moved(cameras[who], turn, np.array(shift)))
    refuse(tmp_path, cameras, board, rows, f"camera 'cam{who}' moved against the others between frames "
                                           f"{frame - 1} and {frame}", "before and after apart")


def test_of_two_cameras_both_are_named_when_one_moved(tmp_path):
    cameras, board, poses, rows = make(2, 16)
    rows = seen_by_changed(cameras, board, poses, rows, 9, 1, moved(cameras[1], [0, 0.004, 0], np.array([1.0, 0, 0])))
    refuse(tmp_path, cameras, board, rows, "cameras 'cam0' and 'cam1' moved against each other between frames "
                                           "8 and 9")


def test_a_lens_that_was_touched_is_named_with_the_frame(tmp_path):
    cameras, board, poses, rows = make(3, 20)
    zoomed = {key: 1.01 * cameras[2][key] for key in ("fx", "fy")}
    rows = seen_by_changed(cameras, board, poses, rows, 10, 2, zoomed)
    refuse(tmp_path, cameras, board, rows, "lens of camera 'cam2' changed between frames 9 and 10", "focus")


def test_names_that_were_swapped_between_recordings_are_found_by_the_lenses(tmp_path):
    cameras, board, _, rows = make(3, 20)
    swapped = [({0: 1, 1: 0, 2: 2}[c] if f >= 12 else c, f, p, x, y, o) for c, f, p, x, y, o in rows]
    refuse(tmp_path, cameras, board, swapped, "'cam0' and 'cam1' have each other's lens from frame 12 on",
           "names were swapped")


def test_wrong_frames_alone_are_no_change(tmp_path):
    cameras, board, _, rows = make(3, 20)
    # Three neighbouring frames of one camera carry each other's numbers.
    other = {5: 6, 6: 7, 7: 5}
    rows = [(c, other.get(f, f) if c == 1 else f, p, x, y, o) for c, f, p, x, y, o in rows]
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)
    assert rig["rejected_by_reason"]["view that disagrees with the rig"] > 0


def test_a_bowed_board_on_a_slow_sweep_is_no_change(tmp_path):
    cameras, board, poses, _ = make(3, 24)
    poses.sort(key=lambda pose: pose[1][2])
    bowed = board.copy()
    bowed[:, 2] = 1.0 - ((board[:, 0] - 600) / 600)**2
    simulate.write_folder(tmp_path / "in", cameras, board, simulate.make_scene(cameras, bowed, poses, NOISE_PX))
    solve(tmp_path / "in", tmp_path / "out")


def test_a_print_of_the_wrong_size_is_found_by_a_second_board(tmp_path):
    cameras, board, poses, rows = make(2, 12)
    large = board * 1.02
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    scene = json.loads((tmp_path / "in" / "scene.json").read_text())
    scene["boards"].append({"name": "b", "points": "points.csv"})
    (tmp_path / "in" / "scene.json").write_text(json.dumps(scene))
    with open(tmp_path / "in" / "observations.csv", "a") as file:
        for c, frame, point, x, y, _ in simulate.make_scene(cameras, large, poses[::-1], NOISE_PX):
            file.write(f"{c},{frame},b,{point},{x:.6f},{y:.6f}\n")
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"),
                   "boards 'a' and 'b' contradict each other in size", "2.0 % less", "'cam0' and 'cam1'")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("turn_of", [lambda i: np.eye(3),
                                     lambda i: simulate.rotation([0, 0, 0.2 * i]),
                                     lambda i: simulate.rotation([0.5, 0.1, 0]),
                                     lambda i: simulate.rotation([0.5, 0.1, 0]) @ simulate.rotation([0, 0, 0.4 * i])],
                         ids=["facing", "facing and turning", "all at one tilt", "turning on one tilted table"])
def test_views_that_do_not_tell_the_lens_are_refused(turn_of, tmp_path):
    cameras, board, _, _ = make(1, 2)
    middle = np.array([600.0, 350, 0])
    rng = np.random.default_rng(4)
    poses = [(turn_of(i), np.array([rng.uniform(-150, 150), rng.uniform(-80, 80), 1700 + 60 * i])
              - turn_of(i) @ middle) for i in range(12)]
    rows = simulate.make_scene(cameras, board, poses, NOISE_PX)
    refuse(tmp_path, cameras, board, rows, "'cam0'", "tilted by 20 to 45 degrees, about different axes")


def test_a_mirrored_camera_is_named(tmp_path):
    cameras, board, _, rows = make(2, 12)
    rows = [(c, f, p, cameras[0]["width"] - 1 - x if c == 1 else x, y, o) for c, f, p, x, y, o in rows]
    refuse(tmp_path, cameras, board, rows, "cameras 'cam0' and 'cam1' see the flat board 'a' from opposite sides")


def test_an_observation_that_stands_twice_is_named_by_its_lines(tmp_path):
    cameras, board, _, rows = make(2, 6)
    refuse(tmp_path, cameras, board, rows + rows[4:5],
           f"observations.csv line {len(rows) + 2}: observes point {rows[4][2]} of board 'a' with camera 'cam0' "
           "in frame 0 a second time, after line 6; remove one of them")


def test_a_camera_whose_frames_are_all_shifted_is_refused(tmp_path):
    cameras, board, _, rows = make(2, 16)
    rows = [(c, f + 1 if c == 1 else f, p, x, y, o) for c, f, p, x, y, o in rows]
    refuse(tmp_path, cameras, board, rows, "frame numbers or clock")


def add_to_scene(folder, **keys):
    scene = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps(scene | keys))


def distance_mm(cameras, a, b):
    centres = [-camera["cam_from_rig"][0].T @ camera["cam_from_rig"][1] for camera in (cameras[a], cameras[b])]
    return float(np.linalg.norm(centres[0] - centres[1]))


def test_a_print_of_the_wrong_size_is_found_by_a_known_baseline(tmp_path):
    cameras, board, poses, _ = make(2, 12)
    rows = simulate.make_scene(cameras, board * 1.003, poses, NOISE_PX)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    known = distance_mm(cameras, 0, 1)
    words = ["cameras 'cam0' and 'cam1' are", f"{known:.3f} mm as given", "0.30 % off", "points.csv", "measure both"]
    add_to_scene(tmp_path / "in", baselines=[{"cameras": ["cam0", "cam1"], "mm": known, "sigma_mm": 0.05}])
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), *words)
    add_to_scene(tmp_path / "in", baselines=[])
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out", "--baseline", f"cam1,cam0,{known},0.05"),
                   *words[1:])
    assert not (tmp_path / "out").exists()
    # 0.3 % of 300 mm are 0.9 mm: a distance known to 0.5 mm does not contradict that.
    solve(tmp_path / "in", tmp_path / "out", "--baseline", f"cam0,cam1,{known},0.5")


def test_a_known_baseline_that_is_right_changes_nothing(tmp_path):
    cameras, board, _, rows = make(3, 12)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    plain = solve(tmp_path / "in", tmp_path / "plain")
    add_to_scene(tmp_path / "in", baselines=[{"cameras": ["cam2", "cam1"], "mm": distance_mm(cameras, 1, 2),
                                             "sigma_mm": 0.01}])
    assert solve(tmp_path / "in", tmp_path / "out")["cameras"] == plain["cameras"]


@pytest.mark.parametrize("baselines, words", [
    ([{"cameras": ["cam0", "cam9"], "mm": 300, "sigma_mm": 1}], ["names camera 'cam9'"]),
    ([{"cameras": ["cam0", "cam0"], "mm": 300, "sigma_mm": 1}], ["two different cameras"]),
    ([{"cameras": ["cam0", "cam1"], "mm": 300, "sigma_mm": 0}], ["both above 0"]),
    ([{"cameras": ["cam0", "cam1"], "mm": 300}], ["'baselines' must be a list"])])
def test_a_baseline_that_cannot_be_one_is_refused(baselines, words, tmp_path):
    cameras, board, _, rows = make(2, 3)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    add_to_scene(tmp_path / "in", baselines=baselines)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "scene.json", *words)


def test_a_baseline_option_that_cannot_be_read_is_refused(tmp_path):
    cameras, board, _, rows = make(2, 3)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out", "--baseline", "cam0,cam1,300"),
                   "--baseline cam0,cam1,300: give two cameras", "left,right,300,0.1")


def test_a_print_of_the_wrong_size_is_found_by_a_prior_rig(tmp_path):
    cameras, board, poses, rows = make(3, 14)
    simulate.write_folder(tmp_path / "lab", cameras, board, rows)
    solve(tmp_path / "lab", tmp_path / "prior", "--model", "brown")
    rows = simulate.make_scene(cameras, board * 1.02, poses[:8], NOISE_PX, seed=9)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    prior = ("--prior", tmp_path / "prior" / "rig.json")
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out", *prior, "--prior-poses"),
                   "the boards contradict the prior", "rig.json in size: cameras 'cam0' and 'cam1' are",
                   "2.0 % less, in the same direction", "measure the print")
    assert not (tmp_path / "out").exists()
    # The lenses do not know of it, and neither does a rig without its poses.
    solve(tmp_path / "in", tmp_path / "out", *prior)


@pytest.mark.parametrize("turn, shift, words", [
    ([0.02, 0, 0], [0, 0, 0], ["cameras 'cam0' and 'cam1' do not stand to each other as in the prior",
                               "by 1.1", "degrees", "was moved since"]),
    # 0.06 and 0.006 degrees: less than cameras alone tell, but not than the joint solution does.
    ([0.001, 0, 0], [0, 0, 0], ["the joint solution contradicts the prior", "with its poses", "a camera was moved"]),
    ([0.0001, 0, 0], [0, 0, 0], ["the joint solution contradicts the prior", "with its poses", "a camera was moved"])])
def test_a_camera_that_moved_since_the_prior_is_found(turn, shift, words, tmp_path):
    cameras, board, poses, rows = make(3, 14)
    simulate.write_folder(tmp_path / "lab", cameras, board, rows)
    solve(tmp_path / "lab", tmp_path / "prior", "--model", "brown")
    cameras[1].update(moved(cameras[1], turn, np.array(shift)))
    simulate.write_folder(tmp_path / "in", cameras, board, simulate.make_scene(cameras, board, poses, NOISE_PX, seed=9))
    prior = ("--prior", tmp_path / "prior" / "rig.json")
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out", *prior, "--prior-poses"), *words)
    assert not (tmp_path / "out").exists()


def test_a_mirrored_target_is_named(tmp_path):
    cameras = simulate.make_cameras(2, np.random.default_rng(3))
    target = journals.make_target(6, 8)
    board, ids = journals.target_board(target)
    poses = simulate.make_path(10, np.random.default_rng(3), board)
    # Printed mirrored: every circle is where its mirror image should be.
    printed = board * [-1, 1, 1, 1] + [800.0, 0, 0, 0]
    rows = [(c, f, ids[p], x, y, o) for c, f, p, x, y, o in simulate.make_scene(cameras, printed, poses, NOISE_PX)]
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    (tmp_path / "in" / "target.json").write_text(json.dumps(target))
    add_to_scene(tmp_path / "in", boards=[{"name": "a", "target": "target.json"}])
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"),
                   "camera 'cam0' sees board 'a' mirrored in 10 of 10 views", "printed or measured mirrored")


def test_a_board_of_points_that_is_seen_from_behind_is_told(tmp_path):
    cameras, board, poses, _ = make(2, 10)
    rows = simulate.make_scene(cameras, board * [-1, 1, 1, 1] + [1200.0, 0, 0, 0], poses, NOISE_PX)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    result = run("solve", tmp_path / "in", "--out", tmp_path / "out")
    # Allowed, for such a board turned round is the same board; which it is, it cannot tell.
    assert result.returncode == 0
    assert "points.csv; seen from its +z side in all views: mirrored, unless" in result.stdout


def test_wrong_points_are_counted_by_reason(tmp_path):
    cameras, board, poses, _ = make(2, 12)
    rows = simulate.make_scene(cameras, board, poses, NOISE_PX, outliers=0.02)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    rig = solve(tmp_path / "in", tmp_path / "out")
    wrong = sum(row[5] for row in rows)
    assert rig["rejected_by_reason"] == {"far from its projection": wrong} and wrong > 20
    assert f"{wrong}  far from its projection" in (tmp_path / "out" / "summary.txt").read_text()


def test_frames_that_repeat_others_bit_for_bit_count_once(tmp_path):
    """A recording that stands in the folder twice would halve the variances with the same noise."""
    cameras, board, _, rows = make(2, 10)
    simulate.write_folder(tmp_path / "once", cameras, board, rows)
    plain = solve(tmp_path / "once", tmp_path / "plain")
    again = [(c, f + 100, p, x, y, o) for c, f, p, x, y, o in rows]
    simulate.write_folder(tmp_path / "twice", cameras, board, rows + again)
    rig = solve(tmp_path / "twice", tmp_path / "out")
    assert rig["cameras"] == plain["cameras"]
    assert rig["rejected_by_reason"]["view that repeats an earlier frame bit for bit"] == len(again)


def test_too_few_views_are_named_with_their_number(tmp_path):
    cameras, board, _, rows = make(1, 2)
    refuse(tmp_path, cameras, board, rows, "camera 'cam0' has 2 usable views, needs at least")
