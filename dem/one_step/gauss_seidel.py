r"""Non-linear Gauss–Seidel as a solver: sweeps with the exact local solve, with or without Anderson acceleration.

Anderson (1965) on the map x → sweeps(x): with the last m increments f_k = G(x_k) − x_k, the next iterate is G(x_k) − ΔG γ, γ = argmin
‖f_k − ΔF γ‖, projected on the cones; the memory is dropped when the increment doubles. Excellent on stacks, of no use on large packings,
where it falls back to the sweeps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .monitor import Monitor
from .sweeps import project, sweep

__all__ = ["solve_anderson", "solve_nlgs"]

Array = NDArray[np.float64]

_MEMORY = 8  # increments kept
_PERIOD = 5  # sweeps per application of the map


def _sweeps(blocks: Blocks, x: Array, count: int, monitor: Monitor) -> None:
    b = blocks
    for _ in range(count):
        sweep(b.pointer, b.column, b.value, b.place, b.q, b.mu, x, False)
    monitor.sweeps += count


def solve_nlgs(blocks: Blocks, monitor: Monitor, *, limit: int = 1_000_000, patience: float = np.inf) -> None:
    """Sweep from the best iterate until it converges, `limit` sweeps are done, or more than `patience` sweeps are foreseen.

    What is foreseen follows from the reduction of the error over the last half of the sweeps.
    """
    x = monitor.best.copy()
    errors: list[float] = []
    done = 0
    while done < limit:
        batch = min(10 if done < 200 else 50, limit - done)
        _sweeps(blocks, x, batch, monitor)
        done += batch
        before = monitor.error
        if monitor(x):
            return
        errors.append(min(before, monitor.error))
        if np.isfinite(patience) and done >= 100 and len(errors) > 4:
            half = len(errors) // 2
            rate = np.log(errors[half] / errors[-1]) / ((len(errors) - 1 - half) * batch)
            if np.log(errors[-1] / monitor.tolerance) > patience * max(rate, 0.0):
                return


def solve_anderson(blocks: Blocks, monitor: Monitor, *, limit: int = 1_000_000, patience: float = np.inf) -> None:
    """Accelerated sweeps from the best iterate; gives up after `patience` sweeps without a tenth less error."""
    x = monitor.best.copy()
    size = x.size
    increments, images = np.empty((size, _MEMORY)), np.empty((size, _MEMORY))
    kept = 0
    last_f = last_g = np.empty(0)
    least = np.inf
    mark, marked = np.inf, 0
    done = 0
    while done < limit:
        g = x.copy()
        _sweeps(blocks, g, _PERIOD, monitor)
        done += _PERIOD
        if monitor(g):
            return
        if monitor.error < 0.9 * mark:
            mark, marked = monitor.error, done
        elif done - marked > patience:
            return
        f = (g - x).ravel()
        length = float(np.linalg.norm(f))
        if length == 0.0 or not np.isfinite(length):
            return
        if length > 2.0 * least:
            kept, least = 0, length
            x, last_f, last_g = g, f, g.ravel().copy()
            continue
        least = min(least, length)
        if last_f.size:
            increments[:, kept % _MEMORY], images[:, kept % _MEMORY] = f - last_f, g.ravel() - last_g
            kept += 1
        last_f, last_g = f, g.ravel().copy()
        x = g
        used = min(kept, _MEMORY)
        if used:
            basis = increments[:, :used]
            gram = basis.T @ basis
            if not np.isfinite(gram).all():
                return  # the sweeps diverge and the iterates leave the range of numbers: nothing to accelerate
            gram[np.diag_indices(used)] *= 1.0 + 1e-12
            weight = np.linalg.lstsq(gram, basis.T @ f, rcond=1e-14)[0]
            x = (last_g - images[:, :used] @ weight).reshape(g.shape)
            project(x, blocks.mu)
