"""Kelvin–Voigt solid: a spring and a dashpot in parallel, σ = 𝕂ε + 2η dev ε̇ + ζ (tr ε̇) I.

The viscous stress is the irreversible stress σ^ir, the force of the observable: φ* = dev σ^ir:dev σ^ir/(4η) + (tr σ^ir)²/(18ζ).
"""

from __future__ import annotations

from .. import Law, dev, forces, inner, isotropic, tr
from ._entry import Entry, WorkedValue
from ._symbols import E, eps, eta, nu, zeta

viscous = forces(eps, names="sig_ir")

kelvin_voigt = Law(
    "kelvin_voigt",
    psi=isotropic(E, nu).energy(eps),
    phi_star=inner(dev(viscous), dev(viscous)) / (4 * eta) + tr(viscous) ** 2 / (18 * zeta),
    observable=eps,
    note="Kelvin–Voigt: elasticity and linear viscosity in parallel",
)

ENTRY = Entry(
    kelvin_voigt,
    source="Thomson (Lord Kelvin) 1865; Voigt 1892",
    values=dict(E=12e6, nu=0.2, eta=1e6, zeta=2e6),
    worked=WorkedValue(
        eps=(1e-3, 0, 0, 0, 0, 2**0.5 * 1e-3),
        stress=(20000.0, 6000.0, 6000.0, 0, 0, 19798.989873223334),
        source="closed form, one step from rest: σ = 𝕂ε + (2η dev ε + ζ (tr ε) I)/dt",
        dt=0.5,
    ),
)
