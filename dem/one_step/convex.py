r"""Convex programs of the one-step problem, on clarabel's canonical data and through cvxpy.

With s = ‖u_T‖ frozen and W symmetric, the problem is the second-order cone program (Acary, Cadoux, Lemaréchal and Malick 2011)

    min J(r) = ½ r·W r + (q + μ s n)·r ,   r ∈ K ,

and a reaction solves the frictional problem exactly when it solves its own program. Hence a **certificate** that shares nothing with
the other solvers: J at the reaction against the optimum of clarabel. Without friction it is the QP min ½ r_N·W_NN r_N + q_N·r_N over
r_N ≥ 0, equivalently an LCP. The fixed point s ← ‖u_T(s)‖ is a solver too, slow where friction couples strongly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import ConvergenceError, InputError
from .blocks import Blocks
from .monitor import Monitor
from .problem import OneStepProblem

__all__ = ["Certificate", "ConeProgram", "certify", "solve_cone_program"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Certificate:
    """J of a reaction and of the optimum of its own cone program, in the scaled problem; `gap` relative to the size of J's terms."""

    objective: float
    optimum: float
    gap: float
    velocity_difference: float  # energy norm of r − r_optimal over that of r

    @property
    def certified(self) -> bool:
        """Optimal up to the accuracy of the cone solver (gap below 1e-7, both signs)."""
        return abs(self.gap) < 1e-7


class ConeProgram:
    """The cone program of a symmetric problem in the scaling r = c a x; `solve` takes s (n,) in units of the scaled velocities.

    `through` is "clarabel" (canonical data, set up once, only q changes) or "cvxpy". Raises `InputError` for an asymmetric W.
    """

    def __init__(self, problem: OneStepProblem, through: str = "clarabel") -> None:
        if not problem.symmetric:
            raise InputError(
                f"W is not symmetric (relative part {problem.asymmetry:.1e}): no convex program has this problem as its optimality "
                "condition; take another solver"
            )
        if through not in ("clarabel", "cvxpy"):
            raise InputError(f"through = {through!r}: a cone program goes through clarabel or cvxpy")
        self.problem, self.through = problem, through
        n = problem.contact_count
        diagonal = problem.delassus.diagonal()[0::3]
        a = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, diagonal.max(initial=0.0) or 1.0))
        c = float(np.max(np.repeat(a, 3) * np.abs(problem.q), initial=0.0)) or 1.0
        self.scale = c * a
        self.smooth = problem.mu == 0.0
        # unknowns: all three components with friction, the normal one without
        keep = np.ones((n, 3), dtype=bool)
        keep[self.smooth, 1:] = False
        self._keep = np.flatnonzero(keep.ravel())
        half = sp.diags(np.repeat(a, 3))
        self.matrix = sp.csr_matrix(half @ problem.delassus @ half)[self._keep][:, self._keep]
        self.q = np.repeat(a, 3) * problem.q / c
        self._normal = np.zeros((n, 3))
        self._normal[:, 0] = problem.mu
        self._solver: Any = None

    def linear(self, s: Array) -> Array:
        """q̄ + μ s n, shape (3n,)."""
        return self.q + (self._normal * s[:, None]).ravel()

    def objective(self, x: Array, s: Array) -> tuple[float, float]:
        """J(x) and the sum of the sizes of its terms, x (n, 3) scaled."""
        kept = x.ravel()[self._keep]
        quadratic, linear = 0.5 * float(kept @ (self.matrix @ kept)), float(kept @ self.linear(s)[self._keep])
        return quadratic + linear, abs(quadratic) + abs(linear)

    def slips(self, x: Array) -> Array:
        """‖ȳ_T‖ (n,) of y = W̄x + q̄."""
        y = self.problem.velocity((self.scale[:, None] * x).ravel()).reshape(-1, 3)
        a_over_c = 1.0 / np.sqrt(
            np.where((d := self.problem.delassus.diagonal()[0::3]) > 0.0, d, d.max(initial=0.0) or 1.0)
        )
        return np.hypot(y[:, 1], y[:, 2]) * a_over_c**2 / self.scale

    def solve(self, s: Array) -> Array:
        """The optimal x (n, 3). Raises `ConvergenceError` when the cone solver gives none."""
        kept = self._by_clarabel(s) if self.through == "clarabel" else self._by_cvxpy(s)
        x = np.zeros(3 * len(s))
        x[self._keep] = kept
        return x.reshape(-1, 3)

    def _cone_rows(self) -> tuple[sp.csr_matrix, list[int]]:
        """Rows that map the unknowns to (r_N) of smooth and (μ r_N, r_T) of frictional contacts, in that order."""
        place = np.full(3 * len(self.smooth), -1)
        place[self._keep] = np.arange(len(self._keep))
        plain = place[3 * np.flatnonzero(self.smooth)]
        rough = np.flatnonzero(~self.smooth)
        columns = np.concatenate([plain, place[(3 * rough[:, None] + np.arange(3)).ravel()]])
        weight = np.concatenate(
            [np.ones(len(plain)), np.column_stack([self.problem.mu[rough], np.ones((len(rough), 2))]).ravel()]
        )
        rows = sp.csr_matrix((weight, (np.arange(len(columns)), columns)), shape=(len(columns), len(self._keep)))
        return rows, [len(plain), len(rough)]

    def _by_clarabel(self, s: Array) -> Array:
        import clarabel

        linear = self.linear(s)[self._keep]
        if self._solver is None:
            rows, (plain, rough) = self._cone_rows()
            cones: list[Any] = [clarabel.NonnegativeConeT(plain)] if plain else []
            cones += [clarabel.SecondOrderConeT(3)] * rough
            settings = clarabel.DefaultSettings()
            settings.verbose = False
            settings.presolve_enable = False
            settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
            upper = sp.csc_matrix(sp.triu(self.matrix))
            right = np.zeros(rows.shape[0])
            self._solver = clarabel.DefaultSolver(upper, linear, sp.csc_matrix(-rows), right, cones, settings)
        else:
            self._solver.update(q=linear)
        solution = self._solver.solve()
        x = np.asarray(solution.x)
        if str(solution.status) not in (
            "Solved",
            "AlmostSolved",
            "InsufficientProgress",
            "MaxIterations",
        ) or not np.all(np.isfinite(x)):
            raise ConvergenceError(
                f"the cone program ended with status {solution.status}: the problem has no bounded optimum"
            )
        return x

    def _by_cvxpy(self, s: Array) -> Array:
        import cvxpy as cp

        rows, (plain, rough) = self._cone_rows()
        x = cp.Variable(len(self._keep))
        image = rows @ x
        constraints: list[Any] = [image[:plain] >= 0.0] if plain else []
        if rough:
            blocks = cp.reshape(image[plain:], (3, rough), order="F")
            constraints.append(cp.SOC(blocks[0, :], blocks[1:, :], axis=0))
        program = cp.Problem(
            cp.Minimize(0.5 * cp.quad_form(x, cp.psd_wrap(self.matrix)) + self.linear(s)[self._keep] @ x), constraints
        )
        program.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
        if x.value is None:
            raise ConvergenceError(
                f"the cone program ended with status {program.status}: the problem has no bounded optimum"
            )
        return np.asarray(x.value)


def certify(problem: OneStepProblem, r: Array, *, through: str = "clarabel") -> Certificate:
    """Compare a reaction r (3n,) with the optimum of its own cone program.

    Raises `InputError` when W is not symmetric (there is no such program), `ConvergenceError` when the program has no optimum.
    """
    if problem.contact_count == 0:
        return Certificate(0.0, 0.0, 0.0, 0.0)
    program = ConeProgram(problem, through)
    x = r.reshape(-1, 3) / program.scale[:, None]
    s = program.slips(x)
    best = program.solve(s)
    value, size = program.objective(x, s)
    optimum, other = program.objective(best, s)
    size = max(size, other, 1e-300)
    kept, difference = x.ravel()[program._keep], (x - best).ravel()[program._keep]
    energy = float(kept @ (program.matrix @ kept))
    apart = float(np.sqrt(max(difference @ (program.matrix @ difference), 0.0) / energy)) if energy > 0.0 else 0.0
    return Certificate(value, optimum, (value - optimum) / size, apart)


def solve_cone_program(blocks: Blocks, monitor: Monitor, *, limit: int = 100_000) -> None:
    """The fixed point s ← ‖u_T(s)‖ of cone programs. Raises `InputError` for an asymmetric W."""
    program = ConeProgram(monitor.problem)
    s = np.zeros(len(blocks.mu))
    for _ in range(limit):
        try:
            x = program.solve(s)
        except ConvergenceError:  # no optimum: the best iterate stands
            return
        monitor.factorisations += 1
        if monitor(x):
            return
        s = program.slips(x)
