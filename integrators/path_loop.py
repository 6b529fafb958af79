"""Paths of one material point under mixed control: the loop over steps, compiled once per machine.

Per step find y with V σ(base + Z y) = goal by damped semismooth Newton with the consistent tangent; the strain increment lies in the
span of the columns of Z, the stress is tested by the rows of V. For pure strain and stress control the system is the gradient of the
convex incremental energy, and the line search uses its slope.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from ..cache import njit
from .kernel_types import LAW, METHOD, PLACES, ROW, STEP, TABLE, compiled
from .key import kernels_hash

__all__ = ["path_loop"]

_SIGNATURE = types.Tuple((types.int64, types.float64, types.float64))(
    STEP, METHOD, LAW, LAW, PLACES, TABLE, TABLE, TABLE, TABLE, TABLE, types.boolean, ROW, ROW, TABLE, TABLE, TABLE, ROW,
    ROW, types.float64, types.int64,
)  # fmt: skip


def path_loop() -> Any:
    """The compiled loop; it returns (failed row or −1, residual [Pa], stress scale [Pa])."""
    return compiled(_drive, _SIGNATURE)


@njit(folder=kernels_hash())
def _solve(matrix, right, size, floor):
    """Gaussian elimination with partial pivoting, in place; a pivot below `floor` is replaced by it."""
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        if abs(matrix[k, k]) < floor:
            matrix[k, k] = floor
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            if factor != 0.0:
                for j in range(k, size):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]


def _drive(
    step,
    method,
    law,
    rest,
    plan,
    coefficients,
    base,
    goal,
    z,
    v,
    symmetric,
    eps,
    state,
    out_eps,
    out_sig,
    out_state,
    out_loss,
    out_turns,
    tolerance,
    limit,
):
    """Steps under mixed control: find y with v sigma(base + z y) = goal, by damped Newton; returns (failed row, residual, scale).

    The strain increment lies in the span of the columns of `z`, the stress is tested by the rows of `v`; `out_turns` counts linear systems.
    """
    steps, size = base.shape[0], z.shape[1]
    # the step works on arrays of points: here of one
    old_row, new_row = np.zeros((1, out_state.shape[1])), np.zeros((1, out_state.shape[1]))
    sig_row, tangent_row, trial_row = np.zeros((1, 6)), np.zeros((1, 36)), np.zeros((1, 6))
    loss_row, status_row = np.zeros(1), np.zeros(1, dtype=np.int64)
    old, new, sig, tangent, trial = old_row[0], new_row[0], sig_row[0], tangent_row[0].reshape(6, 6), trial_row[0]
    for i in range(state.shape[0]):
        old[i] = state[i]
    varying = coefficients.shape[0] > 1
    start = np.zeros(6)
    residual, change, matrix = np.zeros(6), np.zeros(6), np.zeros((6, 6))
    stiff, total, highest, lost = 0.0, 0.0, 0.0, 0.0
    for n in range(steps):
        # the prescribed part of the strain is put on at once; unknown components begin at their last value
        for i in range(6):
            trial[i] = base[n, i]
        for k in range(size):
            part, along = 0.0, 0.0
            for i in range(6):
                part += z[i, k] * z[i, k]
                along += z[i, k] * (eps[i] - base[n, i])
            for i in range(6):
                trial[i] += z[i, k] * along / part
        done = False
        turns, cut = 0, 0
        level, before, slope, first = 0.0, -1.0, 0.0, 0.0
        low, up, factor = 0.0, -1.0, 1.0
        # one evaluation per pass; `before` < 0 marks the first one of a step, which is always taken
        while turns < limit:
            row = n if varying else 0
            step(
                method, law, rest, trial_row, old_row, new_row, sig_row, tangent_row, 1, loss_row, status_row,
                coefficients[row : row + 1], plan,
            )  # fmt: skip
            status, lost = status_row[0], loss_row[0]
            scale, strain, now, along, here = 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(6):
                scale = max(scale, abs(sig[i]))
                strain = max(strain, abs(trial[i]))
                here = max(here, abs(tangent[i, i]))
            stiff = max(stiff, here)
            if turns == 0 and status == 0:
                first = scale
            for k in range(size):
                value = -goal[n, k]
                scale = max(scale, abs(goal[n, k]))
                for i in range(6):
                    value += v[k, i] * sig[i]
                residual[k] = value
                now = max(now, abs(value))
                along += value * change[k]
            taken = before < 0.0 or (status == 0 and now < 0.5 * before)
            if not taken:
                # line search: on the slope of the convex incremental energy where the system is its gradient, else on the residual
                cut += 1
                if symmetric and slope < 0.0:
                    taken = status == 0 and (abs(along) <= 0.8 * abs(slope) or (along < 0.0 and up < 0.0))
                    if not taken:
                        if status == 0 and along < 0.0:
                            low = factor
                        else:
                            up = factor
                        factor = 0.5 * (low + up)
                else:
                    taken = (status == 0 and now < before) or cut > 8
                    if not taken:
                        factor *= 0.5
                taken = taken or cut > 30
            if taken:
                turns += 1
                for i in range(6):
                    start[i] = trial[i]
                if status != 0:
                    break
                # rounding of stiffness times strain bounds what can be reached, but a runaway strain must not excuse a residual
                # a stress that has to vanish (free thermal expansion) is measured by what the row began with, and what cancels in it
                level = max(scale, 1e-3 * highest, min(first, here * strain))
                before = now
                if now <= max(tolerance * level, min(4e-15 * stiff * strain, 1e-8 * level)):
                    done = True
                    highest = max(highest, scale)
                    break
                for k in range(size):
                    for l in range(size):
                        value = 0.0
                        for i in range(6):
                            if v[k, i] != 0.0:
                                for j in range(6):
                                    value += v[k, i] * tangent[i, j] * z[j, l]
                        matrix[k, l] = value
                    change[k] = -residual[k]
                _solve(matrix, change, size, 1e-13 * stiff)
                slope = 0.0
                for k in range(size):
                    slope += residual[k] * change[k]
                low, up, factor, cut = 0.0, -1.0, 1.0, 0
            for i in range(6):
                value = start[i]
                for k in range(size):
                    value += factor * z[i, k] * change[k]
                trial[i] = value
        if not done:
            return n, before, level
        for i in range(6):
            eps[i] = start[i]
        total += lost
        for i in range(6):
            out_eps[n, i] = eps[i]
            out_sig[n, i] = sig[i]
        for i in range(new.shape[0]):
            old[i] = new[i]
            out_state[n, i] = new[i]
        out_loss[n] = total
        out_turns[n] = turns - 1
    return -1, 0.0, highest
