"""tessera-rig compare as a user runs it. That its verdicts come at the rate they claim is shown by simulated
pairs in tests/unit_host/test_compare.cc."""
import json
import pathlib
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
from solved import run, solved  # noqa: E402


def changed(path, change):
    rig = json.loads(solved(12).path.read_text())
    change(rig)
    path.write_text(json.dumps(rig))
    return path


def test_two_recordings_of_one_rig_are_the_same():
    result = run("compare", solved(11).path, solved(12).path, "--check", expect=0)
    assert "are the same" in result.stdout and result.stderr == ""


def test_a_rig_compared_with_itself_does_not_differ_at_all():
    out = run("compare", solved().path, solved().path, expect=0).stdout
    assert out.splitlines()[5].split()[:2] == ["cam0", "0.0000"] and "RMS 0.0000 mm" in out


def test_a_moved_camera_is_named_and_check_says_so_by_its_exit_status(tmp_path):
    def move(rig):
        rig["cameras"][2]["cam_from_rig"]["translation_mm"][1] += 3.0
    moved = changed(tmp_path / "moved.json", move)
    result = run("compare", solved(11).path, moved, expect=0)
    assert "'cam2' has moved by" in result.stdout and "'cam1' has moved" not in result.stdout
    assert "differ by more" in run("compare", solved(11).path, moved, "--check", expect=1).stderr


def test_cameras_are_matched_by_name_whatever_their_order(tmp_path):
    out = run("compare", solved(11).path, changed(tmp_path / "b.json", lambda rig: (
        rig.pop("covariance"), rig["cameras"].reverse())), expect=0).stdout
    for line in out.splitlines()[5:8]:
        # 0.02 px are the deviation of corners here, and as a part of the rig.
        assert float(line.split()[1]) < 0.06
    assert "cannot be told" in out


def test_names_that_do_not_match_are_told(tmp_path):
    def rename(rig):
        rig.pop("covariance")
        rig["cameras"][1]["name"] = "other"
    out = run("compare", solved(11).path, changed(tmp_path / "b.json", rename), expect=0).stdout
    assert "but not in" in out and "'cam1'" in out and "'other'" in out


@pytest.mark.parametrize("change, words", [
    (lambda rig: rig["cameras"][1].update(width=1000), ["'cam1'", "1920 x 1080", "1000 x 1080"]),
    (lambda rig: (rig.pop("covariance"), [c.update(name="x" + c["name"]) for c in rig["cameras"]]),
     ["no camera's name", "'cam0'", "'xcam0'"]),
])
def test_what_cannot_be_compared_is_refused(change, words, tmp_path):
    result = run("compare", solved(11).path, changed(tmp_path / "b.json", change), expect=1)
    for word in words:
        assert word in result.stderr


def test_check_wants_covariances(tmp_path):
    path = changed(tmp_path / "b.json", lambda rig: rig.pop("covariance"))
    assert "b.json" in run("compare", solved(11).path, path, "--check", expect=1).stderr
    assert "--check" in run("compare", "--help", expect=0).stdout
