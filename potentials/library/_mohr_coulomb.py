"""Mohr–Coulomb plasticity, associated, with linear isotropic hardening.

f = ((1 + sin φ) A_max − (1 − sin φ) A_min)/2 + R − c cos φ, R = −H_i p, tension positive: half the difference of the extreme principal
stresses is at most c cos φ minus half their sum times sin φ.
"""

from __future__ import annotations

from sympy import cos, sin

from .. import Law, eig_max, eig_min, forces, indicator, isotropic
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, c, eps, eps_p, nu, p, phi

A, R = forces(eps_p, p, names="A R")

mohr_coulomb = Law(
    "mohr_coulomb",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator((1 + sin(phi)) / 2 * eig_max(A) - (1 - sin(phi)) / 2 * eig_min(A) + R - c * cos(phi)),
    observable=eps,
    internal=(eps_p, p),
    note="Mohr–Coulomb plasticity, associated, linear isotropic hardening",
)

ENTRY = Entry(
    mohr_coulomb,
    source="Coulomb 1773; Mohr 1900",
    values=dict(E=12e6, nu=0.2, phi=0.5, c=3000.0, H_i=5e5),
    worked=WorkedValue(
        eps=(1e-4, 1e-4, -2e-3, 0, 0, 0),
        stress=(-5493.674927892589, -5493.674927892589, -25906.34866684253, 0, 0, 0),
        source="closed form, compressive edge: flow γ ((1+s)/4, (1+s)/4, −(1−s)/2), s = sin φ, and one linear equation f(γ) = 0",
        state=dict(p=9.320514351713658e-05),
    ),
)
