"""Paths of a law stepped by cone programs: the same mixed control as for compiled laws, one point, exact tangents, warm starts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .general_update import GeneralUpdate

__all__ = ["follow"]

Array = NDArray[np.float64]
TOLERANCE = 1e-11
FLOOR = 1e-9
TURNS = 60


def follow(
    update: GeneralUpdate,
    base: Array,
    goal: Array,
    z: Array,
    v: Array,
    start: Array,
    packed: Array,
    values: Mapping[str, Any],
    steps: Array,
    temperatures: Array | None,
) -> tuple[int, float, float, dict[str, Array]]:
    """Find y with v σ(base + z y) = goal at every row, by damped Newton. Returns (failed row or −1, residual, stress scale, columns).

    `packed` (1, m) is the state at the start, `steps` (n,) the time steps, `temperatures` (n,) where the law has one. The residual is
    brought to 1e-11 of the stress; where the law is too stiff for that, what stands still below 1e-9 is taken.
    """
    n = len(base)
    found = {"eps": np.zeros((n, 6)), "sig": np.zeros((n, 6)), "state": np.zeros((n, update.state_size))}
    found |= {"psi": np.zeros(n), "dissipation": np.zeros(n)}
    eps, old, highest, total, warm = start, packed, 0.0, 0.0, None
    name = None if update.law.temperature is None else update.law.temperature.name
    for row in range(n):
        given = dict(values) if name is None or temperatures is None else {**values, name: temperatures[row]}
        numbers, temperature = update.arguments(given, 1)

        def evaluate(strain: Array, before: Any) -> Any:
            return update.solve(strain[None], old, steps[row], numbers, temperature, tangent=True, start=before)  # noqa: B023

        along = z.T @ (eps - base[row]) / np.maximum((z * z).sum(axis=0), 1e-300)
        trial = base[row] + z @ along
        out = evaluate(trial, warm)
        for turn in range(TURNS):
            stress = out.slopes[0, :6]
            gap = v @ stress - goal[row]
            level = max(float(np.abs(stress).max()), float(np.abs(goal[row]).max(initial=0.0)), 1e-3 * highest)
            size = float(np.abs(gap).max(initial=0.0))
            if out.status[0] != 0:
                return row, size, level, found
            if size <= TOLERANCE * level:
                break
            step = -np.linalg.lstsq(v @ out.tangent[0] @ z, gap, rcond=1e-13)[0]
            factor = 1.0
            while factor > 1e-4:
                new = evaluate(trial + factor * (z @ step), out)
                rest = float(np.abs(v @ new.slopes[0, :6] - goal[row]).max())
                if new.status[0] == 0 and rest < (1 - 0.1 * factor) * size:
                    break
                factor *= 0.5
            else:
                if size <= FLOOR * level:
                    break
                return row, size, level, found
            trial, out = trial + factor * (z @ step), new
            if turn == TURNS - 1:
                return row, rest, level, found
        lost_state, lost = update.outcome(trial[None], old, out)
        eps, old, warm = trial, lost_state, out
        highest = max(highest, float(np.abs(out.slopes[0, :6]).max()))
        total += float(lost[0])
        found["eps"][row], found["sig"][row], found["state"][row] = eps, out.slopes[0, :6], old[0]
        found["psi"][row] = update.energy(eps, update.packing.unpack(old), **given)[0]
        found["dissipation"][row] = total
    return -1, 0.0, highest, found
