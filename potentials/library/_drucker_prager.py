"""Drucker–Prager plasticity, associated, with linear isotropic hardening.

f = ‖dev A‖/√2 + tan(θ_f)/3 tr A + R − C_0, R = −H_i p; perfectly plastic for H_i = 0.
"""

from __future__ import annotations

from sympy import sqrt, tan

from .. import Law, dev, forces, indicator, isotropic, norm, tr
from ._entry import Entry, WorkedValue
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

ENTRY = Entry(
    drucker_prager,
    source="Drucker and Prager 1952",
    values=dict(E=12e6, nu=0.2, theta_f=0.3, C_0=2842.0, H_i=472e3),
    worked=WorkedValue(
        eps=(1e-2, 1e-2, 1e-2, 0, 0, 0),
        stress=(90331.14061830784, 90331.14061830784, 90331.14061830784, 0, 0, 0),
        source="closed form, apex: γ = (3Kt ε − C_0)/(t²K + H_i), σ = (3K ε − K t γ) I with t = tan(θ_f), K = E/1.8",
        state=dict(p=0.053179441232684),
    ),
)
