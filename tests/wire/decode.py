#!/usr/bin/env python3
"""A decoder of feature packets, written from common/wire/WIRE.md alone: a check on the document.

decode(bytes) gives a dictionary, or raises Refused with the name of a wire_status.
    decode.py FILE.hex...    prints what each file's packet holds, as JSON
"""
import json
import sys


class Refused(Exception):
    pass


def need(condition, status):
    if not condition:
        raise Refused("WIRE_" + status)


def unsigned(data, at, count):
    return int.from_bytes(data[at:at + count], "little")


def checksum(data):
    """CRC-32C: reflected polynomial, low bits first, all ones at the start, inverted at the end."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = (register >> 1) ^ (0x82F63B78 * (register & 1))
    return register ^ 0xFFFFFFFF


# Section 2, the fields that are only numbers: name, offset, bytes.
NUMBERS = [
    ("boot_id", 56, 8), ("sequence", 64, 4), ("packet_index", 68, 4),
    ("clock_uncertainty_ns", 80, 4),
    ("exposure_ns", 84, 4), ("row_time_ns", 88, 4), ("clock_kind", 92, 1), ("flips", 93, 1),
    ("binning_x", 94, 1), ("binning_y", 95, 1), ("width", 96, 2), ("height", 98, 2),
    ("region_x", 100, 2), ("region_y", 102, 2), ("region_width", 104, 2), ("region_height", 106, 2),
    ("frames_dropped", 108, 4), ("target_digest", 112, 8), ("settings_digest", 120, 8),
    ("packets_dropped", 128, 4), ("truncation", 132, 2), ("fraction_bits", 140, 1),
]


def serial_of(field):
    text = field.rstrip(b"\0")
    need(text, "BAD_SERIAL")
    try:
        serial = text.decode("utf-8")
    except UnicodeDecodeError:
        raise Refused("WIRE_BAD_SERIAL") from None
    need(all(ord(c) >= 0x20 and not 0x7F <= ord(c) <= 0x9F for c in serial), "BAD_SERIAL")
    return serial


def header_of(data):
    h = {"version": unsigned(data, 4, 2), "serial": serial_of(data[24:56])}
    for name, at, count in NUMBERS:
        h[name] = unsigned(data, at, count)
    h["t_capture_ns"] = int.from_bytes(data[72:80], "little", signed=True)
    need(h["clock_kind"] <= 4, "BAD_CLOCK")
    need(1 <= h["width"] <= 32768 and 1 <= h["height"] <= 32768, "BAD_IMAGE")
    need(h["fraction_bits"] <= 14, "BAD_IMAGE")
    need(max(h["width"], h["height"]) * 2 ** h["fraction_bits"] <= 2 ** 23, "BAD_IMAGE")
    need(h["binning_x"] <= 16 and h["binning_y"] <= 16 and h["flips"] < 4, "BAD_SENSOR")
    if any(h[f"region_{n}"] for n in ("x", "y", "width", "height")):
        need(h["region_width"] >= h["width"] * max(h["binning_x"], 1), "BAD_SENSOR")
        need(h["region_height"] >= h["height"] * max(h["binning_y"], 1), "BAD_SENSOR")
    return h


def patch_of(data, at, last_id, h):
    """The patch at `at`, and where the next one begins."""
    need(at + 4 <= len(data), "BAD_COUNT")
    head, mask = unsigned(data, at, 2), unsigned(data, at + 2, 2)
    need(head < 0x2000 and mask < 0x2000, "RESERVED_SET")
    patch_id = head & 0xFFF
    need(patch_id > last_id, "BAD_ORDER")
    present = [i for i in range(13) if mask >> i & 1]
    at += 4
    if head & 0x1000:
        need(at + 9 <= len(data), "BAD_COUNT")
        level_3 = [13 + 8 * j + k for j in range(9) for k in range(8) if data[at + j] >> k & 1]
        need(level_3, "EMPTY_PATCH")
        present += level_3
        at += 9
    need(present, "EMPTY_PATCH")
    need(at + 7 * len(present) <= len(data), "BAD_COUNT")
    features = []
    for index in present:
        number = unsigned(data, at, 7)
        x, y = number & 0x7FFFFF, number >> 23 & 0x7FFFFF
        need(x < h["width"] << h["fraction_bits"] and y < h["height"] << h["fraction_bits"],
             "OUTSIDE_IMAGE")
        features.append([index, x, y, number >> 46 & 31, number >> 51])
        at += 7
    return {"patch": patch_id, "features": features}, at


def decode(data):
    """Section 4, in its order. Positions stay in steps, sigma and size in codes."""
    need(len(data) < 4 or data[:4] == b"\x54\x53\x53\x52", "BAD_MAGIC")
    need(len(data) >= 16, "SHORT")
    header_bytes, packet_bytes = unsigned(data, 6, 2), unsigned(data, 8, 4)
    need(144 <= header_bytes <= 512 and header_bytes <= packet_bytes <= 2490880, "BAD_LENGTH")
    need(len(data) >= packet_bytes, "SHORT")
    need(len(data) == packet_bytes, "BAD_LENGTH")
    need(unsigned(data, 12, 4) == checksum(data[:12] + data[16:]), "BAD_CHECKSUM")
    need(unsigned(data, 4, 2) == 1, "BAD_VERSION")
    need(not any(data[16:20]) and not any(data[141:144]), "RESERVED_SET")
    h = header_of(data)
    at, last_id, patches = header_bytes, -1, []
    for _ in range(unsigned(data, 134, 2)):
        patch, at = patch_of(data, at, last_id, h)
        last_id = patch["patch"]
        patches.append(patch)
    need(at == len(data), "BAD_COUNT")
    need(sum(len(p["features"]) for p in patches) == unsigned(data, 136, 4), "BAD_COUNT")
    return {"header": h, "patches": patches}


def pixels(packet):
    """Yields (patch, feature, x, y, sigma, size); (0, 0) is the centre of the top-left pixel."""
    step = 2.0 ** -packet["header"]["fraction_bits"]
    for patch in packet["patches"]:
        for index, x, y, sigma, size in patch["features"]:
            yield (patch["patch"], index, x * step - 0.5, y * step - 0.5,
                   2 ** (sigma / 3 - 11), 2 ** (size / 3))


def read_hex(path):
    with open(path) as file:
        return bytes.fromhex("".join(line for line in file if not line.startswith("#")))


if __name__ == "__main__":
    for name in sys.argv[1:]:
        try:
            print(json.dumps(decode(read_hex(name)), indent=1))
        except Refused as why:
            sys.exit(f"{name}: {why}")
