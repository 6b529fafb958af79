"""Sand: Drucker–Prager with mixed linear hardening.

ψ = ½ (ε−ε^p):𝕂_s(ε−ε^p) + H_k/2 α:α + H_i/2 p²,  f = ‖dev(A+χ)‖/√2 + tan(θ_f)/3 tr(A+χ) + R − C_0. Dissipation is C_0 ṗ.
"""

from __future__ import annotations

from sympy import sqrt, tan

from .. import Law, dev, forces, indicator, inner, isotropic, norm, tr
from ._entry import Entry, WorkedValue
from ._symbols import C_0, E_s, H_i, H_k, alpha, eps, eps_p, nu_s, p, theta_f

A, chi, R = forces(eps_p, alpha, p, names="A chi R")
sand_energy = isotropic(E_s, nu_s).energy(eps - eps_p) + H_k / 2 * inner(alpha, alpha) + H_i / 2 * p**2
sand_domain = indicator(norm(dev(A + chi)) / sqrt(2) + tan(theta_f) / 3 * tr(A + chi) + R - C_0)

sand = Law(
    "sand",
    psi=sand_energy,
    phi_star=sand_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand: Drucker–Prager with linear kinematic and isotropic hardening",
)

sand_values = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3)

ENTRY = Entry(
    sand,
    source="Drucker and Prager 1952; Laniel, Alart and Pagano 2008",
    values=sand_values,
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-5844.104310196617, -6299.2686628889805, -13581.898305966792, 0, 0, 1931.098802058932),
        source="closed form, cone: γ = f/(G + H_k/2 + t²(K + H_k/3) + H_i) at the trial state; tr ε^p/p = tan(θ_f)",
        state=dict(p=0.0010896712946152735),
    ),
)
