"""Drucker–Prager cone closed by an elliptic cap: two surfaces that meet in a corner.

    f₁ = ‖dev A‖/√2 + tan(θ_f)/3 tr A + R − C_0,        R = −H_i p,
    f₂ = √(‖dev A‖²/2 + r² ⟨−tr A/3 − L⟩²) + r (R_c − W),   R_c = −H_c v.

The cap begins at the pressure L and ends at L + W − R_c; r is its height over its width.
"""

from __future__ import annotations

from sympy import sqrt, tan

from .. import Law, dev, forces, indicator, inner, isotropic, norm, pos, tr
from ._entry import Entry, WorkedValue
from ._symbols import C_0, E, H_c, H_i, L, W, eps, eps_p, nu, p, r, theta_f, v

A, R, R_c = forces(eps_p, p, v, names="A R R_c")

drucker_prager_cap = Law(
    "drucker_prager_cap",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2 + H_c / 2 * v**2,
    phi_star=indicator(
        norm(dev(A)) / sqrt(2) + tan(theta_f) / 3 * tr(A) + R - C_0,
        sqrt(inner(dev(A), dev(A)) / 2 + r**2 * pos(-tr(A) / 3 - L) ** 2) + r * (R_c - W),
    ),
    observable=eps,
    internal=(eps_p, p, v),
    note="Drucker–Prager cone with an elliptic cap, each with linear hardening",
)

ENTRY = Entry(
    drucker_prager_cap,
    source="DiMaggio and Sandler 1971",
    values=dict(E=12e6, nu=0.2, theta_f=0.3, C_0=2842.0, H_i=1e5, H_c=1e6, L=3e4, W=2e4, r=0.5),
    worked=WorkedValue(
        eps=(-1e-2, -1e-2, -1e-2, 0, 0, 0),
        stress=(-69565.21739130435, -69565.21739130435, -69565.21739130435, 0, 0, 0),
        source="closed form, isotropic compression: Δv = (3K|ε| − L − W)/(K + H_c), pressure L + W + H_c Δv",
        state=dict(v=0.01956521739130435),
    ),
)
