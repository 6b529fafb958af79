r"""One-step contact problems solved a second time, by means that share nothing with the solvers of `fenchel.dem`.

* `lemke`: complementary pivoting for 0 ≤ x ⊥ W x + q ≥ 0; it ends at a solution for every positive semidefinite W for which there is one
  (Cottle, Pang and Stone 1992), followed by one exact solve on the set of rows that it found.
* `quadratic_program`: the same problem as min ½ x·W x + q·x over x ≥ 0, an interior point method (clarabel) through cvxpy.
* `cone_fixed_point`: with s = ‖u_T‖ frozen a step with friction is a second-order cone program; s ← ‖u_T(s)‖ until it stands still
  (Acary, Cadoux, Lemaréchal and Malick 2011).
* `natural_map`: r − P_K(r − ρ û) contact by contact, û = u + μ‖u_T‖ n, ρ = 1/W_NN (de Saxcé and Feng 1998); the projection by cases.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError

__all__ = ["ConeStep", "cone_fixed_point", "least_constraint", "lemke", "natural_map"]

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


# as far as the interior point goes: where rows depend on each other it stops short of 1e-12 and says "inaccurate"
_TIGHT: dict[str, Any] = {f"tol_{name}": 1e-12 for name in ("gap_abs", "gap_rel", "feas")}
_TIGHT |= {f"reduced_{name}": 1e-7 for name in _TIGHT}


def least_constraint(h: Array, inverse_mass: Array, free: Array, shift: Array) -> Array:
    """Multipliers x (n,) of: the velocities nearest to the free ones in kinetic energy with Hᵀ v + w ≥ 0 (Gauss); H (d, n), w (n,).

    Raises `ConvergenceError` when the interior point method gives none.
    """
    import cvxpy as cp

    q = h.T @ free + shift
    rows = h.T * np.sqrt(inverse_mass)
    length, size = np.linalg.norm(rows, axis=1), float(np.max(np.abs(q)))
    # y = M^(1/2) (v − v_free) / size
    y = cp.Variable(len(free))
    bounds = [(rows / length[:, None]) @ y + q / (size * length) >= 0]
    program = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(y)), bounds)
    program.solve(solver=cp.CLARABEL, **_TIGHT)
    if bounds[0].dual_value is None:
        raise ConvergenceError(f"the quadratic program ended with status {program.status}")
    # the interior point says which rows hold; the values are those of these rows, corrected until none changes side
    matrix, x = rows @ rows.T, size / length * np.asarray(bounds[0].dual_value)
    active = x * length**2 > matrix @ x + q
    for _ in range(30):
        x = _on_rows(matrix, q, np.flatnonzero(active))
        u = matrix @ x + q
        if min(x.min() / x.max(), u.min() / size) > -1e-13:
            break
        active = x * length**2 > u
    return x


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
