"""Renders a row's frames (once: they are kept), runs tessera-detect on them and scores the result."""
import hashlib
import json
import os
import subprocess
from pathlib import Path

from accuracy_clutter import write as write_clutter
from accuracy_conditions import TARGETS
from accuracy_score import Score, read_rows, score

EMPTY_FRAME = "frame_00000.pgm"


class Run:
    def __init__(self, bin_folder, work_folder, seed, jobs=1, detect_options=()):
        self.bin = Path(bin_folder)
        self.work = Path(work_folder)
        self.seed = seed
        self.jobs = jobs
        self.detect_options = list(detect_options)
        self.renderer = hashlib.sha256((self.bin / "tessera-render").read_bytes()).hexdigest()
        self.targets = {}

    def target(self, name):
        """The target file's text; made once."""
        if name not in self.targets:
            rows, cols, levels = TARGETS[name]
            self.targets[name] = self.call("tessera-target", "--rows", rows, "--cols", cols,
                                           "--levels", levels, "--patch-mm", 100, "--seed",
                                           self.seed % 2**32, "--name", f"accuracy-{name}")
        return self.targets[name]

    def call(self, program, *words):
        run = subprocess.run([self.bin / program, *map(str, words)], capture_output=True, text=True)
        if run.returncode != 0:
            raise RuntimeError(f"{program} failed: {run.stderr.strip()}")
        return run.stdout

    def render(self, scene):
        """The folder with the scene's frames and truth."""
        text = self.target(scene.target)
        views = scene.views
        if views is None:  # the board far beside the camera
            path = {"kind": "poses", "poses": [{"translation_mm": [1e6, 0, 1000]}]}
        else:
            path = {"kind": "views", "views": views}
        description = json.dumps(
            {"format": "tessera-render-scene", "version": 1, "target": "target.json",
             "seed": scene.seed, "cameras": [scene.camera], "path": path}, indent=1)
        words = description + text + self.renderer + str(scene.drawn)
        folder = self.work / hashlib.sha256(words.encode()).hexdigest()[:16]
        if (folder / "done").exists():
            return folder
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "target.json").write_text(text)
        (folder / "scene.json").write_text(description)
        if scene.drawn is None:
            self.call("tessera-render", folder / "scene.json", "--out", folder / "out", "--jobs",
                      self.jobs)
        else:
            (folder / "out" / "cam0").mkdir(parents=True, exist_ok=True)
            write_clutter(folder / "out" / "cam0" / EMPTY_FRAME, scene.drawn, scene.camera,
                          scene.seed)
        (folder / "done").touch()
        return folder

    def measure(self, row):
        total = Score()
        for scene in row.scenes:
            folder = self.render(scene)
            frames = sorted((folder / "out" / "cam0").glob("*.pgm"))
            found = folder / f"found-{os.getpid()}.csv"
            words = ["--csv", found, *self.detect_options]
            if row.use_target:
                words += ["--target", folder / "target.json"]
            elif TARGETS[scene.target][2] != 2:
                words += ["--levels", TARGETS[scene.target][2]]
            try:
                self.call("tessera-detect", *words, *frames)
                found_rows = list(read_rows(found))
            finally:
                found.unlink(missing_ok=True)
            truth_file = folder / "out" / "cam0" / "truth.csv"
            truth = [] if row.empty else list(read_rows(truth_file))
            if not row.empty and not truth:
                raise RuntimeError(f"{truth_file} holds no circle")
            one = score(truth, found_rows, scene.camera, json.loads(self.target(scene.target)),
                        len(frames))
            one.faults = [(kind, str(folder / "out" / "cam0" / file), *rest)
                          for kind, file, *rest in one.faults]
            total.add(one)
        return total
