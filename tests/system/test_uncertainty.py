"""tessera-rig uncertainty as a user runs it. That its numbers are honest is shown by simulated solves in
tests/unit_host/test_error_bars.cc."""
import csv
import json
import pathlib
import sys

import cv2
import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
from solved import run, solved  # noqa: E402


def read(path):
    return list(csv.DictReader(path.open()))


def test_tables_and_maps_are_written_and_agree_with_the_printed_ones(tmp_path):
    printed = run("uncertainty", solved().path, "--distances", "900,1500", "--out", tmp_path, expect=0).stdout
    rows = read(tmp_path / "projection.csv")
    assert {(r["camera"], float(r["distance_mm"])) for r in rows} == {
        (f"cam{i}", d) for i in range(3) for d in (900.0, 1500.0)}
    for row in rows:
        c = np.array([[row["xx_px2"], row["xy_px2"]], [row["xy_px2"], row["yy_px2"]]], float)
        # Six digits are written.
        assert float(row["worst_px"]) == pytest.approx(np.sqrt(np.linalg.eigvalsh(c)[1]), rel=1e-4)
    worst = max(float(r["worst_px"]) for r in rows if r["camera"] == "cam1" and r["distance_mm"] == "1500")
    assert f"{worst:.4f}" in next(line for line in printed.splitlines() if line.startswith("cam1 ")
                                  and " 1500 " in line)
    assert [r["camera"] for r in read(tmp_path / "poses.csv")] == ["cam0", "cam1", "cam2"]
    points = read(tmp_path / "triangulation.csv")
    assert len(points) > 50 and all(int(r["cameras"]) >= 2 for r in points)
    for i in range(3):
        assert cv2.imread(str(tmp_path / f"uncertainty-cam{i}.png")).shape[1] == 960


def test_pose_deviations_are_those_of_the_rig_file_about_the_centre(tmp_path):
    run("uncertainty", solved().path, "--out", tmp_path, expect=0)
    first, second, _ = read(tmp_path / "poses.csv")
    assert float(first["x_mm"]) == float(first["turn_x_deg"]) == 0.0 < float(first["world_x_mm"])
    std = solved().json["cameras"][1]["standard_deviation"]
    assert float(second["turn_y_deg"]) == pytest.approx(std["rotation_deg"][1], rel=1e-4)


def test_the_image_centre_is_surer_than_its_corners_and_noise_makes_points_less_sure(tmp_path):
    run("uncertainty", solved().path, "--out", tmp_path / "a", expect=0)
    run("uncertainty", solved().path, "--out", tmp_path / "b", "--noise-px", "0.05", expect=0)
    rows = [float(r["worst_px"]) for r in read(tmp_path / "a" / "projection.csv")]
    grid = np.array(rows[:13 * 17]).reshape(13, 17)
    # Boards wander about the middle; a corner is extrapolated.
    assert grid[6, 8] < 0.5 * min(grid[0, 0], grid[0, -1], grid[-1, 0], grid[-1, -1])
    for a, b in zip(read(tmp_path / "a" / "triangulation.csv"), read(tmp_path / "b" / "triangulation.csv")):
        assert float(b["sigma_z_mm"]) > float(a["sigma_z_mm"])


def test_a_rig_without_covariance_or_distances_is_refused(tmp_path):
    rig = json.loads(solved().path.read_text())
    for key in ("covariance", "distance_mm"):
        bad = json.loads(json.dumps(rig))
        bad.pop(key, None)
        for camera in bad["cameras"]:
            camera.pop(key, None)
        (tmp_path / "rig.json").write_text(json.dumps(bad))
        result = run("uncertainty", tmp_path / "rig.json", "--out", tmp_path / "out", expect=1)
        assert "rig.json" in result.stderr and ("solve again" in result.stderr or "--distances" in result.stderr)
        assert not (tmp_path / "out").exists()
    assert run("uncertainty", solved().path, "--distances", "-5").returncode == 2
