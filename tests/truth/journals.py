"""Packets and journals of simulated cameras, from common/wire/WIRE.md, host/journal/JOURNAL.md and
common/target/TARGET.md alone.

    target = make_target(rows, cols, first_id)     what goes into target.json
    board, ids = target_board(target)              rows x, y, z, radius (simulate.py), and their point ids
    packets = make_packets(cameras, ids, rows, target)   of simulate.make_scene's rows
    write_journal(path, packets)
"""
import struct
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "golden" / "wire"))
import make_samples as maker  # noqa: E402

INRADIUS = (np.sqrt(2) - 1) / 4
STEP_NS = 100_000_000


def make_target(rows=4, cols=5, first_id=100, **change):
    ids = [[first_id + 37 * (r * cols + c) for c in range(cols)] for r in range(rows)]
    turns = [[(r + 2 * c) % 3 % 2 for c in range(cols)] for r in range(rows)]
    return {"format": "tessera-target", "version": 1, "name": "sim", "rows": rows, "cols": cols,
            "patch_mm": 100.0, "ids": ids, "turns": turns} | change


def patch_features():
    """(u, v, radius) of the 13 features of a patch of side 1, circle ratio 0.5."""
    h = INRADIUS
    small = [(0.25, h), (0.5, 0.25 - h), (0.75, h), (0.5, 0.25 + h)]
    features = [(0.5, 2 * h, h)]
    for quarter in (1, 2, 3):
        for u, v in small:
            for _ in range(quarter):
                u, v = 1 - v, u
            features.append((u, v, h / 2))
    return features


def target_board(target):
    rows, ids = [], []
    for r, line in enumerate(target["ids"]):
        for c, patch in enumerate(line):
            for index, (u, v, radius) in enumerate(patch_features()):
                if target["turns"][r][c]:
                    u, v = 1 - u, 1 - v
                rows.append([target["patch_mm"] * (c + u), target["patch_mm"] * (r + v), 0,
                             target["patch_mm"] * radius])
                ids.append(patch * 128 + index)
    return np.array(rows), ids


def target_digest(target):
    """FNV-1a over what common/target/target.h lists; circle profile as target.md's defaults."""
    data = struct.pack("<HHBIIIq", target["rows"], target["cols"], 2, 32768, round(0.8 * 65536),
                       round(0.4 * 65536), round(target["patch_mm"] * 1e6))
    for ids, turns in zip(target["ids"], target["turns"]):
        for patch, turn in zip(ids, turns):
            data += struct.pack("<HB", patch, turn)
    digest = 0xCBF29CE484222325
    for byte in data:
        digest = (digest ^ byte) * 0x100000001B3 % 2**64
    return digest or 1


def make_packets(cameras, ids, rows, target, **change):
    """One packet a camera and frame, in order of time; `change` replaces header fields."""
    seen = {}
    for camera, frame, point, x, y, _ in rows:
        patches = seen.setdefault((frame, camera), {})
        patch, index = divmod(ids[point], 128)
        # From the pixel centre's zero to the corner's, in steps of 2^-12 px; sigma 2^(16/3 - 11) = 0.0197 px.
        patches.setdefault(patch, {})[index] = (round((x + 0.5) * 4096), round((y + 0.5) * 4096), 16, 9)
    packets = []
    for (frame, camera), patches in sorted(seen.items()):
        fields = {"serial": cameras[camera]["name"], "boot_id": 7, "sequence": frame,
                  "packet_index": frame, "t_capture_ns": 5 * 10**18 + STEP_NS * frame + 1000 * camera,
                  "clock_kind": 3, "width": cameras[camera]["width"],
                  "height": cameras[camera]["height"], "target_digest": target_digest(target),
                  "fraction_bits": 12} | change
        packets.append(maker.build(fields, dict(sorted(patches.items()))))
    return packets


def write_journal(path, packets, kind=1):
    head = b"TSSRJRNL" + struct.pack("<HHIIq", 1, 32, 0, 0, 0)
    data = head + struct.pack("<I", maker.crc32c(head))
    for number, packet in enumerate(packets):
        body = b"sim" + packet
        record = b"TREC" + struct.pack("<IIBBHqI", len(body), maker.crc32c(body), kind, 0, 3, number, 1)
        data += record + struct.pack("<I", maker.crc32c(record)) + body
    Path(path).write_bytes(data)
    return path
