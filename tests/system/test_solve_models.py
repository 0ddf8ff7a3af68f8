"""tessera-rig solve on lenses that no formula fits and boards that are not flat: what is chosen, how near
it comes to the truth, and that it costs nothing where it is not needed."""
import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))
import simulate  # noqa: E402

RIG = str(pathlib.Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")) / "tessera-rig")
NOISE_PX = 0.05
FRAMES = 24


def run(*arguments, stdin=None):
    return subprocess.run([RIG, *map(str, arguments)], input=stdin, capture_output=True, text=True,
                          timeout=300)


def solve(folder, out, *options):
    result = run("solve", folder, "--out", out, *options)
    assert result.returncode == 0, result.stderr
    return json.loads((out / "rig.json").read_text()), result.stdout


def field_px(pixels):
    """A smooth shift of up to 2 px: a wave across the image and a bump."""
    x, y = pixels[:, 0], pixels[:, 1]
    wave = np.sin(2 * np.pi * (x / 1300 + y / 1700))
    bump = np.exp(-((x - 600)**2 + (y - 700)**2) / (2 * 280.0**2))
    return np.stack([1.2 * wave - 0.8 * bump, 0.8 * wave + 1.2 * bump], axis=-1)


def bow_mm(board):
    """A bow of 1 mm between middle and edge."""
    half = np.ptp(board[:, :2], axis=0) / 2
    u, v = ((board[:, :2] - board[:, :2].min(axis=0) - half) / half).T
    return 1.0 - (u * u + v * v) / 2


def observe(cameras, board, poses, seed, bent=False, shifted=()):
    """As simulate.make_scene for corners, of a board that is bowed and cameras of which some have the field."""
    rng = np.random.default_rng(seed)
    points = board[:, :3].copy()
    points[:, 2] += bow_mm(board) if bent else 0.0
    rows = []
    for c, camera in enumerate(cameras):
        turn_cr, shift_cr = camera["cam_from_rig"]
        for frame, (turn, shift) in enumerate(poses):
            there = (points @ turn.T + shift) @ turn_cr.T + shift_cr
            pixels = simulate.project(camera, there)
            pixels += field_px(pixels) if c in shifted else 0.0
            inside = ((pixels > 0) & (pixels < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
            for point in np.flatnonzero(inside):
                rows.append((c, frame, int(point), *(pixels[point] + rng.normal(0, NOISE_PX, 2)), False))
    return rows


def make(folder, sigma=NOISE_PX, frames=FRAMES, seed=8, **kind):
    rng = np.random.default_rng(5)
    cameras = simulate.make_cameras(2, rng)
    board = simulate.grid_board(14, 24, 50.0, (0.0, 0.0))
    poses = simulate.make_path(frames, rng, board)
    rows = observe(cameras, board, poses, seed, **kind)
    simulate.write_folder(folder, cameras, board, rows, sigma)
    return cameras, board, rows


def pixels_of(rig, camera, points):
    result = run("project", rig, "--camera", camera["name"], stdin="x,y,z\n" + "".join(
        f"{x!r},{y!r},{z!r}\n" for x, y, z in points.tolist()))
    return np.genfromtxt(result.stdout.splitlines()[1:], delimiter=",")


def projection_error(rig, camera, seen):
    """RMS over the pixels of a grid that have an observation within 40 px, after the best rotation."""
    grid = np.stack(np.meshgrid(np.arange(20, 1900, 60), np.arange(20, 1060, 60)), axis=-1).reshape(-1, 2)
    near = np.array([np.abs(seen - p).max(axis=1).min() < 40 for p in grid])
    # The true pixel of a ray is what the field makes of the formula's.
    rays = np.stack([(grid[near, 0] - camera["cx"]) / camera["fx"], (grid[near, 1] - camera["cy"]) / camera["fy"],
                     np.ones(near.sum())], axis=-1)
    base = simulate.project(camera, rays)
    truth = base + field_px(base)
    inside = ((truth > 0) & (truth < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
    rays, truth = rays[inside], truth[inside]
    turn = np.eye(3)
    for _ in range(6):
        found = pixels_of(rig, camera, rays @ turn.T)
        columns = []
        for axis in np.eye(3):
            moved = pixels_of(rig, camera, rays @ (simulate.rotation(1e-5 * axis) @ turn).T)
            columns.append(((moved - found) / 1e-5).ravel())
        step = np.linalg.lstsq(np.stack(columns, axis=-1), (truth - found).ravel(), rcond=None)[0]
        turn = simulate.rotation(step) @ turn
    miss = pixels_of(rig, camera, rays @ turn.T) - truth
    return np.sqrt((miss**2).sum(axis=1).mean())


@pytest.fixture(scope="module")
def unfittable(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unfittable")
    cameras, _, rows = make(folder / "in", shifted=(0, 1))
    rig, text = solve(folder / "in", folder / "out")
    return folder, cameras, rows, rig, text


def test_a_lens_that_no_formula_fits_gets_a_field_and_comes_within_a_tenth_of_a_pixel(unfittable):
    folder, cameras, rows, rig, text = unfittable
    for c, camera in enumerate(rig["cameras"]):
        assert camera["model"] == "spline" and camera["base"] in ("brown", "rational", "thin-prism")
        count = camera["spline"]["columns"] * camera["spline"]["rows"]
        assert len(camera["spline"]["x_px"]) == len(camera["spline"]["y_px"]) == count
        seen = np.array([row[3:5] for row in rows if row[0] == c])
        assert projection_error(folder / "out" / "rig.json", cameras[c], seen) < 0.1
    assert rig["boards"][0]["surface"] is None
    assert "spline" in text and "taken" in text


def test_brown_as_told_stays_brown_and_the_summary_warns(unfittable):
    folder, cameras, rows, _, _ = unfittable
    rig, text = solve(folder / "in", folder / "brown", "--model", "brown")
    assert [camera["model"] for camera in rig["cameras"]] == ["brown", "brown"]
    # The field is 15 to 40 times the noise, and what Brown's terms leave of it several times.
    assert rig["held_out"] is not None
    assert "residuals are" in text or "not to be trusted" in text or "too small to be trusted" in text


def test_told_camera_by_camera_one_gets_a_field_and_the_other_keeps_its_formula(tmp_path):
    cameras, _, rows = make(tmp_path / "in", shifted=(0,))
    rig, _ = solve(tmp_path / "in", tmp_path / "out", "--model", "cam0=spline,cam1=brown", "--flat")
    assert [camera["model"] for camera in rig["cameras"]] == ["spline", "brown"]
    assert rig["cameras"][0]["base"] == "brown"
    seen = np.array([row[3:5] for row in rows if row[0] == 0])
    assert projection_error(tmp_path / "out" / "rig.json", cameras[0], seen) < 0.1
    std = rig["cameras"][1]["standard_deviation"]
    for key in ("fx", "fy", "cx", "cy"):
        assert abs(rig["cameras"][1][key] - cameras[1][key]) < 4.5 * std[key], key


def test_a_field_as_told_over_an_ordinary_lens_costs_what_its_freedom_costs(tmp_path):
    cameras, _, rows = make(tmp_path / "in")
    # Nothing asks for a field, so its cells stay the coarsest: 84 control points beside 9 intrinsics. The
    # error of a mean over the image grows as the root of the unknowns, sqrt(93 / 9) = 3.2 of Brown's own
    # error, which is sqrt(9 / (2 * 8000 points)) * 0.05 px = 0.0012 px a component; poses take their share,
    # thrice that at the border of the data.
    rig, _ = solve(tmp_path / "in", tmp_path / "out", "--model", "spline")
    for c, camera in enumerate(rig["cameras"]):
        assert (camera["model"], camera["base"]) == ("spline", "brown")
        assert camera["spline"]["columns"] - 3 == 4
        rays = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.2, 0.2, 5), [1.0]), -1).reshape(-1, 3)
        seen = np.array([row[3:5] for row in rows if row[0] == c])
        truth = simulate.project(cameras[c], rays)
        near = [np.abs(seen - p).max(axis=1).min() < 40 for p in truth]
        miss = pixels_of(tmp_path / "out" / "rig.json", camera, rays[near]) - truth[near]
        # A shift of all pixels is a turn of the camera, which is not the lens's.
        assert np.sqrt(((miss - miss.mean(axis=0))**2).sum(axis=1).mean()) < 0.03
    assert rig["boards"][0]["surface"] is None
    # Error bars in pixels have the field's share; that they are right with it is shown in test_error_bars.cc.
    assert len(rig["cameras"][0]["spline"]["variance_px2"]["xx"]) == 17 * 13
    bars = []
    for change in (lambda camera: None, lambda camera: camera["spline"].pop("variance_px2")):
        for camera in rig["cameras"]:
            change(camera)
        (tmp_path / "rig.json").write_text(json.dumps(rig))
        table = run("uncertainty", tmp_path / "rig.json").stdout
        bars.append(float(next(line for line in table.splitlines() if line.startswith("cam0")).split()[3]))
    assert bars[0] > bars[1]
    rig["cameras"][1]["spline"]["variance_px2"] = {"columns": 17, "rows": 13, "xx": [], "xy": [], "yy": []}
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    assert "'variance_px2'" in run("uncertainty", tmp_path / "rig.json").stderr


def test_two_recordings_through_fields_are_the_same(tmp_path):
    for name, seed in (("one", 8), ("two", 9)):
        make(tmp_path / name, seed=seed)
        solve(tmp_path / name, tmp_path / f"{name}-out", "--model", "spline", "--flat")
    out = run("compare", tmp_path / "one-out" / "rig.json", tmp_path / "two-out" / "rig.json", "--check")
    assert out.returncode == 0 and "are the same" in out.stdout, out.stdout
    rig = json.loads((tmp_path / "two-out" / "rig.json").read_text())
    rig["cameras"][0]["distortion"][0] += 0.005
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    out = run("compare", tmp_path / "one-out" / "rig.json", tmp_path / "rig.json", "--check")
    assert out.returncode == 1 and "'cam0': its lens differs" in out.stdout, out.stdout


def test_too_few_views_do_not_carry_a_field_that_is_told(tmp_path):
    make(tmp_path / "in", frames=7)
    result = run("solve", tmp_path / "in", "--out", tmp_path / "out", "--model", "cam1=spline,brown")
    assert result.returncode == 1 and not (tmp_path / "out").exists()
    sentence = result.stderr.strip().splitlines()[-1]
    assert "'cam1' has too few data for a spline lens: 7 views" in sentence and "--model brown" in sentence


@pytest.mark.parametrize("model, status, words", [
    ("sphere", 2, ["'sphere' is not one of", "thin-prism", "spline"]),
    ("cam0=spine", 2, ["'spine' is not one of"]),
    ("cubic+spline", 2, ["'cubic+spline'"]),
    ("brown,rational", 2, ["two lenses", "not named"]),
    ("cam0=brown,cam0=auto", 2, ["two lenses", "'cam0'"]),
    ("left=brown", 1, ["'left'", "'cam0', 'cam1'"])])
def test_a_lens_that_cannot_be_told_is_refused(unfittable, tmp_path, model, status, words):
    result = run("solve", unfittable[0] / "in", "--out", tmp_path / "out", "--model", model)
    assert result.returncode == status and not (tmp_path / "out").exists()
    for word in words:
        assert word in result.stderr


def test_unproject_undoes_project_through_a_field(unfittable):
    folder, cameras, _, _, _ = unfittable
    pixels = np.array([[300.0, 200.0], [960.5, 540.25], [1500.0, 900.0]])
    rays = run("unproject", folder / "out" / "rig.json", "--camera", cameras[0]["name"],
               stdin="x,y\n" + "".join(f"{x!r},{y!r}\n" for x, y in pixels.tolist()))
    rays = np.genfromtxt(rays.stdout.splitlines()[1:], delimiter=",")
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    # The iteration's own limit is 1e-6 px.
    assert np.abs(pixels_of(folder / "out" / "rig.json", cameras[0], rays) - pixels).max() < 2e-6


@pytest.mark.parametrize("sigma", [NOISE_PX, None])
def test_a_bowed_board_is_found_bowed(tmp_path, sigma):
    cameras, board, _ = make(tmp_path / "in", sigma=sigma, bent=True)
    rig, text = solve(tmp_path / "in", tmp_path / "out", "--model", "brown")
    surface = rig["boards"][0]["surface"]
    truth = bow_mm(board)
    truth = truth - truth.mean()
    # A point is seen by 0.05 px at 1.4 px a millimetre times the tangent of some 0.3 rad, in some 40
    # views, and a surface of 13 unknowns averages over 336 / 13 of them: 4 micrometres; a lens that takes
    # part adds as much. Of the extremes of 336 places, five times that.
    assert surface["highest_um"] == pytest.approx(1000 * truth.max(), abs=40)
    assert surface["lowest_um"] == pytest.approx(1000 * truth.min(), abs=40)
    assert surface["rms_um"] == pytest.approx(1000 * truth.std(), abs=20)
    assert (tmp_path / "out" / "surface-a.png").read_bytes().startswith(b"\x89PNG")
    assert "board a is not flat" in text
    for camera, known in zip(rig["cameras"], cameras):
        std = camera["standard_deviation"]
        # As in test_solve.py; over 40 draws these quotients have an RMS of 0.9 to 1.2, 2.6 at most.
        for key in ("fx", "fy", "cx", "cy"):
            assert abs(camera[key] - known[key]) < 4.5 * std[key], key
        assert std["fx"] < 1e-3 * camera["fx"]


def test_flat_holds_a_board_flat(tmp_path):
    make(tmp_path / "in", bent=True)
    rig, text = solve(tmp_path / "in", tmp_path / "out", "--model", "brown", "--flat")
    assert rig["boards"][0]["surface"] is None
    assert rig["held_out"] is None
    assert "--flat" in rig["made_by"]["command"]
    assert max(camera["noise_factor"] for camera in rig["cameras"]) > 1.2


def test_a_flat_board_and_an_ordinary_lens_stay_as_simple_as_they_are(tmp_path):
    make(tmp_path / "in")
    free, _ = solve(tmp_path / "in", tmp_path / "free")
    held, _ = solve(tmp_path / "in", tmp_path / "held", "--model", "brown", "--flat")
    assert [camera["model"] for camera in free["cameras"]] == ["brown", "brown"]
    assert free["boards"][0]["surface"] is None
    for a, b in zip(free["cameras"], held["cameras"]):
        for key in ("fx", "fy", "cx", "cy", "distortion", "cam_from_rig"):
            assert a[key] == b[key]
    out = free["held_out"]
    assert out["instants"] == FRAMES
    assert out["rms_sigmas"] < out["allowed_sigmas"]


def test_too_few_frames_choose_nothing(tmp_path):
    make(tmp_path / "in", frames=7, bent=True)
    rig, _ = solve(tmp_path / "in", tmp_path / "out")
    assert rig["held_out"] is None
    assert rig["boards"][0]["surface"] is None


@pytest.mark.parametrize("key, value, word", [
    ("columns", 3, "columns"), ("x_px", [0.0], "x_px"), ("step_px", [0.0, 1.0], "step_px"),
    ("origin_px", None, "origin_px"), (None, None, "spline")])
def test_a_spline_lens_that_is_damaged_is_refused_by_name(unfittable, tmp_path, key, value, word):
    rig = json.loads((unfittable[0] / "out" / "rig.json").read_text())
    if key is None:
        del rig["cameras"][0]["spline"]
    else:
        rig["cameras"][0]["spline"][key] = value
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    result = run("project", tmp_path / "rig.json", "--camera", "cam0", stdin="x,y,z\n0,0,1\n")
    assert result.returncode == 1
    assert "cameras[0]" in result.stderr and word in result.stderr
