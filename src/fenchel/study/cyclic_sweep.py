"""The sweep of the cyclic test: E_w/E_s, θ_f, H_k, H_i and stroke, three models each; where a condition holds and what decides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cyclic import CyclicTest
from .cyclic_runs import CRITERIA, LONG, LOOPS, in_order, loops_to_stabilise, run_model
from .models import MODELS, SETS

__all__ = ["AXES", "NAMES", "WIRED", "Sweep", "axis_points", "largest_box", "main_effects", "sweep_line", "sweep_slice"]

Array = NDArray[np.float64]

AXES: dict[str, tuple[float, float]] = {  # ends of the sweep: E_w/E_s [-], rad, Pa, Pa, u/H [-]
    "ratio": (0.0273, 0.5),
    "theta_f": (0.079, 0.35),
    "H_k": (5e5, 2e6),
    "H_i": (5e4, 5e5),
    "stroke": (1e-3, 4e-3),
}
NAMES = {"ratio": "E_w/E_s", "theta_f": "θ_f", "H_k": "H_k", "H_i": "H_i", "stroke": "u/H"}
WIRED = ("texsol", "reinforced")


def axis_points(name: str, count: int) -> Array:
    """Values along an axis of the sweep, in geometric progression."""
    return np.geomspace(*AXES[name], count)


def sweep_slice(ratio: float, count: int) -> dict[str, Any]:
    """All points of the sweep at one E_w/E_s; axes of the arrays after those of criterion and model: θ_f, H_k, H_i, stroke."""
    shape = (count,) * (len(AXES) - 1)
    loops = np.zeros((len(CRITERIA), len(MODELS), *shape), dtype=np.int64)
    residual, ordered = np.zeros((len(MODELS), *shape)), np.zeros(shape, dtype=bool)
    axes = [axis_points(name, count) for name in list(AXES)[1:]]
    for place in product(*(range(count) for _ in axes)):
        point = {"ratio": ratio} | {n: float(a[i]) for n, a, i in zip(list(AXES)[1:], axes, place, strict=True)}
        found = _point(point)
        loops[:, :, *place] = found["loops"]
        residual[:, *place] = found["residual"]
        ordered[place] = found["ordered"]
    return {"loops": loops, "residual": residual, "ordered": ordered}


def sweep_line(name: str, count: int = 9) -> dict[str, Any]:
    """One parameter along its axis, the others those of `demo_stiff` and a stroke of 0.2 %."""
    base = {k: v for k, v in SETS["demo_stiff"].items() if k in AXES} | {"ratio": 0.5, "stroke": 2e-3}
    along = axis_points(name, count)
    found = [_point(base | {name: float(x)}) for x in along]
    return {
        "along": along,
        "loops": np.stack([f["loops"] for f in found], axis=-1),
        "residual": np.stack([f["residual"] for f in found], axis=-1),
    }


def _point(point: Mapping[str, float]) -> dict[str, Any]:
    """Loops to stabilise by criterion and model, residual strain after 20 loops (nan: compressed all along), order of the peaks."""
    values = SETS["demo_stiff"] | {k: v for k, v in point.items() if k in SETS["demo_stiff"]}
    values["E_w"] = point["ratio"] * values["E_s"]
    found = [run_model(model, values, CyclicTest(stroke=point["stroke"], loops=LONG)) for model in MODELS]
    peaks = {model: -f.low[:LOOPS] for model, f in zip(MODELS, found, strict=True)}
    return {
        "loops": np.array([[loops_to_stabilise(f, c) for f in found] for c in CRITERIA]),
        "residual": np.array([f.residual[LOOPS - 1] if f.high[LOOPS - 1] >= 0.0 else np.nan for f in found]),
        "ordered": in_order(peaks),
    }


class Sweep:
    """The slices as one: arrays (E_w/E_s, θ_f, H_k, H_i, u/H)."""

    def __init__(self, slices: Sequence[Mapping[str, Any]]) -> None:
        self.axes = {name: axis_points(name, len(slices)) for name in AXES}
        loops = np.stack([f["loops"] for f in slices], axis=2)
        self.loops = {m: loops[:, k] for k, m in enumerate(MODELS)}  # criterion first
        residual = np.stack([f["residual"] for f in slices], axis=1)
        self.residual = {m: np.abs(residual[k]) for k, m in enumerate(MODELS)}
        self.ordered = np.stack([f["ordered"] for f in slices])

    @property
    def earlier(self) -> Array:
        """By criterion and point."""
        return np.all([self.loops["sand"] > self.loops[m] for m in WIRED], axis=0)

    def region(self, box: tuple[slice, ...]) -> str:
        """A box in words: the axes that it does not span."""
        units = {"theta_f": (1.0, " rad"), "H_k": (1e-3, " kPa"), "H_i": (1e-3, " kPa"), "stroke": (100.0, " %")}
        words = []
        for (name, values), part in zip(self.axes.items(), box, strict=True):
            factor, unit = units.get(name, (1.0, ""))
            low, high = (f"{factor * values[i]:.3g}{unit}" for i in (part.start, part.stop - 1))
            if part.stop - part.start == len(values):
                continue
            words.append(
                f"{NAMES[name]} = {low}" if low == high
                else f"{NAMES[name]} ≥ {low}" if part.stop == len(values)
                else f"{NAMES[name]} ≤ {high}" if part.start == 0 else f"{NAMES[name]} from {low} to {high}"
            )  # fmt: skip
        return " and ".join(words) or "the whole sweep"


def largest_box(holds: Array) -> tuple[slice, ...] | None:
    """The box with the most points at all of which a condition holds; the first one among equals, None if there is none."""
    ranges = [[slice(a, b) for a, b in combinations_with_replacement(range(n + 1), 2) if a < b] for n in holds.shape]
    best, most = None, 0
    for box in product(*ranges):
        part = holds[box]
        if part.size > most and part.all():
            best, most = box, part.size
    return best


def main_effects(values: Array) -> list[float]:
    """Share of the variance over a full grid that each axis explains by itself (correlation ratio)."""
    whole = float(np.var(values))
    axes = range(values.ndim)
    return [
        float(np.var(values.mean(axis=tuple(j for j in axes if j != i)))) / whole if whole > 0.0 else 0.0 for i in axes
    ]
