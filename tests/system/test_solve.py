"""tessera-rig solve, project, unproject, export and report on simulated observations with known truth."""
import json
import os
import pathlib
import subprocess
import sys

import cv2
import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))
import simulate  # noqa: E402

RIG = str(pathlib.Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")) / "tessera-rig")
NOISE_PX = 0.02


def run(*arguments, stdin=None):
    return subprocess.run([RIG, *map(str, arguments)], input=stdin, capture_output=True, text=True,
                          timeout=300)


def refused(result, *words):
    """One sentence on stderr (after progress lines) that holds all the words, and status 1."""
    assert result.returncode == 1, result.stderr
    complaint = result.stderr.strip().splitlines()[-1]
    for word in words:
        assert word in complaint, complaint
    return True


def solve(folder, out, *options):
    result = run("solve", folder, "--out", out, *options)
    assert result.returncode == 0, result.stderr
    return json.loads((out / "rig.json").read_text())


def make(cameras=3, frames=16, model="brown", noise=NOISE_PX, outliers=0.0, seed=3, **path):
    rng = np.random.default_rng(seed)
    rig = simulate.make_cameras(cameras, rng, model)
    board = simulate.grid_board(7, 12, 100.0, (12.0, 20.0))
    poses = simulate.make_path(frames, rng, board, **path)
    rows = simulate.make_scene(rig, board, poses, noise, outliers, seed)
    return rig, board, poses, rows


def pose_of(camera):
    pose = camera["cam_from_rig"]
    return np.array(pose["rotation"]).reshape(3, 3), np.array(pose["translation_mm"])


def assert_recovered(rig, truth, sigmas=4.5):
    """Every parameter lies within 4.5 of its own reported standard deviations: of some 40 parameters
    one lies outside by chance in 1 run of 3,700. The deviations are themselves bounded, so that the
    test cannot pass by reporting large ones."""
    for camera, known in zip(rig["cameras"], truth):
        std = camera["standard_deviation"]
        for key in ("fx", "fy", "cx", "cy"):
            assert abs(camera[key] - known[key]) < sigmas * std[key], (camera["name"], key)
        # 0.02 px of noise over thousands of points, each seeing a 1,400 px focal length at tilts up
        # to 0.6 rad: a hundredth of a percent is ten times what such data give.
        assert std["fx"] < 1e-3 * camera["fx"]
        found_turn, found_shift = pose_of(camera)
        turn, shift = known["cam_from_rig"]
        miss = np.linalg.norm(-found_turn.T @ found_shift + turn.T @ shift)
        bound = np.linalg.norm(std["translation_mm"]) + 2000 * np.radians(np.linalg.norm(std["rotation_deg"]))
        assert miss <= sigmas * bound + 1e-9
        angle = np.linalg.norm(cv2.Rodrigues(found_turn.T @ turn)[0])
        assert angle <= sigmas * np.radians(np.linalg.norm(std["rotation_deg"])) + 1e-9


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Three Brown cameras, no sigmas given, 2 % gross outliers."""
    folder = tmp_path_factory.mktemp("brown")
    cameras, board, poses, rows = make(outliers=0.02)
    simulate.write_folder(folder / "in", cameras, board, rows)
    result = run("solve", folder / "in", "--out", folder / "out")
    assert result.returncode == 0, result.stderr
    return {"cameras": cameras, "board": board, "poses": poses, "rows": rows, "result": result,
            "in": folder / "in", "out": folder / "out",
            "rig": json.loads((folder / "out" / "rig.json").read_text())}


def test_reprojection_error_is_the_noise(solved):
    # The residual's length has the RMS sqrt(2) * noise, less the part that the fitted parameters take:
    # 16 poses and 3 lenses take (16*6 + 3*9 + 2*6) of some 2 * 3,000 residuals, 1.2 % of the RMS. The
    # RMS over N points scatters by 1/sqrt(4 N), 0.9 %: five of these and the bias make 6 %.
    assert solved["rig"]["rmse_px"] == pytest.approx(np.sqrt(2) * NOISE_PX, rel=0.06)
    for camera in solved["rig"]["cameras"]:
        assert camera["rmse_px"]**2 == pytest.approx(camera["mean_px"]**2 + camera["std_px"]**2, rel=1e-6)


def test_lenses_and_poses_are_recovered_within_their_error_bars(solved):
    assert_recovered(solved["rig"], solved["cameras"])


def test_gross_outliers_and_nothing_else_are_rejected(solved):
    # Outliers lie 5 px and more away, 40 times the rule's limit of 6 sigmas; a good point passes that
    # limit once in 65 million.
    assert solved["rig"]["rejected"] == sum(row[5] for row in solved["rows"])
    assert solved["rig"]["observations"] + solved["rig"]["rejected"] == len(solved["rows"])
    assert solved["rig"]["rmse_all_px"] > 1.0 > solved["rig"]["rmse_px"]


def test_boards_come_out_where_they_were(solved):
    assert len(solved["rig"]["frames"]) == len(solved["poses"])
    for frame in solved["rig"]["frames"]:
        turn, shift = solved["poses"][frame["frame"]]
        found = np.array(frame["rig_from_board"]["translation_mm"])
        # 0.02 px at 2,200 mm and 1,400 px is 0.03 mm a point; over 50 points and with the lens's own
        # uncertainty along the axis 0.5 mm is ten times what is expected.
        assert np.linalg.norm(found - shift) < 0.5


def test_same_input_gives_the_same_bytes(solved, tmp_path):
    run("solve", solved["in"], "--out", tmp_path)
    for name in ("rig.json", "summary.txt", "residuals-cam0.png"):
        assert (tmp_path / name).read_bytes() == (solved["out"] / name).read_bytes()


def test_summary_shows_the_table_and_report_prints_it_again(solved):
    summary = (solved["out"] / "summary.txt").read_text()
    assert f"{solved['rig']['rmse_px']:.4f}" in summary
    assert "coverage" in summary and "points/frame" in summary and "cam2" in summary
    assert run("report", solved["out"] / "rig.json").stdout == summary
    assert solved["result"].stdout == summary


@pytest.mark.parametrize("model", ["rational", "thin-prism", "fisheye"])
def test_other_lenses_are_recovered(model, tmp_path):
    cameras, board, _, rows = make(2, 14, model)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    rig = solve(tmp_path / "in", tmp_path / "out", "--model", model)
    assert rig["rmse_px"] == pytest.approx(np.sqrt(2) * NOISE_PX, rel=0.08)  # as above, fewer points
    # The coefficients of a rational lens stand in for one another; what counts is where points land.
    for camera, known in zip(rig["cameras"], cameras):
        # Where there are data; in the corners there are none.
        y, x = np.mgrid[250:830:12j, 400:1520:20j]
        rays = unproject(tmp_path / "out" / "rig.json", camera["name"], np.stack([x, y], -1).reshape(-1, 2))
        there = simulate.project(known, rays)
        miss = there - np.stack([x, y], -1).reshape(-1, 2)
        # Less the small rotation of the camera frame that the lens trades against: its mean. What is
        # left is the error of the fit, a fraction of the noise over this many points; half a pixel
        # would show a wrong model at once, 0.1 px is twice the worst extrapolation at this noise.
        assert np.sqrt(((miss - miss.mean(axis=0))**2).sum(axis=1).mean()) < 0.1


@pytest.mark.parametrize("model", ["rational", "thin-prism"])
def test_a_rich_lens_on_few_views_has_a_ray_for_every_pixel(model, tmp_path):
    # Its coefficients stand in for one another; without a word on their size they run to where the
    # denominator has a zero inside the image.
    for seed in (3, 4):
        cameras, board, _, rows = make(2, 6, model, seed=seed)
        simulate.write_folder(tmp_path / "in", cameras, board, rows)
        rig = solve(tmp_path / "in", tmp_path / "out", "--model", model)
        y, x = np.mgrid[0:1079:9j, 0:1919:15j]
        for camera in rig["cameras"]:
            rays = unproject(tmp_path / "out" / "rig.json", camera["name"], np.stack([x, y], -1).reshape(-1, 2))
            assert np.isfinite(rays).all(), (seed, camera["name"])


def project(rig, camera, points):
    text = "x,y,z\n" + "\n".join(",".join(repr(float(v)) for v in p) for p in points) + "\n"
    result = run("project", rig, "--camera", camera, stdin=text)
    assert result.returncode == 0, result.stderr
    return np.genfromtxt(result.stdout.splitlines()[1:], delimiter=",").reshape(-1, 2)


def unproject(rig, camera, pixels):
    text = "x,y\n" + "\n".join(",".join(repr(float(v)) for v in p) for p in pixels) + "\n"
    result = run("unproject", rig, "--camera", camera, stdin=text)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[0] == "x,y,z"
    return np.genfromtxt(result.stdout.splitlines()[1:], delimiter=",").reshape(-1, 3)


def rig_file(path, model, distortion):
    path.write_text(json.dumps({"format": "tessera-rig", "version": 1, "cameras": [
        {"name": "one", "width": 1920, "height": 1080, "model": model, "fx": 1400.5, "fy": 1402.25,
         "cx": 955.5, "cy": 543.25, "distortion": distortion,
         "cam_from_rig": {"rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation_mm": [0, 0, 0]}}]}))
    return path


LENSES = [("brown", [-0.28, 0.09, 4e-4, -3e-4, -0.012]),
          ("rational", [0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03]),
          ("thin-prism", [0.35, 0.12, 3e-4, -2e-4, 0.01, 0.65, 0.22, 0.03, 6e-4, -2e-4, -5e-4, 2e-4]),
          ("fisheye", [-0.03, 0.008, -0.004, 0.0007])]


@pytest.mark.parametrize("model, distortion", LENSES)
def test_project_agrees_with_opencv(model, distortion, tmp_path):
    rig = rig_file(tmp_path / "rig.json", model, distortion)
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-600, 600, 200), rng.uniform(-350, 350, 200),
                              rng.uniform(900, 3000, 200)])
    matrix = np.array([[1400.5, 0, 955.5], [0, 1402.25, 543.25], [0, 0, 1]])
    zero = np.zeros(3)
    if model == "fisheye":
        known = cv2.fisheye.projectPoints(points[None], zero, zero, matrix, np.array(distortion))[0]
    else:
        known = cv2.projectPoints(points, zero, zero, matrix, np.array(distortion))[0]
    # Both are double arithmetic on numbers of some 1e3.
    assert np.abs(project(rig, "one", points) - known.reshape(-1, 2)).max() < 1e-8


@pytest.mark.parametrize("model, distortion", LENSES)
def test_project_after_unproject_is_the_pixel(model, distortion, tmp_path):
    rig = rig_file(tmp_path / "rig.json", model, distortion)
    y, x = np.mgrid[0:1080:13j, 0:1920:17j]
    pixels = np.stack([x, y], -1).reshape(-1, 2)
    rays = unproject(rig, "one", pixels)
    assert np.abs(np.linalg.norm(rays, axis=1) - 1).max() < 1e-12
    # The iteration ends below 1e-6 px or says nan.
    assert np.abs(project(rig, "one", 1000 * rays) - pixels).max() < 2e-6


def test_points_without_image_and_pixels_without_ray_are_nan(tmp_path):
    rig = rig_file(tmp_path / "rig.json", "brown", [-0.28, 0, 0, 0, 0])
    found = project(rig, "one", [[0, 0, -5], [10, 20, 0], [0, 0, 5], [5000, 0, 100]])
    # -0.28 r^2 folds at r = sqrt(1 / 0.84) = 1.09: nothing is farther from the centre than
    # 1400.5 * 1.09 * (1 - 0.28 / 0.84) = 1018 px.
    assert np.isnan(found[[0, 1, 3]]).all() and np.isfinite(found[2]).all()
    rays = unproject(rig, "one", [[955.5, 543.25], [955.5 + 1010, 543.25], [955.5 + 1025, 543.25]])
    assert np.isfinite(rays[:2]).all() and np.isnan(rays[2]).all()


def test_exported_yaml_is_read_by_opencv(solved, tmp_path):
    result = run("export", solved["out"] / "rig.json", "--format", "opencv", "--out", tmp_path / "rig.yaml")
    assert result.returncode == 0, result.stderr
    storage = cv2.FileStorage(str(tmp_path / "rig.yaml"), cv2.FILE_STORAGE_READ)
    cameras = storage.getNode("cameras")
    assert cameras.size() == 3
    for i, camera in enumerate(solved["rig"]["cameras"]):
        node = cameras.at(i)
        assert node.getNode("name").string() == camera["name"]
        assert node.getNode("image_width").real() == camera["width"]
        matrix = node.getNode("camera_matrix").mat()
        assert matrix[0, 0] == camera["fx"] and matrix[1, 2] == camera["cy"]
        assert list(node.getNode("distortion_coefficients").mat().ravel()) == camera["distortion"]
        assert list(node.getNode("R").mat().ravel()) == camera["cam_from_rig"]["rotation"]
        assert list(node.getNode("T").mat().ravel()) == camera["cam_from_rig"]["translation_mm"]


def test_cameras_that_nothing_connects_are_named_and_nothing_is_written(tmp_path):
    cameras, board, _, rows = make(3, 24)
    apart = [row for row in rows if (row[0] == 2) == (row[1] % 2 == 0)]
    simulate.write_folder(tmp_path / "in", cameras, board, apart)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"),
                   "camera 'cam2' (frames 0, 2, 4, 6, 8 ... 22; 12 in all)", "'cam0' (frames 1, 3,", "--partial")
    assert not (tmp_path / "out").exists()


def test_parts_that_nothing_connects_are_solved_each_by_itself_when_asked(tmp_path):
    cameras, board, _, rows = make(4, 30)
    apart = [row for row in rows if (row[0] >= 2) == (row[1] % 2 == 0)]
    simulate.write_folder(tmp_path / "in", cameras, board, apart)
    rig = solve(tmp_path / "in", tmp_path / "out", "--partial")
    assert [(camera["name"], camera["part"]) for camera in rig["cameras"]] == [
        ("cam0", 0), ("cam1", 0), ("cam2", 1), ("cam3", 1)]
    assert "'cam2', 'cam3'" in rig["left_out"][0]
    assert {frame["part"] for frame in rig["frames"]} == {0, 1}
    assert_recovered({**rig, "cameras": rig["cameras"][:2]}, cameras[:2])
    turn, shift = cameras[2]["cam_from_rig"]
    moved = [{**c, "cam_from_rig": (c["cam_from_rig"][0] @ turn.T,
                                    c["cam_from_rig"][1] - c["cam_from_rig"][0] @ turn.T @ shift)}
             for c in cameras[2:]]
    assert_recovered({**rig, "cameras": rig["cameras"][2:]}, moved)


def test_a_camera_that_cannot_be_solved_is_left_out_when_asked(tmp_path):
    cameras, board, _, rows = make(3, 14)
    simulate.write_folder(tmp_path / "in", cameras, board, [r for r in rows if r[0] != 2 or r[1] in (1, 2)])
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "'cam2' has ")
    rig = solve(tmp_path / "in", tmp_path / "out", "--partial")
    assert [camera["name"] for camera in rig["cameras"]] == ["cam0", "cam1"]
    assert "'cam2' has " in rig["left_out"][0] and rig["rejected_by_reason"]["camera left out"] > 0


def test_the_number_of_threads_does_not_change_a_byte(solved, tmp_path):
    for threads in (1, 2, 3):
        out = tmp_path / str(threads)
        assert run("solve", solved["in"], "--out", out, "--threads", str(threads)).returncode == 0
        for name in ("rig.json", "summary.txt", "residuals-cam0.png"):
            assert (out / name).read_bytes() == (solved["out"] / name).read_bytes()


def test_a_camera_joined_through_another_is_solved(tmp_path):
    cameras, board, _, rows = make(3, 30)
    chain = [row for row in rows if (row[1] % 2 == 0 and row[0] != 2) or (row[1] % 2 == 1 and row[0] != 0)]
    simulate.write_folder(tmp_path / "in", cameras, board, chain)
    assert_recovered(solve(tmp_path / "in", tmp_path / "out"), cameras)


def test_a_static_board_joins_cameras_through_its_one_pose(tmp_path):
    cameras, board, poses, rows = make(2, 14)
    # Board a moves, and each camera sees it in frames of its own; board b stands still.
    fixed = simulate.make_scene(cameras, board, [(np.eye(3), np.array([-300.0, -300, 1700]))] * 2, NOISE_PX)
    simulate.write_folder(tmp_path / "in", cameras, board, [])
    scene = json.loads((tmp_path / "in" / "scene.json").read_text())
    scene["boards"].append({"name": "b", "points": "points.csv", "static": True})
    (tmp_path / "in" / "scene.json").write_text(json.dumps(scene))
    with open(tmp_path / "in" / "observations.csv", "w") as file:
        file.write("camera,frame,board,point,x,y\n")
        for c, frame, point, x, y, _ in rows:
            if frame % 2 == c:
                file.write(f"{c},{frame},a,{point},{x:.6f},{y:.6f}\n")
        for c, frame, point, x, y, _ in fixed:
            if frame == c:
                file.write(f"{c},{100 + frame},b,{point},{x:.6f},{y:.6f}\n")
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)


@pytest.mark.parametrize("change, words", [
    (lambda text: text.replace("\ncam0,", "\ncamX,", 1), ["observations.csv line 2", "camX"]),
    (lambda text: text + "cam0,0,a,9999,5,5\n", ["observations.csv line", "no point 9999"]),
    (lambda text: text + "cam0,0,a,1,5\n", ["observations.csv line", "5 fields"]),
    (lambda text: text + "cam0,0,a,1,five,5\n", ["observations.csv line", "'x'", "five"]),
    (lambda text: text + "cam0,0,a,1,nan,5\n", ["observations.csv line", "'x'", "finite"]),
    (lambda text: text + "cam0,0.5,a,1,5,5\n", ["observations.csv line", "'frame'"]),
    (lambda text: text + text.splitlines()[1] + "\n", ["observations.csv line", "second time", "line 2"]),
    (lambda text: text.replace("point", "pint", 1), ["observations.csv line 1", "'point'"]),
    (lambda text: text.splitlines()[0] + "\n", ["observations.csv", "no observations"]),
])
def test_bad_lines_are_refused_by_name(change, words, solved, tmp_path):
    for name in ("scene.json", "points.csv"):
        (tmp_path / name).write_bytes((solved["in"] / name).read_bytes())
    text = (solved["in"] / "observations.csv").read_text()
    (tmp_path / "observations.csv").write_text(change(text))
    assert refused(run("solve", tmp_path, "--out", tmp_path / "out"), *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("change, words", [
    ({"format": "other"}, ["scene.json", "'format'"]),
    ({"version": 2}, ["scene.json", "'version'"]),
    ({"surprise": 1}, ["scene.json", "'surprise'"]),
    ({"rigid": [["a", "b"]]}, ["scene.json", "'rigid'", "'b'"]),
    ({"rigid": [["a"]]}, ["scene.json", "'rigid'", "two or more"]),
    ({"rigid": "a"}, ["scene.json", "'rigid'", "list"]),
    ({"cameras": []}, ["scene.json", "'cameras'"]),
    ({"boards": [{"name": "a"}]}, ["scene.json", "boards[0]"]),
    ({"boards": [{"name": "a", "points": "none.csv"}]}, ["none.csv"]),
    ({"cameras": [{"name": "cam0", "width": 0, "height": 5}]}, ["cameras[0]", "'width'"]),
])
def test_bad_scenes_are_refused_by_key(change, words, solved, tmp_path):
    for name in ("points.csv", "observations.csv"):
        (tmp_path / name).write_bytes((solved["in"] / name).read_bytes())
    scene = {**json.loads((solved["in"] / "scene.json").read_text()), **change}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    assert refused(run("solve", tmp_path, "--out", tmp_path / "out"), *words)


def test_missing_folders_and_wrong_use_have_their_exit_codes(tmp_path):
    assert refused(run("solve", tmp_path / "none", "--out", tmp_path / "out"), "none")
    assert run("solve").returncode == 2
    assert run("solve", tmp_path, "--out", tmp_path, "--model", "magic").returncode == 2
    assert run("solve", "--help").returncode == 0
    assert refused(run("report", tmp_path / "none.json"), "none.json")


def test_too_few_views_are_refused(tmp_path):
    cameras, board, _, rows = make(2, 2)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "'cam0'", "2 usable views")


def test_views_that_all_face_the_board_are_refused(tmp_path):
    cameras, board, _, _ = make(1, 2)
    poses = [(np.eye(3), np.array([-600.0 + 30 * i, -350, 1500 + 80 * i])) for i in range(10)]
    rows = simulate.make_scene(cameras, board, poses, NOISE_PX)
    simulate.write_folder(tmp_path / "in", cameras, board, rows)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "'cam0'", "tilted")


def test_one_camera_with_mirrored_images_is_refused(tmp_path):
    cameras, board, _, rows = make(2, 12)
    mirrored = [(c, f, p, cameras[0]["width"] - 1 - x if c == 1 else x, y, o) for c, f, p, x, y, o in rows]
    simulate.write_folder(tmp_path / "in", cameras, board, mirrored)
    assert refused(run("solve", tmp_path / "in", "--out", tmp_path / "out"), "'cam1'", "mirrored")


def test_frames_of_another_time_are_rejected_as_views(tmp_path):
    cameras, board, poses, rows = make(2, 20)
    # Camera 1 delivers two frames under each other's number.
    swap = {4: 9, 9: 4}
    mixed = [(c, swap.get(f, f) if c == 1 else f, p, x, y, o) for c, f, p, x, y, o in rows]
    simulate.write_folder(tmp_path / "in", cameras, board, mixed)
    rig = solve(tmp_path / "in", tmp_path / "out")
    assert_recovered(rig, cameras)
    assert rig["rejected_by_reason"]["view that disagrees with the rig"] > 0


def test_given_sigmas_are_compared_with_the_residuals(tmp_path):
    cameras, board, _, rows = make(2, 12)
    simulate.write_folder(tmp_path / "in", cameras, board, rows, sigma=NOISE_PX / 2)
    rig = solve(tmp_path / "in", tmp_path / "out")
    for camera in rig["cameras"]:
        # The median of some 1,000 absolute residuals scatters by 4 %; three of these.
        assert camera["noise_factor"] == pytest.approx(2.0, rel=0.12)
