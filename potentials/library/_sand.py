"""Sand: Drucker–Prager with mixed linear hardening.

ψ = ½ (ε−ε^p):𝕂_s(ε−ε^p) + H_k/2 α:α + H_i/2 p²,  f = ‖dev(A+χ)‖/√2 + tan(θ_f)/3 tr(A+χ) + R − C_0. Dissipation is C_0 ṗ.
"""

from __future__ import annotations

from sympy import sqrt, tan

from ..extended import indicator
from ..invariants import inner, norm, tr
from ..law import Law
from ..roles import forces
from ..stiffness import isotropic
from ..tensor import dev
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
