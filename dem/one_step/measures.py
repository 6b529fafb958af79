r"""How good is a reaction? Every error measure of a one-step problem, from r, W, q and μ alone.

Nothing here is shared with the solvers, so that a claim of convergence is a statement of two codes. With u = W r + q,
û = u + μ‖u_T‖ n, ρ > 0 and the natural map F_ρ(r) = r − P_K(r − ρ û), zero exactly at solutions:

* `natural_map_q` = ‖F_1‖/‖q‖ (Acary, Brémond and Huber 2018, eq. 127);
* `natural_map_max` = ‖F_1‖/max(‖q‖, ‖r‖, ‖u‖);
* `natural_map_scaled` = ‖F_ρ‖/‖r‖ with ρ = 1/W_NN of each contact: the same in any units (with r = 0: ‖q‖/W̄_NN in place of ‖r‖);
* `gap` = r·û/max(|r·q|, ε);
* `reaction_violation`, `velocity_violation`: largest distance of r from K and of û from K*, relative to ‖r‖ and ‖q‖.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import OneStepProblem

__all__ = ["ContactErrors", "measure", "onto_cone", "worst_contacts"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactErrors:
    """The measures of this module by name; all dimensionless, all zero at a solution."""

    natural_map_max: float
    natural_map_q: float
    natural_map_scaled: float
    gap: float
    reaction_violation: float
    velocity_violation: float

    @property
    def worst(self) -> float:
        """What convergence is judged by: the larger of `natural_map_q` and `natural_map_scaled`."""
        return max(self.natural_map_q, self.natural_map_scaled)

    def as_dict(self) -> dict[str, float]:
        """By name."""
        return asdict(self)


def onto_cone(r: Array, mu: Array) -> Array:
    """Projection of r (3n,) on K = Π {‖r_T‖ ≤ μ r_N}."""
    blocks = r.reshape(-1, 3)
    normal, size = blocks[:, 0], np.hypot(blocks[:, 1], blocks[:, 2])
    out = blocks.copy()
    along = (normal + mu * size) / (1.0 + mu * mu)  # of the foot on the generator
    outside = (size > mu * normal) | (normal < 0.0)
    polar = outside & (along <= 0.0)
    side = outside & ~polar
    out[polar] = 0.0
    out[side, 0] = along[side]
    with np.errstate(invalid="ignore", divide="ignore"):
        out[side, 1:] *= (mu[side] * along[side] / size[side])[:, None]
    return out.ravel()


def _residual(problem: OneStepProblem, r: Array, rho: Array | float) -> tuple[Array, Array, Array]:
    u = problem.velocity(r)
    hat = u.copy()
    hat[0::3] += problem.mu * np.hypot(u[1::3], u[2::3])
    return r - onto_cone(r - rho * hat, problem.mu), u, hat


def _ratio(error: float, size: float) -> float:
    return 0.0 if error == 0.0 else error / size if size > 0.0 else float("inf")


def _normal_scale(problem: OneStepProblem) -> Array:
    """ρ = 1/W_NN per contact (1 over the mean where a contact has no mobility)."""
    diagonal = problem.delassus.diagonal()[0::3]
    mobile = diagonal > 0.0
    mean = diagonal[mobile].mean() if mobile.any() else 1.0
    return 1.0 / np.where(mobile, diagonal, mean)


def measure(problem: OneStepProblem, r: Array) -> ContactErrors:
    """All measures of the reactions `r` (3n,); infinite where r is not finite."""
    if problem.contact_count == 0:
        return ContactErrors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not np.all(np.isfinite(r)):
        return ContactErrors(*[float("inf")] * 6)
    rho = _normal_scale(problem)
    plain, u, hat = _residual(problem, r, 1.0)
    scaled = _residual(problem, r, np.repeat(rho, 3))[0]
    norm_q, norm_r = float(np.linalg.norm(problem.q)), float(np.linalg.norm(r))
    error = float(np.linalg.norm(plain))
    size = norm_r if norm_r > 0.0 else norm_q * float(np.mean(rho))
    gap = abs(float(r @ hat))
    violation_r = float(np.linalg.norm(r - onto_cone(r, problem.mu)))
    # K*: û_N ≥ μ‖û_T‖, that is u_N ≥ 0
    violation_u = float(np.max(np.maximum(0.0, -u[0::3]), initial=0.0))
    return ContactErrors(
        natural_map_max=_ratio(error, max(norm_q, norm_r, float(np.linalg.norm(u)))),
        natural_map_q=_ratio(error, norm_q),
        natural_map_scaled=_ratio(float(np.linalg.norm(scaled)), size),
        gap=_ratio(gap, max(abs(float(r @ problem.q)), 1e-16 * norm_r * norm_q)),
        reaction_violation=_ratio(violation_r, norm_r),
        velocity_violation=_ratio(violation_u, norm_q),
    )


def worst_contacts(problem: OneStepProblem, r: Array, count: int = 5) -> list[tuple[int, float]]:
    """The contacts that carry most of the scaled residual: (index, share of the squared residual), largest first."""
    if problem.contact_count == 0:
        return []
    error = _residual(problem, r, np.repeat(_normal_scale(problem), 3))[0]
    squared = np.sum(error.reshape(-1, 3) ** 2, axis=1)
    total = squared.sum()
    order = np.argsort(-squared)[:count]
    return [(int(k), float(squared[k] / total)) for k in order if squared[k] > 0.0]
