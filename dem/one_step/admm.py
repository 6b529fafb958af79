r"""Alternating directions with one factorisation: (W̄ + ρI) x = −q̄ − μ s n − l + ρ z, z = P_K(x̃ + l/ρ), l += ρ(x̃ − z).

s = ‖y_T‖ is read off the multiplier at every turn, x̃ = 1.6 x − 0.6 z is the over-relaxed iterate. Boyd et al. (2011); for friction:
Acary, Brémond and Huber (2018). Reaches 1e-3 to 1e-4 within milliseconds where sweeps cycle; no method for 1e-8 on large packings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .linear import BlockSystem
from .monitor import Monitor
from .sweeps import project

__all__ = ["solve_admm"]

_RELAXATION = 1.6


def solve_admm(
    blocks: Blocks, monitor: Monitor, *, limit: int = 1_000_000, rho: float = 0.1, patience: float = np.inf
) -> None:
    """Iterate from the best iterate; gives up after `patience` iterations without a tenth less error."""
    n = len(blocks.mu)
    value = blocks.value.copy()
    value[blocks.place] += rho * np.eye(3)
    system = BlockSystem(blocks)
    try:
        system.factorise(value)
    except np.linalg.LinAlgError:
        return
    monitor.factorisations += 1
    z = monitor.best.copy()
    multiplier: NDArray[np.float64] = np.zeros((n, 3))
    mark, marked = np.inf, 0
    for k in range(limit):
        right = rho * z - multiplier - blocks.q
        right[:, 0] -= blocks.mu * np.hypot(multiplier[:, 1], multiplier[:, 2])
        x = _RELAXATION * system.solve(right) + (1.0 - _RELAXATION) * z
        z = x + multiplier / rho
        project(z, blocks.mu)
        multiplier += rho * (x - z)
        if k % 5 == 4:
            if monitor(z):
                return
            if monitor.error < 0.9 * mark:
                mark, marked = monitor.error, k
            elif k - marked > patience:
                return
