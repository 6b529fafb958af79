"""Isotropic linear elasticity, ψ = ½ ε:𝕂ε."""

from __future__ import annotations

from .. import Law, isotropic
from ._entry import Entry, WorkedValue
from ._symbols import E, eps, nu

linear_elastic = Law(
    "linear_elastic", psi=isotropic(E, nu).energy(eps), observable=eps, note="isotropic linear elasticity"
)

ENTRY = Entry(
    linear_elastic,
    source="Hooke 1678; Lamé 1852",
    values=dict(E=12e6, nu=0.2),
    worked=WorkedValue(
        eps=(1e-3, 0, 0, 0, 0, 0),
        stress=(40000 / 3, 10000 / 3, 10000 / 3, 0, 0, 0),
        source="closed form: (λ + 2μ, λ, λ) ε₁₁ with λ = E/3.6, μ = E/2.4",
    ),
)
