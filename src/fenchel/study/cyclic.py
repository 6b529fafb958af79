"""Cyclic compression of one element (Fig. 3 of the study): loops of axial shortening 0 → −u → 0 under a constant lateral stress.

A homogeneous element is one material point under mixed control. Per loop: the axial stress at both ends of the stroke, the axial
strain where it passes zero on unloading, the growth of the accumulated plastic strain. A loop is stabilised when neither end stress has
changed since the loop before by more than a share `criterion` of the larger of the two, and none does later.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["CyclicTest", "Loops", "cyclic_compression"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CyclicTest:
    """`stroke` u/H [-], `loops`, `steps` per half loop, `confinement` [Pa], `criterion` of stabilisation [-]."""

    stroke: float = 2e-3
    loops: int = 20
    steps: int = 40
    confinement: float = 0.0
    criterion: float = 1e-3

    def __post_init__(self) -> None:
        if not (
            self.stroke > 0 and self.loops >= 2 and self.steps >= 1 and self.confinement >= 0 and self.criterion > 0
        ):
            raise InputError(
                "cyclic test: stroke and criterion positive, confinement not negative, at least 2 loops and 1 step"
            )


@dataclass(frozen=True)
class Loops:
    """`strain` [-] and `stress` [Pa] axial, along the path; per loop `low` and `high` [Pa] (end of shortening, end of the loop),
    `residual` [-] (axial strain at zero axial deviator on unloading), `growth` of p [-]; `stabilised`, the loop (from 1), None if never.
    """

    strain: Array
    stress: Array
    low: Array
    high: Array
    residual: Array
    growth: Array
    stabilised: int | None


def cyclic_compression(update: Any, values: Mapping[str, float], test: CyclicTest | None = None) -> Loops:
    """Run the test with a compiled `update` and parameter values by name. Raises `ConvergenceError` where the path cannot be followed."""
    from ..integrators import drive_arrays

    test = test or CyclicTest()
    down = -test.stroke * np.arange(1, test.steps + 1) / test.steps
    loop = np.concatenate([down, down[-2::-1], [0.0]])
    axial = np.concatenate([[0.0], np.tile(loop, test.loops)])
    targets = np.zeros((axial.size, 6))
    targets[:, 2] = axial
    targets[:, :2] = -test.confinement
    history = drive_arrays(update, [True, True, False, True, True, True], targets, values)
    stress = history.sig[:, 2]
    ends = 1 + 2 * test.steps * np.arange(test.loops)
    low, high = stress[ends + test.steps - 1], stress[ends + 2 * test.steps - 1]
    excess = stress + test.confinement
    residual = np.array(
        [_crossing(axial, excess, int(start) + test.steps - 1, int(start) + 2 * test.steps) for start in ends]
    )
    plastic = history.state.get("p", np.zeros(axial.size))
    marks = plastic[ends + 2 * test.steps - 1]
    growth = np.diff(np.concatenate([[0.0], marks]))
    return Loops(axial, stress, low, high, residual, growth, _stabilised(low, high, test.criterion))


def _crossing(axial: Array, excess: Array, start: int, stop: int) -> float:
    """Axial strain where the excess stress first passes zero from below between two rows; the last strain if it does not."""
    for row in range(start, min(stop, axial.size) - 1):
        if excess[row] < 0.0 <= excess[row + 1]:
            share = excess[row] / (excess[row] - excess[row + 1])
            return float(axial[row] + share * (axial[row + 1] - axial[row]))
    return float(axial[min(stop, axial.size) - 1])


def _stabilised(low: Array, high: Array, criterion: float) -> int | None:
    scale = np.maximum(np.abs(low), np.abs(high))[1:]
    change = np.maximum(np.abs(np.diff(low)), np.abs(np.diff(high))) / np.maximum(scale, np.finfo(float).tiny)
    late = np.flatnonzero(change >= criterion)
    first = 2 if late.size == 0 else int(late[-1]) + 3
    return first if first <= low.size else None
