"""Tresca plasticity, associated, with linear isotropic hardening: f = A_max − A_min + R − σ_y, R = −H_i p."""

from __future__ import annotations

from .. import Law, eig_max, eig_min, forces, indicator, isotropic
from ._entry import Entry, WorkedValue
from ._symbols import E, H_i, eps, eps_p, nu, p, sigma_y

A, R = forces(eps_p, p, names="A R")

tresca = Law(
    "tresca",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_i / 2 * p**2,
    phi_star=indicator(eig_max(A) - eig_min(A) + R - sigma_y),
    observable=eps,
    internal=(eps_p, p),
    note="Tresca plasticity, largest shear stress, linear isotropic hardening",
)

ENTRY = Entry(
    tresca,
    source="Tresca 1864",
    values=dict(E=208e9, nu=0.3, sigma_y=250e6, H_i=6e9),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 4e-3),
        stress=(0, 0, 0, 0, 0, 190181357.59029603),
        source="closed form, simple shear (a face): Δp = (4μ ε₁₂ − σ_y)/(4μ + H_i), σ₁₂ = 2μ (ε₁₂ − Δp), μ = 80 GPa",
        state=dict(p=0.0031595092024539876),
    ),
)
