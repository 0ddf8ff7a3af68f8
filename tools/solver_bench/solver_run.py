"""What the tools of this folder share: the simulator on the path, and programs run and measured."""
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "truth"))

# One thread for whatever linear algebra Python's libraries bring: times are compared on one.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}


@dataclasses.dataclass
class Run:
    status: int
    stdout: str
    stderr: str
    wall_s: float
    cpu_s: float
    peak_mb: float

    @property
    def complaint(self):
        return (self.stderr.strip().splitlines() or ["no message"])[-1]


def rig_program():
    return Path(os.environ.get("TESSERA_BIN", ROOT / "build" / "bin")) / "tessera-rig"


def run(command, timeout=3600):
    with tempfile.TemporaryDirectory() as folder:
        figures = Path(folder) / "figures.json"
        done = subprocess.run([sys.executable, str(Path(__file__).with_name("measure_child.py")), str(figures),
                               *map(str, command)], capture_output=True, text=True, timeout=timeout,
                              check=False, env={**os.environ, **ONE_THREAD})
        taken = json.loads(figures.read_text()) if figures.exists() else dict.fromkeys(
            ("wall_s", "cpu_s", "peak_mb"), float("nan"))
    return Run(done.returncode, done.stdout, done.stderr, **taken)


def solve(folder, out, options=()):
    """tessera-rig solve; an older result in `out` is removed first, so that none is taken for new."""
    (Path(out) / "rig.json").unlink(missing_ok=True)
    return run([rig_program(), "solve", folder, "--out", out, *options])


def say(text):
    print(text, file=sys.stderr, flush=True)
