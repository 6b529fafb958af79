"""`auto`: which methods, in which order, for which problem.

Sweeps first (they solve well-posed problems in milliseconds), then the proximal interior point, polished by the proximal Newton method; what
is still unsolved, and has admissible velocities at all, gets the selective interior point and the global homotopy in turn, each polished.
Choices depend on sizes and counts, not on clocks, so that a problem solved within its time is solved the same way again.
"""

from __future__ import annotations

import time

from .admm import solve_admm
from .blocks import Blocks
from .feasibility import Infeasibility, find_infeasibility
from .gauss_seidel import solve_anderson, solve_nlgs
from .homotopy import solve_homotopy
from .interior import solve_interior, solve_interior_selective
from .monitor import Monitor
from .newton import polish

__all__ = ["solve_auto"]

_LARGE = 20_000  # contacts above which no factorisation is tried
_COARSE = 1e-5  # tolerance above which first-order methods are preferred on large problems


def solve_auto(blocks: Blocks, monitor: Monitor) -> Infeasibility | None:
    """Chain the methods until one converges; returns a proof that there is no solution where one was found."""
    n = len(blocks.mu)
    solve_nlgs(blocks, monitor, limit=100 if n <= _LARGE else 200)
    if monitor.converged or monitor.out_of_time:
        return None
    solve_nlgs(blocks, monitor, limit=2000 if n < 1000 else 1000, patience=400)
    if monitor.converged or monitor.out_of_time:
        return None
    if n > _LARGE:
        solve_anderson(blocks, monitor)
        return None
    if monitor.tolerance >= _COARSE:
        solve_admm(blocks, monitor, limit=500, patience=100)
        if monitor.converged:
            return None
    solve_interior(blocks, monitor, limit=150, patience=25)
    if _polished(blocks, monitor):
        return None
    proof = find_infeasibility(monitor.problem, time_limit=monitor.time_left)
    if proof is not None or monitor.out_of_time:
        return proof
    solve_homotopy(blocks, monitor, until=monitor.until(0.3))
    if _polished(blocks, monitor):
        return None
    solve_interior_selective(blocks, monitor, limit=150, patience=60)
    if _polished(blocks, monitor):
        return None
    for start in (10.0, 0.3, 3.0):
        solve_homotopy(blocks, monitor, start=start, until=monitor.until(0.5))
        if _polished(blocks, monitor):
            return None
    while not monitor.out_of_time:
        before = time.thread_time()
        solve_anderson(blocks, monitor, patience=2000)
        if monitor.converged or time.thread_time() - before <= 0.0:
            break
        break
    return None


def _polished(blocks: Blocks, monitor: Monitor) -> bool:
    """Polish the best iterate as long as a round halves the error; whether to stop."""
    while not (monitor.converged or monitor.out_of_time):
        before = monitor.error
        polish(blocks, monitor, limit=40)
        if monitor.error > 0.5 * before:
            break
    return monitor.converged or monitor.out_of_time
