"""tessera-rig solve on journals: what is put together, and what is refused with which sentence."""
import json
import os
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))
import journals  # noqa: E402
import simulate  # noqa: E402

RIG = str(pathlib.Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")) / "tessera-rig")
NOISE_PX = 0.02


class Scene:
    """Two cameras, a board of 4 x 5 patches in twelve poses."""

    def __init__(self):
        rng = np.random.default_rng(11)
        self.cameras = simulate.make_cameras(2, rng)
        self.target = journals.make_target()
        self.board, self.ids = journals.target_board(self.target)
        poses = simulate.make_path(12, rng, self.board)
        self.rows = simulate.make_scene(self.cameras, self.board, poses, NOISE_PX)
        self.packets = self.make()

    def make(self, rows=None, target=None, **change):
        return journals.make_packets(self.cameras, self.ids, self.rows if rows is None else rows,
                                     target or self.target, **change)


@pytest.fixture(scope="module")
def scene():
    return Scene()


@pytest.fixture
def folder(tmp_path, scene):
    (tmp_path / "target.json").write_text(json.dumps(scene.target))
    return tmp_path


def solve(folder, *inputs, targets=("target.json",)):
    arguments = [a for t in targets for a in ("--target", str(folder / t))]
    return subprocess.run([RIG, "solve", *map(str, inputs), *arguments, "--out", str(folder / "out")],
                          capture_output=True, text=True, timeout=120)


def solved(folder, *inputs, **options):
    result = solve(folder, *inputs, **options)
    assert result.returncode == 0, result.stderr
    return json.loads((folder / "out" / "rig.json").read_text())


def refused(folder, result, *words):
    """One sentence on standard error that holds all the words, status 1, nothing written."""
    assert result.returncode == 1, result.stderr
    assert result.stdout == ""
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    for word in words:
        assert word in result.stderr, result.stderr
    assert not (folder / "out").exists()
    return True


def journal(folder, packets, name="rig.journal", **options):
    return journals.write_journal(folder / name, packets, **options)


@pytest.fixture(scope="module")
def plain(scene, tmp_path_factory):
    """The rig of the undisturbed journal."""
    folder = tmp_path_factory.mktemp("plain")
    (folder / "target.json").write_text(json.dumps(scene.target))
    return solved(folder, journal(folder, scene.packets))


def test_a_journal_gives_the_rig_that_made_it(scene, plain):
    # As in test_solve.py: sqrt(2) times the noise, and 1/sqrt(4 N) of scatter over 2,000 points and more
    # is 1.1 %; the parameters take 1.5 %, the wire's rounding (1/4096 px) adds nothing. Five of these.
    assert plain["rmse_px"] == pytest.approx(np.sqrt(2) * NOISE_PX, rel=0.07)
    assert plain["observations"] + plain["rejected"] == len(scene.rows)
    assert [c["name"] for c in plain["cameras"]] == ["cam0", "cam1"]
    assert len(plain["frames"]) == len({row[1] for row in scene.rows})
    for camera, known in zip(plain["cameras"], scene.cameras):
        for key in ("fx", "fy", "cx", "cy"):
            assert abs(camera[key] - known[key]) < 4.5 * camera["standard_deviation"][key]


def test_a_packet_sent_again_after_a_reconnect_counts_once(scene, plain, folder):
    again = scene.packets + scene.packets[3:6]
    rig = solved(folder, journal(folder, again))
    assert rig["cameras"] == plain["cameras"]
    assert rig["frames"] == plain["frames"]
    assert rig["rejected_by_reason"]["packet that came twice"] == 3


def test_journals_of_each_camera_and_of_both_give_the_same_rig(scene, plain, folder):
    by_camera = [[p for p in scene.packets if name in p[24:56]] for name in (b"cam0", b"cam1")]
    rig = solved(folder, journal(folder, by_camera[1], "b"), journal(folder, by_camera[0], "a"))
    assert rig["cameras"] == plain["cameras"]
    assert rig["frames"] == plain["frames"]


def test_packets_out_of_order_give_the_same_rig(scene, plain, folder):
    rig = solved(folder, journal(folder, scene.packets[::-1]))
    assert rig["cameras"] == plain["cameras"]
    assert rig["frames"] == plain["frames"]


def test_patches_on_no_target_are_left_out_and_counted(scene, plain, folder):
    """A detector without a target sends every id that it reads (digest 0)."""
    strange = {4000: {0: (4096 * 100, 4096 * 100, 16, 9), 1: (4096 * 120, 4096 * 100, 16, 9)}}
    fields = {"serial": "cam0", "boot_id": 7, "sequence": 99, "packet_index": 99, "clock_kind": 3,
              "t_capture_ns": 5 * 10**18 + 40 * journals.STEP_NS, "width": 1920, "height": 1080,
              "fraction_bits": 12}
    rig = solved(folder, journal(folder, scene.make(target_digest=0)
                                 + [journals.maker.build(fields, strange)]))
    assert rig["rejected_by_reason"]["patch on none of the targets"] == 2
    assert rig["cameras"][0]["fx"] == pytest.approx(plain["cameras"][0]["fx"], rel=1e-9)


def test_another_target_is_refused_with_both_digests(scene, folder):
    other = journals.make_target(first_id=101)
    result = solve(folder, journal(folder, scene.make(target=other)))
    assert refused(folder, result, "'cam0'", f"{journals.target_digest(other):016x}",
                   f"{journals.target_digest(scene.target):016x}", "target.json")


def test_clocks_of_two_kinds_are_refused(scene, folder):
    realtime = scene.make([row for row in scene.rows if row[0] == 1], clock_kind=2)
    mixed = [p for p in scene.packets if b"cam0" in p[24:56]] + realtime
    assert refused(folder, solve(folder, journal(folder, mixed)), "'cam0'", "TAI", "'cam1'", "realtime")


def test_an_image_size_that_changes_is_refused(scene, folder):
    late = [row for row in scene.rows if row[1] >= 6]
    early = [row for row in scene.rows if row[1] < 6]
    mixed = scene.make(early) + scene.make(late, width=2000)
    assert refused(folder, solve(folder, journal(folder, mixed)), "'cam0'", "1920 x 1080", "2000 x 1080")


def test_two_targets_that_share_a_patch_are_refused(scene, folder):
    (folder / "other.json").write_text(json.dumps(journals.make_target(2, 2, first_id=100 + 37 * 19)))
    result = solve(folder, journal(folder, scene.packets), targets=("target.json", "other.json"))
    assert refused(folder, result, "other.json", f"patch {100 + 37 * 19}", "share")


def test_journals_need_a_target_and_packets(scene, folder):
    path = journal(folder, scene.packets)
    assert refused(folder, solve(folder, path, targets=()), "--target")
    assert refused(folder, solve(folder, folder / "none"), "none")
    assert refused(folder, solve(folder, path, targets=("missing.json",)), "missing.json")
    empty = journal(folder, [], "empty")
    assert refused(folder, solve(folder, empty), "empty", "no packets")
    (folder / "text").write_text("this is no journal, but it is longer than its head would be")
    assert refused(folder, solve(folder, folder / "text"), "text")


def test_a_record_kind_that_must_be_known_refuses_the_journal(scene, folder):
    assert refused(folder, solve(folder, journal(folder, scene.packets, kind=128)), "rig.journal")
    # Others are passed over, and then there is nothing.
    assert refused(folder, solve(folder, journal(folder, scene.packets, kind=2)), "no packets")


def test_a_damaged_packet_costs_only_itself(scene, folder):
    """A turned bit in the first packet of camera 0: its record's checksum fails, the rest is read."""
    path = journal(folder, scene.packets)
    data = bytearray(path.read_bytes())
    data[32 + 32 + 3 + 200] ^= 1
    path.write_bytes(data)
    rig = solved(folder, path)
    lost = sum(1 for row in scene.rows if row[1] == 0 and row[0] == 0)
    assert rig["observations"] + rig["rejected"] == len(scene.rows) - lost


def test_captures_too_far_apart_do_not_make_an_instant(scene, folder):
    """Camera 1 half an interval later: no instant is shared, so nothing connects the cameras."""
    late = [row for row in scene.rows if row[0] == 1]
    packets = [p for p in scene.packets if b"cam0" in p[24:56]]
    for packet in scene.make(late):
        moved = bytearray(packet)
        at = journals.maker.HEADER["t_capture_ns"][0]
        time_ns = int.from_bytes(moved[at:at + 8], "little") + journals.STEP_NS // 2
        journals.maker.put(moved, "t_capture_ns", time_ns)
        packets.append(journals.maker.seal(moved))
    result = solve(folder, journal(folder, packets))
    assert result.returncode == 1 and not (folder / "out").exists()
    assert re.search(r"cam0.*cam1|cam1.*cam0", result.stderr.splitlines()[-1])
