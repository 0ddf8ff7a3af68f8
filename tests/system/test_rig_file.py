"""What rig.json says about its own errors."""
import json
import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
import simulate  # noqa: E402
from solved import NOISE_PX, run, simulated, solved  # noqa: E402

MOTION = [f"{kind}_{axis}" for kind in ("rotation", "translation") for axis in "xyz"]


def covariance_of(rig):
    """(names, symmetric matrix) as host/README.md describes them."""
    names, lower = rig["covariance"]["parameters"], rig["covariance"]["lower"]
    matrix = np.zeros((len(names), len(names)))
    matrix[np.tril_indices(len(names))] = lower
    return names, matrix + np.tril(matrix, -1).T


def test_the_covariance_names_every_parameter_and_agrees_with_the_standard_deviations():
    rig = solved().json
    names, matrix = covariance_of(rig)
    lens = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"]
    assert names == ([f"cam0.{n}" for n in lens] + [f"cam1.{n}" for n in lens + MOTION]
                     + [f"cam2.{n}" for n in lens + MOTION] + [f"boards.{n}" for n in MOTION])
    deviation = dict(zip(names, np.sqrt(np.diag(matrix))))
    for camera in rig["cameras"]:
        name, std = camera["name"], camera["standard_deviation"]
        listed = [std[k] for k in lens[:4]] + std["distortion"]
        if name != "cam0":
            listed += list(np.radians(std["rotation_deg"])) + std["translation_mm"]
        found = [deviation[f"{name}.{n}"] for n in (lens if name == "cam0" else lens + MOTION)]
        assert found == pytest.approx(listed, rel=1e-12)
    scale = 1 / np.sqrt(np.diag(matrix))
    # A correlation matrix; its numbers are written with all their digits, which leaves 1e-16 times its size.
    assert np.linalg.eigvalsh(matrix * scale * scale[:, None]).min() > -1e-14 * len(names)


def test_the_covariance_takes_one_line_a_row():
    rig = solved()
    names = rig.json["covariance"]["parameters"]
    rows = rig.path.read_text().split('"lower": [\n')[1].split("]")[0].splitlines()
    assert [len(row.rstrip(",").split(",")) for row in rows] == list(range(1, len(names) + 1))


@pytest.mark.parametrize("change, words", [
    (lambda c: c["parameters"].reverse(), ["covariance", "'parameters'"]),
    (lambda c: c["lower"].pop(), ["covariance", "'lower'", "numbers"]),
    (lambda c: c["lower"].__setitem__(4, None), ["covariance", "lower[4]"]),
    (lambda c: c["lower"].__setitem__(2, -1.0), ["covariance", "cam0.fy", "below 0"]),
])
def test_a_covariance_that_cannot_be_is_refused_by_key(change, words, tmp_path):
    rig = json.loads(solved().path.read_text())
    change(rig["covariance"])
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    result = run("report", tmp_path / "rig.json")
    assert result.returncode == 1
    for word in [str(tmp_path / "rig.json"), *words]:
        assert word in result.stderr


def test_parts_that_nothing_connects_have_a_frame_and_an_implied_motion_each(tmp_path):
    cameras = solved().cameras
    board, _, rows = simulated(cameras, 5, 24)
    apart = [row for row in rows if (row[0] == 2) == (row[1] % 2 == 0)]
    simulate.write_folder(tmp_path / "in", cameras, board, apart, sigma=NOISE_PX)
    run("solve", tmp_path / "in", "--out", tmp_path / "out", "--model", "brown", "--partial", expect=0)
    path = tmp_path / "out" / "rig.json"
    rig = json.loads(path.read_text())
    assert [camera["part"] for camera in rig["cameras"]] == [0, 0, 1]
    names, matrix = covariance_of(rig)
    assert names[-12:] == [f"{of}.{n}" for of in ("boards", "boards 1") for n in MOTION]
    assert "cam1.rotation_x" in names and "cam2.rotation_x" not in names
    # What nothing connects is independent; inverting both at once leaves rounding.
    first = [i for i, n in enumerate(names) if n.startswith(("cam0.", "cam1.", "boards."))]
    second = [i for i in range(len(names)) if i not in first]
    deviation = np.sqrt(np.diag(matrix))
    correlation = matrix / np.outer(deviation, deviation)
    assert np.abs(correlation[np.ix_(first, second)]).max() < 1e-9
    assert run("uncertainty", path, expect=0).stdout.count("\ncam2 ") == 4
    for form in ("kalibr", "colmap", "mrcal", "opencv"):
        assert "parts" in run("export", path, "--format", form, "--out", tmp_path / "x", expect=1).stderr
    assert "parts" in run("compare", path, path, expect=1).stderr
