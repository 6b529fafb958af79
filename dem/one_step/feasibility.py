r"""Has a problem any admissible velocity? A proof that it has none, or a proof that a solution exists.

û ∈ K* is the same as u_N ≥ 0. If some z ≥ 0 on the normals has  −Wᵀ(z n) ∈ K*  and  q·(z n) < 0,  then z·u_N < 0 for every r ∈ K: no
reaction keeps the bodies apart, there is **no solution** (Farkas). Such a z is found by a cone program and then checked in plain algebra;
since −Wᵀ(z n) ∈ K* holds up to round-off only, the proof names the size of reactions up to which it excludes solutions.

A velocity v with Hᵀv + w in the *interior* of K* (symmetric W; in local form u ∈ q + range W) proves that **a solution exists**
(Acary, Cadoux, Lemaréchal and Malick 2011; Klarbring and Pang 1998). It fails where walls or floors allow self-stress.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .blocks import scaled_blocks
from .measures import onto_cone
from .problem import OneStepProblem

__all__ = ["Infeasibility", "check_infeasibility", "find_infeasibility", "interior_velocity"]

Array = NDArray[np.float64]

_CREDIBLE = 1e6  # reactions up to this multiple of the natural size must be excluded


@dataclass(frozen=True)
class Infeasibility:
    """A proof that no reactions keep the bodies apart: multipliers z ≥ 0 of the normals, and what they exclude."""

    multiplier: Array  # (n,)
    excluded: float  # no solution has Σ(1 + μ) a⁻¹-scaled reactions below this multiple of max|a q|
    contacts: tuple[int, ...]  # those that squeeze each other, heaviest first


def check_infeasibility(problem: OneStepProblem, multiplier: Array) -> float:
    """The scaled size of reactions below which z proves that no solution exists; 0 if it proves nothing.

    With −q·(zn) = 1 after scaling, z·u_N = −1 + r·Wᵀ(zn) ≤ −1 + ε Σ‖r_i‖, where ε is the largest distance of −Wᵀ(zn) from K*.
    """
    normal = problem.delassus.diagonal()[0::3]
    a = 1.0 / np.sqrt(np.where(normal > 0.0, normal, normal[normal > 0.0].mean() if np.any(normal > 0.0) else 1.0))
    if np.any(multiplier < 0.0):
        return 0.0
    c = float(np.max(np.repeat(a, 3) * np.abs(problem.q), initial=0.0))
    vector = np.zeros(3 * problem.contact_count)
    vector[0::3] = multiplier
    work = -float(vector @ problem.q)
    if work <= 0.0 or c == 0.0:
        return 0.0
    vector /= work
    pushed = -(problem.delassus.T @ vector) * np.repeat(a, 3) * c  # acts on x = r/(c a)
    outside = onto_cone(-pushed, problem.mu).reshape(-1, 3)  # the part of −Wᵀ(zn) that K* does not hold (Moreau)
    epsilon = float(np.max(np.linalg.norm(outside, axis=1), initial=0.0))
    rounding = 1e-16 * float(np.max(np.abs(pushed), initial=0.0))
    return 1.0 / max(epsilon, rounding, 1e-300)


def find_infeasibility(problem: OneStepProblem, *, time_limit: float = np.inf) -> Infeasibility | None:
    """A proof that the problem has no solution, or None where none was found (which proves nothing)."""
    import clarabel

    n = problem.contact_count
    if n == 0 or np.all(problem.q[0::3] >= 0.0):
        return None
    blocks = scaled_blocks(problem)
    a = 1.0 / np.sqrt(blocks.mobility)
    scale = sp.diags(np.repeat(a, 3))
    w = sp.csc_matrix(scale @ problem.delassus @ scale)
    q = problem.q * np.repeat(a, 3)
    q = q / max(float(np.max(np.abs(q))), 1e-300)
    # minimise q_N·z over 0 ≤ z, Σz ≤ 1, −Wᵀ(zn) ∈ K*, its normal rows divided by μ
    columns = w.T[:, 0::3]
    rows = sp.csc_matrix(-columns)
    factor = np.ones(3 * n)
    factor[0::3] = 1.0 / np.where(problem.mu > 0.0, problem.mu, 1.0)
    order, cones = [], []
    smooth = problem.mu == 0.0
    for i in np.flatnonzero(smooth):
        order.append([3 * i])
    count = len(order)
    order += [[3 * i, 3 * i + 1, 3 * i + 2] for i in np.flatnonzero(~smooth)]
    rows = sp.csc_matrix(sp.diags(factor) @ rows)[np.concatenate(order)]
    matrix = sp.csc_matrix(sp.vstack([-sp.identity(n), sp.csr_matrix(np.ones((1, n))), -rows]))
    right = np.zeros(matrix.shape[0])
    right[n] = 1.0
    cones = [clarabel.NonnegativeConeT(n + 1 + count)] + [clarabel.SecondOrderConeT(3)] * int((~smooth).sum())
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = 1e-11
    settings.time_limit = float(min(time_limit, 1e9))
    solution = clarabel.DefaultSolver(sp.csc_matrix((n, n)), q[0::3], matrix, right, cones, settings).solve()
    z = np.maximum(np.asarray(solution.x), 0.0)
    if not np.all(np.isfinite(z)) or q[0::3] @ z >= -1e-9 * max(float(np.sum(z)), 1e-300):
        return None
    z[z < 1e-9 * z.max()] = 0.0
    multiplier = z * a
    excluded = check_infeasibility(problem, multiplier)
    if excluded < _CREDIBLE:
        return None
    return Infeasibility(multiplier, excluded, tuple(int(k) for k in np.argsort(-z)[:6] if z[k] > 0.0))


def interior_velocity(problem: OneStepProblem, *, time_limit: float = np.inf) -> tuple[float, Array]:
    """max t with u_N ≥ μ‖u_T‖ + t at every contact (|v| bounded), in the scaled problem, and that u (3n,).

    t > 0 proves that a solution exists (W symmetric); t = 0 within the accuracy of the program, about 1e-8, decides nothing.
    """
    import clarabel

    n = problem.contact_count
    blocks = scaled_blocks(problem)
    a = 1.0 / np.sqrt(blocks.mobility)
    scale = np.repeat(a, 3)
    size = max(float(np.max(np.abs(problem.q) * scale, initial=0.0)), 1e-300)
    bodies = problem.bodies
    if bodies is None:
        free, step = problem.q, sp.csc_matrix(problem.delassus @ sp.diags(scale))
    else:  # u = Hᵀ v + w with v = M^(−1/2) y: the same unit for every degree of freedom
        root = 1.0 / np.sqrt(np.abs(bodies.mass.diagonal()))
        free, step = bodies.w, sp.csc_matrix(bodies.h.T @ sp.diags(root))
    dofs = step.shape[1]
    unit = np.tile([1.0, 0.0, 0.0], n)
    factor = np.ones(3 * n)
    factor[0::3] = 1.0 / np.where(problem.mu > 0.0, problem.mu, 1.0)
    # the cone rows: (u_N/μ − t/μ, u_T); the t column is scaled by its own row only
    image = sp.csr_matrix(sp.hstack([sp.diags(factor * scale) @ step, sp.csc_matrix(-(factor * unit)[:, None])]))
    smooth = problem.mu == 0.0
    order = np.concatenate([3 * np.flatnonzero(smooth), (3 * np.flatnonzero(~smooth)[:, None] + np.arange(3)).ravel()])
    top = sp.csr_matrix(([1.0], ([0], [dofs])), shape=(1, dofs + 1))
    matrix = sp.csc_matrix(sp.vstack([top, -image[order]]))
    right = np.concatenate([[1.0], (factor * scale * free / size)[order]])
    cones = [clarabel.NonnegativeConeT(1 + int(smooth.sum()))] + [clarabel.SecondOrderConeT(3)] * int((~smooth).sum())
    cost = np.zeros(dofs + 1)
    cost[dofs] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.time_limit = float(min(time_limit, 1e9))
    solution = clarabel.DefaultSolver(sp.csc_matrix((dofs + 1, dofs + 1)), cost, matrix, right, cones, settings).solve()
    u = free + size * (step @ np.asarray(solution.x)[:dofs])
    hat = u.reshape(-1, 3) * (a / size)[:, None]
    return float(np.min(hat[:, 0] - problem.mu * np.hypot(hat[:, 1], hat[:, 2]), initial=np.inf)), u
