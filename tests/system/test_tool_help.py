"""Every Python program under tools/ says with --help what it is, in its own words, and does nothing else."""
import ast
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOLS = [path for path in sorted((ROOT / "tools").glob("*/*.py")) if '__name__ == "__main__"' in path.read_text()]
# Compared with mrcal, it cannot begin where that is not installed.
WITHOUT_PEER = {"peer_mrcal.py": "No module named 'mrcal'"}


def test_every_tool_has_help():
    assert len(TOOLS) >= 10
    # All at once: each spends its time importing.
    running = {path: subprocess.Popen([sys.executable, path, "--help"], stdout=subprocess.PIPE,
                                      stderr=subprocess.PIPE, text=True, cwd=ROOT) for path in TOOLS}
    faults = []
    for path, child in running.items():
        out, err = child.communicate(timeout=120)
        first_words = ast.get_docstring(ast.parse(path.read_text())).split()[:5]
        if child.returncode != 0 and WITHOUT_PEER.get(path.name, "?") in err:
            continue
        if child.returncode != 0 or " ".join(first_words) not in " ".join(out.split()):
            faults.append(f"{path.relative_to(ROOT)}: status {child.returncode}, {err.strip()[-200:]}")
    assert not faults, "\n".join(faults)
