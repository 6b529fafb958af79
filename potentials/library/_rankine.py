"""Rankine's tension cut-off with linear isotropic hardening: f = A_max + R − σ_t, R = −H_i p."""

from __future__ import annotations

from .. import Law, eig_max, forces, indicator, isotropic
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, eps, eps_p, nu, p, sigma_t

A, R = forces(eps_p, p, names="A R")

rankine = Law(
    "rankine",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator(eig_max(A) + R - sigma_t),
    observable=eps,
    internal=(eps_p, p),
    note="Rankine: the largest principal stress is limited, linear isotropic hardening",
)

ENTRY = Entry(
    rankine,
    source="Rankine 1857",
    values=dict(E=30e9, nu=0.2, sigma_t=3e6, H_i=3e9),
    worked=WorkedValue(
        eps=(3e-4, 0, 0, 0, 0, 0),
        stress=(3577981.651376147, 894495.4128440367, 894495.4128440367, 0, 0, 0),
        source="closed form, uniaxial strain (a face): γ = ((λ + 2μ) ε₁₁ − σ_t)/(λ + 2μ + H_i), σ = (λ + 2μ, λ, λ)(ε₁₁ − γ)",
        state=dict(p=0.00019266055045871557),
    ),
)
