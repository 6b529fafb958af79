"""Thermo-elasto-plasticity with heat conduction: a law that fills every row of Table 1.

    ψ  = ½ e:𝕂e − 3K α_T (T − T_0) tr e − C_v (T ln(T/T_0) − T + T_0) + H_i/2 p²,   e = ε − ε^p,
    φ* = I{√(3/2) ‖dev A‖ + R − σ_y ≤ 0} + k/(2T) |∇T|².

ψ is concave in T, s = 3K α_T tr e + C_v ln(T/T_0), and −q/T = (k/T) ∇T is Fourier's law.
"""

from __future__ import annotations

from sympy import Rational, log, sqrt

from .. import Law, dev, forces, gradient, indicator, inner, isotropic, norm, tr
from ._entry import Entry, WorkedValue
from ._symbols import T_0, C_v, E, H_i, T, alpha_T, eps, eps_p, k, nu, p, sigma_y

A, R = forces(eps_p, p, names="A R")
G = gradient(T)
stiffness = isotropic(E, nu)
heat = C_v * (T * log(T / T_0) - T + T_0)
expansion = 3 * stiffness.bulk * alpha_T * (T - T_0) * tr(eps - eps_p)

thermo_elasto_plastic = Law(
    "thermo_elasto_plastic",
    psi=stiffness.energy(eps - eps_p) - expansion - heat + H_i / 2 * p**2,
    phi_star=indicator(sqrt(Rational(3, 2)) * norm(dev(A)) + R - sigma_y) + k / (2 * T) * inner(G, G),
    observable=eps,
    internal=(eps_p, p),
    note="thermo-elasto-plasticity (von Mises) with heat conduction",
)

ENTRY = Entry(
    thermo_elasto_plastic,
    source="Duhamel 1837 (thermal stress); Fourier 1822 (conduction); von Mises 1913",
    values=dict(E=208e9, nu=0.3, sigma_y=250e6, H_i=6e9, alpha_T=12e-6, T_0=293.0, C_v=3.6e6, k=50.0),
    worked=WorkedValue(
        eps=(0, 0, 0, 0, 0, 2**0.5 * 4e-3),
        stress=(-311999999.99999994, -311999999.99999994, -311999999.99999994, 0, 0, 221221036.3218548),
        source="closed form, simple shear 50 K above T_0: the shear of von Mises and the pressure 3K α_T (T − T_0)",
        state=dict(p=0.0034898882798539894),
        temperatures=dict(T=343.0),
    ),
)
