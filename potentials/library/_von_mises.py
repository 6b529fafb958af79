"""Von Mises plasticity with linear kinematic and isotropic hardening.

f = √(3/2) ‖dev(A + χ)‖ + R − σ_y with χ = −(2/3) H_k α, R = −H_i p: in uniaxial tension the stress rises by H_k + H_i per plastic strain.
"""

from __future__ import annotations

from sympy import Rational, sqrt

from ..extended import indicator
from ..invariants import inner, norm
from ..law import Law
from ..roles import forces
from ..stiffness import isotropic
from ..tensor import dev
from ._symbols import E, H_i, H_k, alpha, eps, eps_p, nu, p, sigma_y

A, chi, R = forces(eps_p, alpha, p, names="A chi R")

von_mises = Law(
    "von_mises",
    psi=isotropic(E, nu).energy(eps - eps_p) + H_k / 3 * inner(alpha, alpha) + H_i / 2 * p**2,
    phi_star=indicator(sqrt(Rational(3, 2)) * norm(dev(A + chi)) + R - sigma_y),
    observable=eps,
    internal=(eps_p, alpha, p),
    note="von Mises plasticity, linear kinematic and isotropic hardening",
)
