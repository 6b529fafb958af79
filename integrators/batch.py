"""One reduced program at many points: the engine, and clarabel where the engine stops short or is asked for.

clarabel's interior point ends at about the square root of its gap from a degenerate optimum; the engine, started there, does not. No active
set is guessed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compact import Compact
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, ORTHANT, POWER, POWER_DUAL, SECOND_ORDER, SEMIDEFINITE
from .general import ITERATION_LIMIT, ROUNDING, solve_points
from .scalar_terms import POWER_TERM
from .step_program import StepProgram
from .threads import shared

__all__ = [
    "INFEASIBLE",
    "BatchSolution",
    "interior_start",
    "run_engine",
    "run_interior",
    "slopes_of",
    "solve_batch",
]

Array = NDArray[np.float64]
INFEASIBLE = 9
# penalties to begin with: of cones alone, and where there are scalar terms, which only a stiff one sees; then those of further attempts
TAU, TERM_TAU = 100.0, 1e4
OTHER_TAUS = (10.0, 0.3, 1e3)
STEPS = 60
# relative duality gap up to which an answer that the engine could not finish counts as one
NEAR_GAP = 1e-8
# rows that a thread takes at a time: enough to forget the call, few enough to share the work evenly
CHUNK = 256


@dataclass
class BatchSolution:
    """Unknowns `y` (N, n), `multipliers` (N, m), `slopes` ∂W/∂d (N, D), `tangent` (N, 6, 6) or None, relative `residual`, codes `status`;
    Newton steps `counts` and outer `turns` of the attempt that is kept, and how many `attempts` were made."""

    y: Array
    multipliers: Array
    slopes: Array
    tangent: Array | None
    residual: Array
    status: NDArray[np.int64]
    counts: NDArray[np.int64]
    turns: NDArray[np.int64]
    attempts: NDArray[np.int64]

    def take(self, rows: NDArray[np.int64], other: BatchSolution) -> None:
        """Copy the rows of `other` (as many as `rows`) to `rows` here."""
        for name in ("y", "multipliers", "slopes", "residual", "status", "counts", "turns"):
            getattr(self, name)[rows] = getattr(other, name)
        if self.tangent is not None and other.tangent is not None:
            self.tangent[rows] = other.tangent


def run_engine(
    program: StepProgram,
    data: Array,
    *,
    tangent: bool = True,
    tolerance: float = 1e-13,
    start: tuple[Array, Array] | None = None,
    tau: float | None = None,
    threads: int = 1,
) -> BatchSolution:
    """The engine from the program's own guess, or from `start` = (y, multipliers); `tau` the first penalty.

    Points know nothing of each other: the answer does not depend on `threads`, to the last bit.
    """
    count, n, m = len(data), program.p.size, program.h0.size
    y = np.zeros((count, n)) if start is None else np.array(start[0], dtype=float)
    multipliers = np.zeros((count, m)) if start is None else np.array(start[1], dtype=float)
    slopes, residual = np.zeros((count, data.shape[1])), np.zeros(count)
    status, counts, turns = np.zeros((3, count), dtype=np.int64)
    tangents = np.zeros((count, 6, 6)) if tangent else np.zeros((1, 6, 6))
    if tau is None:
        tau = TERM_TAU if any(cone.kind >= POWER_TERM for cone in program.cones) else TAU
    arrays, data = program.engine_arrays, np.ascontiguousarray(data)

    def run(first: int, last: int) -> None:
        rows = slice(first, last)
        solve_points(
            *arrays, data[rows], start is not None, y[rows], multipliers[rows], slopes[rows],
            tangents[rows] if tangent else tangents, tangent, residual[rows], status[rows], counts[rows], turns[rows],
            tolerance, tau, STEPS,
        )  # fmt: skip

    shared(run, count, threads, CHUNK)
    found = tangents if tangent else None
    return BatchSolution(y, multipliers, slopes, found, residual, status, counts, turns, np.ones(count, dtype=np.int64))


def solve_batch(
    program: StepProgram,
    data: Array,
    *,
    tangent: bool = True,
    tolerance: float = 1e-13,
    start: tuple[Array, Array] | None = None,
    threads: int = 1,
    form: Compact | None = None,
) -> BatchSolution:
    """The engine on the compact form of `program`; points where it stops short again with other penalties, then from clarabel's answer.

    Unknowns and multipliers, also those of `start`, are those of the compact form, or of another `form`.
    """
    chosen: Compact = program.compact if form is None else form
    small = chosen.program
    found = run_engine(small, data, tangent=tangent, tolerance=tolerance, start=start, threads=threads)
    for tau in OTHER_TAUS:
        left = np.flatnonzero(found.status > ROUNDING)
        if left.size == 0:
            return found
        _again(found, left, small, data, tangent=tangent, tolerance=tolerance, tau=tau, threads=threads)
    left = np.flatnonzero(found.status > ROUNDING)
    if left.size:
        begin, infeasible = interior_start(program, data[left], chosen)
        _again(found, left, small, data, tangent=tangent, tolerance=tolerance, start=begin, tau=1e3, threads=threads)
        failed = infeasible & (found.status[left] > ROUNDING)
        found.status[left[failed]] = INFEASIBLE
        # a residual at the level of the last digits of large data is an answer, though not to the asked tolerance
        near = left[(found.status[left] == ITERATION_LIMIT) & (found.residual[left] <= 1e-10)]
        if near.size:
            from .certificate import relative_gap

            # of data that cancel, or of moduli that are decades apart, so much may be left of the residual that the answer is none
            gap = relative_gap(small, data[near], found.y[near], found.multipliers[near])
            found.status[near[gap <= NEAR_GAP]] = ROUNDING
    return found


def _again(found: BatchSolution, left: NDArray[np.int64], program: StepProgram, data: Array, **options: Any) -> None:
    """Another attempt at the rows `left`, kept where it is better."""
    again = run_engine(program, data[left], **options)
    better = (again.status <= ROUNDING) | (again.residual < found.residual[left])
    found.attempts[left] += 1
    _take(found, left[better], again, better)


def _take(found: BatchSolution, rows: NDArray[np.int64], other: BatchSolution, mask: NDArray[np.bool_]) -> None:
    part = BatchSolution(
        other.y[mask],
        other.multipliers[mask],
        other.slopes[mask],
        None if other.tangent is None else other.tangent[mask],
        other.residual[mask],
        other.status[mask],
        other.counts[mask],
        other.turns[mask],
        other.attempts[mask],
    )
    found.take(rows, part)


def interior_start(
    program: StepProgram, data: Array, form: Compact | None = None
) -> tuple[tuple[Array, Array], NDArray[np.bool_]]:
    """clarabel's answers as a start of the compact form, or of another, and where it says infeasible."""
    y, multipliers, infeasible = run_interior(program, data)
    return (program.compact if form is None else form).start(y, multipliers), infeasible


def slopes_of(program: StepProgram, data: Array, y: Array, multipliers: Array) -> Array:
    """∂W/∂d = C d + c₁ + q₁ᵀy − h₁ᵀλ at given unknowns."""
    return data @ program.C.T + program.c1 + y @ program.q1 - multipliers @ program.h1


# -- clarabel -------------------------------------------------------------------------------------------------------------------


def run_interior(program: StepProgram, data: Array, tolerance: float = 1e-9) -> tuple[Array, Array, NDArray[np.bool_]]:
    """clarabel at every point: (y, multipliers, infeasible); zeros where it has no answer."""
    import clarabel
    from scipy import sparse

    n = program.p.size
    maps = _row_maps(program)
    A = sparse.csc_matrix(maps @ program.G)
    P = sparse.csc_matrix(np.diag(program.p))
    cones: list[Any] = []
    for cone in program.cones:
        cones.append(
            {
                ORTHANT: lambda c: clarabel.NonnegativeConeT(c.size),
                SECOND_ORDER: lambda c: clarabel.SecondOrderConeT(c.size),
                SEMIDEFINITE: lambda c: clarabel.PSDTriangleConeT(3),
                EXPONENTIAL: lambda c: clarabel.ExponentialConeT(),
                EXPONENTIAL_DUAL: lambda c: clarabel.ExponentialConeT(),
                POWER: lambda c: clarabel.PowerConeT(c.alpha),
                POWER_DUAL: lambda c: clarabel.PowerConeT(c.alpha),
            }[cone.kind](cone)
        )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.max_iter = 200
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    y, multipliers = np.zeros((len(data), n)), np.zeros((len(data), program.h0.size))
    infeasible = np.zeros(len(data), dtype=bool)
    solver: Any = None
    for i, row in enumerate(data):
        q, h = program.q0 + program.q1 @ row, program.h0 + program.h1 @ row
        scale = max(float(np.abs(q).max(initial=0.0)), float(np.abs(h).max(initial=0.0))) or 1.0
        q, b = q / scale, maps @ (h / scale)
        if solver is None:
            solver = clarabel.DefaultSolver(P, q, A, b, cones, settings)
        else:
            solver.update(q=q, b=b)
        found = solver.solve()
        infeasible[i] = "Infeasible" in str(found.status)
        x, z = np.array(found.x), np.array(found.z)
        if np.isfinite(x).all() and np.isfinite(z).all() and not infeasible[i]:
            y[i], multipliers[i] = x * scale, maps.T @ z * scale
    return y, multipliers, infeasible


def _row_maps(program: StepProgram) -> Array:
    """Linear map of the slack to clarabel's cones: order of semidefinite rows, duals of the last two cones as images of the cones."""
    found = np.eye(program.h0.size)
    start = 0
    for cone in program.cones:
        rows = slice(start, start + cone.size)
        if cone.kind == SEMIDEFINITE:
            found[rows, rows] = np.eye(6)[[0, 5, 1, 4, 3, 2]]
        elif cone.kind == EXPONENTIAL_DUAL:
            found[rows, rows] = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, np.e]])
        elif cone.kind == POWER_DUAL:
            found[rows, rows] = np.diag([1.0 / cone.alpha, 1.0 / (1.0 - cone.alpha), 1.0])
        start += cone.size
    return found
