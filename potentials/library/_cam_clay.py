"""Modified Cam-Clay as a gauge, jointly convex in stress and hardening force.

With q = ‖dev A‖, m = tr A/3 (tension positive) and R = −H_i p,

    f = √(3 q²/(2M²) + (m + a − R)²) − (a − R):

the ellipse of slope M through the origin, whose far end is the preconsolidation pressure 2(a − R) = 2(a + H_i p). The textbook form
q²/M² + P (P − P_c) bounds the same stresses, but is not convex in P and P_c together, so that it is no force function.

Restriction: the law is associated in all its forces, so that ṗ = γ + tr ε̇^p and the ellipse only grows. On the dry side of the critical
state the clay dilates and still hardens: softening and the critical state as a limit are not modelled.
"""

from __future__ import annotations

from sympy import Rational, sqrt

from .. import Law, dev, forces, indicator, inner, isotropic, tr
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, M, a, eps, eps_p, nu, p

A, R = forces(eps_p, p, names="A R")

cam_clay = Law(
    "cam_clay",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator(sqrt(Rational(3, 2) / M**2 * inner(dev(A), dev(A)) + (tr(A) / 3 + a - R) ** 2) + R - a),
    observable=eps,
    internal=(eps_p, p),
    note="modified Cam-Clay in gauge form, hardening only",
)

ENTRY = Entry(
    cam_clay,
    source="Roscoe and Burland 1968 (ellipse)",
    values=dict(E=12e6, nu=0.2, M=1.1, a=50e3, H_i=1e6),
    worked=WorkedValue(
        eps=(-1e-2, -1e-2, -1e-2, 0, 0, 0),
        stress=(-137500.0, -137500.0, -137500.0, 0, 0, 0),
        source="closed form, isotropic compression: γ = (3K|ε| − 2a)/(K + 4H_i), Δp = 2γ, pressure 2(a + H_i Δp)",
        state=dict(p=0.018750000000000003),
    ),
)
