"""Von Mises plasticity with linear kinematic and isotropic hardening.

f = √(3/2) ‖dev(A + χ)‖ + R − σ_y with χ = −(2/3) H_k α, R = −H_i p: in uniaxial tension the stress rises by H_k + H_i per plastic strain.
"""

from __future__ import annotations

from sympy import Rational, sqrt

from .. import Law, dev, forces, indicator, inner, isotropic, norm
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, H_k, alpha, eps, eps_p, nu, p, sigma_y

A, chi, R = forces(eps_p, alpha, p, names="A chi R")

von_mises = Law(
    "von_mises",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_k / 3 * inner(alpha, alpha) + H_i / 2 * p**2,
    phi_star=indicator(sqrt(Rational(3, 2)) * norm(dev(A + chi)) + R - sigma_y),
    observable=eps,
    internal=(eps_p, alpha, p),
    note="von Mises plasticity, linear kinematic and isotropic hardening",
)

ENTRY = Entry(
    von_mises,
    source="von Mises 1913; Prager 1955 (kinematic hardening)",
    values=dict(E=208e9, nu=0.3, sigma_y=250e6, H_k=4e9, H_i=6e9),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 4e-3),
        stress=(0, 0, 0, 0, 0, 232163046.61940566),
        source="closed form, simple shear: Δp = (√3·2μ ε₁₂ − σ_y)/(3μ + H_k + H_i), σ₁₂ = 2μ ε₁₂ − √3 μ Δp, μ = 80 GPa",
        state=dict(p=0.0034340500673763256),
    ),
)
