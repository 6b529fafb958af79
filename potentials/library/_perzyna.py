"""Perzyna's viscoplasticity: φ* = σ_0 ε̇_0/(n+1) ⟨f/σ_0⟩^(n+1), f = √(3/2) ‖dev A‖ + R − σ_y, R = −H_i p; ṗ = ε̇_0 ⟨f/σ_0⟩^n."""

from __future__ import annotations

from sympy import Rational, sqrt

from .. import Law, dev, forces, isotropic, norm, pos
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, eps, eps_p, n, nu, p, rate_0, sigma_0, sigma_y

A, R = forces(eps_p, p, names="A R")
overstress = sqrt(Rational(3, 2)) * norm(dev(A)) + R - sigma_y

perzyna = Law(
    "perzyna",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=sigma_0 * rate_0 / (n + 1) * pos(overstress / sigma_0) ** (n + 1),
    observable=eps,
    internal=(eps_p, p),
    note="Perzyna viscoplasticity: rate a power of the overstress over von Mises, linear isotropic hardening",
)

ENTRY = Entry(
    perzyna,
    source="Perzyna 1966",
    values=dict(E=208e9, nu=0.3, sigma_y=250e6, sigma_0=1e8, rate_0=1e-3, n=4.0, H_i=5e9),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 0.0016350740045409323),
        stress=(0, 0, 0, 0, 0, 247500526.09371698),
        source="closed form, the strain chosen for an overstress σ_0/2 in shear: Δp = dt ε̇_0/2^n, q = σ_y + H_i Δp + σ_0/2",
        state=dict(p=0.000625),
        dt=10.0,
    ),
)
