"""Duality gap of a computed step, evaluated outside the generated code.

For increments Δ and forces Y at the end of the step, both admissible, primal minus dual is the Fenchel residual

    gap = φ(Δ) + φ*(Y) − Y·Δ ≥ 0,

as the state laws hold exactly by construction. Where the computed pair is not exactly admissible, the residual is
bounded by what it takes to make it so: f(Y)₊ γ for the forces, and the excess of the flow over its cone for the increments.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .atoms import energy_atoms, flow_atoms
from .update import Array, Update

__all__ = ["duality_gap"]


def duality_gap(update: Update, eps: Array, old: Array, new: Array, values: Array) -> Array:
    """Gap [J/m³] per point, shape (n,); sizes of violations are counted in, so that a wrong step cannot show a small gap."""
    law = update.law
    numbers = {p.name: float(v) for p, v in zip(law.parameters, values, strict=True)}
    if not law.surfaces:
        return np.zeros(len(eps))
    energy, flow = energy_atoms(law, numbers), flow_atoms(law, numbers)
    z = np.concatenate([eps, new], axis=1)
    force = -(z @ energy.hessian + energy.linear)[:, 6:]
    delta = new - old
    row, limit, norms = flow.linear[0], flow.limits[0], flow.norms[0]
    f = force @ row - limit + sum((a * np.linalg.norm(force @ m.T, axis=1) for a, m in norms), np.zeros(len(eps)))
    gamma, residual = _multiplier(delta, row, norms)
    size = np.linalg.norm(force, axis=1)
    return np.abs(gamma * limit - np.einsum("ij,ij->i", force, delta)) + gamma * np.maximum(f, 0.0) + residual * size


def _multiplier(delta: Array, row: Array, norms: Any) -> tuple[Array, Array]:
    """Smallest γ with Δ = γ ℓ + LᵀD, ‖D‖ ≤ aγ, and by how much Δ misses that form."""
    if norms:
        a, operator = norms[0]
        basis = np.column_stack([row, operator.T])
    else:
        a, basis = 0.0, row[:, None]
    found = delta @ np.linalg.pinv(basis).T
    missed = np.linalg.norm(delta - found @ basis.T, axis=1)
    gamma = found[:, 0]
    if norms:
        shear = np.linalg.norm(
            found[:, 1:] @ (np.eye(6) - np.outer(np.r_[1, 1, 1, 0, 0, 0], np.r_[1, 1, 1, 0, 0, 0]) / 3.0), axis=1
        )
        if not row.any():
            gamma = shear / a
        missed = missed + np.maximum(shear - a * gamma, 0.0)
    return gamma, missed + np.maximum(-gamma, 0.0)
