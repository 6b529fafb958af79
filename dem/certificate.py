r"""The one-step problem without friction as a convex program, and the Delassus operator that both views share.

Unknowns x ≥ 0: normal impulses of contacts and walls and tensions of unilateral links (rods: free). With signed normals D (contacts push,
links pull), u = u_free + W x, the step solves

    min ½ xᵀ (W + C) x + bᵀ x ,  x ≥ 0 on unilateral rows  ⇔  0 ≤ x ⊥ (W + C) x + b ≥ 0 ,

a QP, equivalently an LCP (theory: Jean 1999; Acary and Brogliato 2008). Velocities are unique; impulses too wherever C > 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from .stepping import Drive, Simulation

__all__ = ["ContactProgram", "contact_program"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactProgram:
    """min ½ xᵀ (Hᵀ M⁻¹ H + C) x + bᵀ x over x ≥ 0 on `unilateral` rows; rows in the order contacts, walls, links."""

    h: Array  # (row_count, dof_count): H transposed, generalised directions of the rows
    inverse_mass: Array  # (dof_count,)
    compliance: Array  # (row_count,) C
    b: Array  # (row_count,) free velocity plus g/h or −β
    unilateral: NDArray[np.bool_]

    @property
    def delassus(self) -> Array:
        """W = Hᵀ M⁻¹ H, symmetric positive semidefinite, shape (row_count, row_count)."""
        return (self.h * self.inverse_mass) @ self.h.T

    def solve(self) -> Array:
        """Impulses by clarabel through cvxpy, in the scaling where W + C has unit diagonal. Raises `ConvergenceError`."""
        import cvxpy as cp

        matrix = self.delassus + np.diag(self.compliance)
        scale = 1.0 / np.sqrt(np.diag(matrix))
        size = float(np.max(np.abs(scale * self.b))) or 1.0
        # ½‖L y‖² keeps the program positive semidefinite by construction
        factor = (
            np.concatenate([np.sqrt(self.inverse_mass)[:, None] * self.h.T, np.diag(np.sqrt(self.compliance))]) * scale
        )
        y = cp.Variable(len(self.b))
        bounds: list[cp.Constraint] = [y[self.unilateral] >= 0.0] if self.unilateral.any() else []
        problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(factor @ y) + (scale * self.b / size) @ y), bounds)
        # hyperstatic rigid packings have no unique impulse: the tightest tolerance may be out of reach
        for tolerance in (1e-12, 1e-10, 1e-8):
            try:
                problem.solve(
                    solver=cp.CLARABEL,
                    tol_gap_abs=tolerance,
                    tol_gap_rel=tolerance,
                    tol_feas=tolerance,
                    reduced_tol_gap_abs=tolerance,
                    reduced_tol_gap_rel=tolerance,
                    reduced_tol_feas=tolerance,
                )
            except cp.SolverError:
                continue
            if problem.status == "optimal" and y.value is not None:
                return self._polish(scale * size * np.asarray(y.value))
        raise ConvergenceError(
            f"the convex program of the step ended with status {problem.status}: check the scene for rows without mass"
        )

    def _polish(self, x: Array) -> Array:
        """Primal–dual active-set steps from the interior point; the iterate of least residual is returned."""
        matrix = self.delassus + np.diag(self.compliance)
        diagonal = np.diag(matrix)
        best, least = x, self.residual(x)
        for _ in range(30):
            active = ~self.unilateral | (x * diagonal > matrix @ x + self.b)
            inner = matrix[np.ix_(active, active)]
            step = np.zeros_like(x)
            step[active] = x[active] - np.linalg.lstsq(inner, inner @ x[active] + self.b[active], rcond=1e-12)[0]
            x = step
            if self.residual(x) < least:
                best, least = x, self.residual(x)
            if least < 1e-14:
                break
        return best

    def residual(self, x: Array) -> float:
        """Natural map of the complementarity, ‖x − P(x − ρ((W+C)x + b))‖/‖x‖ with ρ = 1/diag(W+C)."""
        matrix = self.delassus + np.diag(self.compliance)
        trial = x - (matrix @ x + self.b) / np.diag(matrix)
        error = x - np.where(self.unilateral, np.maximum(trial, 0.0), trial)
        return float(np.linalg.norm(error) / max(np.linalg.norm(x), 1e-300))


def contact_program(simulation: Simulation, step: float, drive: Drive) -> ContactProgram:
    """The convex program of the next step of a frictionless simulation; the assembly is left as it is.

    Raises `InputError` when the material has friction: the step is then no convex program (theory §10).
    """
    if simulation.kernels.rule.friction or any(plane.friction for plane in simulation.planes):
        raise InputError("a step with Coulomb friction is no convex program: set friction = 0, or read the natural map")
    if simulation.planes or simulation.kernels.dimension != 3:
        raise InputError("the convex program is written for a box in three dimensions: leave planes out")
    wire = simulation.kernels.wire
    probe = Simulation(simulation.assembly.copy(), simulation.laws, simulation.solver, skin=simulation.skin)
    _, free, _, box_free, _, rows = probe.assemble(step, drive)
    bodies = len(free)
    count = len(rows.pair) + len(rows.wall) + len(rows.link)
    h = np.zeros((count, 3 * bodies + 3))
    compliance = np.zeros(count)
    shift = np.zeros(count)
    unilateral = np.ones(count, dtype=bool)
    k = 0
    for (i, j), row in zip(rows.pair, rows.contact, strict=True):
        h[k, 3 * i : 3 * i + 3] = row[0:3]
        h[k, 3 * j : 3 * j + 3] = -row[0:3]
        compliance[k], shift[k] = rows.cn, row[9]
        k += 1
    for (i, axis, side), row in zip(rows.wall, rows.wall_row, strict=True):
        h[k, 3 * i + axis] = -side
        h[k, 3 * bodies + axis] = 1.0
        compliance[k], shift[k] = rows.cn, row[1]
        k += 1
    tension_only = wire is not None and wire.rule().unilateral
    for (i, j), row in zip(rows.link, rows.link_row, strict=True):
        h[k, 3 * i : 3 * i + 3] = -row[0:3]
        h[k, 3 * j : 3 * j + 3] = row[0:3]
        compliance[k], shift[k], unilateral[k] = row[6], -row[4], tension_only
        k += 1
    velocity = np.concatenate([free[:, 0:3].ravel(), box_free[:, 0]])
    inverse_mass = np.concatenate([np.repeat(free[:, 6], 3), box_free[:, 1]])
    return ContactProgram(h, inverse_mass, compliance, h @ velocity + shift, unilateral)
