"""Speed against accuracy of one contact problem: every solver, tolerance and start.

The error of a setting is the larger of `natural_map_q` and `natural_map_scaled`, recomputed from the reactions alone; beside it stands the
error of the velocities against the most accurate solution that was found, ‖u − u*‖/‖q‖ (velocities, for reactions need not be unique). A
warm start is a solution whose reactions were disturbed by five per cent at random: about what the step before leaves. The cost is processor
time of this thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem.one_step import SOLVERS, OneStepProblem, Solution, solve
from ..errors import FenchelError, InputError
from ..front import Front, Measured, environment

__all__ = ["MEASURES", "TOLERANCES", "measure_contact"]

Array = NDArray[np.float64]
MEASURES = {
    "residual": "larger of natural_map_q and natural_map_scaled, recomputed",
    "velocity": "velocities against the most accurate solution, ‖u − u*‖/‖q‖",
}
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
COLD = ("interior", "interior_selective", "homotopy", "cone_program")  # begin where they begin
DISTURBED = 0.05
QUICK, REPEATS = 0.1, 3  # solutions below so many seconds are timed so many times


def measure_contact(
    problem: OneStepProblem,
    *,
    solvers: Sequence[str] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
    warm: bool = True,
    time_limit: float = 20.0,
    measure: str = "residual",
    progress: Callable[[float, str], None] | None = None,
    seed: int = 1,
) -> Front:
    """The front of a problem. A solver that misses a tolerance in `time_limit` seconds is not asked for a finer one.

    Raises `InputError` for an unknown solver or measure, a problem that is solved by r = 0, or one that has no solution.
    """
    names = tuple(SOLVERS) if solvers is None else tuple(solvers)
    unknown = [name for name in names if name not in SOLVERS]
    if unknown:
        raise InputError(f"solver = {unknown[0]!r} is unknown: choose from {', '.join(SOLVERS)}")
    if measure not in MEASURES:
        raise InputError(f"measure = {measure!r} is unknown: choose one of {', '.join(MEASURES)}")
    if not np.any(problem.q[0::3] < 0.0):
        raise InputError("no contact closes by itself: r = 0 is the solution, nothing is to be chosen")
    tell = progress or (lambda _share, _what: None)
    tell(0.0, "reference")
    best = _best(problem, time_limit)
    size = float(np.linalg.norm(problem.q))
    disturbed = best.r * (1.0 + DISTURBED * np.random.default_rng(seed).standard_normal(best.r.size))
    runs = [(name, None) for name in names]
    if warm:
        runs += [(name, disturbed) for name in names if name not in COLD]
    points: list[Measured] = []
    solutions: list[Solution | None] = []
    for k, (name, start) in enumerate(runs):
        missed = ""
        for tolerance in sorted(tolerances, reverse=True):
            setting: dict[str, Any] = {
                "solver": name,
                "tolerance": tolerance,
                "start": "cold" if start is None else "warm",
            }
            tell((k + 1) / (len(runs) + 1), f"{name}, tolerance {tolerance:g}")
            if missed:
                points.append(Measured(setting=setting, cost=float("inf"), error=None, failure=missed))
                solutions.append(None)
                continue
            found, took, failure = _solved(problem, name, tolerance, start, time_limit)
            if found is None or not found.converged:
                missed = failure or f"not reached in {time_limit:g} s, nor was {tolerance:g}"
                points.append(
                    Measured(
                        setting=setting, cost=took, error=None, failure=failure or f"not reached in {time_limit:g} s"
                    )
                )
                solutions.append(None)
                continue
            if found.errors.worst < best.errors.worst:
                best = found
            points.append(_measured(setting, found, took))
            solutions.append(found)
    points = [_with_velocity(p, s, best, size, measure) for p, s in zip(points, solutions, strict=True)]
    return Front(
        kind="contact",
        subject=problem.title or f"{problem.contact_count} contacts",
        measure=MEASURES[measure],
        cost="s",
        points=tuple(points),
        environment=environment(),
        note=f"{problem.contact_count} contacts; the most accurate solution has a residual of {best.errors.worst:.1e}",
    )


def _best(problem: OneStepProblem, time_limit: float) -> Solution:
    """The most accurate solution: `auto` to 1e-12, or as far as it comes."""
    found = solve(problem, tolerance=1e-12, time_limit=2.0 * time_limit, keep_unconverged=True)
    if found.infeasibility is not None:
        raise InputError("the problem has no solution: `fenchel contact` shows the contacts that are squeezed")
    return found


def _solved(
    problem: OneStepProblem, name: str, tolerance: float, start: Array | None, time_limit: float
) -> tuple[Solution | None, float, str]:
    """(solution, least seconds of some runs, why there is none)."""
    least = float("inf")
    found: Solution | None = None
    for _ in range(REPEATS):
        try:
            found = solve(
                problem, solver=name, tolerance=tolerance, start=start, time_limit=time_limit, keep_unconverged=True
            )
        except (FenchelError, ArithmeticError, np.linalg.LinAlgError) as reason:
            return None, float("inf"), " ".join(str(reason).split())
        least = min(least, found.seconds)
        if found.seconds > QUICK:
            break
    return found, least, ""


def _measured(setting: dict[str, Any], found: Solution, took: float) -> Measured:
    return Measured(
        setting=setting,
        cost=took,
        error=found.errors.worst,
        figures={
            "residual": found.errors.worst,
            "gap": found.errors.gap,
            "sweeps": float(found.sweeps),
            "factorisations": float(found.factorisations),
        },
    )


def _with_velocity(point: Measured, found: Solution | None, best: Solution, size: float, measure: str) -> Measured:
    if found is None:
        return point
    apart = float(np.linalg.norm(found.u - best.u)) / size
    error = point.error if measure == "residual" else apart
    return replace(point, error=error, figures={**point.figures, "velocity": apart})
