"""What rig.json says about its own errors."""
import json
import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "build" / "deps" / "pycolmap"))
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


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Two recordings of a rig whose third camera never sees the board with the others."""
    paths = []
    for seed in (5, 6):
        folder = tmp_path_factory.mktemp("parts")
        board, _, rows = simulated(solved().cameras, seed, 24)
        apart = [row for row in rows if (row[0] == 2) == (row[1] % 2 == 0)]
        simulate.write_folder(folder / "in", solved().cameras, board, apart, sigma=NOISE_PX)
        run("solve", folder / "in", "--out", folder / "out", "--model", "brown", "--partial", expect=0)
        paths.append(folder / "out" / "rig.json")
    return paths


def test_parts_that_nothing_connects_have_a_frame_and_an_implied_motion_each(parts):
    path = parts[0]
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


def test_parts_are_compared_one_by_one(parts, tmp_path):
    out = run("compare", *parts, "--check", expect=0).stdout
    assert f"part 1 of {parts[0]}, part 1 of {parts[1]}:" in out and "are the same" in out
    assert "How the parts stand to each other was not compared" in out
    # A whole rig has one frame; what the other file's parts can say of it is compared in each.
    out = run("compare", solved().path, parts[0], "--check", expect=0).stdout
    assert f"part 0 of {solved().path}, part 1 of {parts[0]}:" in out

    def move(rig):
        rig["cameras"][1]["cam_from_rig"]["translation_mm"][1] += 3.0
        rig["cameras"][2]["fx"] *= 1.005
    rig = json.loads(parts[1].read_text())
    move(rig)
    (tmp_path / "moved.json").write_text(json.dumps(rig))
    out = run("compare", parts[0], tmp_path / "moved.json", expect=0).stdout
    assert "'cam1' has moved by" in out and "'cam2': its lens differs" in out
    assert "With two cameras it cannot be told" in out


@pytest.mark.parametrize("form", ["kalibr", "opencv"])
def test_a_format_that_holds_one_rig_wants_a_part_chosen(parts, tmp_path, form):
    complaint = run("export", parts[0], "--format", form, "--out", tmp_path / "x", expect=1).stderr
    assert "--part, which are 0 (cam0, cam1), 1 (cam2)" in complaint and not (tmp_path / "x").exists()
    run("export", parts[0], "--format", form, "--out", tmp_path / "x", "--part", 1, "--approximate", expect=0)
    text = (tmp_path / "x").read_text()
    assert "cam2" in text and "cam1" not in text.replace("camera", "")
    complaint = run("export", parts[0], "--format", form, "--out", tmp_path / "y", "--part", 2, expect=1).stderr
    assert "no part 2; it has 0 (cam0, cam1), 1 (cam2)" in complaint and not (tmp_path / "y").exists()


def test_colmap_has_a_rig_a_part_and_mrcal_a_folder(parts, tmp_path):
    run("export", parts[0], "--format", "colmap", "--out", tmp_path / "c", expect=0)
    rigs = json.loads((tmp_path / "c" / "rig_config.json").read_text())
    assert [[camera["image_prefix"] for camera in rig["cameras"]] for rig in rigs] == [["cam0/", "cam1/"], ["cam2/"]]
    assert [[camera.get("ref_sensor", False) for camera in rig["cameras"]] for rig in rigs] == [[True, False], [True]]
    try:
        import pycolmap
    except ImportError:
        pass  # make export-peers fetches it
    else:
        read = pycolmap.read_rig_config(tmp_path / "c" / "rig_config.json")
        assert [[camera.image_prefix for camera in rig.cameras] for rig in read] == [["cam0/", "cam1/"], ["cam2/"]]
    lines = (tmp_path / "c" / "cameras.txt").read_text().splitlines()
    assert [line.split()[0] for line in lines if not line.startswith("#")] == ["1", "2", "3"]
    run("export", parts[0], "--format", "mrcal", "--out", tmp_path / "m", expect=0)
    names = sorted(str(path.relative_to(tmp_path / "m")) for path in (tmp_path / "m").rglob("*.cameramodel"))
    assert names == ["part-0/cam0.cameramodel", "part-0/cam1.cameramodel", "part-1/cam2.cameramodel"]
    text = (tmp_path / "m" / "part-1" / "cam2.cameramodel").read_text()
    assert "'extrinsics': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]" in text and "first camera of its part" in text
    run("export", parts[0], "--format", "mrcal", "--out", tmp_path / "one", "--part", 0, expect=0)
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == ["cam0.cameramodel", "cam1.cameramodel"]


def test_json_and_ros_take_all_parts(parts, tmp_path):
    run("export", parts[0], "--format", "json", "--out", tmp_path / "rig.json", expect=0)
    assert json.loads((tmp_path / "rig.json").read_text()) == json.loads(parts[0].read_text())
    assert "leave --part out" in run("export", parts[0], "--format", "json", "--out", tmp_path / "x.json",
                                     "--part", 0, expect=1).stderr
    run("export", parts[0], "--format", "ros", "--out", tmp_path / "ros", expect=0)
    assert sorted(path.name for path in (tmp_path / "ros").iterdir()) == ["cam0.yaml", "cam1.yaml", "cam2.yaml"]
