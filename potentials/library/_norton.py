"""Norton's viscoplasticity: φ* = σ_0 ε̇_0/(n+1) (q/σ_0)^(n+1), q = √(3/2) ‖dev A‖; ε̇^p = ε̇_0 (q/σ_0)^n (3/2) dev A/q."""

from __future__ import annotations

from sympy import Rational, sqrt

from .. import Law, dev, forces, isotropic, norm
from ._entry import Entry, WorkedValue
from ._symbols import E, eps, eps_p, n, nu, rate_0, sigma_0

A = forces(eps_p, names="A")

norton = Law(
    "norton",
    psi=isotropic(E, nu).energy(eps - eps_p),
    phi_star=sigma_0 * rate_0 / (n + 1) * (sqrt(Rational(3, 2)) * norm(dev(A)) / sigma_0) ** (n + 1),
    observable=eps,
    internal=eps_p,
    note="Norton viscoplasticity: creep rate a power of the stress",
)

ENTRY = Entry(
    norton,
    source="Norton 1929; Odqvist 1935 (multiaxial)",
    values=dict(E=208e9, nu=0.3, sigma_0=1e8, rate_0=1e-6, n=5.0),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 0.0025879610346371132),
        stress=(0, 0, 0, 0, 0, 97979589.71132715),
        source="closed form, the strain chosen for q = 1.2 σ_0 in shear: Δp = dt ε̇_0 1.2^n, ε₁₂ = 1.2 σ_0/(2√3 μ) + (√3/2) Δp",
        dt=1000.0,
    ),
)
