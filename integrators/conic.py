"""The implicit step at one point as a cvxpy problem in scaled units, for inspection, for reference and for other solvers.

    min ½ (e, y)ᵀ M (e, y) + gᵀ(e, y)   subject to   e = ε,   h₁ e + h − G y ∈ K,

the reduced program of the law (see `step_program`) with the strain as an unknown, so that the stress is the multiplier of e = ε. Nothing of
the engine is used: cvxpy rewrites it and clarabel solves it. `solve` then polishes that answer by the engine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError, Status
from ..notebook import Summary
from ..potentials import Law
from ..potentials.spectral import as_matrix, from_matrix
from .batch import ROUNDING, BatchSolution, interior_start, slopes_of, solve_batch
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, ORTHANT, POWER, POWER_DUAL, SECOND_ORDER, SEMIDEFINITE
from .general_step import GeneralStep, Part, StepSolution
from .step_program import StepProgram

__all__ = ["ConicSolution", "ConicStep", "conic_step", "reference"]

Array = NDArray[np.float64]
UNPOLISHED = 1e-4  # mismatch over the size of the data up to which an answer without polish counts as one
LOOSE = 100.0  # times a tolerance that was asked for, which clarabel means in its own scaling


@dataclass(frozen=True, repr=False)
class ConicSolution(Summary):
    """Solution of one step: `stress` [Pa] (6,), `state` by name, `objective` W = ψ + dt φ [J/m³], `status` text of clarabel and the
    `residual`, the natural map of the program relative to its data (zero at the solution and nowhere else)."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "stress": "Pa",
        "objective": "J/m³",
        "residual": "-",
    }

    stress: np.ndarray
    state: dict[str, Any]
    objective: float
    status: str
    residual: float

    def _title(self) -> str:
        return f"step of a cone program: {self.status}"


@dataclass(frozen=True)
class ConicStep:
    """The program of one step at one point; `.problem` is the cvxpy problem, unknowns divided by `size`, strains by `strain_unit` too."""

    law: Law
    update: Any
    program: StepProgram
    data: Array
    eps: Array
    old: Array
    problem: Any
    strain_constraint: Any
    unknowns: Any
    cones: tuple[Any, ...]
    size: float
    strain_unit: float

    def solve(self, **options: Any) -> ConicSolution:
        """Solve by clarabel and polish; `options` go to cvxpy's `solve`. Raises `ConvergenceError` if no solution is found."""
        start, status = self.interior(**options)
        found = solve_batch(self.program, self.data, tangent=False, start=start)
        if found.status[0] > ROUNDING:
            raise ConvergenceError(
                f"law '{self.law.name}': the conic program has no solution here: clarabel says '{status}'"
            )
        y = found.y
        increment = self.program.compact.program.increments(self.data, y)
        solution = StepSolution(found.slopes, None, increment, found.residual, found.status, found.counts, [])
        new, _ = self.update.outcome(self.eps, self.old, solution)
        unpacked = {n: v[0] for n, v in self.update.packing.unpack(new).items()}
        return ConicSolution(
            found.slopes[0, :6].copy(), unpacked, self._objective(found), status, float(found.residual[0])
        )

    def interior(self, **options: Any) -> tuple[tuple[Array, Array], str]:
        """clarabel's answer through cvxpy: (unknowns, multipliers) of the compact form, and its status."""
        y, multipliers, status = self.unpolished(**options)
        if y is None or multipliers is None:
            if "infeasible" in status:
                raise ConvergenceError(
                    f"law '{self.law.name}': the conic program has no solution here: clarabel says '{status}'"
                )
            return interior_start(self.program, self.data)[0], status
        return self.program.compact.start(y[None], multipliers[None]), status

    def unpolished(self, **options: Any) -> tuple[Array | None, Array | None, str]:
        """(unknowns, multipliers) of the reduced program as clarabel leaves them, and its status."""
        import cvxpy

        try:
            self.problem.solve(solver=cvxpy.CLARABEL, **options)
        except cvxpy.SolverError:
            return None, None, "failed"
        status = str(self.problem.status)
        if self.problem.value is None or not np.isfinite(self.problem.value):
            return None, None, status
        n = self.program.p.size
        y = np.asarray(self.unknowns.value).reshape(-1) * self.size if n else np.zeros(0)
        parts = [_dual(c, k.kind) for c, k in zip(self.cones, self.program.cones, strict=True)]
        multipliers = np.concatenate(parts) * self.size if parts else np.zeros(0)
        return y, multipliers, status

    def _objective(self, found: BatchSolution) -> float:
        from .certificate import term_values

        program, d = self.program.compact.program, self.data[0]
        y = found.y[0]
        q, s = program.q0 + program.q1 @ d, program.h0 + program.h1 @ d - program.G @ y
        constant = program.c0 + float(program.c1 @ d) + 0.5 * float(d @ program.C @ d)
        return constant + float(0.5 * y @ (program.p * y) + q @ y) + term_values(program, s)


def conic_step(law: Law, eps_new: Any, state: Mapping[str, Any] | None, values: Mapping[str, Any]) -> ConicStep:
    """Declare the program of one step at one point: strain (6,), `state` by name or None; `values` are the parameters by name, the
    temperature by its name, and `dt`, the time step [s], 1 if not given.

    Raises `InputError` for bad input and `DeclarationError` where an atom of the law has no conic form.
    """
    from .general_update import GeneralUpdate

    eps = np.asarray(eps_new, dtype=float).reshape(-1)
    if eps.shape != (6,) or not np.isfinite(eps).all():
        raise InputError(f"conic: the strain has shape {np.shape(eps_new)}; it must be six finite Mandel components")
    law.check_evolution()
    given = dict(values)
    dt = float(given.pop("dt", 1.0))
    update = GeneralUpdate.of(law, False, "conic")
    rows = {n: np.asarray(v, dtype=float)[None] for n, v in state.items()} if state is not None else None
    old = update.packing.pack(rows, 1)
    numbers, temperature = update.arguments(given, 1)
    step = update.step(numbers, dt)
    (_, program, data), *_ = step.groups(eps[None], old, temperature)
    return declare(law, update, program, data, eps[None], old)


def declare(law: Law, update: Any, program: StepProgram, data: Array, eps: Array, old: Array) -> ConicStep:
    """The cvxpy problem of one row of data."""
    import cvxpy as cp

    d, n = data[0], program.p.size
    rest = d.copy()
    # the minimum is convex in a given strain, which can be an unknown; it is concave in a given stress, which is a number
    shown = 0.0 if program.stress else 1.0
    rest[:6] *= 1.0 - shown
    q, h = program.q0 + program.q1 @ d, program.h0 + program.h1 @ d
    stiffness = float(np.diag(program.C)[:6].max(initial=0.0)) or 1.0
    size = max(
        float(np.abs(q).max(initial=0.0)),
        float(np.abs(h).max(initial=0.0)),
        shown * float(np.abs(eps).max()) * stiffness**0.5,
    )
    size = size or 1.0
    strain_unit = 1.0 / stiffness**0.5
    e = cp.Variable(6, name="eps")
    y = cp.Variable(n) if n else None
    point = cp.hstack([e, y]) if y is not None else e
    scale = np.concatenate([np.full(6, strain_unit), np.ones(n)])
    cross = shown * program.q1[:, :6]
    M = np.block([[shown * program.C[:6, :6], cross.T], [cross, np.diag(program.p)]])
    values, vectors = np.linalg.eigh(scale[:, None] * M * scale[None, :])
    keep = values > 1e-14 * max(float(values.max(initial=0.0)), 1e-300)
    factor = np.sqrt(values[keep])[:, None] * vectors[:, keep].T
    slope = np.concatenate([shown * (program.c1[:6] + program.C[:6] @ rest), program.q0 + program.q1 @ rest])
    slope *= scale / size
    objective = 0.5 * cp.sum_squares(factor @ point) + slope @ point
    shift = (program.h0 + program.h1 @ rest) / size
    strains = shown * program.h1[:, :6] * strain_unit
    slack = shift + strains @ e - (program.G @ y if y is not None else 0.0) if shift.size else None
    cones, constraints = [], []
    start = 0
    for cone in program.cones:
        constraint, kept = _constraint(cp, cone, slack[start : start + cone.size])  # type: ignore[index]
        start += cone.size
        cones.append(kept)
        constraints.append(constraint)
    fixed = e == shown * eps[0] / (strain_unit * size)
    problem = cp.Problem(cp.Minimize(objective), [fixed, *constraints])
    return ConicStep(law, update, program, data, eps, old, problem, fixed, y, tuple(cones), size, strain_unit)


def _constraint(cp: Any, cone: Any, s: Any) -> tuple[Any, Any]:
    """cvxpy constraint s ∈ K; the duals of the exponential and power cones as images of the cones."""
    if cone.kind == ORTHANT:
        found = s >= 0
    elif cone.kind == SECOND_ORDER:
        found = cp.SOC(s[0], s[1:])
    elif cone.kind == SEMIDEFINITE:
        found = as_matrix(s) >> 0
    elif cone.kind == EXPONENTIAL:
        found = cp.ExpCone(s[0], s[1], s[2])
    elif cone.kind == EXPONENTIAL_DUAL:
        found = cp.ExpCone(-s[1], -s[0], np.e * s[2])
    else:
        unit = (1.0, 1.0) if cone.kind == POWER else (1.0 / cone.alpha, 1.0 / (1.0 - cone.alpha))
        found = cp.PowCone3D(unit[0] * s[0], unit[1] * s[1], s[2], cone.alpha)
    return found, (found, cone)


def _dual(shown: Any, kind: int) -> Array:
    """Multiplier in the dual cone, in the order of the rows."""
    constraint, cone = shown
    value = constraint.dual_value
    if kind == SECOND_ORDER:
        return np.concatenate([np.ravel(value[0]), np.ravel(value[1])])
    if kind == SEMIDEFINITE:
        return from_matrix(0.5 * (np.asarray(value) + np.asarray(value).T))
    if kind == ORTHANT:
        return np.ravel(value)
    x, y, z = (float(np.ravel(v)[0]) for v in value)
    if kind == EXPONENTIAL_DUAL:
        return np.array([-y, -x, np.e * z])
    if kind == POWER_DUAL:
        return np.array([x / cone.alpha, y / (1.0 - cone.alpha), z])
    assert kind in (EXPONENTIAL, POWER)
    return np.array([x, y, z])


def _mismatch(program: StepProgram, d: Array, y: Array, multipliers: Array) -> float:
    """Largest entry of (Py + q + Gᵀλ, λ − Π_{K*}(λ − s)) over the largest of q and h: what an answer is worth, whatever its status."""
    from .certificate import dual_projection

    q, h = program.q0 + program.q1 @ d, program.h0 + program.h1 @ d
    inside = dual_projection(program, (multipliers - h + program.G @ y)[None])[0]
    wrong = np.concatenate([program.p * y + q + multipliers @ program.G, multipliers - inside])
    size = max(np.abs(q).max(initial=0.0), np.abs(h).max(initial=0.0)) or 1.0
    return float(np.abs(wrong).max(initial=0.0) / size)


def reference(
    step: GeneralStep, eps: Array, old: Array, temperature: Array | None, tolerance: float = 1e-8
) -> StepSolution:
    """The step at every point through cvxpy and clarabel, as they leave it; slow, without tangent."""
    from .general_update import GeneralUpdate

    update = GeneralUpdate.of(step.law, False, "cvxpy")
    n = len(eps)
    slopes, increment = np.zeros((n, 6 + old.shape[1])), np.zeros((n, step.program_size))
    residual, status = np.zeros(n), np.zeros(n, dtype=np.int64)
    parts = []
    for points, program, data in step.groups(eps, old, temperature):
        left = np.zeros((len(data), program.p.size)), np.zeros((len(data), program.h0.size))
        for row, i in enumerate(np.arange(n)[points]):
            given = declare(step.law, update, program, data[row : row + 1], eps[i : i + 1], old[i : i + 1])
            y, multipliers, said = given.unpolished(tol_gap_abs=tolerance, tol_gap_rel=tolerance, tol_feas=tolerance)
            if y is None or multipliers is None:
                status[i] = Status.INFEASIBLE if "infeasible" in said else Status.ITERATION_LIMIT
                continue
            residual[i] = _mismatch(program, data[row], y, multipliers)
            if not residual[i] <= max(UNPOLISHED, LOOSE * tolerance):
                status[i] = Status.ITERATION_LIMIT
                continue
            slopes[i] = slopes_of(program, data[row : row + 1], y[None], multipliers[None])[0, : slopes.shape[1]]
            if not step.stress:
                slopes[i, :6] = -given.strain_constraint.dual_value * given.size / given.strain_unit
            increment[i] = program.increments(data[row : row + 1], y[None])[0]
            left[0][row], left[1][row] = y, multipliers
        parts.append(
            Part(points, program, data, _as_left(program, *left, slopes[points], residual[points], status[points]))
        )
    return StepSolution(slopes, None, increment, residual, status, np.zeros(n, dtype=np.int64), parts)


def _as_left(
    program: StepProgram, y: Array, multipliers: Array, slopes: Array, residual: Array, status: NDArray[np.int64]
) -> BatchSolution:
    """Unknowns and multipliers as another solver left them, in the compact form, for the certificates."""
    small, dual = program.compact.start(y, multipliers)
    zero = np.zeros(len(y), dtype=np.int64)
    return BatchSolution(small, dual, slopes, None, residual, status, zero, zero, zero)
