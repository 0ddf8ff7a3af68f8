"""The committed tables are what their generators write."""
import subprocess
import sys
from pathlib import Path

import pytest

GENERATORS = sorted((Path(__file__).resolve().parents[2] / "tools/gen").glob("*_table.py"))


@pytest.mark.parametrize("generator", GENERATORS, ids=lambda path: path.stem)
def test_the_committed_table_is_what_its_generator_writes(generator):
    done = subprocess.run([sys.executable, generator, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
