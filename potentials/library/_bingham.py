"""Elastic Bingham solid: rigid below a yield stress in shear, linearly viscous above it, in series with elasticity.

φ* = ⟨‖dev A‖ − √2 τ_y⟩²/(4η): in simple shear the plastic part of the shear angle grows at (τ − τ_y)/η.
"""

from __future__ import annotations

from sympy import sqrt

from .. import Law, dev, forces, isotropic, norm, pos
from ._entry import Entry, WorkedValue
from ._symbols import E, eps, eps_p, eta, nu, tau_y

A = forces(eps_p, names="A")

bingham = Law(
    "bingham",
    psi=isotropic(E, nu).energy(eps - eps_p),
    phi_star=pos(norm(dev(A)) - sqrt(2) * tau_y) ** 2 / (4 * eta),
    observable=eps,
    internal=eps_p,
    note="Bingham: yield stress and linear viscosity, in series with elasticity",
)

ENTRY = Entry(
    bingham,
    source="Bingham 1922; Hohenemser and Prager 1932 (tensors)",
    values=dict(E=12e6, nu=0.2, tau_y=1000.0, eta=1e6),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 1e-3),
        stress=(0, 0, 0, 0, 0, 5050.762722761055),
        source="closed form, simple shear: Δε₁₂ = (2μ ε₁₂ − τ_y)/(2η/dt + 2μ), σ₁₂ = 2μ (ε₁₂ − Δε₁₂), μ = 5 MPa",
        dt=0.5,
    ),
)
