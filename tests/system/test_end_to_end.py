"""The main job on a small rig: frames on disk, through the device's own program, to a calibrated rig."""
import csv
import json
import math
import os
import subprocess
import sys

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BIN = os.environ.get("TESSERA_BIN", os.path.join(ROOT, "build", "bin"))
sys.path.insert(0, os.path.join(ROOT, "tools", "demo"))
import compare  # noqa: E402  the demonstration's own comparison with the truth

CAMERAS = ["left", "right"]


def run(program, *words, **options):
    return subprocess.run([os.path.join(BIN, program), *map(str, words)], check=True, timeout=300,
                          capture_output=True, text=True, **options)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Ten instants of two cameras of 960x720, with noise, blur, motion and partial views."""
    folder = tmp_path_factory.mktemp("rig")
    run("tessera-target", "--rows", 6, "--cols", 8, "--patch-mm", 90, "--seed", 5,
        "--out", folder / "target.json")
    scene = {
        "format": "tessera-render-scene", "version": 1, "target": "target.json", "seed": 4,
        "camera_defaults": {"width": 960, "height": 720, "psf_sigma_px": 0.9, "noise": 1.0,
                            "exposure_us": 200},
        "cameras": [
            {"name": "left", "fx": 1100, "distortion": [-0.1, 0.05, 0.0002, 0, 0]},
            {"name": "right", "fx": 1240, "distortion": [-0.05, 0.02, 0, 0.0003, 0],
             "cam_from_rig": {"rotation_vector_deg": [1, 12, -2], "translation_mm": [-300, 5, 30]}},
        ],
        "path": {"kind": "wave", "count": 10, "start_ns": 1000000000, "step_ns": 100000000,
                 "centre_mm": [40, 0, 1000], "sway_mm": [160, 120, 150], "tilt_deg": 35,
                 "turn_deg": 60, "period_s": 0.9},
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    run("tessera-render", folder / "scene.json", "--out", folder / "frames")
    return folder


@pytest.fixture(scope="module")
def journal(recording):
    """What one receiver wrote of both cameras streaming at once."""
    path = recording / "rig.journal"
    with subprocess.Popen([os.path.join(BIN, "tessera-rig"), "receive", "--listen", "127.0.0.1:0",
                           "--journal", path, "--cameras", "2", "--until-closed"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as receiver:
        try:
            port = receiver.stdout.readline().strip().rsplit(":", 1)[-1].split()[-1]
            cameras = [
                subprocess.Popen([os.path.join(BIN, "tessera-replay"), "--frames",
                                  recording / "frames" / name, "--once", "--",
                                  os.path.join(BIN, "tessera-cam"), "--serial", name, "--clock", "file",
                                  "--wait", "--target", recording / "target.json",
                                  "--to", f"127.0.0.1:{port}"], stderr=subprocess.PIPE, text=True)
                for name in CAMERAS
            ]
            for camera in cameras:
                _, errors = camera.communicate(timeout=120)
                assert camera.returncode == 0, errors
            _, errors = receiver.communicate(timeout=60)
            assert receiver.returncode == 0, errors
        finally:
            receiver.kill()
    return path


@pytest.fixture(scope="module")
def result(recording, journal):
    run("tessera-rig", "solve", journal, "--target", recording / "target.json",
        "--out", recording / "result")
    return json.loads((recording / "result" / "rig.json").read_text())


def test_every_visible_circle_is_found_and_none_is_named_wrongly(recording, journal):
    features = recording / "features.csv"
    features.write_text(run("tessera-rig", "journal", "csv", journal).stdout)
    truth = compare.read_truth(recording / "frames", CAMERAS)
    complete, whole, wrong, rms, whitened = compare.compare_features(truth,
                                                                     compare.read_found(features))
    assert wrong == 0
    assert whole > 300
    assert complete >= 0.95 * whole
    # Circles of 4 to 6 px radius, contrast 154, noise 1, blur 0.94: the Cramer-Rao limit is 0.0045 to
    # 0.0055 px RMS; twice that leaves room for motion blur and strong tilt.
    assert rms < 0.011
    # An honest sigma; the packet's sigma is coded in steps of a third of an octave.
    assert 0.8 < whitened < 1.25


def test_the_solved_rig_is_the_true_one(recording, result):
    truth = json.loads((recording / "frames" / "truth.json").read_text())
    position_mm, rotation_deg, focal_percent = compare.compare_rigs(truth, result)
    # Some 10,000 points of 0.007 px over ten views at 1 m determine the focal lengths to 0.002 % and
    # the baseline to 0.01 mm; five times that, for one draw scatters.
    assert position_mm < 0.05
    assert rotation_deg < 0.005
    assert focal_percent < 0.01
    # sqrt(2) of the features' error per axis and axis, over all points.
    assert result["rmse_all_px"] < 0.02


def test_the_same_journal_gives_the_same_bytes(recording, journal, result):
    run("tessera-rig", "solve", journal, "--target", recording / "target.json",
        "--out", recording / "again")
    again = json.loads((recording / "again" / "rig.json").read_text())
    assert again["cameras"] == result["cameras"]
    assert again["frames"] == result["frames"]


def test_packets_hold_at_most_eight_bytes_a_feature(recording, journal):
    """The journal's packets, less headers and records, over all their features."""
    rows = run("tessera-rig", "journal", "csv", journal).stdout.splitlines()
    frames = {tuple(row.split(",")[:2]) for row in rows[1:]}
    header_and_record = 144 + 64  # WIRE.md; an upper bound of JOURNAL.md's record head
    assert os.path.getsize(journal) - header_and_record * len(frames) < 8 * (len(rows) - 1)


def test_tessera_detect_finds_what_the_camera_sent(recording, journal):
    """One detector: files and stream agree to the packet's rounding (1/4096 px at this width)."""
    frame = recording / "frames" / "left" / "frame_00003.pgm"
    found = list(csv.DictReader(run("tessera-detect", "--target", recording / "target.json",
                                    frame).stdout.splitlines()))
    with open(recording / "frames" / "left" / "times.csv", encoding="utf-8", newline="") as file:
        time_us = {row["file"]: int(row["t_ns"]) // 1000 for row in csv.DictReader(file)}
    sent = {}
    for row in csv.DictReader(run("tessera-rig", "journal", "csv", journal).stdout.splitlines()):
        if row["camera"] == "left" and int(row["t_ns"]) // 1000 == time_us["frame_00003.pgm"]:
            sent[row["patch"], row["feature"]] = (float(row["x"]), float(row["y"]))
    assert len(found) == len(sent) > 100
    for row in found:
        x, y = sent[row["patch"], row["feature"]]
        assert math.hypot(float(row["x"]) - x, float(row["y"]) - y) < 1 / 4096
