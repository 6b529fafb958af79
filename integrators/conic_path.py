"""Paths of a law without closed form: the same mixed control, the step by the conic program at every trial strain. Slow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .atoms import energy_atoms
from .conic_update import ConicUpdate
from .update import Array

__all__ = ["follow"]

TOLERANCE = 1e-9
TURNS = 25


def follow(
    update: ConicUpdate,
    base: Array,
    goal: Array,
    z: Array,
    v: Array,
    start: Array,
    state: dict[str, Array],
    values: Mapping[str, Any],
) -> tuple[int, float, float, dict[str, Array]]:
    """Find y with v σ(base + z y) = goal at every row, by damped Newton. Returns (failed row or −1, residual, stress scale, columns).

    The program is exact to about 1e-10 of the stress, hence the tolerance; ψ is evaluated from the atoms of the program.
    """
    energy = energy_atoms(update.law, values)
    plain, sloped = replace(update, tangent=False), replace(update, tangent=True)
    n = len(base)
    found = {"eps": np.zeros((n, 6)), "sig": np.zeros((n, 6)), "state": np.zeros((n, update.packing.state_size))}
    found |= {"psi": np.zeros(n), "dissipation": np.zeros(n)}
    eps, highest, total = start, 0.0, 0.0
    for row in range(n):
        along = z.T @ (eps - base[row]) / np.maximum((z * z).sum(axis=0), 1e-300)
        trial = base[row] + z @ along
        out = plain(trial, state, **values)
        gap = v @ out.stress[0] - goal[row]
        for _ in range(TURNS):
            level = max(float(np.abs(out.stress).max()), float(np.abs(goal[row]).max(initial=0.0)), 1e-3 * highest)
            size = float(np.abs(gap).max(initial=0.0))
            if size <= TOLERANCE * level:
                break
            tangent: Any = sloped(trial, state, **values).tangent
            step = -np.linalg.lstsq(v @ tangent[0] @ z, gap, rcond=1e-10)[0]
            factor = 1.0
            while factor > 1e-3:
                new = plain(trial + factor * (z @ step), state, **values)
                rest = v @ new.stress[0] - goal[row]
                if float(np.abs(rest).max()) < (1 - 0.1 * factor) * size:
                    break
                factor *= 0.5
            else:
                return row, size, level, found
            trial, out, gap = trial + factor * (z @ step), new, rest
        else:
            return row, float(np.abs(gap).max()), level, found
        eps, state = trial, out.state
        highest = max(highest, float(np.abs(out.stress).max()))
        total += float(out.dissipation[0])
        packed = update.packing.pack(state, 1)[0]
        found["eps"][row], found["sig"][row], found["state"][row] = eps, out.stress[0], packed
        found["psi"][row], found["dissipation"][row] = energy.value(np.concatenate([eps, packed])), total
    return -1, 0.0, highest, found
