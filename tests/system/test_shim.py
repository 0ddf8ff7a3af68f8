"""The file-based V4L2 shim, judged by other people's programs and by a small client of our own."""
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys

import numpy
import pytest

HERE = pathlib.Path(__file__).resolve().parent
BIN = pathlib.Path(os.environ.get("TESSERA_BIN", HERE.parent.parent / "build" / "bin")).resolve()
REPLAY = str(BIN / "tessera-replay")
CLIENT = [sys.executable, str(HERE / "v4l2_client.py")]
WIDTH, HEIGHT, COUNT = 96, 64, 11  # eleven files: natural order differs from the alphabet's


def need(tool):
    assert shutil.which(tool), f"{tool} is not installed; `make deps` installs it"
    return tool


def make_folder(path, kind, count=COUNT, width=WIDTH, height=HEIGHT, seed=7):
    """Frames of noise; returns what V4L2 must deliver for each."""
    path.mkdir(parents=True, exist_ok=True)
    rng = numpy.random.default_rng(seed)
    maxval = {"GREY": 255, "Y10": 1023, "Y12": 4095, "Y16": 65535}.get(kind)
    delivered = []
    for i in range(count):
        if maxval is None:
            row_bytes = {"YUYV": 4, "UYVY": 4, "NV12": 3}[kind] * width // 2
            raw = rng.integers(0, 256, row_bytes * height, dtype=numpy.uint8).tobytes()
            (path / f"f{i}.raw").write_bytes(raw)
        else:
            image = rng.integers(0, maxval + 1, (height, width), dtype=numpy.uint16)
            header = f"P5\n# a comment\n{width} {height}\n{maxval}\n".encode()
            file_kind, memory_kind = ("u1", "u1") if maxval == 255 else (">u2", "<u2")
            raw = image.astype(memory_kind).tobytes()
            (path / f"f{i}.pgm").write_bytes(header + image.astype(file_kind).tobytes())
        delivered.append(raw)
    if maxval is None:
        (path / "format.json").write_text(
            json.dumps({"fourcc": kind, "width": width, "height": height}))
    return delivered


def replay(folder, *command, options=(), timeout=120):
    return subprocess.run([REPLAY, "--frames", str(folder), *options, "--", *command],
                          capture_output=True, text=True, timeout=timeout)


def client(folder, *arguments, options=()):
    run = replay(folder, *CLIENT, *arguments, options=options)
    assert run.returncode == 0, run.stderr
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    return lines[0], lines[1:]


def digest(data):
    return hashlib.sha256(data).hexdigest()


def refusal(run, *words, status=1):
    assert run.returncode == status, (run.returncode, run.stderr)
    assert len(run.stderr.splitlines()) == 1, run.stderr
    for word in words:
        assert word in run.stderr
    assert run.stdout == ""


ALL_KINDS = ["GREY", "Y10", "Y12", "Y16", "YUYV", "UYVY", "NV12"]


# ---- other people's programs ----

@pytest.mark.parametrize("kind", ALL_KINDS)
def test_v4l2_compliance_finds_no_failure_in_lockstep(tmp_path, kind):
    make_folder(tmp_path / "cam0", kind)
    run = replay(tmp_path / "cam0", need("v4l2-compliance"), "-d", "/dev/video0", "-s30")
    assert run.returncode == 0, run.stdout
    assert "Failed: 0, Warnings: 0" in run.stdout, run.stdout
    assert "test MMAP (epoll): OK" in run.stdout and "test USERPTR (select): OK" in run.stdout


@pytest.mark.parametrize("fps", ["100", "23.976"])
def test_v4l2_compliance_finds_no_failure_when_paced_and_timed(tmp_path, fps):
    make_folder(tmp_path / "cam0", "GREY")
    (tmp_path / "cam0" / "times.csv").write_text(
        "file,t_ns\n" + "".join(f"f{i}.pgm,{(i + 1) * 40000000}\n" for i in range(COUNT)))
    run = replay(tmp_path / "cam0", need("v4l2-compliance"), "-d", "/dev/video0", "-s10",
                 options=["--fps", fps])
    assert run.returncode == 0, run.stdout
    assert "Failed: 0, Warnings: 0" in run.stdout, run.stdout


@pytest.mark.parametrize("kind", ALL_KINDS)
@pytest.mark.parametrize("how", ["--stream-mmap", "--stream-user"])
def test_v4l2_ctl_reads_every_frame_byte_for_byte(tmp_path, kind, how):
    frames = make_folder(tmp_path / "in", kind)
    out = tmp_path / "out.raw"
    run = replay(tmp_path / "in", need("v4l2-ctl"), "-d", "/dev/video0", how,
                 f"--stream-count={2 * COUNT}", f"--stream-to={out}")
    assert run.returncode == 0, run.stderr
    assert out.read_bytes() == b"".join(frames + frames)


def test_v4l2_ctl_through_libv4l2_reads_every_frame(tmp_path):
    frames = make_folder(tmp_path / "in", "YUYV")
    out = tmp_path / "out.raw"
    run = replay(tmp_path / "in", need("v4l2-ctl"), "-w", "-d", "/dev/video0", "--stream-mmap",
                 f"--stream-count={COUNT}", f"--stream-to={out}")
    assert run.returncode == 0, run.stderr
    assert out.read_bytes() == b"".join(frames)


@pytest.mark.parametrize("kind,name", [
    ("GREY", "gray"), ("Y16", "gray16le"), ("YUYV", "yuyv422"), ("UYVY", "uyvy422"),
    ("NV12", "nv12")])
def test_ffmpeg_reads_every_frame_byte_for_byte(tmp_path, kind, name):
    frames = make_folder(tmp_path / "in", kind)
    out = tmp_path / "out.raw"
    run = replay(tmp_path / "in", need("ffmpeg"), "-nostdin", "-v", "error", "-f", "v4l2",
                 "-input_format", name, "-video_size", f"{WIDTH}x{HEIGHT}", "-ts", "abs",
                 "-i", "/dev/video0", "-frames:v", str(2 * COUNT), "-fps_mode", "passthrough",
                 "-f", "rawvideo", str(out))
    assert run.returncode == 0, run.stderr
    assert out.read_bytes() == b"".join(frames + frames)


@pytest.mark.parametrize("kind", ["GREY", "Y16", "YUYV", "UYVY", "NV12"])
@pytest.mark.parametrize("mode", ["mmap", "dmabuf"])
def test_gstreamer_reads_every_frame_byte_for_byte(tmp_path, kind, mode):
    frames = make_folder(tmp_path / "in", kind)
    out = tmp_path / "out.raw"
    run = replay(tmp_path / "in", need("gst-launch-1.0"), "-q", "v4l2src", "device=/dev/video0",
                 f"io-mode={mode}", f"num-buffers={2 * COUNT}", "!", "filesink", f"location={out}")
    assert run.returncode == 0, run.stderr
    assert out.read_bytes() == b"".join(frames + frames)


# ---- which frame comes when ----

@pytest.mark.parametrize("kind", ALL_KINDS)
def test_every_kind_arrives_with_its_format_and_bytes(tmp_path, kind):
    frames = make_folder(tmp_path, kind)
    form, got = client(tmp_path, "--frames", str(COUNT))
    fourcc = {"Y10": "Y10 ", "Y12": "Y12 ", "Y16": "Y16 "}.get(kind, kind)
    assert (form["fourcc"], form["width"], form["height"]) == (fourcc, WIDTH, HEIGHT)
    assert form["sizeimage"] == len(frames[0])
    assert [line["digest"] for line in got] == [digest(frame) for frame in frames]


def test_a_stride_of_padded_raw_frames_is_told_and_kept(tmp_path):
    data = bytes(range(256)) * 8  # 8 rows of 256 bytes, of which 200 are pixels
    (tmp_path / "a.raw").write_bytes(data)
    (tmp_path / "format.json").write_text(json.dumps(
        {"fourcc": "GREY", "width": 200, "height": 8, "bytesperline": 256}))
    form, got = client(tmp_path)
    assert form["bytesperline"] == 256 and form["sizeimage"] == 2048
    assert got[0]["digest"] == digest(data)


def test_each_streamon_starts_at_the_first_frame_and_the_end_wraps(tmp_path):
    frames = [digest(frame) for frame in make_folder(tmp_path, "GREY")]
    _, got = client(tmp_path, "--frames", str(COUNT + 3), "--streams", "2")
    one = frames + frames[:3]
    assert [line["digest"] for line in got] == one + one
    assert [line["sequence"] for line in got] == 2 * list(range(COUNT + 3))


def test_once_ends_with_epipe_after_the_last_frame_and_streams_again(tmp_path):
    frames = [digest(frame) for frame in make_folder(tmp_path, "GREY")]
    _, got = client(tmp_path, "--frames", "100", "--streams", "2", options=["--once"])
    assert [line.get("digest", line.get("error")) for line in got] == 2 * (frames + ["EPIPE"])


def test_lockstep_drops_nothing_however_slow_the_program(tmp_path):
    frames = [digest(frame) for frame in make_folder(tmp_path, "GREY")]
    _, got = client(tmp_path, "--frames", "6", "--pause", "0.05", "--buffers", "2")
    assert [line["sequence"] for line in got] == list(range(6))
    assert [line["digest"] for line in got] == frames[:6]


def test_paced_frames_without_a_buffer_are_dropped_and_counted(tmp_path):
    frames = [digest(frame) for frame in make_folder(tmp_path, "GREY")]
    # At 200 frames a second a pause of 50 ms lets about ten pass and three buffers are soon full,
    # so eight frames last beyond sequence 30; at least one gap is certain on any machine.
    _, got = client(tmp_path, "--frames", "8", "--pause", "0.05", options=["--fps", "200"])
    sequences = [line["sequence"] for line in got]
    assert sequences == sorted(set(sequences)) and sequences[-1] >= 20
    for line in got:
        assert line["digest"] == frames[line["sequence"] % COUNT]


def test_paced_frames_keep_the_rate(tmp_path):
    make_folder(tmp_path, "GREY")
    _, got = client(tmp_path, "--frames", "21", options=["--fps", "50"])
    elapsed_s = (got[-1]["us"] - got[0]["us"]) / 1e6
    expected_s = (got[-1]["sequence"] - got[0]["sequence"]) / 50
    # Each frame comes at its own due time, so delays do not add up. A busy machine may hold up
    # the first or the last by some tens of milliseconds.
    assert abs(elapsed_s - expected_s) < 0.2


def test_paced_once_ends_although_frames_were_dropped(tmp_path):
    make_folder(tmp_path, "GREY")
    _, got = client(tmp_path, "--frames", "100", "--pause", "0.03",
                    options=["--fps", "200", "--once"])
    assert got[-1] == {"error": "EPIPE"}
    assert len(got) - 1 < COUNT


def test_times_csv_sets_the_timestamps_and_a_second_pass_goes_on(tmp_path):
    make_folder(tmp_path, "GREY", count=4)
    times_ns = [5_000_000_999, 5_040_000_000, 5_080_000_000, 5_120_000_000]
    rows = "".join(f"f{i}.pgm,{t}\n" for i, t in reversed(list(enumerate(times_ns))))
    (tmp_path / "times.csv").write_text("file,t_ns\n" + rows + "other.pgm,1\n")
    _, got = client(tmp_path, "--frames", "6")
    # V4L2 counts microseconds; what is less is cut. The mean interval is (120 ms - 999 ns) / 3,
    # cut to 39999667 ns, so the second pass comes 119999001 + 39999667 ns after the first.
    span_ns = 119_999_001 + 39_999_667
    expected = times_ns + [times_ns[0] + span_ns, times_ns[1] + span_ns]
    assert [line["us"] for line in got] == [t // 1000 for t in expected]


def test_an_exposure_in_times_csv_moves_the_timestamp_to_its_start(tmp_path):
    make_folder(tmp_path, "GREY", count=1)
    (tmp_path / "times.csv").write_text("file,t_ns,exposure_ns\nf0.pgm,1000000000,8000000\n")
    _, got = client(tmp_path)
    assert got[0]["us"] == 996000
    start_of_exposure, monotonic = 0x10000, 0x2000
    assert got[0]["flags"] & 0x70000 == start_of_exposure
    assert got[0]["flags"] & 0xe000 == monotonic


def test_several_processes_have_a_device_each_at_once(tmp_path):
    expected, running = [], []
    for camera in range(3):
        folder = tmp_path / f"cam{camera}"
        frames = make_folder(folder, "GREY", seed=camera)
        expected.append([digest(frame) for frame in frames])
        device = f"/dev/video{camera}"
        running.append(subprocess.Popen(
            [REPLAY, "--frames", str(folder), "--device", device, "--once", "--", *CLIENT,
             "--device", device, "--frames", "100"], stdout=subprocess.PIPE, text=True))
    for frames, process in zip(expected, running):
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0
        got = [json.loads(line) for line in out.splitlines()[1:]]
        assert [line.get("digest") for line in got] == frames + [None]


def test_a_file_that_breaks_while_streaming_is_a_frame_marked_as_broken(tmp_path):
    frames = [digest(frame) for frame in make_folder(tmp_path, "GREY", count=6)]
    # Two buffers and lockstep: when frame 0 is reported, frames from 2 on are still unread.
    process = subprocess.Popen(
        [REPLAY, "--frames", str(tmp_path), "--", *CLIENT, "--buffers", "2", "--frames", "6",
         "--pause", "0.3"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    first = [process.stdout.readline(), process.stdout.readline()]
    os.truncate(tmp_path / "f4.pgm", 100)
    out, err = process.communicate(timeout=60)
    got = [json.loads(line) for line in first[1:] + out.splitlines()]
    assert process.returncode == 0 and "f4.pgm" in err
    assert [line["sequence"] for line in got] == list(range(6))
    error_flag = 0x40
    assert [bool(line["flags"] & error_flag) for line in got] == [i == 4 for i in range(6)]
    assert [line["digest"] for line in got[:4] + got[5:]] == frames[:4] + frames[5:]


def test_an_address_sanitizer_program_runs_under_the_shim(tmp_path):
    make_folder(tmp_path / "in", "GREY")
    source = tmp_path / "open.c"
    source.write_text("#include <fcntl.h>\n#include <stdlib.h>\n"
                      "int main(void)\n{\n    free(malloc(9));\n"
                      "    return open(\"/dev/video0\", O_RDWR) < 0;\n}\n")
    program = tmp_path / "open"
    subprocess.run([need("gcc"), "-fsanitize=address", "-o", str(program), str(source)], check=True)
    run = replay(tmp_path / "in", str(program))
    assert run.returncode == 0, run.stderr


# ---- the command ----

def test_the_exit_status_is_the_commands(tmp_path):
    make_folder(tmp_path, "GREY", count=1)
    assert replay(tmp_path, "sh", "-c", "exit 37").returncode == 37


def test_options_of_the_command_are_the_commands(tmp_path):
    make_folder(tmp_path, "GREY", count=1)
    run = replay(tmp_path, "echo", "--frames", "--help")
    assert run.stdout == "--frames --help\n"


def test_other_devices_stay_what_they_are(tmp_path):
    make_folder(tmp_path, "GREY", count=1)
    run = replay(tmp_path, "test", "-e", "/dev/video201", options=["--device", "/dev/video200"])
    assert run.returncode == 1
    run = replay(tmp_path, "test", "-c", "/dev/video200", options=["--device", "/dev/video200"])
    assert run.returncode == 0


def test_help_and_version_are_answered():
    for option, word in [("--help", "--frames"), ("--version", "tessera-replay ")]:
        run = subprocess.run([REPLAY, option], capture_output=True, text=True)
        assert run.returncode == 0 and word in run.stdout and run.stderr == ""


@pytest.mark.parametrize("arguments,word", [
    (["--", "true"], "--frames"),
    (["--frames"], "--frames"),
    (["--nonsense", "--", "true"], "--nonsense"),
    (["--frames", ".", "--fps", "0", "--", "true"], "--fps"),
    (["--frames", ".", "--fps", "10x", "--", "true"], "--fps"),
    (["--frames", ".", "--fps", "nan", "--", "true"], "--fps"),
    (["--frames", ".", "--device", "/dev/null", "--", "true"], "--device"),
    (["--frames", "."], "command"),
])
def test_wrong_use_gets_one_sentence_and_status_2(arguments, word):
    run = subprocess.run([REPLAY, *arguments], capture_output=True, text=True)
    refusal(run, word, status=2)


def test_a_command_that_does_not_exist_is_named(tmp_path):
    make_folder(tmp_path, "GREY", count=1)
    refusal(replay(tmp_path, "no-such-program"), "no-such-program", status=127)


# ---- bad folders, all refused before the command starts ----

def test_a_missing_folder_is_named(tmp_path):
    refusal(replay(tmp_path / "nowhere", "echo", "started"), "nowhere")


def test_a_file_in_place_of_a_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("x")
    refusal(replay(tmp_path / "file", "echo", "started"), "file", "folder")


def test_an_empty_folder_is_refused(tmp_path):
    (tmp_path / "truth.csv").write_text("a,b\n")
    refusal(replay(tmp_path, "echo", "started"), "no frames")


BAD_PGM = {
    "no PGM": b"GIF89a",
    "plain PGM": b"P2\n2 2\n255\n0 1 2 3\n",
    "header cut short": b"P5\n2 2\n",
    "no width": b"P5\n0 2\n255\n",
    "huge": b"P5\n99999999999 2\n255\n",
    "zero maxval": b"P5\n2 2\n0\n....",
    "odd maxval": b"P5\n2 2\n999\n........",
    "pixels cut short": b"P5\n2 2\n255\n...",
    "trailing bytes": b"P5\n2 2\n255\n.....",
    "empty": b"",
}


@pytest.mark.parametrize("name", BAD_PGM)
def test_a_bad_pgm_is_named(tmp_path, name):
    (tmp_path / "a0.pgm").write_bytes(b"P5\n2 2\n255\n....")
    (tmp_path / "a1.pgm").write_bytes(BAD_PGM[name])
    refusal(replay(tmp_path, "echo", "started"), "a1.pgm")


@pytest.mark.parametrize("other", [b"P5\n4 1\n255\n....", b"P5\n2 2\n1023\n" + bytes(8)])
def test_a_frame_of_another_size_or_format_is_named(tmp_path, other):
    (tmp_path / "a0.pgm").write_bytes(b"P5\n2 2\n255\n....")
    (tmp_path / "a1.pgm").write_bytes(other)
    refusal(replay(tmp_path, "echo", "started"), "a1.pgm", "one format and size")


@pytest.mark.parametrize("text,word", [
    ("", "f0.pgm"),
    ("name,time\nf0.pgm,1\n", "line 1"),
    ("file,t_ns\nf0.pgm\n", "line 2"),
    ("file,t_ns\nf0.pgm,1.5\n", "line 2"),
    ("file,t_ns\nf0.pgm,\n", "line 2"),
    ("file,t_ns\nf0.pgm,99999999999999999999\n", "line 2"),
    ("file,t_ns\nf0.pgm,1\nf0.pgm,2\n", "line 3"),
    ("file,t_ns\nf0.pgm,1\n", "f1.pgm"),
    ("file,t_ns,exposure_ns\nf0.pgm,1,-1\n", "line 2"),
])
def test_a_bad_times_csv_is_named_with_its_line(tmp_path, text, word):
    make_folder(tmp_path, "GREY", count=2)
    (tmp_path / "times.csv").write_text(text)
    refusal(replay(tmp_path, "echo", "started"), "times.csv", word)


@pytest.mark.parametrize("text", [
    "", "[]", "{", '{"fourcc": "YUYV"}', '{"fourcc": "RGB3", "width": 4, "height": 4}',
    '{"fourcc": "YUYV", "width": 4.5, "height": 4}', '{"fourcc": "YUYV", "width": 3, "height": 4}',
    '{"fourcc": "NV12", "width": 4, "height": 3}', '{"fourcc": "YUYV", "width": 0, "height": 4}',
    '{"fourcc": "YUYV", "width": 4, "height": 4, "bytesperline": 7}',
    '{"fourcc": "YUYV", "width": 4, "height": 4, "colour": 1}',
    '{"fourcc": "YUYV", "width": 4, "height": 4, "col\\nour": 1}',
])
def test_a_bad_format_json_is_named(tmp_path, text):
    (tmp_path / "a.raw").write_bytes(bytes(32))
    (tmp_path / "format.json").write_text(text)
    refusal(replay(tmp_path, "echo", "started"), "format.json")


def test_a_raw_file_of_the_wrong_size_is_named(tmp_path):
    (tmp_path / "a.raw").write_bytes(bytes(33))
    (tmp_path / "format.json").write_text('{"fourcc": "YUYV", "width": 4, "height": 4}')
    refusal(replay(tmp_path, "echo", "started"), "a.raw", "33", "32")


# ---- scripted faults ----

def faulty(folder, text):
    path = folder / "faults.txt"
    path.write_text(text)
    return ["--faults", str(path)]


@pytest.mark.parametrize("pace", [[], ["--fps", "200"]])
def test_a_script_breaks_shortens_and_loses_frames(tmp_path, pace):
    frames = make_folder(tmp_path, "GREY", count=6)
    script = faulty(tmp_path, "frame,fault\n1,error\n2,short\n4,lost\n")
    _, got = client(tmp_path, "--frames", "5", "--buffers", "8", options=script + pace)
    assert [line["sequence"] for line in got] == [0, 1, 2, 3, 5]
    error_flag = 0x40
    assert [bool(line["flags"] & error_flag) for line in got] == [False, True, False, False, False]
    half = digest(frames[2][:len(frames[2]) // 2])
    assert [line["digest"] for line in got] == [
        digest(frames[0]), digest(frames[1]), half, digest(frames[3]), digest(frames[5])]


@pytest.mark.parametrize("pace", [[], ["--fps", "200"]])
def test_a_script_unplugs_the_device_after_the_frames_before(tmp_path, pace):
    make_folder(tmp_path, "GREY", count=6)
    options = faulty(tmp_path, "frame,fault\n3,unplug\n") + pace
    run = replay(tmp_path, *CLIENT, "--frames", "9", options=options)
    lines = [json.loads(line) for line in run.stdout.splitlines()[1:]]
    assert [line["sequence"] for line in lines if "sequence" in line] == [0, 1, 2]
    # QBUF, DQBUF or STREAMOFF, whichever comes first, finds no device.
    assert run.returncode != 0 and "Errno 19" in run.stderr


@pytest.mark.parametrize("text,word", [
    ("", "empty"), ("frame;fault\n", "line 1"), ("frame,fault\n-1,lost\n", "line 2"),
    ("frame,fault\n1,burnt\n", "line 2"), ("frame,fault\n1\n", "line 2")])
def test_a_bad_script_of_faults_is_named_with_its_line(tmp_path, text, word):
    make_folder(tmp_path, "GREY", count=1)
    refusal(replay(tmp_path, "true", options=faulty(tmp_path, text)), "faults.txt", word)
