"""The capture module under the file-based V4L2 shim, built with sanitizers for the purpose."""
import json
import os
import pathlib
import shutil
import subprocess

import numpy
import pytest

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent
BIN = pathlib.Path(os.environ.get("TESSERA_BIN", TOP / "build" / "bin")).resolve()
WIDTH, HEIGHT, COUNT = 40, 24, 5
KINDS = ["GREY", "Y10", "Y12", "Y16", "YUYV", "UYVY", "NV12"]  # in the order of enum frame_format
FRAME, NONE, ENDED, UNPLUGGED = range(4)


@pytest.fixture(scope="session")
def dump(tmp_path_factory):
    program = tmp_path_factory.mktemp("capture") / "capture_dump"
    sources = ["tests/system/capture_dump.c", "firmware/capture/capture.c",
               "firmware/capture/v4l2.c", "firmware/capture/v4l2_sys_linux.c"]
    assert shutil.which("gcc"), "gcc is not installed; `make deps` installs it"
    subprocess.run(["gcc", "-std=c11", "-D_GNU_SOURCE", "-g", "-O1", "-I.",
                    "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
                    "-o", str(program), *sources], check=True, cwd=TOP)
    return str(program)


def fnv(data):
    total = 0xcbf29ce484222325
    for byte in data:
        total = (total ^ byte) * 0x100000001b3 % 2**64
    return f"{total:016x}"


def make_raw(folder, kind, padding=0):
    """Raw frames; returns each one's luma-carrying rows without padding."""
    folder.mkdir(exist_ok=True)
    row_bytes = WIDTH * (1 if kind in ("GREY", "NV12") else 2)
    rows = HEIGHT * 3 // 2 if kind == "NV12" else HEIGHT
    rng = numpy.random.default_rng(3)
    seen = []
    for i in range(COUNT):
        image = rng.integers(0, 256, (rows, row_bytes + padding), dtype=numpy.uint8)
        (folder / f"f{i}.raw").write_bytes(image.tobytes())
        seen.append(image[:HEIGHT, :row_bytes].tobytes())
    (folder / "format.json").write_text(json.dumps(
        {"fourcc": kind, "width": WIDTH, "height": HEIGHT, "bytesperline": row_bytes + padding}))
    return seen


def run(dump, folder, *arguments, options=("--once",)):
    return subprocess.run(
        [str(BIN / "tessera-replay"), "--frames", str(folder), *options, "--", dump,
         "/dev/video0", *arguments], capture_output=True, text=True, timeout=60)


def lines_of(result):
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    lines = [line.split() for line in result.stdout.splitlines()]
    return lines[0], lines[1:-1], lines[-1]


@pytest.mark.parametrize("padding", [0, 24])
@pytest.mark.parametrize("kind", KINDS)
def test_every_format_and_row_length_is_read_to_the_end(tmp_path, dump, kind, padding):
    seen = make_raw(tmp_path / "cam3", kind, padding)
    head, frames, end = lines_of(run(dump, tmp_path / "cam3", "100", kind))
    assert head == ["platform:cam3", str(KINDS.index(kind)), str(WIDTH), str(HEIGHT)]
    assert [frame[2] for frame in frames] == [fnv(rows) for rows in seen]
    assert [int(frame[0]) for frame in frames] == list(range(COUNT))
    assert end == f"end {ENDED} frames {COUNT} dropped 0 broken 0".split()


def test_the_time_is_that_of_times_csv(tmp_path, dump):
    make_raw(tmp_path / "in", "GREY")
    times_ns = [1_000_000_000 + 33_333_000 * i for i in range(COUNT)]
    (tmp_path / "in" / "times.csv").write_text(
        "file,t_ns\n" + "".join(f"f{i}.raw,{t}\n" for i, t in enumerate(times_ns)))
    _, frames, _ = lines_of(run(dump, tmp_path / "in", "100"))
    assert [int(frame[1]) for frame in frames] == times_ns


def test_frames_that_a_paced_device_drops_are_counted(tmp_path, dump):
    make_raw(tmp_path / "in", "GREY")
    # Far faster than any program can take frames, so that some are dropped.
    _, frames, end = lines_of(run(dump, tmp_path / "in", "200", options=("--fps", "100000")))
    sequences = [int(frame[0]) for frame in frames]
    assert len(sequences) == 200
    assert int(end[5]) == sequences[-1] - sequences[0] + 1 - 200 > 0


def test_a_device_that_is_not_there_is_named(dump):
    result = subprocess.run([dump, "/dev/video250", "1"], capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr == "/dev/video250: there is no such device; is the camera plugged in?\n"


def test_a_file_that_is_no_camera_is_named(dump):
    result = subprocess.run([dump, "/dev/null", "1"], capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr == "/dev/null: is not a V4L2 device\n"


def test_a_format_that_is_not_offered_is_answered_with_what_is(tmp_path, dump):
    make_raw(tmp_path / "in", "UYVY")
    result = run(dump, tmp_path / "in", "1", "Y12")
    assert result.returncode == 1
    assert result.stderr == "/dev/video0: the camera does not offer Y12; it offers: UYVY\n"


def test_a_size_that_is_not_offered_is_answered_with_what_is(tmp_path, dump):
    make_raw(tmp_path / "in", "GREY")
    result = run(dump, tmp_path / "in", "1", "GREY", "640", "480")
    assert result.returncode == 1
    assert f"nearest is {WIDTH}x{HEIGHT}, all are: {WIDTH}x{HEIGHT}" in result.stderr


def test_faulty_frames_are_skipped_and_an_unplugged_camera_is_told(tmp_path, dump):
    make_raw(tmp_path / "in", "GREY")
    (tmp_path / "faults.txt").write_text(
        "frame,fault\n1,error\n2,short\n3,lost\n9,unplug\n")
    options = ["--faults", str(tmp_path / "faults.txt")]
    _, frames, end = lines_of(run(dump, tmp_path / "in", "100", options=options))
    assert [int(frame[0]) for frame in frames] == [0, 4, 5, 6, 7, 8]
    assert end == f"end {UNPLUGGED} frames 6 dropped 1 broken 2".split()
