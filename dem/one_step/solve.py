"""One interface to every solver of the one-step problem: `solve(problem, solver=..., tolerance=...)`."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import ConvergenceError, InputError, Status
from ...front import checked_accuracy, shipped_front
from .admm import solve_admm
from .blocks import Blocks, scaled_blocks
from .convex import solve_cone_program
from .feasibility import Infeasibility
from .gauss_seidel import solve_anderson, solve_nlgs
from .homotopy import solve_homotopy
from .interior import solve_interior, solve_interior_selective
from .measures import ContactErrors, measure, worst_contacts
from .monitor import Monitor
from .newton import polish, solve_proximal_newton
from .pipeline import solve_auto, solve_measured
from .problem import OneStepProblem

__all__ = ["SOLVERS", "Solution", "describe", "solve"]

Array = NDArray[np.float64]

TIME_LIMIT = 120.0  # s
FINEST = 1e-14  # tolerance

SOLVERS: dict[str, tuple[str, Callable[[Blocks, Monitor], Infeasibility | None]]] = {
    "auto": ("sweeps, interior point, homotopy and polish, as size and progress ask", solve_auto),
    "measured": ("what was the fastest on random problems like this one, then auto", solve_measured),
    "nlgs": ("non-linear Gauss-Seidel with the exact local solve", solve_nlgs),
    "anderson": ("the same with Anderson acceleration", solve_anderson),
    "admm": ("alternating directions, one factorisation", solve_admm),
    "interior": ("proximal interior point with de Saxce's term", solve_interior),
    "interior_selective": ("the same, damped only where positivity is lost", solve_interior_selective),
    "newton": ("proximal point with a semismooth Newton method", solve_proximal_newton),
    "homotopy": ("interior points followed through turning points", solve_homotopy),
    "cone_program": ("fixed point of cone programs (symmetric W)", solve_cone_program),
}


@dataclass(frozen=True)
class Solution:
    """Reactions r and velocities u (3n,), errors recomputed from r alone, status, and the work that was done."""

    r: Array
    u: Array
    errors: ContactErrors
    status: Status
    solver: str
    tolerance: float
    sweeps: int
    factorisations: int
    seconds: float  # of the processor, this thread, without reading files and compiling
    infeasibility: Infeasibility | None = None

    @property
    def converged(self) -> bool:
        """Whether `natural_map_q` and `natural_map_scaled` are both at most the tolerance."""
        return self.status is Status.CONVERGED


def solve(
    problem: OneStepProblem,
    *,
    solver: str = "auto",
    tolerance: float | None = None,
    accuracy: float | None = None,
    time_limit: float = TIME_LIMIT,
    start: Array | None = None,
    keep_unconverged: bool = False,
) -> Solution:
    """Solve u = W r + q, K* ∋ û ⟂ r ∈ K to `natural_map_q` and `natural_map_scaled` ≤ `tolerance`.

    solver: a name of `SOLVERS`. tolerance: 1e-8 if not given. accuracy: in place of both, the tolerance, by the solver that was the
    fastest on problems like this one ("measured"); as every solution it counts only after the errors were recomputed. time_limit:
    processor seconds [s], looked at between iterations. start: reactions (3n,) to begin with (the interior methods begin cold).
    keep_unconverged: return the best reactions found with their status instead of raising.

    Raises `ConvergenceError` with the figures when the tolerance is not reached or a proof was found that no solution exists,
    `InputError` for an unknown solver or a tolerance that is not positive.
    """
    if accuracy is not None:
        if solver != "auto" or tolerance is not None:
            raise InputError("accuracy chooses the solver and is the tolerance: leave both out, or leave accuracy out")
        solver, tolerance = "measured", checked_accuracy(accuracy)
    tolerance = 1e-8 if tolerance is None else tolerance
    if solver not in SOLVERS:
        raise InputError(f"solver = {solver!r} is unknown: choose one of {', '.join(SOLVERS)}")
    if not (np.isfinite(tolerance) and tolerance >= FINEST):
        raise InputError(
            f"tolerance = {tolerance}: at least {FINEST:.0e}, below which errors are round-off (1e-8 is usual)"
        )
    if not time_limit > 0.0:
        raise InputError(f"time_limit = {time_limit} s: it is positive")
    _warm_up()
    if solver == "measured":
        shipped_front("contact")
    began = time.thread_time()
    n = problem.contact_count
    r, proof = np.zeros(3 * n), None
    sweeps = factorisations = 0
    # data and iterates may leave the range of numbers; what is returned is the best that was measured, and its errors say so
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        # r = 0 is a solution exactly when no contact closes by itself
        if n and np.any(problem.q[0::3] < 0.0):
            blocks = scaled_blocks(problem)
            monitor = Monitor(problem, blocks, tolerance, time_limit)
            monitor(blocks.unknowns(_given(start, n)))
            if not monitor.converged:
                proof = SOLVERS[solver][1](blocks, monitor)
            r, sweeps, factorisations = blocks.reactions(monitor.best), monitor.sweeps, monitor.factorisations
        seconds = time.thread_time() - began
        errors = measure(problem, r)
    if errors.worst <= tolerance:
        status = Status.CONVERGED
    elif proof is not None:
        status = Status.INFEASIBLE
    else:
        status = Status.ITERATION_LIMIT if np.isfinite(errors.worst) else Status.NOT_FINITE
    solution = Solution(
        r, problem.velocity(r), errors, status, solver, tolerance, sweeps, factorisations, seconds, proof
    )
    if not solution.converged and not keep_unconverged:
        raise ConvergenceError(describe(problem, solution))
    return solution


@functools.cache
def _warm_up() -> None:
    """Compile, or load from the cache, what the methods call, on one sliding contact: it shall not count as time of a problem."""
    problem = OneStepProblem.local(np.eye(3), [-1.0, 2.0, 0.0], [0.5])
    blocks = scaled_blocks(problem)
    for run in (solve_nlgs, solve_interior, solve_interior_selective, polish, solve_homotopy):
        run(blocks, Monitor(problem, blocks, 0.0, 60.0), limit=7)


def _given(start: Array | None, n: int) -> Array:
    if start is None:
        return np.zeros(3 * n)
    if np.shape(start) != (3 * n,):
        raise InputError(f"start has shape {np.shape(start)}: reactions have shape ({3 * n},)")
    return np.asarray(start, dtype=float)


def describe(problem: OneStepProblem, solution: Solution) -> str:
    """One line on how a solution ended, for messages."""
    e = solution.errors
    if solution.converged:
        return f"{solution.solver}: converged, natural_map_q {e.natural_map_q:.1e}, natural_map_scaled {e.natural_map_scaled:.1e}"
    if solution.infeasibility is not None:
        proof = solution.infeasibility
        return (
            f"the problem has no solution: the contacts {', '.join(map(str, proof.contacts))} are squeezed whatever the reactions "
            f"(proved up to {proof.excluded:.0e} times their natural size): look at q_N and at driven bodies"
        )
    worst = ", ".join(f"{k} ({share:.0%})" for k, share in worst_contacts(problem, solution.r, 3))
    return (
        f"{solution.solver} stopped after {solution.seconds:.1f} s, {solution.sweeps} sweeps, {solution.factorisations} factorisations at "
        f"natural_map_q {e.natural_map_q:.1e} and natural_map_scaled {e.natural_map_scaled:.1e} > {solution.tolerance:.0e} "
        f"(contacts with most of it: {worst}): raise time_limit, loosen tolerance, or try another solver"
    )
