r"""Proximal interior point with de Saxcé's term inside the Newton step.

In the folded unknowns (`cones`) the residual R = y − W̄x − q̄ − ‖y_T‖ e₀ and the complementarity x∘y → σ g e, g = x·y/n, are reduced together
by predictor–corrector steps (Mehrotra 1992) on

    [W̄ + (I − E) P² + C] dx = (I − E) P c + R .

* The friction term makes the operator non-monotone: the proximal term C = αI, centred at the iterate so that R is unchanged, keeps the step
  from collapsing. `selective` puts C only where the block (I − E)P² has lost positivity.
* When R lags behind g the target is raised (balance), or the iterate would stick to the boundary.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...cache import njit
from .blocks import Blocks
from .cones import Folded, follow, jordan, longest_step, right_side, scale_cones, to_local, unfold
from .linear import BlockSystem
from .monitor import Monitor
from .sweeps import product

__all__ = ["solve_interior", "solve_interior_selective"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

_START = 10.0  # of x₀ and y₀, in the scaling where max|q̄| = 1
_LEAST_PROXIMAL, _LEAST_SELECTIVE = 1e-9, 1e-6


def solve_interior(blocks: Blocks, monitor: Monitor, *, limit: int = 1000, patience: int = 1000) -> None:
    """Iterate from a cold start; gives up after `patience` steps without halving the error."""
    _solve(blocks, monitor, limit, patience, selective=False)


def solve_interior_selective(blocks: Blocks, monitor: Monitor, *, limit: int = 1000, patience: int = 1000) -> None:
    """The same, damped only where a block lost positivity: better on some large packings, worse on small coupled clusters."""
    _solve(blocks, monitor, limit, patience, selective=True)


def _solve(blocks: Blocks, monitor: Monitor, limit: int, patience: int, *, selective: bool) -> None:
    n = len(blocks.mu)
    work, system = Folded(blocks), BlockSystem(blocks)
    x = np.zeros((n, 3))
    x[:, 0] = _START
    y = x.copy()
    image, residual, c, b, dx, dy, v, correction, pa, pb = (np.zeros((n, 3)) for _ in range(10))
    value, damping = np.empty_like(work.value), np.zeros(n)
    alpha, floor, balance = (1e-2, _LEAST_SELECTIVE, 10.0) if selective else (1e-2, _LEAST_PROXIMAL, 100.0)
    mark, marked = np.inf, 0

    def direction(target: float) -> float:
        """dx, dy toward x∘y = target e less the correction; the longest step inside the cones."""
        jordan(work.middle, work.middle, v)
        np.negative(v, out=v)
        v[:, 0] += target
        np.subtract(v, correction, out=v)
        right_side(work.middle, work.root, work.slope, v, residual, c, b)
        dx[:] = system.solve(b)
        follow(work.root, work.square, c, dx, dy)
        return min(longest_step(x, dx), longest_step(y, dy))

    for k in range(limit):
        if not scale_cones(x, y, 0.0, work.root, work.square, work.block, work.middle, work.slope, work.slip):
            return
        product(blocks.pointer, blocks.column, work.value, work.q, x, image)
        np.subtract(y, image, out=residual)
        residual[:, 0] -= work.slip
        g = float(np.vdot(x, y)) / n
        lag = float(np.sqrt(np.mean(residual**2))) / (balance * g) if g > 0.0 else np.inf
        if k > 4 and monitor(unfold(x, blocks.mu)):
            return
        if monitor.error < 0.5 * mark:
            mark, marked = monitor.error, k
        elif k - marked > patience:
            return
        if selective:
            _damp_selectively(work.block, alpha, min(1.0, alpha / 0.1), damping)
        else:
            damping[:] = alpha
        _add_blocks(work.value, blocks.place, work.block, damping, value)
        try:
            system.factorise(value)
        except np.linalg.LinAlgError:
            if alpha >= 1.0:
                return
            alpha = min(1.0, max(10.0 * alpha, 1e-6))
            continue
        monitor.factorisations += 1
        correction[:] = 0.0
        longest = min(1.0, direction(0.0))
        predicted = float(np.vdot(x + longest * dx, y + longest * dy)) / n
        sigma = max(0.1, min(1.0, (predicted / g) ** 3)) if g > 0.0 else 1.0
        if lag > 1.0:
            sigma = 2.0 if lag > 10.0 else 1.0
        to_local(work.root, dx, dy, pa, pb)
        jordan(pa, pb, correction)
        step = min(1.0, 0.9 * direction(sigma * g))
        if step < 0.1:
            correction[:] = 0.0
            step = min(1.0, 0.9 * direction(max(0.5, sigma) * g))
        if not np.isfinite(step):
            return
        x += step * dx
        y += step * dy
        if step > 0.6:
            alpha = max(floor, 0.5 * alpha)
        elif step < 0.3:
            alpha = min(1.0, 3.0 * alpha)


@njit
def _add_blocks(base: Array, place: Ints, block: Array, damping: Array, out: Array) -> None:
    """out = base + block + damping I on the diagonal blocks."""
    out[:] = base
    for i in range(len(place)):
        for a in range(3):
            for b in range(3):
                out[place[i], a, b] += block[i, a, b]
            out[place[i], a, a] += damping[i]


@njit
def _damp_selectively(block: Array, alpha: float, share: float, out: Array) -> None:
    """C_i = share · max(0, −λ_min(sym B_i)) + 1e-4 α, the eigenvalue in closed form."""
    for i in range(block.shape[0]):
        a, b, c = block[i, 0, 0], block[i, 1, 1], block[i, 2, 2]
        d = 0.5 * (block[i, 0, 1] + block[i, 1, 0])
        e = 0.5 * (block[i, 0, 2] + block[i, 2, 0])
        f = 0.5 * (block[i, 1, 2] + block[i, 2, 1])
        mean = (a + b + c) / 3.0
        a, b, c = a - mean, b - mean, c - mean
        size = np.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
        least = mean
        if size > 0.0:
            det = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
            half = min(1.0, max(-1.0, 0.5 * det / size**3))
            least += 2.0 * size * np.cos(np.arccos(half) / 3.0 + 2.0 * np.pi / 3.0)
        out[i] = share * max(0.0, -least) + 1e-4 * alpha
