"""A compiled step inverted: the strain that carries a given stress, for any law with a generated step.

    ∇W_n(ε) = σ    by Newton's method on the convex function W_n(ε) − σ:ε,

semismooth, with the consistent tangent, and a line search on the slope (φ′(t) = (∇W_n(ε + t d) − σ):d is monotone, so a point where it
has fallen is one where the function has, whatever rounding does to its value). The compliance is the inverse of the tangent there. Ends
where the residual no longer falls, at the rounding of stiffness times strain. Where no strain carries σ the strains grow without bound,
and the status says so.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..cache import njit
from .kernel_types import LAW, METHOD, PLACES, ROW, STEP, TABLE, compiled
from .key import kernels_hash
from .pointers import StepPointers

__all__ = ["InversePointers", "advance", "begin", "inverse_pointers", "inverted"]

Array = NDArray[np.float64]
_FOLDER = kernels_hash()
LIMIT = 200
SLOPE, LOW, UP, LENGTH, BEFORE, STILL, CUT, LEAST, COUNT = range(9)
_SIGNATURE = types.void(
    STEP, METHOD, LAW, LAW, TABLE, TABLE, TABLE, TABLE, TABLE, types.int64, ROW, PLACES, TABLE, PLACES, types.int64,
)  # fmt: skip


@njit(folder=_FOLDER)
def _factor(a, floor):
    """Cholesky factor of a 6×6 row of 36 in its lower triangle; pivots below `floor` are raised to it. Returns how many were."""
    raised = 0
    for j in range(6):
        value = a[7 * j]
        for k in range(j):
            value -= a[6 * j + k] * a[6 * j + k]
        if not value > floor:
            value = floor
            raised += 1
        root = math.sqrt(value)
        a[7 * j] = root
        for i in range(j + 1, 6):
            value = a[6 * i + j]
            for k in range(j):
                value -= a[6 * i + k] * a[6 * j + k]
            a[6 * i + j] = value / root
    return raised


@njit(folder=_FOLDER)
def _substitute(a, x):
    for i in range(6):
        for k in range(i):
            x[i] -= a[6 * i + k] * x[k]
        x[i] /= a[7 * i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            x[i] -= a[6 * k + i] * x[k]
        x[i] /= a[7 * i]


@njit(folder=_FOLDER)
def begin(rows, control):
    """Start at zero strain. `rows` (6, 6): accepted and tried strain, stress there, residual, direction, best strain; `control` (9,)."""
    for i in range(6):
        rows[1, i] = rows[4, i] = 0.0
    for i in range(9):
        control[i] = 0.0
    control[UP], control[BEFORE], control[LEAST], control[LENGTH] = -1.0, -1.0, math.inf, 1.0


@njit(folder=_FOLDER)
def advance(sig, rows, tangent, status, stiff, room, control):
    """One turn, the step at `rows[1]` having given `rows[2]` and `tangent` (36,): −1 to ask for the next, else the outcome: 0 found, in
    `rows[1]`, 1 no end, 2 not finite, 3 the strains grow without bound."""
    load, along, now, size = 0.0, 0.0, 0.0, 0.0
    for i in range(6):
        rows[3, i] = rows[2, i] - sig[i]
        along += rows[3, i] * rows[4, i]
        now = max(now, abs(rows[3, i]))
        size = max(size, abs(rows[1, i]))
        load = max(load, abs(sig[i]))
    before, slope, up = control[BEFORE], control[SLOPE], control[UP]
    control[COUNT] += 1.0
    if control[COUNT] > LIMIT:
        return 3 if stiff * size > 1e9 * load else 1
    fine = status == 0 and now < math.inf
    if not (
        before < 0.0 or (fine and (now < 0.5 * before or abs(along) <= 0.9 * abs(slope) or (along < 0.0 and up < 0.0)))
    ):
        # the slope is monotone along the direction: bracket its zero
        control[CUT] += 1.0
        control[LOW if fine and along < 0.0 else UP] = control[LENGTH]
        if control[CUT] <= 40.0:
            control[LENGTH] = 0.5 * (control[LOW] + control[UP])
            for i in range(6):
                rows[1, i] = rows[0, i] + control[LENGTH] * rows[4, i]
            return -1
    if not fine:
        return 2 if status == 0 else status
    noise = 2e-16 * (load + stiff * size)
    if now < control[LEAST]:
        control[LEAST], control[STILL] = now, 0.0
        for i in range(6):
            rows[5, i] = rows[1, i]
    else:
        control[STILL] += 1.0
    if now <= noise or (control[STILL] >= 2.0 and control[LEAST] <= 1e3 * noise):
        for i in range(6):
            rows[1, i] = rows[5, i]
        return 0
    if stiff * size > 1e13 * load:
        return 3
    for i in range(36):
        room[i] = tangent[i]
    for i in range(6):
        rows[0, i], rows[4, i] = rows[1, i], -rows[3, i]
    if _factor(room, 1e-9 * stiff) > 0:
        # W_n hardly curves along some direction: a ridge that fades with the residual keeps the step at the size of the strains
        ridge = stiff * max(1e-9, 1e-2 * min(1.0, now / (load + noise)))
        for i in range(36):
            room[i] = tangent[i]
        for i in range(6):
            room[7 * i] += ridge
        _factor(room, 1e-14 * stiff)
    _substitute(room, rows[4])
    slope = 0.0
    for i in range(6):
        slope += rows[3, i] * rows[4, i]
        rows[1, i] = rows[0, i] + rows[4, i]
    control[SLOPE], control[BEFORE] = slope, now
    control[LOW], control[UP], control[LENGTH], control[CUT] = 0.0, -1.0, 1.0, 0.0
    return -1


@njit(folder=_FOLDER)
def inverted(tangent, stiff, rows, room):
    """The compliance into `room` (36,); `tangent` is overwritten, and a row of `rows`."""
    _factor(tangent, 1e-15 * stiff)
    for i in range(6):
        for k in range(6):
            rows[4, k] = 1.0 if i == k else 0.0
        _substitute(tangent, rows[4])
        for k in range(6):
            room[6 * i + k] = rows[4, k]


def _points(step, method, law, rest, sig, old, new, strain, compliance, want, loss, status, coefficients, plan, pair):
    rows, tangent, room, control = np.zeros((6, 6)), np.zeros((1, 36)), np.zeros(36), np.zeros(9)
    each, code = np.zeros(1), np.zeros(1, dtype=np.int64)
    varying = 1 if coefficients.shape[0] > 1 else 0
    for m in range(sig.shape[0]):
        k = varying * m
        c, before, after = coefficients[k : k + 1], old[m : m + 1], new[m : m + 1]
        stiff = abs(c[0, pair]) + 3.0 * abs(c[0, pair + 1])
        begin(rows, control)
        flag = -1
        while flag < 0:
            step(method, law, rest, rows[1:2], before, after, rows[2:3], tangent, 1, each, code, c, plan)
            flag = advance(sig[m], rows, tangent[0], code[0], stiff, room, control)
        if flag == 0:
            # once more at the best point, for its state and tangent
            step(method, law, rest, rows[1:2], before, after, rows[2:3], tangent, 1, each, code, c, plan)
        for i in range(6):
            strain[m, i] = rows[1, i]
        if want:
            inverted(tangent[0], stiff, rows, compliance[m])
        loss[m], status[m] = each[0], flag


@dataclass(frozen=True)
class InversePointers:
    """The pointers of a step, run backwards; `pair` is the place of the elastic stiffness among the coefficients."""

    inner: StepPointers
    pair: int

    @property
    def coefficients(self) -> Callable[..., Array]:
        """Rows of coefficients of the step itself."""
        return self.inner.coefficients

    def run(self, sig: Array, old: Array, new: Array, *rest: Any) -> None:
        """Strains at every point, as `StepPointers.run` gives stresses."""
        strain, compliance, want, loss, status, rows = rest
        inner = self.inner
        compiled(_points, _SIGNATURE)(
            inner.step, inner.method, inner.law, inner.rest, sig, old, new, strain, compliance, int(want), loss, status, rows,
            inner.plan, self.pair,
        )  # fmt: skip


def inverse_pointers(pointers: StepPointers, module: ModuleType) -> StepPointers | InversePointers:
    """Pointers that take stresses: of a closed step with one unilateral energy its own inverse, else Newton's method on the step."""
    if module.METHOD != "closed":
        return InversePointers(pointers, 0)
    if module.OWN_STRAIN_ENERGY:
        return InversePointers(pointers, 7)
    from .inverse_unilateral import inverse_unilateral

    return replace(pointers, step=inverse_unilateral(module.PLAN), memory={})
