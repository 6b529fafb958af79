"""Paths of a law that the compiled path loop cannot call: the same mixed control, one point, exact tangents, warm starts.

Stepped by cone programs in either formulation, or by the inverse of a generated step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiled_step import packed_values
from .general_step import StepSolution
from .general_update import GeneralUpdate
from .stress_update import StressUpdate
from .thermal import thermal_input

__all__ = ["follow"]

Array = NDArray[np.float64]
TOLERANCE = 1e-11
FLOOR = 1e-9
TURNS = 60


@dataclass(frozen=True)
class _Answer:
    """What a step gives at one point: the stress of a strain or the strain of a stress, its derivative, status, state, dissipation."""

    answer: Array
    tangent: Array
    status: int
    state: Array
    lost: float
    solution: StepSolution | None = None


@dataclass(frozen=True)
class _Steps:
    """Steps of one point along the rows of a path: `values` by name, time steps (n,), temperatures (n,) or None."""

    update: GeneralUpdate | StressUpdate
    values: Mapping[str, Any]
    times: Array
    temperatures: Array | None

    def given(self, row: int) -> dict[str, Any]:
        """Values at a row, the temperature among them."""
        heat = self.update.law.temperature
        if heat is None or self.temperatures is None:
            return dict(self.values)
        return {**self.values, heat.name: self.temperatures[row]}

    def at(self, row: int, driven: Array, old: Array, before: _Answer | None) -> _Answer:
        """The step at a row to the strain (or stress) `driven`, from the packed state `old` (1, m)."""
        if isinstance(self.update, GeneralUpdate):
            return self._program(self.update, row, driven, old, before)
        return self._inverse(self.update, row, driven, old)

    def _program(self, update: GeneralUpdate, row: int, driven: Array, old: Array, before: _Answer | None) -> _Answer:
        numbers, temperature = update.arguments(self.given(row), 1)
        start = None if before is None else before.solution
        found = update.solve(driven[None], old, self.times[row], numbers, temperature, tangent=True, start=start)
        answer, tangent = update.response(found)
        assert tangent is not None  # asked for
        new, lost = update.outcome(answer if update.turned else driven[None], old, found)
        return _Answer(answer[0], tangent[0], int(found.status[0]), new, float(lost[0]), found)

    def _inverse(self, update: StressUpdate, row: int, driven: Array, old: Array) -> _Answer:
        heat, rest = thermal_input(update.law, self.given(row), 1)
        rows = update.coefficients(packed_values(update, rest), float(self.times[row]), heat.temperature)
        new, eps, compliance, lost = np.empty_like(old), np.empty((1, 6)), np.empty((1, 36)), np.empty(1)
        status = np.empty(1, dtype=np.int64)
        sig = np.ascontiguousarray(driven[None])
        update.pointers.run(sig, old, new, eps, compliance, True, lost, status, rows)
        return _Answer(eps[0], compliance.reshape(6, 6), int(status[0]), new, float(lost[0]))


def follow(
    update: GeneralUpdate | StressUpdate,
    base: Array,
    goal: Array,
    z: Array,
    v: Array,
    start: Array,
    packed: Array,
    values: Mapping[str, Any],
    times: Array,
    temperatures: Array | None,
) -> tuple[int, float, float, dict[str, Array]]:
    """Find y with v σ(base + z y) = goal at every row, by damped Newton; driven by the stress v ε(base + z y) = goal. Returns (failed row
    or −1, residual, scale of the answer, columns).

    `packed` (1, m) is the state at the start, `times` (n,) the time steps, `temperatures` (n,) where the law has one. The residual is
    brought to 1e-11 of the answer; where the law is too stiff for that, what stands still below 1e-9 is taken.
    """
    n = len(base)
    found = {"eps": np.zeros((n, 6)), "sig": np.zeros((n, 6)), "state": np.zeros((n, update.state_size))}
    found |= {"psi": np.zeros(n), "dissipation": np.zeros(n), "iterations": np.zeros(n)}
    steps = _Steps(update, values, times, temperatures)
    turned = update.formulation == "stress"
    last, old, highest, total, warm = start, packed, 0.0, 0.0, None
    whole = -1.0
    for row in range(n):
        along = z.T @ (last - base[row]) / np.maximum((z * z).sum(axis=0), 1e-300)
        trial = base[row] + z @ along
        out = steps.at(row, trial, old, warm)
        if whole < 0.0:
            # the size that the path has in all, so that a row of zeros is not asked for digits that rounding does not leave
            whole = max(float(np.abs(goal).max(initial=0.0)), float(np.abs(out.tangent).max() * np.abs(base).max()))
        first = float(np.abs(out.answer).max())
        for turn in range(TURNS):
            gap = v @ out.answer - goal[row]
            level = max(float(np.abs(out.answer).max()), float(np.abs(goal[row]).max(initial=0.0)))
            # an answer that has to vanish (free thermal expansion) is measured by what the row began with, and what cancels in it
            level = max(level, min(first, float(np.abs(out.tangent).max() * np.abs(trial).max())))
            level = max(level, 1e-3 * highest, 1e-3 * whole)
            size = float(np.abs(gap).max(initial=0.0))
            if out.status != 0:
                return row, size, level, found
            if size <= TOLERANCE * level:
                break
            step = -np.linalg.lstsq(v @ out.tangent @ z, gap, rcond=1e-13)[0]
            factor = 1.0
            while factor > 1e-4:
                new = steps.at(row, trial + factor * (z @ step), old, out)
                rest = float(np.abs(v @ new.answer - goal[row]).max())
                if new.status == 0 and rest < (1 - 0.1 * factor) * size:
                    break
                factor *= 0.5
            else:
                if size <= FLOOR * level:
                    break
                return row, size, level, found
            trial, out = trial + factor * (z @ step), new
            if turn == TURNS - 1:
                return row, rest, level, found
        last, old, warm = trial, out.state, out
        highest = max(highest, float(np.abs(out.answer).max()))
        total += out.lost
        found["eps"][row], found["sig"][row] = (out.answer, trial) if turned else (trial, out.answer)
        found["state"][row] = old[0]
        found["psi"][row] = update.energy(found["eps"][row], update.packing.unpack(old), **steps.given(row))[0]
        found["dissipation"][row] = total
        found["iterations"][row] = turn
    return -1, 0.0, highest, found
