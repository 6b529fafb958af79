"""Sand, option K2: kinematic hardening moves the cone in its deviatoric plane only.

f = ‖dev(A+χ)‖/√2 + tan(θ_f)/3 tr A + R − C_0; the pressure limit is not shifted by χ. Everything else as in `sand`.
"""

from __future__ import annotations

from sympy import sqrt, tan

from .. import Law, dev, indicator, norm, tr
from ._entry import Entry, WorkedValue
from ._sand import A, R, chi, sand_energy, sand_values
from ._symbols import C_0, alpha, eps, eps_p, p, theta_f

deviatoric_domain = indicator(norm(dev(A + chi)) / sqrt(2) + tan(theta_f) / 3 * tr(A) + R - C_0)

sand_k2 = Law(
    "sand_k2",
    psi=sand_energy,
    phi_star=deviatoric_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand whose kinematic hardening is deviatoric (option K2)",
)

ENTRY = Entry(
    sand_k2,
    source="Drucker and Prager 1952; Prager 1955 (kinematic hardening)",
    values=sand_values,
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-5845.370762671988, -6300.355617515563, -13580.11329501274, 0, 0, 1930.337257182407),
        source="closed form, cone: γ = f/(G + H_k/2 + t²K + H_i) at the trial state",
        state=dict(p=0.0010900302903128528),
    ),
)
