"""`auto`: which methods, in which order, for which problem.

Sweeps first: they solve well-posed problems in milliseconds. Then the proximal interior point, polished by the proximal Newton method. What
is still unsolved and not proved to be without solution gets the homotopy and the selective interior point, the cheaper one first.
Choices depend on sizes and counts, not on clocks: a problem solved within its time is solved the same way again.
"""

from __future__ import annotations

from .admm import solve_admm
from .blocks import Blocks
from .choice import LEAST, PATIENCE, choose_solver, described, probe
from .feasibility import Infeasibility, find_infeasibility
from .gauss_seidel import solve_anderson, solve_nlgs
from .homotopy import solve_homotopy
from .interior import solve_interior, solve_interior_selective
from .monitor import Monitor
from .newton import polish, solve_proximal_newton

__all__ = ["solve_auto", "solve_measured"]

_TINY = 80  # contacts up to which an interior point solution is cheaper than some hundred sweeps
_SMALL = 1000  # contacts below which a factorisation costs milliseconds
_LARGE = 20_000  # contacts above which none is tried
_COARSE = 1e-5  # tolerance from which on first-order methods are worth more of the time


def solve_auto(blocks: Blocks, monitor: Monitor) -> Infeasibility | None:
    """Chain the methods until one converges; returns a proof that there is no solution where one was found."""
    n = len(blocks.mu)
    solve_nlgs(blocks, monitor, limit=100)
    if n <= _TINY and not _finished(monitor):
        solve_interior(blocks, monitor, limit=40)
    coarse = monitor.tolerance >= _COARSE
    if not _finished(monitor):
        # at coarse tolerances thousands of sweeps of a large problem cost what a few dozen factorisations do
        solve_nlgs(blocks, monitor, limit=3000, patience=3000 if coarse and n > _SMALL else 300)
    if n <= _SMALL and not _finished(monitor):
        solve_anderson(blocks, monitor, limit=400, patience=100)
    if n > _LARGE and not _finished(monitor):
        solve_anderson(blocks, monitor)
    if _finished(monitor):
        return None
    if n <= _SMALL and coarse:
        solve_admm(blocks, monitor, limit=400, patience=100)
        if _finished(monitor):
            return None
    # large packings: the selective damping and a start farther inside are the better ones; small coupled clusters: the others
    first, starts = (solve_interior, (1.0, 10.0, 0.1)) if n <= _SMALL else (solve_interior_selective, (10.0, 1.0, 0.1))
    first(blocks, monitor, limit=150, patience=40)
    if _polished(blocks, monitor):
        return None
    proof = find_infeasibility(monitor.problem, time_limit=monitor.time_left)
    if proof is not None or _finished(monitor):
        return proof
    for start in starts:
        solve_homotopy(blocks, monitor, limit=3000, start=start)
        if _polished(blocks, monitor):
            return None
    solve_anderson(blocks, monitor)
    return None


def solve_measured(blocks: Blocks, monitor: Monitor) -> Infeasibility | None:
    """What was the fastest on problems like this one (`choice`); `auto` where that does not come to its end in good time."""
    early, late = probe(blocks, monitor)
    if _finished(monitor):
        return None
    choice = choose_solver(described(blocks, monitor.problem.mu, early, late), monitor.tolerance)
    method = _METHODS.get(choice.solver)
    if method is not None:
        with monitor.within(max(PATIENCE * choice.seconds, LEAST)):
            method(blocks, monitor)
    return None if _finished(monitor) else solve_auto(blocks, monitor)


_METHODS = {
    "nlgs": solve_nlgs,
    "anderson": solve_anderson,
    "admm": solve_admm,
    "interior": solve_interior,
    "newton": solve_proximal_newton,
    "homotopy": solve_homotopy,
}


def _finished(monitor: Monitor) -> bool:
    return monitor.converged or monitor.out_of_time


def _polished(blocks: Blocks, monitor: Monitor) -> bool:
    """Polish the best iterate as long as a round halves the error; whether to stop."""
    while not _finished(monitor):
        before = monitor.error
        polish(blocks, monitor, limit=40)
        if monitor.error > 0.5 * before:
            break
    return _finished(monitor)
