"""Drucker–Prager plasticity, associated, with linear isotropic hardening.

f = ‖dev A‖/√2 + tan(θ_f)/3 tr A + R − C_0, R = −H_i p; perfectly plastic for H_i = 0.
"""

from __future__ import annotations

from sympy import sqrt, tan

from ..extended import indicator
from ..invariants import norm, tr
from ..law import Law
from ..roles import forces
from ..stiffness import isotropic
from ..tensor import dev
from ._symbols import C_0, E, H_i, eps, eps_p, nu, p, theta_f

A, R = forces(eps_p, p, names="A R")

drucker_prager = Law(
    "drucker_prager",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator(norm(dev(A)) / sqrt(2) + tan(theta_f) / 3 * tr(A) + R - C_0),
    observable=eps,
    internal=(eps_p, p),
    note="Drucker–Prager plasticity, associated, linear isotropic hardening",
)
