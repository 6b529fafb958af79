"""Maxwell fluid: a spring and a dashpot in series, viscous in shear and elastic in volume; φ* = dev A:dev A/(4η)."""

from __future__ import annotations

from .. import Law, dev, forces, inner, isotropic
from ._entry import Entry, WorkedValue
from ._symbols import E, eps, eps_v, eta, nu

A = forces(eps_v, names="A")

maxwell = Law(
    "maxwell",
    psi=isotropic(E, nu).energy(eps - eps_v),
    phi_star=inner(dev(A), dev(A)) / (4 * eta),
    observable=eps,
    internal=eps_v,
    note="Maxwell: shear stress relaxes in the time η/μ",
)

ENTRY = Entry(
    maxwell,
    source="Maxwell 1867",
    values=dict(E=12e6, nu=0.2, eta=1e6),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 1e-3),
        stress=(0, 0, 0, 0, 0, 4040.6101782088435),
        source="closed form, one implicit step: σ₁₂ = 2μ ε₁₂/(1 + μ dt/η), μ = 5 MPa",
        dt=0.5,
    ),
)
