"""Readings of a friction angle and a cohesion as the cone √J₂ + a I₁ − k ≤ 0, I₁ = tr A, tension positive.

| reading | a | k |
|---|---|---|
| `shear_limit` (that of `sand`) | tan θ/3 | c |
| `sine` | sin θ/3 | c cos θ |
| `compression`, through the compressive edges of Mohr–Coulomb | 2 sin θ/(√3 (3 − sin θ)) | 6 c cos θ/(√3 (3 − sin θ)) |
| `extension`, through its extensive edges | 2 sin θ/(√3 (3 + sin θ)) | 6 c cos θ/(√3 (3 + sin θ)) |
| `plane_strain`, same limit load in plane strain | tan θ/√(9 + 12 tan² θ) | 3 c/√(9 + 12 tan² θ) |
"""

from __future__ import annotations

import math
from typing import Any

from sympy import Expr, asin, atan, cos, sin, sqrt, sympify, tan

from ...errors import InputError

__all__ = ["cone", "cone_values", "rescaled_pseudo_norm", "triaxial_friction"]

READINGS = ("shear_limit", "sine", "compression", "extension", "plane_strain")
STEEPEST = math.pi / 3 * (1 - 1e-12)  # slope √3 of √J₂ over the mean pressure: φ would be 90°
FORMS = {"sqrt_J2": 1, "norm": sqrt(2), "q": sqrt(3)}


def cone(theta: Any, c: Any, reading: str = "shear_limit", *, form: str = "sqrt_J2") -> tuple[Any, Any]:
    """(a, k) of F + a I₁ − k ≤ 0 from a friction angle `theta` [rad] and a cohesion `c` [Pa]; a [-], k [Pa].

    F is √J₂, or with `form="norm"` ‖dev A‖ = √2 √J₂, or with `form="q"` √(3 J₂); it is the same cone, a and k are scaled. Numbers
    give numbers, symbols expressions. `InputError` for a reading or form that does not exist. Source: Drucker and Prager 1952.

    >>> [round(x, 6) for x in cone(0.079, 2842.0)]
    [0.026388, 2842.0]
    """
    if reading not in READINGS:
        raise InputError(f"reading {reading!r} is not known; it is one of {', '.join(READINGS)}")
    if form not in FORMS:
        raise InputError(f"form {form!r} is not known; it is one of {', '.join(FORMS)}")
    angle, cohesion = sympify(theta, strict=True), sympify(c, strict=True)
    if reading == "shear_limit":
        a, k = tan(angle) / 3, cohesion
    elif reading == "sine":
        a, k = sin(angle) / 3, cohesion * cos(angle)
    elif reading == "plane_strain":
        root = sqrt(9 + 12 * tan(angle) ** 2)
        a, k = tan(angle) / root, 3 * cohesion / root
    else:
        sign = -1 if reading == "compression" else 1
        root = sqrt(3) * (3 + sign * sin(angle))
        a, k = 2 * sin(angle) / root, 6 * cohesion * cos(angle) / root
    return _plain(FORMS[form] * a), _plain(FORMS[form] * k)


def cone_values(a: Any, k: Any) -> dict[str, Any]:
    """`theta_f` [rad] and `C_0` [Pa] of `sand`, `texsol` and `drucker_prager` for the cone √J₂ + a I₁ − k ≤ 0: tan θ_f = 3a, C_0 = k.

    >>> cone_values(*cone(0.1, 5.0))
    {'theta_f': 0.1, 'C_0': 5.0}
    """
    return {"theta_f": _plain(atan(3 * sympify(a, strict=True))), "C_0": _plain(sympify(k, strict=True))}


def triaxial_friction(theta_f: Any, C_0: Any) -> dict[str, Any]:
    """`phi` [rad] and `c` [Pa] of the Mohr–Coulomb law that has the strength of the cone √J₂ = C_0 + P tan θ_f in triaxial compression.

    It undoes the reading "compression" of `cone`: with t = tan θ_f, sin φ = √3 t/(2 + t/√3) and c = C_0 √3 (3 − sin φ)/(6 cos φ).
    `InputError` for a cone so steep (tan θ_f ≥ √3, θ_f ≥ 60°) that no friction angle has it. Source: Drucker and Prager 1952.

    >>> {name: round(x, 6) for name, x in triaxial_friction(*cone_values(*cone(0.6, 5.0, "compression")).values()).items()}
    {'phi': 0.6, 'c': 5.0}
    """
    angle = sympify(theta_f, strict=True)
    t = tan(angle)
    sine = sqrt(3) * t / (2 + t / sqrt(3))
    if angle.is_number and not 0 <= float(angle) < STEEPEST:
        raise InputError(
            f"theta_f = {theta_f}: no friction angle of Mohr–Coulomb has this strength in compression; it needs 0 to 60°"
        )
    cohesion = sympify(C_0, strict=True) * sqrt(3) * (3 - sine) / (6 * sqrt(1 - sine**2))
    return {"phi": _plain(asin(sine)), "c": _plain(cohesion)}


def rescaled_pseudo_norm(factor: Any, *, C_0: Any, H_i: Any) -> dict[str, Any]:
    """`C_0` and `H_i` [Pa] of the same law when its surface is written as `factor`·f: C_0 → c C_0, H_i → c² H_i, and p → p/c.

    >>> rescaled_pseudo_norm(2.0, C_0=10.0, H_i=3.0)
    {'C_0': 20.0, 'H_i': 12.0}
    """
    c = sympify(factor, strict=True)
    if c.is_positive is False:
        raise InputError(f"a pseudo-norm is scaled by a positive factor, not {factor}")
    return {"C_0": _plain(c * C_0), "H_i": _plain(c**2 * H_i)}


def _plain(value: Expr) -> Any:
    return float(value) if value.is_number else value
