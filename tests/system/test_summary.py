"""The summary that a person judges a calibration by."""
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "truth"))
from solved import run, solved  # noqa: E402


def report(tmp_path, change):
    rig = json.loads(solved().path.read_text())
    change(rig)
    (tmp_path / "rig.json").write_text(json.dumps(rig))
    return run("report", tmp_path / "rig.json", expect=0).stdout


def lines_of(text, name):
    """What stands under the heading, up to the next."""
    rows = text.split(f"\n{name}")[1].splitlines()[1:]
    return [row for row in rows[:next((i for i, r in enumerate(rows) if not r.startswith("-")), len(rows))]]


def test_a_good_rig_of_three_is_told_in_forty_lines(tmp_path):
    text = report(tmp_path, lambda rig: None)
    assert len(text.splitlines()) <= 40
    assert "Good: cam0, cam1, cam2" in text and "Weak spots: none found" in text


def test_the_length_that_sets_the_scale_is_named_with_its_file(tmp_path):
    assert "a: the coordinates in points.csv" in report(tmp_path, lambda rig: None)


def test_the_numbers_are_those_of_the_rig_file(tmp_path):
    text = report(tmp_path, lambda rig: None)
    camera = solved().json["cameras"][1]
    assert f"{camera['fx']:.3f}" in text and f"{camera['distortion'][0]:.6g}" in text
    row = next(line for line in text.split("\nViews:")[1].splitlines() if line.startswith("cam1"))
    assert row.split()[1:4] == [f"{camera['distance_mm'][k]:.0f}" for k in ("least", "median", "most")]
    assert f"cam0 {camera['shared_views']['cam0']}" in row


def test_what_is_lacking_is_told_by_camera(tmp_path):
    def spoil(rig):
        rig["cameras"][0]["coverage"]["weak"] = ["top left", "left"]
        rig["cameras"][1]["tilt_deg"]["most"] = 12.0
        rig["cameras"][2]["distance_mm"] = {"least": 900.0, "median": 950.0, "most": 1000.0}
        rig["cameras"][2]["shared_views"] = {"cam1": 2}
    text = report(tmp_path, spoil)
    zero, one, two = lines_of(text, "Views to add")
    assert zero.startswith("- cam0:") and "top left, left" in zero
    assert one.startswith("- cam1:") and "12 at most" in one
    assert two.startswith("- cam2:") and "900 to 1000 mm" in two and "2 at most" in two
    assert "Good: no camera" in text


def test_what_is_weak_is_told_by_camera(tmp_path):
    def spoil(rig):
        camera = rig["cameras"][1]
        camera["standard_deviation"]["fx"] = 0.01 * camera["fx"]
        camera["noise_factor"] = 2.5
    text = report(tmp_path, spoil)
    focal, noise = lines_of(text, "Weak spots")
    assert "cam1: focal length known to 1.00 % only" in focal and "2.5 times" in noise
    assert "Good: cam0, cam2" in text


def test_views_are_counted_as_the_boards_were_held():
    rig = solved().json
    for camera in rig["cameras"]:
        assert sum(camera["tilted_views"].values()) <= camera["views"]
        assert 0 <= camera["tilt_deg"]["least"] <= camera["tilt_deg"]["most"] < 90
        distance = camera["distance_mm"]
        # The board's middle is held between 900 and 2,200 mm; it is 1.4 m wide.
        assert 300 < distance["least"] < distance["median"] < distance["most"] < 3200
        for other, count in camera["shared_views"].items():
            back = next(c for c in rig["cameras"] if c["name"] == other)["shared_views"]
            assert back[camera["name"]] == count <= min(camera["views"], len(rig["frames"]))
