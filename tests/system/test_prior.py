"""tessera-rig solve --prior: lenses from the lab, the rig on site. That the errors which it leaves are as
large as it says is shown by simulated solves in tests/unit_host/test_prior.cc."""
import copy
import json
import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
import simulate  # noqa: E402
from solved import NOISE_PX, run, simulated, solved  # noqa: E402


def site(tmp_path, change=lambda cameras: None, frames=14, seed=17):
    """Observations on site of the rig that the lab calibrated, changed."""
    cameras = copy.deepcopy(solved().cameras)
    change(cameras)
    board, _, rows = simulated(cameras, seed, frames)
    simulate.write_folder(tmp_path / "site", cameras, board, rows, sigma=NOISE_PX)
    return tmp_path / "site"


def solve(folder, *options, expect=0):
    out = folder.parent / "out"
    result = run("solve", folder, "--out", out, "--model", "brown", *options, expect=expect)
    if expect:
        assert not out.exists()
        return result.stderr.strip().splitlines()[-1]
    return json.loads((out / "rig.json").read_text())


def test_a_prior_makes_lenses_and_poses_surer_and_they_stay_true(tmp_path):
    folder = site(tmp_path, frames=5)
    plain = solve(folder)
    lenses = solve(folder, "--prior", solved().path)
    poses = solve(folder, "--prior", solved().path, "--prior-poses")
    for i, known in enumerate(solved().cameras):
        std = [rig["cameras"][i]["standard_deviation"] for rig in (plain, lenses, poses)]
        lab = solved().json["cameras"][i]["standard_deviation"]["fx"]
        assert std[1]["fx"] < lab < std[0]["fx"] and std[2]["fx"] <= 1.001 * std[1]["fx"]
        for rig, own in zip((lenses, poses), std[1:]):
            # One of these 24 numbers lies beyond 4.5 of its deviations in 6,000 runs.
            for key in ("fx", "fy", "cx", "cy"):
                assert abs(rig["cameras"][i][key] - known[key]) < 4.5 * own[key]
        if i > 0:
            # Both know less than both together; 2 % are left for the two solutions to differ in.
            lab = solved().json["cameras"][i]["standard_deviation"]["translation_mm"]
            for both, site_only, lab_only in zip(std[2]["translation_mm"], std[1]["translation_mm"], lab):
                assert both < 1.02 * min(site_only, lab_only)


def test_two_frames_are_enough_with_known_lenses(tmp_path):
    folder = site(tmp_path, frames=2)
    assert "usable view" in solve(folder, expect=1)
    rig = solve(folder, "--prior", solved().path)
    for camera, known in zip(rig["cameras"][1:], solved().cameras[1:]):
        turn = np.array(camera["cam_from_rig"]["rotation"]).reshape(3, 3)
        shift = np.array(camera["cam_from_rig"]["translation_mm"])
        miss = turn.T @ shift - known["cam_from_rig"][0].T @ known["cam_from_rig"][1]
        std = camera["standard_deviation"]
        bound = np.linalg.norm(std["translation_mm"]) + 600 * np.radians(np.linalg.norm(std["rotation_deg"]))
        assert np.linalg.norm(miss) < 4.5 * bound < 20.0


def test_swapped_names_are_told(tmp_path):
    def swap(cameras):
        cameras[0]["name"], cameras[1]["name"] = "cam1", "cam0"
    complaint = solve(site(tmp_path, swap), "--prior", solved().path, expect=1)
    assert "'cam1'" in complaint and "'cam0'" in complaint and "swapped" in complaint


def test_a_lens_that_was_changed_is_named(tmp_path):
    def touch(cameras):
        cameras[2]["fx"] *= 1.003
        cameras[2]["fy"] *= 1.003
    complaint = solve(site(tmp_path, touch), "--prior", solved().path, expect=1)
    assert "'cam2' contradicts the prior" in complaint and "sigmas" in complaint and "'cam0'" not in complaint


@pytest.mark.parametrize("change, options, words", [
    (lambda rig: rig.pop("covariance"), [], ["no 'covariance'"]),
    (lambda rig: rig["cameras"][0].update(width=1000), [], ["'cam0'", "1000 x 1080", "1920 x 1080"]),
    (lambda rig: [rig["cameras"][i].update(name=f"x{i}") for i in range(3)] and rename(rig), [],
     ["no camera of the prior"]),
    (lambda rig: None, ["--model", "rational"], ["'cam0'", "--model brown"]),
])
def test_a_prior_that_cannot_be_one_is_refused(change, options, words, tmp_path):
    rig = json.loads(solved().path.read_text())
    change(rig)
    (tmp_path / "prior.json").write_text(json.dumps(rig))
    folder = site(tmp_path, frames=3)
    result = run("solve", folder, "--out", tmp_path / "out", *(options or ["--model", "brown"]), "--prior",
                 tmp_path / "prior.json", expect=1)
    for word in [*words, "prior.json"]:
        assert word in result.stderr.strip().splitlines()[-1]


def rename(rig):
    names = rig["covariance"]["parameters"]
    names[:] = [n.replace("cam", "x") for n in names]


def test_a_model_left_to_the_tool_is_the_priors_and_stays_it(tmp_path):
    # Rational lenses describe Brown's as well; where nothing is given the tool would take Brown's.
    lab = tmp_path / "lab"
    run("solve", site(tmp_path / "first"), "--out", lab, "--model", "rational")
    rig = json.loads((lab / "rig.json").read_text())
    assert {camera["model"] for camera in rig["cameras"]} == {"rational"}
    folder = site(tmp_path / "second", seed=18)
    run("solve", folder, "--out", tmp_path / "out", "--prior", lab / "rig.json")
    later = json.loads((tmp_path / "out" / "rig.json").read_text())
    for camera, before in zip(later["cameras"], rig["cameras"]):
        assert camera["model"] == "rational"
        # Both recordings together know fx better than the first.
        assert camera["standard_deviation"]["fx"] < before["standard_deviation"]["fx"]
    assert all(board["surface"] is None for board in later["boards"])


def bow_mm(board):
    """A bow of 1 mm between middle and edge."""
    low, high = board[:, :2].min(axis=0), board[:, :2].max(axis=0)
    u, v = ((board[:, :2] - (low + high) / 2) / ((high - low) / 2)).T
    return 1.0 - (u * u + v * v) / 2


@pytest.fixture(scope="module")
def bowed(tmp_path_factory):
    """The lab's rig sees a bowed board on site: solved without the lab, with its lenses, with its poses too."""
    folder = tmp_path_factory.mktemp("bowed")
    board = simulate.grid_board(7, 12, 100.0, (0.0, 0.0))
    bent = board.copy()
    bent[:, 2] += bow_mm(board)
    poses = simulate.make_path(14, np.random.default_rng(21), board)
    rng = np.random.default_rng(22)
    rows = []
    for c, camera in enumerate(solved().cameras):
        turn_cr, shift_cr = camera["cam_from_rig"]
        for frame, (turn, shift) in enumerate(poses):
            pixels = simulate.project(camera, (bent[:, :3] @ turn.T + shift) @ turn_cr.T + shift_cr)
            inside = ((pixels > 0) & (pixels < [camera["width"] - 1, camera["height"] - 1])).all(axis=1)
            rows += [(c, frame, int(point), *(pixels[point] + rng.normal(0, NOISE_PX, 2)), False)
                     for point in np.flatnonzero(inside)]
    simulate.write_folder(folder / "site", solved().cameras, board, rows, sigma=NOISE_PX)
    return folder / "site", board, [solve(folder / "site", *options) for options in (
        (), ("--prior", solved().path), ("--prior", solved().path, "--prior-poses"))]


def test_a_bowed_board_is_found_bowed_with_a_prior_that_makes_everything_surer(bowed):
    _, board, (plain, lenses, poses) = bowed
    truth = bow_mm(board) - bow_mm(board).mean()
    for rig in (lenses, poses):
        # As in test_solve_models.py, from a fifth as many views of a quarter of the points at two fifths of
        # the noise: about twice the error.
        assert rig["boards"][0]["surface"]["rms_um"] == pytest.approx(1000 * truth.std(), abs=40)
        assert rig["rmse_px"] == pytest.approx(NOISE_PX * np.sqrt(2), rel=0.1)
    for i, known in enumerate(solved().cameras):
        lab = solved().json["cameras"][i]["standard_deviation"]
        std = [rig["cameras"][i]["standard_deviation"] for rig in (plain, lenses, poses)]
        assert std[1]["fx"] < min(lab["fx"], std[0]["fx"]) and std[2]["fx"] <= 1.001 * std[1]["fx"]
        for rig, own in zip((lenses, poses), std[1:]):
            for key in ("fx", "fy", "cx", "cy"):
                assert abs(rig["cameras"][i][key] - known[key]) < 4.5 * own[key]
            if i > 0:
                turn, shift = known["cam_from_rig"]
                pose = rig["cameras"][i]["cam_from_rig"]
                miss = np.array(pose["translation_mm"]) - shift
                assert (np.abs(miss) < 4.5 * np.array(own["translation_mm"])).all()
        if i > 0:
            assert (np.array(std[2]["translation_mm"]) < 1.02 * np.array(std[1]["translation_mm"])).all()


def test_held_flat_a_bowed_board_contradicts_the_prior_by_name(bowed, tmp_path):
    result = run("solve", bowed[0], "--out", tmp_path / "out", "--flat", "--prior", solved().path, expect=1)
    complaint = result.stderr.strip().splitlines()[-1]
    assert "contradicts the prior" in complaint and "sigmas" in complaint and not (tmp_path / "out").exists()


def test_prior_poses_wants_a_prior(tmp_path):
    assert run("solve", tmp_path, "--out", tmp_path / "out", "--prior-poses").returncode == 2
