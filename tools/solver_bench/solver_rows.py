"""The scenarios of `make solver-accuracy`, and what is required of each."""
import dataclasses

TRUE_MODEL, BENT_BOARD, UNFITTABLE_PX = 1.1, 1.2, 0.1


@dataclasses.dataclass(frozen=True)
class Row:
    rig: str
    words: str
    scene: dict
    options: tuple = ("--model", "brown")
    ratio: float = TRUE_MODEL          # of every error to the reference's
    worst_px: float = None             # instead: RMS of projection where there are data

    @property
    def name(self):
        return f"{self.rig}: {self.words}"

    @property
    def triangulates(self):
        return self.rig in ("ring", "room")


def _bent(rig, kind, **more):
    return Row(rig, f"board {dict(bow='bowed', twist='twisted', dent='dented')[kind]} by 1 mm"
               + (", 2 % outliers" if more else ""), {"surface": kind, **more}, ratio=BENT_BOARD)


def _lens(rig, model):
    return Row(rig, f"{model} lens", {"model": model}, ("--model", model))


def _unfittable(rig):
    return Row(rig, "lens that no parametric model fits", {"field": 0.7}, (), worst_px=UNFITTABLE_PX)


def _rolling(rig, row_time_us, words, shift_mm_s=300.0, turn_rad_s=1.0, estimate=(), **more):
    rolling = {"row_time_s": [1e-6 * us for us in row_time_us], "shift_mm_s": shift_mm_s,
               "turn_rad_s": turn_rad_s, "estimate": estimate}
    return Row(rig, "rolling shutters, " + words, {"rolling": rolling, **more})


def rows():
    """Noise 0.05 px, Brown's lens, a flat board of circles and no outliers where nothing else is said."""
    wrong = {"outliers": 0.02}
    return [
        Row("paper", "noise 0.05 px", {}),
        Row("paper", "corners instead of circles", {"radius": 0.0}),
        Row("paper", "noise 0.01 px", {"noise": 0.01}),
        Row("paper", "noise 0.3 px", {"noise": 0.3}),
        Row("paper", "2 % outliers", wrong),
        Row("paper", "2 % outliers, noise 0.3 px", {"noise": 0.3, **wrong}),
        Row("paper", "model left to the tool", {}, ()),
        _lens("paper", "rational"), _lens("paper", "thin-prism"), _lens("paper", "fisheye"),
        _bent("paper", "bow"), _bent("paper", "twist"), _bent("paper", "dent"), _bent("paper", "bow", **wrong),
        _unfittable("paper"),
        _rolling("paper", [10, 12], "boards move"),
        _rolling("small", [12, 15, 0], "boards move"),
        _rolling("small", [12, 15, 0], "boards move, 2 % outliers", **wrong),
        _rolling("small", [12, 15, 0], "boards move, one row time estimated", estimate=(1,)),
        _rolling("small", [12, 15, 0], "boards held still", 0.0, 0.0),
        Row("ring", "noise 0.05 px", {}),
        Row("ring", "noise 0.3 px", {"noise": 0.3}),
        Row("ring", "2 % outliers", wrong),
        Row("ring", "model left to the tool", {}, ()),
        _lens("ring", "rational"), _lens("ring", "thin-prism"),
        _bent("ring", "bow"), _bent("ring", "twist"), _bent("ring", "dent"),
        _unfittable("ring"),
        Row("room", "noise 0.05 px", {}),
        Row("room", "2 % outliers", wrong),
    ]
