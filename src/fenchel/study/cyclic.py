"""Cyclic compression of one element (Fig. 3 of the study): loops of axial shortening 0 → −u → 0 under a constant lateral stress.

A homogeneous element is one material point under mixed control. Per loop: the axial stress at both ends of the stroke and the slopes
after them, the axial strain where the stress passes zero on unloading, the growth of the accumulated plastic strain. A loop is stabilised
when neither end stress has changed since the loop before by more than a share `criterion` of the larger of the two, and none does later.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["CyclicTest", "Loops", "cyclic_compression"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CyclicTest:
    """`stroke` u/H [-], `loops`, `steps` per half loop, `confinement` [Pa], `criterion` of stabilisation [-]; with `extension` the upper
    end of the stroke is at that share of u beyond zero."""

    stroke: float = 2e-3
    loops: int = 20
    steps: int = 40
    confinement: float = 0.0
    criterion: float = 1e-3
    extension: float = 0.0

    def __post_init__(self) -> None:
        positive = self.stroke > 0 and self.criterion > 0 and self.confinement >= 0 and self.extension >= 0
        if not (positive and self.loops >= 2 and self.steps >= 1):
            raise InputError(
                "cyclic test: stroke and criterion positive, confinement and extension not negative, at least 2 loops and 1 step"
            )

    def axial(self) -> Array:
        """Axial strain along the path [-], `steps` rows down and as many up per loop after the first row."""
        share = np.arange(1, self.steps + 1) / self.steps
        top = self.extension * self.stroke
        up = -self.stroke + (self.stroke + top) * share
        up[-1] = top
        loop = np.concatenate([top - (self.stroke + top) * share, up])
        axial = np.concatenate([[0.0], np.tile(loop, self.loops)])
        axial[1 : self.steps + 1] = -self.stroke * share
        return axial


@dataclass(frozen=True)
class Loops:
    """`strain` [-] and `stress` [Pa] axial, along the path; per loop `low` and `high` [Pa] (end of shortening, end of the loop),
    `slope_low` and `slope_high` [Pa] (of the step that leaves the lower end, of the one that enters the loop), `residual` [-] (axial strain
    at zero axial deviator on unloading; that of the end if there is none), `growth` of p [-]; `change` of the end stresses, from the
    second loop on [-]; `stabilised`, the loop (from 1), None if never.
    """

    strain: Array
    stress: Array
    low: Array
    high: Array
    slope_low: Array
    slope_high: Array
    residual: Array
    growth: Array
    change: Array
    stabilised: int | None

    def stabilised_at(self, criterion: float) -> int | None:
        """The loop from which on no end stress changes by that share or more; None if there is none."""
        late = np.flatnonzero(self.change >= criterion)
        first = 2 if late.size == 0 else int(late[-1]) + 3
        return first if first <= self.low.size else None


def cyclic_compression(update: Any, values: Mapping[str, float], test: CyclicTest | None = None) -> Loops:
    """Run the test with a compiled `update` and parameter values by name. Raises `ConvergenceError` where the path cannot be followed."""
    from ..integrators import drive_arrays

    test = test or CyclicTest()
    axial = test.axial()
    targets = np.zeros((axial.size, 6))
    targets[:, 2] = axial
    targets[:, :2] = -test.confinement
    history = drive_arrays(update, [True, True, False, True, True, True], targets, values)
    stress = history.sig[:, 2]
    first = 1 + 2 * test.steps * np.arange(test.loops)  # row of the first step of each loop
    bottom, top = first + test.steps - 1, first + 2 * test.steps - 1
    slope = np.diff(stress) / np.diff(axial)
    excess = stress + test.confinement
    residual = np.array([_crossing(axial, excess, int(a), int(b) + 1) for a, b in zip(bottom, top, strict=True)])
    plastic = history.state.get("p", np.zeros(axial.size))
    low, high = stress[bottom], stress[top]
    change = _change(low, high)
    found = Loops(
        axial, stress, low, high, slope[bottom], slope[first - 1], residual,
        np.diff(np.concatenate([[0.0], plastic[top]])), change, None,
    )  # fmt: skip
    return replace(found, stabilised=found.stabilised_at(test.criterion))


def _crossing(axial: Array, excess: Array, start: int, stop: int) -> float:
    """Axial strain where the excess stress first passes zero from below between two rows; the last strain if it does not."""
    for row in range(start, min(stop, axial.size) - 1):
        if excess[row] < 0.0 <= excess[row + 1]:
            share = excess[row] / (excess[row] - excess[row + 1])
            return float(axial[row] + share * (axial[row + 1] - axial[row]))
    return float(axial[min(stop, axial.size) - 1])


def _change(low: Array, high: Array) -> Array:
    scale = np.maximum(np.abs(low), np.abs(high))[1:]
    return np.maximum(np.abs(np.diff(low)), np.abs(np.diff(high))) / np.maximum(scale, np.finfo(float).tiny)
