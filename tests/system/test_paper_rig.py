"""From pixels to the rig on few and small frames; `make paper-accuracy` does it on the paper's own set-up."""
import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin"))
sys.path.insert(0, str(ROOT / "tools" / "accuracy"))

import paper_rig  # noqa: E402
import paper_split  # noqa: E402
from paper_frames import SHORT, Frames  # noqa: E402


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    frames = Frames(SHORT, 1, BIN, tmp_path_factory.mktemp("paper"), jobs=os.cpu_count() or 1)
    frames.look_at_all()
    return frames


@pytest.fixture(scope="module")
def rig(frames):
    return paper_rig.solved(frames, BIN, [])


def test_every_point_is_as_near_to_its_projection_as_the_limit_allows(frames, rig):
    found = paper_rig.judge(frames, rig)
    limit = found["detector"].limit_px()
    # Twice the limit is what is asked for on the paper's frames (0.008 px where it is 0.004) and here; the
    # detector itself may be at 1.5 times the limit (docs/accuracy.md).
    assert SHORT.rmse_max_px <= 2 * limit
    assert found["good"], found
    # 5,824 points, 66 unknowns: a solution cannot fit better than its noise by more than one half of 66 / 11648.
    assert found["rmse all"] > 0.95 * found["detector"].rms_px()
    assert found["detector"].wrong_ids == 0


def test_the_reported_error_is_over_all_points_and_right(frames, rig):
    """Computed anew from rig.json and the observations, by mathematics that shares no line with the solver."""
    data = paper_split.columns(frames, rig)
    content = rig.content
    assert len(data) == content["observations"] + content["rejected"] == sum(1 for _ in frames.detections())
    lengths = np.hypot(data[:, 1], data[:, 2])
    # The solver's circle centres are exact to 0.001 px (here to far less), which is uncorrelated with the noise.
    assert np.sqrt((lengths**2).mean()) == pytest.approx(content["rmse_all_px"], rel=0.01)
    for c, camera in enumerate(rig.cameras):
        own = data[data[:, 0] == c]
        white = np.hypot(own[:, 1], own[:, 2]) / own[:, 5]
        assert np.sqrt((white**2).mean() / 2) == pytest.approx(camera["whitened_rms"], rel=0.01)


def test_points_that_were_rejected_count_in_rmse_all(frames, rig, tmp_path):
    frames.write_observations(tmp_path / "in")
    lines = (tmp_path / "in" / "observations.csv").read_text().splitlines()
    wrong = range(100, len(lines), 500)
    for at in wrong:
        cells = lines[at].split(",")
        cells[4] = str(float(cells[4]) + 3.0)
        lines[at] = ",".join(cells)
    (tmp_path / "in" / "observations.csv").write_text("\n".join(lines) + "\n")
    frames.call("tessera-rig", "solve", tmp_path / "in", "--out", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "rig.json").read_text())
    assert found["rejected"] == len(wrong)
    # 3 px and a residual of 0.006 px, whose sum has the square 9 + 0.00004 on average; the used points move by what
    # 12 of 5,824 weigh.
    squares = found["rmse_px"]**2 * found["observations"] + 9.0 * len(wrong)
    expected = np.sqrt(squares / (found["observations"] + found["rejected"]))
    assert found["rmse_all_px"] == pytest.approx(expected, rel=0.005)
    assert found["rmse_px"] == pytest.approx(rig.content["rmse_px"], rel=0.02)


def test_renderer_and_simulator_mean_the_same_centre(frames):
    """Distortion makes the edge of a circle no ellipse, and fits that weight its points otherwise differ: by 0.0001 px
    here, by 0.04 px for large tilted circles in the corners of a wide lens. The solver's is held to the simulator's
    by tests/unit_host/test_view_kernel.cc."""
    index = {point: i for i, point in enumerate(frames.ids)}
    worst = 0.0
    for camera, rows in zip(frames.truth.cameras, frames.true_rows()):
        turn_cr, shift_cr = camera["cam_from_rig"]
        for instant in range(SHORT.instants):
            own = [row for row in rows if row["frame"] == instant]
            turn = turn_cr @ frames.truth.poses[0][instant]
            at = [index[int(row["patch"]) * 128 + int(row["feature"])] for row in own]
            points = frames.board[at, :3] @ turn.T + turn_cr @ frames.truth.poses[1][instant] + shift_cr
            centres = paper_split.truth_circles.image_of_circles(
                camera, points, frames.board[at, 3], np.broadcast_to(turn[:, :2], (len(at), 3, 2)))
            worst = np.nanmax([worst, *np.hypot(*(centres - [[row["x"], row["y"]] for row in own]).T)])
    # truth.csv has seven decimals; 24 samples and three rounds leave 1e-6 px.
    assert 0 < worst < 2e-6
