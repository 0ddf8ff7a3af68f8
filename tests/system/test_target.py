"""tessera-target as a user runs it. The geometry here is written from common/target/TARGET.md, not
from the program."""
import json
import math
import os
import re
import resource
import signal
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

BIN = Path(os.environ.get("TESSERA_BIN", Path(__file__).resolve().parents[2] / "build/bin"))
TARGET = str(BIN / "tessera-target")
H = (math.sqrt(2) - 1) / 4
P = (2 - math.sqrt(2)) / 4


def run(*arguments, **more):
    return subprocess.run([TARGET, *map(str, arguments)], capture_output=True, text=True, **more)


def make(folder, *arguments, rows=2, cols=3, patch_mm=20, name="target.json"):
    path = folder / name
    done = run("--rows", rows, "--cols", cols, "--patch-mm", patch_mm, "--out", path, *arguments)
    assert done.returncode == 0, done.stderr
    return json.loads(path.read_text())


def features(levels):
    """(u, v, inradius, bit or None, inverted) of each feature of an unturned patch, by index."""
    def turned(u, v, quarters):
        for _ in range(quarters):
            u, v = 1 - v, u
        return u, v

    start = [(0, 0, 1), (0.75, 0.25, -1), (0.5, 0, 1), (0.25, 0.25, 1)]
    found = [(0.5, 2 * H, 2 * H, None, False)]
    satellites = []
    for bit in range(12):
        quarter = 1 + bit // 4
        u0, v0, sign = start[bit % 4]
        if levels == 2:
            u, v = [(0.25, H), (0.5, 0.25 - H), (0.75, H), (0.5, 0.25 + H)][bit % 4]
            found.append((*turned(u, v, quarter), H, bit, False))
            continue
        u, v = u0 + sign * 0.25, v0 + sign * (0.25 - H) / 2
        found.append((*turned(u, v, quarter), H / 2, bit, False))
        for j in range(6):
            x0, y0 = [(0, 0), (0.5, 0), (0.25, 0.25)][j // 2]
            x = x0 + (0.5 + (P if j % 2 else -P)) / 2
            y = y0 + P / 2
            u, v = u0 + sign * x / 2, v0 + sign * y / 2
            satellites.append((*turned(u, v, quarter), P / 4, bit, j % 2 == 1))
    return found + satellites


def circles(target):
    """(X, Y, circle radius, inradius, white) in mm from the sheet's upper left corner."""
    side = target["patch_mm"]
    for row, ids in enumerate(target["ids"]):
        for col, patch in enumerate(ids):
            for u, v, inradius, bit, inverted in features(target["levels"]):
                if target["turns"][row][col]:
                    u, v = 1 - u, 1 - v
                if bit is None:
                    white = bin(patch).count("1") % 2 == 0
                else:
                    white = bool(patch >> bit & 1) != inverted
                yield ((col + u + target["margin"]) * side, (row + v + target["margin"]) * side,
                       target["circle_ratio"] * inradius * side, inradius * side, white)


def check_raster(image, target, dpi, sampling_px=0):
    """Every circle stands in its place with its colour, its edge and its triangle's colour. Returns
    the largest distance of a circle's centroid from its place in pixels. `sampling_px` says how far
    from a pixel's centre the rasteriser evaluates a gradient."""
    scale = dpi / 25.4
    worst = 0
    for x_mm, y_mm, radius_mm, inradius_mm, white in circles(target):
        x, y = x_mm * scale - 0.5, y_mm * scale - 0.5
        radius, inradius = radius_mm * scale, inradius_mm * scale
        # The window ends a pixel inside the incircle, so it holds the circle on flat ground alone.
        reach = int(inradius)
        x0, y0 = max(0, round(x) - reach), max(0, round(y) - reach)
        window = image[y0:y0 + 2 * reach + 1, x0:x0 + 2 * reach + 1].astype(float)
        dy, dx = np.mgrid[0:window.shape[0], 0:window.shape[1]]
        distance = np.hypot(dx + x0 - x, dy + y0 - y)
        ground = 0.0 if white else 255.0
        assert np.all(window[(distance > radius + 1) & (distance < inradius - 1)] == ground)
        lit = np.where(distance < inradius - 1, np.abs(window - ground), 0)
        worst = max(worst, math.hypot((lit * (dx + x0)).sum() / lit.sum() - x,
                                      (lit * (dy + y0)).sum() / lit.sum() - y))
        t = distance[distance < radius - 1] / radius
        peak = np.exp(-t ** 2 / (2 * target["gauss_sigma"] ** 2))
        level = 255 * (target["edge_level"] + (1 - target["edge_level"]) * peak)
        wanted = level if white else 255 - level
        # A tenth of a level from the gradient's stops, half from rounding to 8 bits, and what the
        # rasteriser adds: a Gaussian's steepest slope is 0.61 of its height a sigma.
        slope = 255 * 0.61 * (1 - target["edge_level"]) / target["gauss_sigma"] / radius
        assert np.abs(window[distance < radius - 1] - wanted).max() <= 0.6 + slope * sampling_px
    return worst


def read(path):
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image if image.ndim == 2 else image[:, :, 1]


def test_the_file_holds_what_was_asked_for(tmp_path):
    target = make(tmp_path, "--name", "wänd", "--levels", 3, "--circle-ratio", 0.6, "--edge-level",
                  0.7, "--gauss-sigma", 0.3, "--margin", 1, "--seed", 9)
    ids = target.pop("ids")
    turns = target.pop("turns")
    assert target == {"format": "tessera-target", "version": 1, "name": "wänd", "rows": 2,
                      "cols": 3, "patch_mm": 20.0, "levels": 3, "circle_ratio": 0.6,
                      "edge_level": 0.7, "gauss_sigma": 0.3, "margin": 1.0}
    assert [len(row) for row in ids] == [3, 3] and [len(row) for row in turns] == [3, 3]


def test_without_out_the_file_goes_to_standard_output(tmp_path):
    make(tmp_path, "--seed", 5)
    done = run("--rows", 2, "--cols", 3, "--patch-mm", 20, "--seed", 5)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout == (tmp_path / "target.json").read_text()


def mt19937_64(seed):
    """The generator of the C++ standard, from its definition."""
    mask = 2 ** 64 - 1
    state = [seed]
    for i in range(1, 312):
        state.append((6364136223846793005 * (state[-1] ^ state[-1] >> 62) + i) & mask)
    while True:
        for i in range(312):
            y = (state[i] & ~0x7FFFFFFF & mask) | (state[(i + 1) % 312] & 0x7FFFFFFF)
            state[i] = state[(i + 156) % 312] ^ y >> 1 ^ (0xB5026F5AA96619E9 if y & 1 else 0)
        for x in state:
            x ^= x >> 29 & 0x5555555555555555
            x ^= x << 17 & 0x71D67FFFEDA60000
            x ^= x << 37 & 0xFFF7EEE000000000
            yield x ^ x >> 43


@pytest.mark.parametrize("seed", [0, 1, 2 ** 64 - 1])
def test_ids_and_turns_are_the_documented_ones(tmp_path, seed):
    target = make(tmp_path, "--seed", seed, rows=7, cols=12)
    outputs = mt19937_64(seed)
    free = list(range(4096))
    for i in range(84):
        n = len(free) - i
        output = next(x for x in outputs if x >= 2 ** 64 % n)
        j = i + output % n
        free[i], free[j] = free[j], free[i]
    assert sum(target["ids"], []) == free[:84]
    assert sum(target["turns"], []) == [next(outputs) >> 63 for _ in range(84)]


def test_a_target_of_all_ids_uses_each_once_and_turns_half_of_them(tmp_path):
    target = make(tmp_path, rows=64, cols=64)
    assert sorted(sum(target["ids"], [])) == list(range(4096))
    # Binomial: standard deviation 32; 5 of them.
    assert abs(sum(map(sum, target["turns"])) - 2048) < 160


def test_excluded_ids_are_not_used_again(tmp_path):
    first = make(tmp_path, rows=40, cols=50, name="a.json")
    second = make(tmp_path, "--exclude", tmp_path / "a.json", rows=32, cols=32, name="b.json")
    third = make(tmp_path, "--exclude", tmp_path / "a.json", "--exclude", tmp_path / "b.json",
                 rows=33, cols=32, name="c.json")
    ids = [set(sum(target["ids"], [])) for target in (first, second, third)]
    assert len(ids[0] | ids[1] | ids[2]) == 2000 + 1024 + 1056
    done = run("--rows", 50, "--cols", 50, "--patch-mm", 20, "--exclude", tmp_path / "a.json")
    assert done.returncode == 2 and "2096 ids are free" in done.stderr


@pytest.mark.parametrize("levels", [2, 3])
def test_the_png_shows_each_circle_where_it_belongs(tmp_path, levels):
    dpi = 500 if levels == 2 else 1200
    target = make(tmp_path, "--levels", levels, "--png", tmp_path / "t.png", "--dpi", dpi)
    assert {0, 1} == set(sum(target["turns"], []))
    # cairo counts coverage in 15 sub-rows a pixel: 1/30 px where an edge lies worst, far less
    # over a circle's whole rim.
    assert check_raster(read(tmp_path / "t.png"), target, dpi) < 0.03


def test_the_pdf_has_true_size_and_shows_each_circle_where_it_belongs(tmp_path):
    target = make(tmp_path, "--pdf", tmp_path / "t.pdf", "--name", "wand 3")
    info = subprocess.run(["pdfinfo", tmp_path / "t.pdf"], capture_output=True, text=True,
                          check=True)
    width, height = map(float, re.search(r"Page size: *([\d.]+) x ([\d.]+)", info.stdout).groups())
    # pdfinfo rounds to 6 digits; (3 + 2 * 0.5) patches of 20 mm.
    assert abs(width - 80 * 72 / 25.4) < 0.001
    assert height > 60 * 72 / 25.4
    dpi = 600
    subprocess.run(["pdftoppm", "-r", str(dpi), "-gray", "-singlefile", tmp_path / "t.pdf",
                    tmp_path / "t"], check=True)
    # poppler samples edges 4 x 4 a pixel: 1/8 px where an edge lies worst, less over a rim; and it
    # evaluates gradients at a pixel's corner.
    assert check_raster(read(tmp_path / "t.pgm"), target, dpi, sampling_px=math.sqrt(0.5)) < 0.1
    text = subprocess.run(["pdftotext", tmp_path / "t.pdf", "-"], capture_output=True, text=True,
                          check=True).stdout
    assert "wand 3" in text and "2 x 3 patches of 20 mm" in text and "digest " in text


def test_the_svg_has_true_size_and_holds_each_circle(tmp_path):
    target = make(tmp_path, "--svg", tmp_path / "t.svg")
    svg = (tmp_path / "t.svg").read_text()
    width, height = map(float, re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', svg).groups())
    box = list(map(float, re.search(r'viewBox="([^"]*)"', svg).group(1).split()))
    assert abs(width - 80) < 1e-6 and box[:2] == [0, 0]
    scale = width / box[2]
    assert abs(height / box[3] - scale) < 1e-9
    drawn = []
    for gradient in re.findall(r"<radialGradient [^>]*>", svg):
        value = {key: float(re.search(rf' {key}="([^"]*)"', gradient).group(1))
                 for key in ("cx", "cy", "r")}
        matrix = re.search(r'gradientTransform="matrix\(([^)]*)\)"', gradient)
        a, b, c, d, e, f = map(float, matrix.group(1).split(",")) if matrix else (1, 0, 0, 1, 0, 0)
        assert (b, c) == (0, 0) and a == d
        drawn.append((scale * (a * value["cx"] + e), scale * (d * value["cy"] + f),
                      scale * a * value["r"]))
    wanted = [circle[:3] for circle in circles(target)]
    assert len(drawn) == len(wanted) == 6 * 13
    # cairo writes six decimals of units of 10 um.
    assert np.abs(np.array(drawn) - np.array(wanted)).max() < 2e-5


@pytest.mark.parametrize("kind", ["png", "pdf"])
def test_a_black_patch_shows_no_seams(tmp_path, kind):
    # Id 4095: every small triangle black; its parity is even, so the anchor is black as well.
    target = make(tmp_path)
    target["ids"][0][0] = 4095
    if 4095 in sum(target["ids"], [])[1:]:
        pytest.fail("choose another seed")
    (tmp_path / "black.json").write_text(json.dumps(target))
    dpi = 333
    done = run("--draw", tmp_path / "black.json", "--png", tmp_path / "t.png", "--dpi", dpi,
               "--pdf", tmp_path / "t.pdf")
    assert done.returncode == 0, done.stderr
    if kind == "pdf":
        subprocess.run(["pdftoppm", "-r", str(dpi), "-gray", "-png", "-singlefile",
                        tmp_path / "t.pdf", tmp_path / "t"], check=True)
    image = read(tmp_path / "t.png")
    scale = dpi / 25.4
    y, x = np.mgrid[0:image.shape[0], 0:image.shape[1]] + 0.5
    inside = np.maximum(np.abs(x - 20 * scale), np.abs(y - 20 * scale)) < 10 * scale - 1
    for x_mm, y_mm, radius_mm, _, _ in list(circles(target))[:13]:
        inside &= np.hypot(x - x_mm * scale, y - y_mm * scale) > radius_mm * scale + 1
    assert inside.sum() > 10000
    assert np.all(image[inside] == 0)


def test_the_ruler_is_as_long_as_its_caption_says(tmp_path):
    dpi = 500
    make(tmp_path, "--png", tmp_path / "t.png", "--dpi", dpi)
    image = read(tmp_path / "t.png")
    scale = dpi / 25.4
    for row in image[math.ceil(60 * scale):]:
        ink = 255.0 - row
        starts = np.flatnonzero(np.diff(np.concatenate([[0], ink > 0])) == 1)
        if len(starts) == 11 and np.ptp(np.diff(starts)) <= 1:
            runs = np.split(ink, starts[1:])
            first, last = (np.average(np.arange(len(run)), weights=run) for run in
                           (runs[0], runs[-1]))
            # Coverage is exact along a row but for 8-bit rounding: some 0.01 px at each end.
            assert abs((starts[-1] + last - first) / scale - 50) < 0.03 / scale
            return
    pytest.fail("no ruler of 11 ticks below the grid")


def test_a_margin_of_nothing_and_a_grid_of_one_patch_are_drawn(tmp_path):
    target = make(tmp_path, "--margin", 0, "--png", tmp_path / "t.png", "--dpi", 500, "--pdf",
                  tmp_path / "t.pdf", "--svg", tmp_path / "t.svg", rows=1, cols=1)
    check_raster(read(tmp_path / "t.png"), target, 500)


@pytest.mark.parametrize("arguments, words", [
    ([], "--rows is missing"),
    (["--rows", "2", "--cols", "3"], "--patch-mm is missing"),
    (["--rows", "0", "--cols", "3", "--patch-mm", "9"], '"rows"'),
    (["--rows", "two", "--cols", "3", "--patch-mm", "9"], "--rows"),
    (["--rows", "-2", "--cols", "3", "--patch-mm", "9"], "--rows"),
    (["--rows", "65", "--cols", "64", "--patch-mm", "9"], "4160 patches"),
    (["--rows", "4294967295", "--cols", "4294967295", "--patch-mm", "9"], "patches"),
    (["--rows", "2", "--cols", "3", "--patch-mm", "0"], '"patch_mm"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "-5"], '"patch_mm"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "nan"], '"patch_mm"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "1e999"], "patch"),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--levels", "1"], '"levels"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--circle-ratio", "1.1"], '"circle_ratio"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--edge-level", "0"], '"edge_level"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--gauss-sigma", "0"], '"gauss_sigma"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--margin", "-1"], '"margin"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--name", "n" * 64], '"name"'),
    (["--rows", "2", "--cols", "3", "--patch-mm", "9", "--dpi", "0", "--png", "t.png"], "--dpi"),
    (["--sides", "2"], "--sides"),
    (["--draw", "target.json"], "--draw needs"),
    (["--draw", "target.json", "--rows", "2", "--pdf", "t.pdf"], "--rows"),
])
def test_wrong_use_exits_2_with_one_sentence(tmp_path, arguments, words):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("tessera-target: ") and done.stderr.count("\n") == 1
    assert words in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("change, words", [
    ({"surface": 1}, '"surface" is not known'),
    ({"version": 2}, '"version" is 2'),
    ({"ids": [[1, 2, 3], [4, 5, 1]]}, "id 1 stands twice"),
    ({"cols": 4}, '"ids", row 0'),
])
def test_a_wrong_target_file_is_refused_with_one_sentence(tmp_path, change, words):
    target = make(tmp_path)
    target.update(change)
    (tmp_path / "wrong.json").write_text(json.dumps(target))
    for arguments in (["--draw", "wrong.json", "--pdf", "t.pdf"],
                      ["--rows", 1, "--cols", 1, "--patch-mm", 9, "--exclude", "wrong.json"]):
        done = run(*arguments, cwd=tmp_path)
        assert done.returncode == 1 and done.stdout == ""
        assert done.stderr.startswith("tessera-target: wrong.json: ") and words in done.stderr
        assert done.stderr.count("\n") == 1
    assert not (tmp_path / "t.pdf").exists()


def test_notes_in_a_target_file_are_no_hindrance(tmp_path):
    target = make(tmp_path)
    target["x_printed"] = {"by": "us"}
    (tmp_path / "noted.json").write_text(json.dumps(target))
    assert run("--draw", "noted.json", "--svg", "t.svg", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("kind, words", [("pdf", "5080 mm"), ("svg", "10000 mm"), ("png", "--dpi")])
def test_a_sheet_too_large_for_its_drawing_gets_a_sentence(tmp_path, kind, words):
    done = run("--rows", 2, "--cols", 3, "--patch-mm", 10000, "--out", tmp_path / "t.json",
               "--" + kind, tmp_path / ("t." + kind))
    assert done.returncode == 1 and words in done.stderr and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_leaves_the_old_file(tmp_path):
    def full_disk():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))

    (tmp_path / "target.json").write_text("what was there")
    done = run("--rows", 20, "--cols", 30, "--patch-mm", 9, "--out", tmp_path / "target.json",
               preexec_fn=full_disk)
    assert done.returncode == 1 and "cannot be written" in done.stderr
    assert (tmp_path / "target.json").read_text() == "what was there"
    assert [path.name for path in tmp_path.iterdir()] == ["target.json"]


@pytest.mark.parametrize("path", ["/dev/full", "/no/such/folder/t.json"])
def test_a_file_that_cannot_be_written_gets_a_sentence(path):
    done = run("--rows", 2, "--cols", 3, "--patch-mm", 9, "--out", path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"tessera-target: {path}: cannot be written: ")
    assert not Path("/dev/full").is_file()


def test_standard_output_that_takes_nothing_is_noticed():
    with open("/dev/full", "w") as full:
        done = subprocess.run([TARGET, "--rows", "2", "--cols", "3", "--patch-mm", "9"],
                              stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and done.stderr.count("\n") == 1


def test_help_and_version_go_to_standard_output():
    for option in ("--help", "--version"):
        done = run(option)
        assert done.returncode == 0 and done.stderr == "" and "tessera-target" in done.stdout
