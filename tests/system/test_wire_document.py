"""The wire's document, its golden samples and a decoder written from the document agree."""
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
GOLDEN = TOP / "tests/golden/wire"
sys.path.insert(0, str(TOP / "tests/wire"))
import decode as wire  # noqa: E402

SAMPLES = sorted(GOLDEN.glob("*.hex"))


def test_there_are_good_and_bad_samples():
    names = [path.name for path in SAMPLES]
    assert sum(name.startswith("good_") for name in names) >= 5
    assert sum(name.startswith("bad_") for name in names) >= 50


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_a_sample_is_what_the_document_says(path):
    expected = path.read_text().split("\n", 1)[0].lstrip("# ")
    data = wire.read_hex(path)
    if expected == "WIRE_OK":
        assert wire.decode(data) == json.loads(path.with_suffix(".json").read_text())
    else:
        with pytest.raises(wire.Refused) as why:
            wire.decode(data)
        assert str(why.value) == expected


def test_the_samples_are_what_their_maker_makes():
    made = subprocess.run([sys.executable, GOLDEN / "make_samples.py", "--check"],
                          capture_output=True, text=True)
    assert made.returncode == 0, made.stdout


def test_the_documents_example_is_the_golden_packet():
    text = (TOP / "common/wire/WIRE.md").read_text()
    lines = re.findall(r"^ *\d+  ((?:[0-9a-f]{2} ?)+)$", text, re.MULTILINE)
    assert bytes.fromhex(" ".join(lines)) == wire.read_hex(GOLDEN / "good_full.hex")


def test_the_checksum_has_the_documents_check_value():
    assert wire.checksum(b"123456789") == 0xE3069283
