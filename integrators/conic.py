"""The implicit step as a conic program: the incremental variational principle, declared through cvxpy.

    min ψ(ε, X) + φ(X − X_n)   over ε, X   subject to   ε = ε_{n+1},

where φ, the support function of {f_j ≤ 0}, is written with multipliers: for f_j = Σ_i a_ji ‖L_ji A‖ + ℓ_j(A) − k_j,

    φ(Δ) = min Σ_j k_j γ_j   subject to   Δ = Σ_j (γ_j ∇ℓ_j + Σ_i L_jiᵀ D_ji),  ‖D_ji‖ ≤ a_ji γ_j.

The stress is the multiplier of ε = ε_{n+1}. Built from the declared atoms of ψ and φ*, independently of the closed form:
quadratic terms by a factor of their Hessian, ⟨x⟩² as a squared positive part, T^≥:T^≥ as min ‖T + N‖² over N ⪰ 0 (the distance
to the negative semidefinite tensors). Strains are counted in a yield strain and stresses in a yield stress, so that the
program is well conditioned. The answer of the interior point is polished on the canonical data (see `polish`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..errors import ConvergenceError, InputError
from ..potentials import Law
from .atoms import ConvexAtoms, FlowAtoms, energy_atoms, flow_atoms
from .closed import state_layout
from .convexity import worst_direction
from .polish import ConeSizes, Program, polish

__all__ = ["ConicSolution", "ConicStep", "conic_step"]


@dataclass(frozen=True)
class ConicSolution:
    """Solution of one step: `stress` [Pa] (6,), `state` by name, `objective` [J/m³], `status` text and the
    `residual`, the natural map of the whole program in its scaled units (zero at the solution and nowhere else)."""

    stress: np.ndarray
    state: dict[str, Any]
    objective: float
    status: str
    residual: float


@dataclass(frozen=True)
class ConicStep:
    """The declared program of one step at one point; `.problem` is the cvxpy problem, in scaled units."""

    law: Law
    problem: Any
    strain_constraint: Any
    state_variable: Any
    old: np.ndarray
    strain_unit: float
    energy_unit: float
    offset: float

    def solve(self, **options: Any) -> ConicSolution:
        """Solve by clarabel and polish; `options` go to clarabel. Raises `ConvergenceError` if no solution is found."""
        import cvxpy

        data, chain, inverse = self.problem.get_problem_data(cvxpy.CLARABEL, solver_opts={})
        program = _program(data)
        found: Any = None
        status, best = "", np.inf
        for tolerance, equilibrate in ((1e-9, True), (1e-11, True), (1e-10, False), (1e-8, True)):
            settings = {
                **dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance),
                "max_iter": 200,
                "equilibrate_enable": equilibrate,
                **options,
            }
            raw = chain.solver.solve_via_data(data, False, False, settings)
            status = str(raw.status)
            x, z = np.array(raw.x, dtype=float), np.array(raw.z, dtype=float)
            if "Infeasible" in status:
                break
            if not (np.isfinite(x).all() and np.isfinite(z).all()):
                continue
            # an interior point stops at about the square root of its gap from a degenerate optimum; the polish does not
            x, z, residual = polish(program, x, z)
            if residual < best:
                found, best = (x, z), residual
            if best <= 1e-10:
                break
        if found is None or not best <= 1e-8:
            raise ConvergenceError(
                f"law '{self.law.name}': the conic program has no solution here: clarabel says '{status}'"
            )
        x, z = found
        value = float(0.5 * x @ program.P @ x + program.q @ x)
        done = SimpleNamespace(x=x, z=z, status="Solved", obj_val=value, solve_time=0.0, iterations=0)
        self.problem.unpack_results(done, chain, inverse)
        stress = -np.asarray(self.strain_constraint.dual_value).reshape(6) * self.energy_unit / self.strain_unit
        change = (
            np.zeros(0)
            if self.state_variable is None
            else np.asarray(self.state_variable.value).reshape(-1) * self.strain_unit
        )
        packed = self.old + change
        layout, _ = state_layout(self.law)
        state = {n: packed[s] if length == 1 else packed[s : s + 6] for n, (s, length) in layout.items()}
        return ConicSolution(
            stress, state, float(self.problem.value) * self.energy_unit + self.offset, self.problem.status, best
        )


def conic_step(law: Law, eps_new: Any, state: Mapping[str, Any] | None, values: Mapping[str, Any]) -> ConicStep:
    """Declare the program of one step at one point: strain (6,), `state` by name or None, parameters by name.

    Raises `InputError` for bad input and `DeclarationError` where an atom of the law has no conic form.
    """
    eps = np.asarray(eps_new, dtype=float).reshape(-1)
    if eps.shape != (6,) or not np.isfinite(eps).all():
        raise InputError(f"conic: the strain has shape {np.shape(eps_new)}; it must be six finite Mandel components")
    law.check_evolution()
    numbers = law.values(values)
    layout, size = state_layout(law)
    old = np.zeros(size)
    for name, (start, length) in layout.items():
        if state is not None:
            if name not in state:
                raise InputError(f"law '{law.name}': the state lacks the internal variable '{name}'")
            old[start : start + length] = np.asarray(state[name], dtype=float).reshape(length)
    return declare(law, energy_atoms(law, numbers), flow_atoms(law, numbers), eps, old)


def declare(law: Law, energy: ConvexAtoms, flow: FlowAtoms, eps: np.ndarray, old: np.ndarray) -> ConicStep:
    """The cvxpy problem, in units of `strain_unit` and `energy_unit`."""
    import cvxpy as cp

    size = old.size
    stiffness = (
        float(np.abs(np.diag(energy.hessian)).max(initial=0.0))
        or max((w for w, *_ in energy.spectral), default=1.0)
        or 1.0
    )
    limit = max((abs(k) for k in flow.limits), default=0.0)
    point = np.concatenate([eps, old])
    force = energy.hessian @ point + energy.linear
    # the unit of strain follows the size of the step; the yield strain bounds it from below
    strain_unit = (
        max(limit / stiffness, float(np.abs(force).max(initial=0.0)) / stiffness, float(np.abs(eps).max(initial=0.0)))
        or 1.0
    )
    energy_unit = stiffness * strain_unit**2
    x_eps = cp.Variable(6)
    x_new = cp.Variable(size) if size else None
    change = x_eps if x_new is None else cp.hstack([x_eps, x_new])
    base = np.concatenate([eps, old])
    # variables: ε = eps + (x_eps) u, X = old + (x_new) u; quadratic part expanded about the base point
    if worst_direction(energy.hessian) is not None or any(w < 0.0 for w, *_ in (*energy.positive, *energy.spectral)):
        raise InputError(f"law '{law.name}': psi is not convex for these values; softening is not modelled")
    for k in flow.limits:
        if k < 0.0:
            raise InputError(
                f"law '{law.name}': f = {-k:g} at zero force; zero force would lie outside the elastic domain of phi_star"
            )
    values, vectors = np.linalg.eigh(energy.hessian / stiffness)
    keep = values > 1e-14 * max(values.max(initial=0.0), 1e-300)
    factor = np.sqrt(values[keep])[:, None] * vectors[:, keep].T
    slope = force * strain_unit / energy_unit
    objective = 0.5 * cp.sum_squares(factor @ change) + slope @ change
    offset = 0.5 * base @ energy.hessian @ base + energy.linear @ base + energy.constant
    constraints: list[Any] = []
    for weight, row, shift in energy.positive:
        start = (row @ base + shift) / strain_unit
        objective = objective + (weight * strain_unit**2 / energy_unit) * cp.square(cp.pos(row @ change + start))
    for weight, coefficient, shift in energy.spectral:
        target = coefficient * x_eps + (coefficient * eps + shift) / strain_unit
        part = _matrix(cp, target) + cp.Variable((3, 3), PSD=True)
        objective = objective + (weight * strain_unit**2 / energy_unit) * cp.sum_squares(part)
    if x_new is not None:
        gamma = cp.Variable(len(flow.limits))
        constraints.append(gamma >= 0)
        total: Any = 0
        for j, (linear, norms) in enumerate(zip(flow.linear, flow.norms, strict=True)):
            total = total + gamma[j] * linear
            for a, operator in norms:
                direction = cp.Variable(6)
                constraints.append(cp.norm(direction, 2) <= a * gamma[j])
                total = total + operator.T @ direction
        constraints.append(x_new == total)
        objective = objective + (np.array(flow.limits) * strain_unit / energy_unit) @ gamma
    fixed = x_eps == np.zeros(6)
    problem = cp.Problem(cp.Minimize(objective), [fixed, *constraints])
    return ConicStep(law, problem, fixed, x_new, old, strain_unit, energy_unit, float(offset))


def _program(data: Any) -> Program:
    """Canonical data of cvxpy for clarabel, dense."""
    sizes = data["dims"]
    upper = np.triu(data["P"].toarray()) if data.get("P") is not None else np.zeros((data["c"].size,) * 2)
    cones = ConeSizes(sizes.zero, sizes.nonneg, tuple(sizes.soc), tuple(sizes.psd))
    return Program(upper + np.triu(upper, 1).T, data["c"], data["A"].toarray(), data["b"], cones)


def _matrix(cp: Any, mandel: Any) -> Any:
    half = np.sqrt(0.5)
    a, b, c = mandel[0], mandel[1], mandel[2]
    f, e, d = half * mandel[3], half * mandel[4], half * mandel[5]
    return cp.bmat([[a, d, e], [d, b, f], [e, f, c]])
