#!/usr/bin/env python3
"""Makes this folder's golden packets from common/wire/WIRE.md, with none of the project's code.

    make_samples.py            writes NAME.hex (and NAME.json, what it says) beside itself
    make_samples.py --check    changes nothing; exit 1 where a file differs
"""
import json
import struct
import sys
from pathlib import Path

HERE = Path(__file__).parent


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


HEADER = {  # field: (offset, struct code), in the order of the document
    "version": (4, "H"), "header_bytes": (6, "H"), "packet_bytes": (8, "I"), "checksum": (12, "I"),
    "refuse": (16, "I"), "ignore": (20, "I"), "serial": (24, "32s"), "boot_id": (56, "Q"),
    "sequence": (64, "I"), "packet_index": (68, "I"), "t_capture_ns": (72, "q"),
    "clock_uncertainty_ns": (80, "I"), "exposure_ns": (84, "I"), "row_time_ns": (88, "I"),
    "clock_kind": (92, "B"), "flips": (93, "B"), "binning_x": (94, "B"), "binning_y": (95, "B"),
    "width": (96, "H"), "height": (98, "H"), "region_x": (100, "H"), "region_y": (102, "H"),
    "region_width": (104, "H"), "region_height": (106, "H"), "frames_dropped": (108, "I"),
    "target_digest": (112, "Q"), "settings_digest": (120, "Q"), "packets_dropped": (128, "I"),
    "truncation": (132, "H"), "patch_count": (134, "H"), "feature_count": (136, "I"),
    "fraction_bits": (140, "B"), "refuse_u8": (141, "B"), "refuse_u16": (142, "H"),
}


def feature(x, y, sigma_code, size_code):
    """x and y in steps from the image's corner."""
    return (x | y << 23 | sigma_code << 46 | size_code << 51).to_bytes(7, "little")


def patch(patch_id, features):
    """features: {index: (x, y, sigma code, size code)}"""
    low = sum(1 << i for i in features if i < 13)
    high = sum(1 << (i - 13) for i in features if i >= 13)
    head = struct.pack("<HH", patch_id | (0x1000 if high else 0), low)
    return head + (high.to_bytes(9, "little") if high else b"") + b"".join(
        feature(*features[i]) for i in sorted(features))


def put(packet, name, value):
    offset, code = HEADER[name]
    struct.pack_into("<" + code, packet, offset, value)


def seal(packet):
    put(packet, "checksum", crc32c(bytes(packet[:12]) + bytes(packet[16:])))
    return bytes(packet)


def build(fields, patches, extra=b"", records=None):
    packet = bytearray(144) + extra
    packet[0:4] = b"TSSR"
    values = {"version": 1, "header_bytes": len(packet), "patch_count": len(patches),
              "feature_count": sum(len(p) for p in patches.values())} | fields
    for name, value in values.items():
        put(packet, name, value.encode() if name == "serial" else value)
    packet += records if records is not None else b"".join(
        patch(i, f) for i, f in patches.items())
    put(packet, "packet_bytes", len(packet))
    return seal(packet)


# Every field another value, every byte of a field another one.
FULL = {
    "serial": "kam\u00e9ra-7", "boot_id": 0x1112131415161718, "sequence": 0x21222324,
    "packet_index": 0x31323334, "t_capture_ns": 0x4142434445464748,
    "clock_uncertainty_ns": 0x51525354,
    "exposure_ns": 0x61626364, "row_time_ns": 0x71727374, "clock_kind": 3, "flips": 2,
    "binning_x": 1, "binning_y": 2, "width": 1920, "height": 1080, "region_x": 0x0102,
    "region_y": 0x0304, "region_width": 0x0782, "region_height": 0x0874,
    "frames_dropped": 0x81828384, "target_digest": 0x9192939495969798,
    "settings_digest": 0xA1A2A3A4A5A6A7A8, "packets_dropped": 0xB1B2B3B4, "truncation": 0x0009,
    "fraction_bits": 12,
}
# The least that is legal.
EMPTY = {"serial": "c", "width": 1, "height": 1, "fraction_bits": 14}
EXTREME = {
    "serial": "0123456789abcdef0123456789abcdef", "boot_id": 2**64 - 1, "sequence": 2**32 - 1,
    "packet_index": 2**32 - 1, "t_capture_ns": -(2**63), "clock_uncertainty_ns": 2**32 - 1,
    "exposure_ns": 2**32 - 1, "row_time_ns": 2**32 - 1, "clock_kind": 4, "flips": 3,
    "binning_x": 16, "binning_y": 1, "width": 4095, "height": 32768, "region_x": 65535,
    "region_y": 65535, "region_width": 65520, "region_height": 32768, "frames_dropped": 2**32 - 1,
    "target_digest": 2**64 - 1, "settings_digest": 2**64 - 1, "packets_dropped": 2**32 - 1,
    "truncation": 0xFFFF, "fraction_bits": 8,
}
# (959.5 + 0.25) px from the corner in x, 540.125 in y, at 12 fraction bits.
FULL_PATCHES = {
    5: {0: (3931136, 2212352, 13, 12), 3: (4096, 2048, 0, 0),
        12: (1920 * 4096 - 1, 1080 * 4096 - 1, 31, 31)},
    0x0ABC: {1: (0, 0, 10, 9)},
}
LEVEL_3 = {
    0: {i: (1000 * i + 500, 700 * i + 300, i % 32, (3 * i) % 32) for i in range(85)},
    7: {12: (1, 2, 3, 4), 13: (5, 6, 7, 8)},
    4095: {84: (9, 10, 11, 12)},
}

GOOD = {
    "good_empty": (EMPTY, {}, b""),
    "good_full": (FULL, FULL_PATCHES, b""),
    "good_extreme": (EXTREME, {4095: {0: (4095 * 256 - 1, 2**23 - 1, 31, 31)}}, b""),
    "good_level3": (FULL | {"truncation": 0}, LEVEL_3, b""),
    # Legal, though this project's encoder does not write it.
    "good_longer_header": (FULL | {"ignore": 0x80000001, "fraction_bits": 9}, {
        9: {2: (1, 1, 1, 1)}}, b"later fields"),
}


def bad_samples():
    full = build(FULL, FULL_PATCHES)
    one = {2: (100, 200, 5, 6)}

    def with_field(**change):
        packet = bytearray(full)
        for name, value in change.items():
            put(packet, name, value)
        return seal(packet)

    def with_records(*records, **change):
        fields = FULL | {"patch_count": len(records)} | change
        return build(fields, {}, records=b"".join(records))

    def edit(at, value):
        packet = bytearray(full)
        packet[at] = value
        return bytes(packet)

    good = patch(5, one)
    yield "nothing", "SHORT", b""
    yield "prefix_only", "SHORT", full[:15]
    yield "one_byte_missing", "SHORT", full[:-1]
    yield "one_byte_more", "BAD_LENGTH", full + b"\0"
    yield "other_magic", "BAD_MAGIC", edit(3, ord("Q"))
    yield "version_2", "BAD_VERSION", with_field(version=2)
    yield "version_0", "BAD_VERSION", with_field(version=0)
    yield "header_of_143", "BAD_LENGTH", with_field(header_bytes=143)
    yield "header_of_513", "BAD_LENGTH", with_field(header_bytes=513)
    yield "header_beyond_packet", "BAD_LENGTH", with_field(header_bytes=len(full) + 1)
    yield "packet_beyond_limit", "BAD_LENGTH", with_field(packet_bytes=2490881)
    yield "header_bit_turned", "BAD_CHECKSUM", edit(70, full[70] ^ 1)
    yield "last_bit_turned", "BAD_CHECKSUM", edit(len(full) - 1, full[-1] ^ 128)
    yield "checksum_turned", "BAD_CHECKSUM", edit(12, full[12] ^ 1)
    yield "refuse_bit_0", "RESERVED_SET", with_field(refuse=1)
    yield "refuse_bit_31", "RESERVED_SET", with_field(refuse=1 << 31)
    yield "refuse_byte_141", "RESERVED_SET", with_field(refuse_u8=1)
    yield "refuse_byte_143", "RESERVED_SET", with_field(refuse_u16=0x8000)
    yield "no_serial", "BAD_SERIAL", with_field(serial=b"")
    yield "serial_after_zero", "BAD_SERIAL", with_field(serial=b"a\0b")
    yield "serial_with_newline", "BAD_SERIAL", with_field(serial=b"a\nb")
    yield "serial_with_c1_control", "BAD_SERIAL", with_field(serial=b"\xc2\x9b")
    yield "serial_latin_1", "BAD_SERIAL", with_field(serial=b"kam\xe9ra")
    yield "serial_overlong", "BAD_SERIAL", with_field(serial=b"\xc0\xaf")
    yield "serial_overlong_3", "BAD_SERIAL", with_field(serial=b"\xe0\x9f\xbf")
    yield "serial_overlong_4", "BAD_SERIAL", with_field(serial=b"\xf0\x8f\xbf\xbf")
    yield "serial_surrogate", "BAD_SERIAL", with_field(serial=b"\xed\xa0\x80")
    yield "serial_beyond_unicode", "BAD_SERIAL", with_field(serial=b"\xf4\x90\x80\x80")
    yield "serial_cut_in_character", "BAD_SERIAL", with_field(serial=b"a" * 31 + b"\xc3")
    yield "clock_5", "BAD_CLOCK", with_field(clock_kind=5)
    yield "width_0", "BAD_IMAGE", with_field(width=0)
    yield "height_0", "BAD_IMAGE", with_field(height=0)
    yield "width_32769", "BAD_IMAGE", with_field(width=32769, fraction_bits=0)
    yield "fraction_too_fine", "BAD_IMAGE", with_field(fraction_bits=13)
    yield "fraction_15", "BAD_IMAGE", build(EMPTY | {"fraction_bits": 15}, {})
    yield "flip_bit_2", "BAD_SENSOR", with_field(flips=4)
    yield "binning_17", "BAD_SENSOR", with_field(binning_x=17, region_width=65535)
    yield "region_too_narrow", "BAD_SENSOR", with_field(region_width=1919)
    yield "region_too_low_for_binning", "BAD_SENSOR", with_field(region_height=2159)
    yield "patch_bit_13", "RESERVED_SET", with_records(struct.pack("<HH", 0x2005, 4) + good[4:])
    yield "patch_bit_15", "RESERVED_SET", with_records(struct.pack("<HH", 0x8005, 4) + good[4:])
    yield "mask_bit_13", "RESERVED_SET", with_records(struct.pack("<HH", 5, 0x2004) + good[4:] * 2)
    yield "mask_bit_15", "RESERVED_SET", with_records(struct.pack("<HH", 5, 0x8004) + good[4:] * 2)
    yield "patch_twice", "BAD_ORDER", with_records(good, good, feature_count=2)
    yield "patches_descending", "BAD_ORDER", with_records(good, patch(4, one), feature_count=2)
    yield "patch_without_features", "EMPTY_PATCH", with_records(struct.pack("<HH", 5, 0))
    yield "level_3_mask_zero", "EMPTY_PATCH", with_records(
        struct.pack("<HH", 0x1005, 4) + bytes(9) + good[4:], feature_count=1)
    yield "x_on_right_edge", "OUTSIDE_IMAGE", with_records(
        patch(5, {2: (1920 * 4096, 200, 5, 6)}), feature_count=1)
    yield "y_on_lower_edge", "OUTSIDE_IMAGE", with_records(
        patch(5, {2: (100, 1080 * 4096, 5, 6)}), feature_count=1)
    yield "patch_missing", "BAD_COUNT", with_field(patch_count=3)
    yield "patch_too_many", "BAD_COUNT", with_field(patch_count=1)
    yield "patch_head_cut", "BAD_COUNT", with_records(good[:3], feature_count=1)
    yield "level_3_mask_cut", "BAD_COUNT", with_records(
        struct.pack("<HH", 0x1005, 0) + b"\1" * 8, feature_count=1)
    yield "feature_cut", "BAD_COUNT", with_records(good[:-1], feature_count=1)
    yield "features_fewer_than_stated", "BAD_COUNT", with_field(feature_count=5)
    yield "features_more_than_stated", "BAD_COUNT", with_field(feature_count=3)
    yield "patches_4097", "BAD_COUNT", with_field(patch_count=4097)


def hex_text(comment, data):
    lines = [f"# {comment}"]
    lines += [data[i:i + 16].hex(" ") for i in range(0, len(data), 16)]
    return "\n".join(lines) + "\n"


def said(fields, patches):
    """What a decoder must find: positions in steps, codes as they are."""
    names = [n for n in HEADER if n not in (
        "header_bytes", "packet_bytes", "checksum", "refuse", "ignore", "refuse_u8", "refuse_u16",
        "patch_count", "feature_count")]
    header = {n: fields.get(n, 1 if n == "version" else 0) for n in names}
    return {"header": header, "patches": [
        {"patch": i, "features": [[k, *f[k]] for k in sorted(f)]} for i, f in patches.items()]}


def files():
    for name, (fields, patches, extra) in GOOD.items():
        yield f"{name}.hex", hex_text("WIRE_OK", build(fields, patches, extra))
        yield f"{name}.json", json.dumps(said(fields, patches), indent=1) + "\n"
    for name, status, data in bad_samples():
        yield f"bad_{name}.hex", hex_text("WIRE_" + status, data)


def main():
    made = dict(files())
    if sys.argv[1:] == ["--check"]:
        there = {p.name: p.read_text() for p in HERE.glob("*") if p.suffix in (".hex", ".json")}
        wrong = sorted(n for n in made.keys() | there.keys() if made.get(n) != there.get(n))
        print(*(f"{name} differs from what make_samples.py makes" for name in wrong), sep="\n")
        return 1 if wrong else 0
    for name, text in made.items():
        (HERE / name).write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
