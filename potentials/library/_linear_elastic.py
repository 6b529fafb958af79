"""Isotropic linear elasticity, ψ = ½ ε:𝕂ε."""

from __future__ import annotations

from ..law import Law
from ..stiffness import isotropic
from ._symbols import E, eps, nu

linear_elastic = Law(
    "linear_elastic", psi=isotropic(E, nu).energy(eps), observable=eps, note="isotropic linear elasticity"
)
