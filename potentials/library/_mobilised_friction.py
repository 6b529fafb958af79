"""Drucker–Prager whose friction is mobilised by plastic strain; semi-implicit.

    f = ‖dev A‖/√2 + t(p_n)/3 tr A + R − C_0,   t(p) = tan θ_0 + (tan θ_f − tan θ_0) p/(p + p_m),

p_n the accumulated plastic strain at the start of the step. A friction that follows p within the step would multiply the pressure by a
hardening force, which is not convex; frozen, every step is a convex projection, and the error of freezing is of first order in the
step. R, the force of p, is −H_i p.
"""

from __future__ import annotations

from sympy import sqrt, tan

from .. import Law, dev, forces, frozen, indicator, isotropic, norm, tr
from ._entry import Entry, WorkedValue
from ._symbols import C_0, E, H_i, eps, eps_p, nu, p, p_m, theta_0, theta_f

A, R = forces(eps_p, p, names="A R")
friction = tan(theta_0) + (tan(theta_f) - tan(theta_0)) * frozen(p) / (frozen(p) + p_m)

mobilised_friction = Law(
    "mobilised_friction",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator(norm(dev(A)) / sqrt(2) + friction / 3 * tr(A) + R - C_0),
    observable=eps,
    internal=(eps_p, p),
    note="Drucker–Prager with friction mobilised by plastic strain, frozen over the step (semi-implicit)",
)

ENTRY = Entry(
    mobilised_friction,
    source="Vermeer and de Borst 1984 (mobilised friction)",
    values=dict(E=12e6, nu=0.2, theta_0=0.1, theta_f=0.5, p_m=5e-3, C_0=2842.0, H_i=1e5),
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-6512.583018519315, -6897.604999586869, -13057.9566966677, 0, 0, 1633.5099223124666),
        source="closed form, cone of friction θ_0 (the state is virgin): γ = f/(G + t²K + H_i) at the trial state",
        state=dict(p=0.001229956037864896),
    ),
)
