"""Boards that are fixed to each other: `rigid` in scene.json."""
import json

import numpy as np
import pytest
from test_solve import NOISE_PX, assert_recovered, make, refused, run, simulate, solve

B_FROM_A = {"b": (simulate.rotation([0.3, -0.5, 0.2]), np.array([150.0, -90.0, 240.0])),
            "c": (simulate.rotation([-0.4, 0.3, 0.6]), np.array([-60.0, 40.0, 150.0]))}


def compose(a, b):
    return a[0] @ b[0], a[0] @ b[1] + a[1]


def inverse(a):
    return a[0].T, -a[0].T @ a[1]


def scene_rows(cameras, board, poses, boards):
    """Rows of simulate.make_scene by board; board X rides on a by B_FROM_A[X]."""
    return {name: simulate.make_scene(
        cameras, board, [pose if name == "a" else compose(pose, inverse(B_FROM_A[name])) for pose in poses],
        NOISE_PX, seed=7 + i) for i, name in enumerate(boards)}


def write(folder, cameras, board, rows, keep, rigid):
    simulate.write_folder(folder, cameras, board, [])
    scene = json.loads((folder / "scene.json").read_text())
    scene["boards"] = [{"name": name, "points": "points.csv"} for name in rows]
    scene["rigid"] = rigid
    (folder / "scene.json").write_text(json.dumps(scene))
    with open(folder / "observations.csv", "w") as file:
        file.write("camera,frame,board,point,x,y\n")
        for name, list_ in rows.items():
            for c, frame, point, x, y, _ in list_:
                if keep(c, frame, name):
                    file.write(f"{c},{frame},{name},{point},{x:.6f},{y:.6f}\n")


def assert_boards_recovered(rig, poses):
    """0.02 px at 2 m and 1,400 px is 0.03 mm a point; over 50 points and with the lens's own uncertainty
    0.5 mm at a board's middle is ten times what is expected."""
    for frame in rig["frames"]:
        pose = poses[frame["frame"]]
        if frame["board"] != "a":
            pose = compose(pose, inverse(B_FROM_A[frame["board"]]))
        found = frame["rig_from_board"]
        middle = np.array([600.0, 350, 0])
        at = np.array(found["rotation"]).reshape(3, 3) @ middle + found["translation_mm"]
        assert np.linalg.norm(at - (pose[0] @ middle + pose[1])) < 0.5


@pytest.mark.parametrize("keep", [
    # Camera 0 sees both boards in three frames, which tells how they are fixed to each other; for the
    # rest each camera has a board of its own.
    lambda c, frame, name: (name == "a") == (c == 0) or (c == 0 and frame < 3),
    # Never: only the common motion tells.
    lambda c, frame, name: (name == "a") == (c == 0),
], ids=["seen together by one camera", "never seen together"])
def test_cameras_that_never_see_the_same_board_are_joined(keep, tmp_path):
    cameras, board, poses, _ = make(2, 16)
    rows = scene_rows(cameras, board, poses, "ab")
    write(tmp_path / "in", cameras, board, rows, keep, [["a", "b"]])
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)
    assert_boards_recovered(rig, poses)
    # As above: 32 poses less, for one more.
    assert rig["rmse_px"] == pytest.approx(np.sqrt(2) * NOISE_PX, rel=0.06)


def test_three_sides_and_three_cameras_are_solved_together(tmp_path):
    cameras, board, poses, _ = make(3, 18)
    rows = scene_rows(cameras, board, poses, "abc")
    # a and b hang together through camera 1, c through the rig that is already joined.
    seen = [("a",), ("a", "b"), ("c",)]
    write(tmp_path / "in", cameras, board, rows,
          lambda c, frame, name: name in seen[c], [["a", "b"], ["b", "c"]])
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)
    assert_boards_recovered(rig, poses)


def test_rigid_boards_say_more_than_boards_apart(tmp_path):
    cameras, board, poses, _ = make(2, 8)
    rows = scene_rows(cameras, board, poses, "ab")
    for name, rigid in (("fixed", [["a", "b"]]), ("apart", [])):
        write(tmp_path / name, cameras, board, rows, lambda *_: True, rigid)
    fixed = solve(tmp_path / "fixed", tmp_path / "1")
    apart = solve(tmp_path / "apart", tmp_path / "2")
    assert_recovered(fixed, cameras)
    for one, other in zip(fixed["cameras"], apart["cameras"]):
        assert one["standard_deviation"]["fx"] < other["standard_deviation"]["fx"]


def test_a_body_that_turns_about_one_axis_only_does_not_join_cameras(tmp_path):
    cameras, board, _, _ = make(2, 2)
    # Tilted from -37 to 37 degrees, always about the same axis: where the boards lie to each other along
    # that axis stays open.
    turns = []
    for i in range(-8, 9):
        turn = simulate.rotation([0.08 * i, 0, 0])
        turns.append((turn, np.array([100.0 + 9 * i, 5 * i, 1700]) - turn @ [600, 350, 0]))
    rows = scene_rows(cameras, board, turns, "ab")
    write(tmp_path / "in", cameras, board, rows, lambda c, frame, name: (name == "a") == (c == 0), [["a", "b"]])
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "'cam1' (frames 0, 1,",
                   "turn")
    assert not (tmp_path / "out").exists()


def test_rigid_boards_that_are_not_rigid_are_rejected_as_views(tmp_path):
    cameras, board, poses, _ = make(2, 16)
    rows = scene_rows(cameras, board, poses, "ab")
    # In two frames board b had been knocked to another place.
    moved = [pose if i not in (3, 9) else compose(pose, (simulate.rotation([0.05, 0, 0.1]), np.array([20.0, 5, 9])))
             for i, pose in enumerate(poses)]
    knocked = scene_rows(cameras, board, moved, "ab")["b"]
    rows["b"] = [row for row in rows["b"] if row[1] not in (3, 9)] + [row for row in knocked if row[1] in (3, 9)]
    write(tmp_path / "in", cameras, board, rows, lambda *_: True, [["a", "b"]])
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)
    assert rig["rejected_by_reason"]["view that disagrees with the rig"] > 0
