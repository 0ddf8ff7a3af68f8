"""tessera-render as its users meet it: what it writes, what it refuses."""
import csv
import json
import os
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

BIN = Path(os.environ.get("TESSERA_BIN", Path(__file__).parents[2] / "build" / "bin"))
DEMO = Path(__file__).parents[2] / "tools" / "render" / "scenes" / "demo.json"
TARGET = {"format": "tessera-target", "version": 1, "rows": 2, "cols": 3, "patch_mm": 50,
          "ids": [[1, 2, 3], [1000, 2000, 4000]], "turns": [[0, 1, 0], [1, 0, 1]]}
VIEWS = {"kind": "views", "views": [{"patch_px": 60, "turn_deg": 10, "tilt_deg": 20}]}


def tool(*words):
    return subprocess.run([BIN / "tessera-render", *map(str, words)], capture_output=True, text=True)


def write_scene(folder, path=VIEWS, target=TARGET, **camera):
    folder.mkdir(exist_ok=True)
    (folder / "target.json").write_text(json.dumps(target))
    one = {"name": "cam0", "width": 240, "height": 180, "fx": 500, "psf_sigma_px": 0.8, **camera}
    scene = {"format": "tessera-render-scene", "version": 1, "target": "target.json",
             "cameras": [one], "path": path}
    (folder / "scene.json").write_text(json.dumps(scene))
    return folder / "scene.json"


def render(scene, *words, name="out"):
    out = scene.parent / name
    run = tool(scene, "--out", out, *words)
    assert run.returncode == 0, run.stderr
    return out


def image(out, frame=0, camera="cam0", kind="pgm"):
    read = cv2.imread(str(out / camera / f"frame_{frame:05d}.{kind}"), cv2.IMREAD_UNCHANGED)
    return read.astype(float)


def truth_rows(out, camera="cam0"):
    with (out / camera / "truth.csv").open() as file:
        return [{k: v if k == "file" else float(v) for k, v in row.items()}
                for row in csv.DictReader(file)]


def matrix(camera):
    return np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])


def test_a_recording_has_frames_times_truth_and_target(tmp_path):
    scene = write_scene(tmp_path, {"kind": "wave", "count": 3, "start_ns": 7, "step_ns": 1000,
                                   "centre_mm": [0, 0, 400]})
    out = render(scene)
    names = sorted(str(p.relative_to(out)) for p in out.rglob("*") if p.is_file())
    assert names == ["cam0/frame_00000.pgm", "cam0/frame_00001.pgm", "cam0/frame_00002.pgm",
                     "cam0/times.csv", "cam0/truth.csv", "target.json", "truth.json"]
    assert (out / "cam0/times.csv").read_text() == \
        "file,t_ns\nframe_00000.pgm,7\nframe_00001.pgm,1007\nframe_00002.pgm,2007\n"
    assert (out / "target.json").read_text() == (tmp_path / "target.json").read_text()
    header = (out / "cam0/truth.csv").read_text().splitlines()[0]
    assert header == ("file,frame,patch,feature,x,y,major,minor,angle,polarity,"
                      "circle_x,circle_y,visible")


@pytest.mark.parametrize("bits, maxval", [(8, 255), (10, 1023), (12, 4095), (16, 65535)])
def test_frames_have_the_bits_asked_for_and_the_same_grey(tmp_path, bits, maxval):
    scene = write_scene(tmp_path, bits=bits, black=51, white=204)
    out = render(scene)
    assert (out / "cam0/frame_00000.pgm").read_bytes().startswith(b"P5\n240 180\n%d\n" % maxval)
    exact = image(render(scene, "--float", name="float"), kind="pfm")
    # Rounding to the nearest: half a step, and a float's last digit.
    step = 255 / maxval
    assert np.abs(image(out) * step - exact).max() <= 0.5 * step + 1e-4
    assert abs(exact.min() - 51) < 0.1 and abs(exact.max() - 204) < 0.1


@pytest.mark.parametrize("model, distortion", [
    ("brown", [-0.2, 0.1, 0.002, -0.001, 0.03]),
    ("rational", [0.3, 0.1, 0.001, 0.002, 0.02, 0.5, 0.1, 0.01]),
])
def test_the_truth_is_what_opencv_projects(tmp_path, model, distortion):
    scene = write_scene(tmp_path, model=model, distortion=distortion, cx=130, fy=510,
                        cam_from_rig={"rotation_vector_deg": [5, -8, 20], "translation_mm": [9, 5, 30]})
    out = render(scene)
    truth = json.loads((out / "truth.json").read_text())
    camera = truth["cameras"][0]
    pose = truth["frames"][0]["rig_from_board"]
    turn = np.array(camera["cam_from_rig"]["rotation"]).reshape(3, 3)
    to_camera = turn @ np.array(pose["rotation"]).reshape(3, 3)
    shift = turn @ pose["translation_mm"] + camera["cam_from_rig"]["translation_mm"]
    rows = truth_rows(out)
    assert len(rows) == 6 * 13
    angles = np.arange(0, 2 * np.pi, 2 * np.pi / 400)
    for row in rows:
        if row["feature"] != 0:
            continue
        r, c = [(r, c) for r in range(2) for c in range(3) if TARGET["ids"][r][c] == row["patch"]][0]
        inradius = (np.sqrt(2) - 1) / 2
        v = 1 - inradius if TARGET["turns"][r][c] else inradius
        centre = np.array([(c + 0.5) * 50, (r + v) * 50, 0])
        ring = centre + 0.5 * inradius * 50 * np.stack(
            [np.cos(angles), np.sin(angles), 0 * angles], 1)
        points = cv2.projectPoints(np.vstack([centre[None], ring]), cv2.Rodrigues(to_camera)[0], shift,
                                   matrix(camera), np.array(camera["distortion"]))[0].reshape(-1, 2)
        assert np.hypot(points[0, 0] - row["circle_x"], points[0, 1] - row["circle_y"]) < 1e-6
        (x, y), axes, _ = cv2.fitEllipseAMS(points[1:].astype(np.float32))
        # OpenCV fits single-precision points (1e-5 px) by another distance; the curves differ from
        # ellipses by less than 0.01 px here, and centres by the square of that over the radius.
        assert np.hypot(x - row["x"], y - row["y"]) < 1e-3
        assert abs(max(axes) / 2 - row["major"]) < 1e-3
        assert abs(min(axes) / 2 - row["minor"]) < 1e-3
        turn_rad = np.deg2rad(row["angle"])
        far = np.array([row["x"], row["y"]]) + row["major"] * np.array(
            [np.cos(turn_rad), np.sin(turn_rad)])
        # The major axis ends on the edge: within the spacing of the points.
        assert np.linalg.norm(points[1:] - far, axis=1).min() < 0.1


def test_visible_needs_the_circle_and_half_a_radius_around_it(tmp_path):
    # The board stands flat and 40 px to the left: its first column of patches is cut by the frame.
    path = {"kind": "views", "views": [{"patch_px": 60, "shift_px": [-72, 0]}]}
    hidden = [[130, 60], [160, 60], [160, 90], [130, 90]]
    scene = write_scene(tmp_path, path, occluders=[{"polygon": hidden, "level": 0.5}])
    out = render(scene)
    seen = image(out)
    assert np.ptp(seen[64:86, 134:156]) == 0  # the occluder is there, and flat
    rows = truth_rows(out)
    kinds = set()
    for row in rows:
        grown = 1.5 * row["major"]
        near = np.hypot(max(130 - row["x"], 0, row["x"] - 160), max(60 - row["y"], 0, row["y"] - 90))
        inside = row["x"] - grown >= -0.5
        assert row["visible"] == (inside and near >= grown)
        assert row["x"] + row["major"] >= -0.5  # at least partly in the image
        kinds.add((inside, near >= grown))
    assert len(kinds) == 3  # whole, cut by the frame, hidden


def test_a_board_seen_from_behind_shows_no_circles(tmp_path):
    pose = {"rotation_vector_deg": [0, 180, 0], "translation_mm": [75, -50, 400]}
    out = render(write_scene(tmp_path, {"kind": "poses", "poses": [pose]}))
    assert truth_rows(out) == []
    assert np.ptp(image(out)[60:120, 80:160]) == 0


def test_motion_blur_is_the_mean_of_the_instants(tmp_path):
    # 6 px in the exposure of 10 ms; 60 stills in the middles of 60 equal parts. Such a mean differs
    # from the integral by (6/60)^2 / 24 of the second derivative, 0.1 grey levels at a blurred edge.
    still = {"rotation_vector_deg": [0, 20, 5], "translation_mm": [-75, -50, 400]}
    speed = 6 / 500 * 400 / 0.01
    moving = {**still, "velocity_mm_s": [speed, 0, 0]}
    blurred = image(render(write_scene(tmp_path / "a", {"kind": "poses", "poses": [moving]},
                                       exposure_us=10000), "--float"), kind="pfm")
    shifts = [((i + 0.5) / 60 - 0.5) * 0.01 * speed for i in range(60)]
    poses = [{**still, "translation_mm": [-75 + s, -50, 400]} for s in shifts]
    stills = render(write_scene(tmp_path / "b", {"kind": "poses", "poses": poses}), "--float")
    mean = np.mean([image(stills, i, kind="pfm") for i in range(60)], axis=0)
    assert np.abs(image(stills, 30, kind="pfm") - mean).max() > 30  # there is blur to get right
    assert np.abs(blurred - mean).max() < 0.5


def test_a_rolling_shutter_shears_image_and_truth_alike(tmp_path):
    moving = {"rotation_vector_deg": [10, 0, 0], "translation_mm": [-75, -50, 400],
              "velocity_mm_s": [3000, 800, 0]}
    path = {"kind": "poses", "poses": [moving]}
    target = {**TARGET, "edge_level": 1, "circle_ratio": 0.3}
    out = render(write_scene(tmp_path / "a", path, target, row_time_us=20), "--float")
    still = truth_rows(render(write_scene(tmp_path / "b", path, target), "--truth-only"))
    rolled = image(out, kind="pfm")
    for row in truth_rows(out):
        if row["feature"] != 0 or row["patch"] not in (1000, 2000, 4000):
            continue
        # A sheared flat circle is a flat ellipse, whose centre of mass is its centre. Between the
        # circle of 3.9 px and its triangle lie 9 px: the blur reaches 4.1 from either side.
        y, x = np.mgrid[0:180, 0:240]
        near = np.hypot(x - row["x"], y - row["y"]) < row["major"] + 4.5
        mass = np.abs(rolled - (25 if row["polarity"] else 215)) * near
        assert abs((mass * x).sum() / mass.sum() - row["x"]) < 0.0005
        assert abs((mass * y).sum() / mass.sum() - row["y"]) < 0.0005
        before = next(r for r in still if r["patch"] == row["patch"] and r["feature"] == 0)
        # 3 m/s for 20 us a row at 500 px focal length and 0.4 m: 0.075 px a row.
        assert abs(row["x"] - before["x"] - 0.075 * row["y"]) < 0.05 * row["x"]
        assert row["x"] - before["x"] > 4


def test_noise_is_as_strong_as_asked_and_comes_from_the_seed_alone(tmp_path):
    path = {"kind": "wave", "count": 4, "centre_mm": [0, 0, 400], "tilt_deg": 20}
    scene = write_scene(tmp_path, path, noise=2.0, bits=16, shot_noise=0.05)
    first = render(scene, name="first")
    again = render(scene, "--jobs", 3, "--frames", "2:4", name="again")
    other = render(scene, "--seed", 5, "--frames", "2", name="other")
    clean = render(scene, "--float", name="float")
    for frame in (2, 3):
        name = f"cam0/frame_{frame:05d}.pgm"
        assert (first / name).read_bytes() == (again / name).read_bytes()
    quiet = image(render(write_scene(tmp_path / "q", path), "--float"), 2, kind="pfm")
    noise = image(first, 2) / 257 - quiet
    assert not np.array_equal(image(first, 2), image(other, 2))
    assert not np.array_equal(noise, image(first, 1) / 257)
    # Standard deviation of n = 43200 numbers scatters by 1 / sqrt(2 n) = 0.34 %: four of these.
    wanted = np.sqrt(4 + 0.05 * quiet)
    assert abs(np.std(noise / wanted) - 1) < 4 * 0.0034
    assert abs(np.mean(noise / wanted)) < 4 / np.sqrt(noise.size)
    assert (clean / "cam0/frame_00002.pfm").exists()


def test_light_falls_off_and_gamma_bends_as_asked(tmp_path):
    plain = dict(background={"level": 1}, black=0, white=200)
    path = {"kind": "poses", "poses": [{"translation_mm": [0, 0, -500]}]}  # behind the camera
    flat = image(render(write_scene(tmp_path / "a", path, **plain), "--float"), kind="pfm")
    assert np.abs(flat - 200).max() < 1e-3
    shade = image(render(write_scene(tmp_path / "b", path, **plain, shading={"to": 0.25}), "--float"),
                  kind="pfm")
    assert abs(shade[0, 0] - 200) < 1e-3 and abs(shade[90, -1] - 50) < 1e-3
    dim = image(render(write_scene(tmp_path / "c", path, **plain, vignetting=0.4), "--float"),
                kind="pfm")
    assert abs(dim[0, 0] - 120) < 1e-3 and dim[90, 120] > 199.9
    bent = image(render(write_scene(tmp_path / "d", path, **plain, gamma=1.8), "--float"), kind="pfm")
    assert np.abs(bent - 255 * (200 / 255) ** (1 / 1.8)).max() < 1e-3


def test_a_print_that_is_stretched_is_seen_stretched(tmp_path):
    path = {"kind": "poses", "poses": [{"translation_mm": [-75, -50, 500]}]}
    still = truth_rows(render(write_scene(tmp_path / "a", path)))
    wide = truth_rows(render(write_scene(
        tmp_path / "b", path, target={**TARGET, "measured_scale": [1.01, 1]})))
    # One pixel a millimetre: x moves by 1 % of the board coordinate, y does not.
    for a, b in zip(still, wide):
        assert abs((b["x"] - a["x"]) - 0.01 * (a["x"] - 119.5 + 75)) < 1e-6
        assert abs(b["y"] - a["y"]) < 1e-6


def test_keys_are_passed_at_their_times(tmp_path):
    keys = [{"t_ns": t, "rotation_vector_deg": [t / 1e8, 0, t / 2e8], "translation_mm": [x, 0, 400]}
            for t, x in ((0, 0), (10**9, 40), (2 * 10**9, -10))]
    out = render(write_scene(tmp_path, {"kind": "keys", "count": 3, "step_ns": 10**9, "keys": keys}),
                 "--truth-only")
    poses = [f["rig_from_board"] for f in json.loads((out / "truth.json").read_text())["frames"]]
    assert [round(p["translation_mm"][0], 6) for p in poses] == [0, 40, -10]
    turn = cv2.Rodrigues(np.array(poses[1]["rotation"]).reshape(3, 3))[0].ravel()
    assert np.abs(np.rad2deg(turn) - [10, 0, 5]).max() < 1e-6
    assert not (out / "cam0/frame_00000.pgm").exists()


def test_the_demo_scene_shows_the_target_from_all_sides(tmp_path):
    (tmp_path / "target.json").write_text(json.dumps({
        "format": "tessera-target", "version": 1, "rows": 7, "cols": 12, "patch_mm": 120,
        "ids": np.arange(84).reshape(7, 12).tolist(), "turns": [[0] * 12] * 7}))
    run = tool(DEMO, "--target", tmp_path / "target.json", "--out", tmp_path / "out", "--truth-only")
    assert run.returncode == 0, run.stderr
    for camera in ("cam0", "cam1", "cam2"):
        rows = [r for r in truth_rows(tmp_path / "out", camera) if r["visible"]]
        frames = {r["frame"] for r in rows}
        assert len(frames) == 25 and len(rows) > 25 * 600
        cells = {(int(r["x"] // 320), int(r["y"] // 270)) for r in rows}
        assert len(cells) == 24  # all of a 6 x 4 grid over the image
        assert np.percentile([r["minor"] for r in rows], 1) > 2.5


def scene_with(folder, change):
    scene = json.loads(write_scene(folder).read_text())
    change(scene)
    (folder / "scene.json").write_text(json.dumps(scene))
    return folder / "scene.json"


@pytest.mark.parametrize("change, words", [
    (lambda s: s.update(colour=1), ["scene.json", "`colour`"]),
    (lambda s: s.update(version=2), ["`version`"]),
    (lambda s: s.update(target="none.json"), ["none.json"]),
    (lambda s: s.pop("path"), ["`path` is missing"]),
    (lambda s: s["path"].update(kind="walk"), ["`kind`", "wave"]),
    (lambda s: s["path"]["views"][0].update(patch_px="big"), ["views[0]", "`patch_px`"]),
    (lambda s: s["cameras"][0].update(bits=9), ["cameras[0]", "`bits`"]),
    (lambda s: s["cameras"][0].update(model="pinhole"), ["`model`"]),
    (lambda s: s["cameras"][0].update(width=10**9), ["`width`"]),
    (lambda s: s["cameras"][0].update(name="../up"), ["`name`"]),
    (lambda s: s["cameras"][0].update(distortion=[0] * 6), ["`distortion`"]),
    (lambda s: s["cameras"][0].update(cam_from_rig={"rotation": [1, 0, 0, 0, 1, 0, 0, 0, -1]}),
     ["cam_from_rig", "`rotation`"]),
    (lambda s: s["cameras"].append(s["cameras"][0]), ["two of the name cam0"]),
])
def test_a_bad_scene_gets_one_sentence_that_names_the_place(tmp_path, change, words):
    run = tool(scene_with(tmp_path, change), "--out", tmp_path / "out")
    assert run.returncode == 1
    assert run.stderr.count("\n") == 1
    for word in words:
        assert word in run.stderr
    assert not (tmp_path / "out").exists()


def test_keys_for_own_use_are_let_through(tmp_path):
    render(scene_with(tmp_path, lambda s: s.update(x_note="mine")), "--truth-only")


@pytest.mark.parametrize("words, exit_code, text", [
    (["--frames", "3:9"], 1, "frames 0:1"),
    (["--frames", "a:b"], 1, "--frames"),
    (["--only", "cam7"], 1, "cam7"),
    (["--jobs", "0"], 2, "--jobs"),
    (["--unheard-of"], 2, "unheard-of"),
])
def test_wrong_words_get_one_sentence(tmp_path, words, exit_code, text):
    run = tool(write_scene(tmp_path), "--out", tmp_path / "out", *words)
    assert run.returncode == exit_code
    assert text in run.stderr


def test_missing_and_broken_scene_files_are_named(tmp_path):
    assert "none.json" in tool(tmp_path / "none.json", "--out", tmp_path / "out").stderr
    (tmp_path / "torn.json").write_text('{"format": ')
    run = tool(tmp_path / "torn.json", "--out", tmp_path / "out")
    assert run.returncode == 1 and "torn.json" in run.stderr and run.stderr.count("\n") == 1
    run = tool(tmp_path, "--out", tmp_path / "out")
    assert run.returncode == 1 and run.stderr.count("\n") == 1
    assert tool().returncode == 2


def test_frames_of_another_recording_are_not_mixed_in(tmp_path):
    scene = write_scene(tmp_path)
    out = render(scene)
    stranger = out / "cam0" / "frame_00031.pgm"
    stranger.write_bytes(b"P5\n1 1\n255\n0")
    run = tool(scene, "--out", out)
    assert run.returncode == 1 and "frame_00031.pgm" in run.stderr
    assert stranger.exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    scene = write_scene(tmp_path)
    (tmp_path / "file").write_text("")
    run = tool(scene, "--out", tmp_path / "file" / "out")
    assert run.returncode == 1 and "file/out" in run.stderr and run.stderr.count("\n") == 1


def test_a_full_disk_is_reported_and_leaves_no_torn_file(tmp_path):
    scene = write_scene(tmp_path)
    out = tmp_path / "out"
    # A limit of 8 KiB a file stands in for the full disk: the frame has 43.
    run = subprocess.run(["sh", "-c", f"trap '' XFSZ; ulimit -f 8; exec {BIN}/tessera-render {scene} --out {out}"],
                         capture_output=True, text=True)
    assert run.returncode == 1 and "frame_00000.pgm" in run.stderr and run.stderr.count("\n") == 1
    assert [p.name for p in (out / "cam0").iterdir()] == []


def test_help_and_version_are_there():
    assert tool("--help").returncode == 0 and "--frames" in tool("--help").stdout
    assert tool("--version").returncode == 0 and "tessera-render" in tool("--version").stdout
