r"""One-step contact problems solved a second time, by means that share nothing with the solvers of `fenchel.dem`.

* `lemke`: complementary pivoting for 0 ≤ x ⊥ W x + q ≥ 0; it ends at a solution for every positive semidefinite W for which there is one
  (Cottle, Pang and Stone 1992), followed by one exact solve on the set of rows that it found.
* `LeastConstraint`: the same step as a quadratic program in the velocities, by active sets (scipy) and by an interior point (clarabel
  through cvxpy).
* `cone_fixed_point`: with s = ‖u_T‖ frozen a step with friction is a second-order cone program; s ← ‖u_T(s)‖ until it stands still
  (Acary, Cadoux, Lemaréchal and Malick 2011).
* `natural_map`: r − P_K(r − ρ û) contact by contact, û = u + μ‖u_T‖ n, ρ = 1/W_NN (de Saxcé and Feng 1998); the projection by cases.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError

__all__ = ["ConeStep", "LeastConstraint", "cone_fixed_point", "lemke", "natural_map"]

Array = NDArray[np.float64]


def lemke(matrix: Array, q: Array) -> Array:
    """x (n,) with 0 ≤ x ⊥ W x + q ≥ 0. Raises `ConvergenceError` where the pivots end on a ray: no solution."""
    n = len(q)
    size = 1.0 / np.sqrt(np.diag(matrix))
    scaled, right = matrix * size[:, None] * size, q * size
    # unknowns w, x and the artificial one; w − W x − e z = q
    table = np.concatenate([np.eye(n), -scaled, -np.ones((n, 1)), right[:, None]], axis=1)
    basis = np.arange(n)
    if np.all(right >= 0.0):
        return np.zeros(n)
    row, entering = int(np.argmin(right)), 2 * n
    for _ in range(50 * n):
        leaving = basis[row]
        table[row] /= table[row, entering]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, entering], table[row])
        basis[row] = entering
        if leaving == 2 * n:
            return size * np.maximum(0.0, _on_rows(scaled, right, np.sort(basis[basis >= n] - n)))
        entering = leaving + n if leaving < n else leaving - n
        column = table[:, entering]
        free = column > 1e-11
        if not free.any():
            raise ConvergenceError("Lemke's pivots end on a ray: the complementarity problem has no solution")
        ratio = np.where(free, table[:, -1] / np.where(free, column, 1.0), np.inf)
        near = ratio <= ratio.min() + 1e-13 * (1.0 + abs(ratio.min()))
        artificial = near & (basis == 2 * n)
        row = int(np.argmax(artificial)) if artificial.any() else int(np.argmax(np.where(near, column, 0.0)))
    raise ConvergenceError(f"Lemke's method cycles after {50 * n} pivots")


def _on_rows(matrix: Array, q: Array, active: NDArray[np.int64]) -> Array:
    """(W x + q) = 0 on the rows `active`, x = 0 elsewhere."""
    x = np.zeros(len(q))
    if active.size:
        x[active] = np.linalg.lstsq(matrix[np.ix_(active, active)], -q[active], rcond=1e-13)[0]
    return x


@dataclass(frozen=True)
class LeastConstraint:
    """Gauss: the velocities nearest to the free ones in kinetic energy among those with u = Hᵀ v + w ≥ 0, as min ½‖y‖² over G y ≥ g.

    y = M^(1/2) (v − v_free)/size, rows of unit length; H (d, n), inverse mass and free velocity (d,), w (n,).
    """

    g: Array  # (n,)
    matrix: Array  # G (n, d)
    length: Array  # (n,) of the rows before
    size: float

    @classmethod
    def of(cls, h: Array, inverse_mass: Array, free: Array, shift: Array) -> LeastConstraint:
        """The data, scaled to order one."""
        rows = h.T * np.sqrt(inverse_mass)
        length = np.linalg.norm(rows, axis=1)
        approach = -(h.T @ free + shift) / length
        size = float(np.linalg.norm(np.maximum(approach, 0.0)))
        return cls(approach / size, rows / length[:, None], length, size)

    def velocities(self) -> Array:
        """u (n,), exactly, by the active sets of Lawson and Hanson (1974, chapter 23) through scipy."""
        from scipy.optimize import nnls

        table = np.vstack([self.matrix.T, self.g])
        last = np.zeros(len(table))
        last[-1] = 1.0
        x, _ = nnls(table, last, maxiter=100 * table.shape[1])
        r = table @ x - last
        return self.size * self.length * (self.matrix @ (-r[:-1] / r[-1]) - self.g)

    def optimum(self) -> float:
        """½‖M^(1/2) (v − v_free)‖² at the minimum, by an interior point (clarabel) through cvxpy, to 1e-9 or better.

        Raises `ConvergenceError` when that is not reached.
        """
        import cvxpy as cp

        y = cp.Variable(self.matrix.shape[1])
        program = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(y)), [self.matrix @ y >= self.g])
        names = [f"{reduced}tol_{name}" for reduced in ("", "reduced_") for name in ("gap_abs", "gap_rel", "feas")]
        for tolerance in (1e-12, 1e-11, 1e-10, 1e-9):  # dependent rows may put the tightest out of reach
            try:
                found: Any = program.solve(solver=cp.CLARABEL, **dict.fromkeys(names, tolerance))
                return self.size**2 * float(found)
            except cp.SolverError:
                continue
        raise ConvergenceError(f"the quadratic program ended with status {program.status}")


class ConeStep:
    """min ½ r·W r + (q + μ s n)·r over r ∈ K, for any s [m/s]; W dense (3n, 3n), normal first; where μ = 0 there is no r_T."""

    def __init__(self, matrix: Array, q: Array, mu: Array) -> None:
        import clarabel
        from scipy import sparse

        self.matrix, self.q, self.mu = matrix, q, mu
        smooth, rough = np.flatnonzero(mu == 0.0), np.flatnonzero(mu > 0.0)
        self._kept = np.concatenate([3 * smooth, (3 * rough[:, None] + np.arange(3)).ravel()])
        a = np.repeat(1.0 / np.sqrt(np.diag(matrix)[0::3]), 3)
        self._size, self._a = float(np.max(np.abs(a * q))), a[self._kept]
        scaled = matrix[np.ix_(self._kept, self._kept)] * self._a[:, None] * self._a
        weight = np.concatenate([np.ones(smooth.size), np.column_stack([mu[rough], np.ones((rough.size, 2))]).ravel()])
        cones = [clarabel.NonnegativeConeT(smooth.size)] * bool(smooth.size) + [
            clarabel.SecondOrderConeT(3)
        ] * rough.size
        settings = clarabel.DefaultSettings()
        settings.verbose = settings.presolve_enable = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        upper, rows = sparse.csc_matrix(np.triu(scaled)), sparse.csc_matrix(sparse.diags(-weight))
        self._solver = clarabel.DefaultSolver(
            upper, np.zeros(weight.size), rows, np.zeros(weight.size), cones, settings
        )

    def solve(self, s: Array) -> Array:
        """r (3n,) for s (n,). Raises `ConvergenceError` when the interior point method gives none."""
        linear = self.q.copy()
        linear[0::3] += self.mu * s
        self._solver.update(q=self._a * linear[self._kept] / self._size)
        solution = self._solver.solve()
        x = np.asarray(solution.x)
        if not np.all(np.isfinite(x)):
            raise ConvergenceError(f"the cone program ended with status {solution.status}")
        r = np.zeros(len(self.q))
        r[self._kept] = self._size * self._a * x
        return r

    def slip(self, r: Array) -> Array:
        """‖u_T‖ (n,) [m/s]."""
        u = self.matrix @ r + self.q
        return np.hypot(u[1::3], u[2::3])


def cone_fixed_point(step: ConeStep, *, limit: int = 200, tolerance: float = 1e-10) -> tuple[Array, int]:
    """r (3n,) where s ← ‖u_T(s)‖ from s = 0 stands still up to `tolerance` of its size (or after `limit` programs), and how many."""
    s = np.zeros(len(step.mu))
    r = step.solve(s)
    for turn in range(2, limit + 1):
        new = step.slip(r)
        change = float(np.max(np.abs(new - s))) / float(np.max(new, initial=1e-300))
        s = new
        r = step.solve(s)
        if change < tolerance:
            return r, turn
    return r, limit


def natural_map(u: Array, r: Array, mu: Array, rho: Array) -> Array:
    """‖r − P_K(r − ρ û)‖ per contact (n,) from u, r (3n,) and ρ (n,)."""
    u, r = u.reshape(-1, 3), r.reshape(-1, 3)
    z = r - rho[:, None] * u
    z[:, 0] -= rho * mu * np.hypot(u[:, 1], u[:, 2])
    t = np.hypot(z[:, 1], z[:, 2])
    foot = np.zeros_like(z)
    inside = (z[:, 0] >= 0.0) & (t <= mu * z[:, 0])
    side = ~inside & (mu * t > -z[:, 0])  # neither in the cone nor in its polar
    foot[inside] = z[inside]
    m, unit = mu[side], z[side, 1:] / np.where(t[side] > 0.0, t[side], 1.0)[:, None]
    generator = np.column_stack([np.ones(m.size), m[:, None] * unit]) / np.sqrt(1.0 + m**2)[:, None]
    foot[side] = np.maximum(np.sum(generator * z[side], axis=1), 0.0)[:, None] * generator
    return np.linalg.norm(r - foot, axis=1)
