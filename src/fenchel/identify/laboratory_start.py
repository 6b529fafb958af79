"""Start values of a fit, read off the curves of laboratory tests.

* E from the slope of q(ε_a) at the start: dq/dε_a = E drained, 3G = 3E/(2(1 + ν)) undrained; ν from dε_v/dε_a = 1 − 2ν.
* The yield of a test is where the tangent at its end meets the elastic line; a test that falls off after its peak yields at the peak.
  Through the yields of all tests goes the line √J₂ = C_0 + P tan θ_f, or q/2 = c cos φ + (P + q/6) sin φ, √J₂ = q/√3, P effective.
* Hardening from the slope S at the end: dq/dε_a^p = S/(1 − S/E); with the flow of the law, γ(1/√3 − tan(θ_f)/3) axially for
  Drucker–Prager and γ(1 − sin φ)/2 for Mohr–Coulomb, it gives the modulus that γ sees.

They need not be good, only near: the fit does the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import asin, atan, cos, sqrt

import numpy as np
from numpy.typing import NDArray

from .laboratory_file import LaboratoryTest
from .laboratory_replay import turning_rows

__all__ = ["RULES", "Readings", "read_curves", "start_values"]

Array = NDArray[np.float64]
ELASTIC = 0.25  # part of the largest q up to which the first slope is read
TAIL = 0.6  # part of the strain of the first leg from which the last slope is read
NU = 0.25  # where no drained test tells
NU_BOUNDS = (0.0, 0.45)
SLOPE = 1.2  # largest tan(theta_f) to start from; at √3 nothing yields in compression any more


@dataclass(frozen=True, kw_only=True)
class Readings:
    """What the curves say: E [Pa], ν, per test yield q [Pa], effective P there [Pa], largest q/P, plastic slope dq/dε_a^p [Pa]."""

    E: float
    nu: float
    q: Array
    pressure: Array
    ratio: float
    hardening: float


def _slope(x: Array, y: Array) -> float:
    return float(x @ y / (x @ x))


def _first_leg(test: LaboratoryTest) -> tuple[Array, Array, Array]:
    turns = turning_rows(test.axial_strain)
    end = int(turns[0]) + 1 if len(turns) else len(test.q)
    sense = 1.0 if test.q[:end].sum() >= 0.0 else -1.0  # extension is read as compression
    return -sense * test.axial_strain[:end], sense * test.q[:end], -sense * test.second[:end]


def read_curves(tests: Sequence[LaboratoryTest]) -> Readings:
    """Readings of the first legs, before any fit."""
    slopes, ratios = [], []
    for test in tests:
        eps, q, second = _first_leg(test)
        late = np.flatnonzero(q > ELASTIC * q.max())
        rows = slice(1, max(int(late[0]) if len(late) else 0, 2) + 1)
        slopes.append(max(_slope(eps[rows], q[rows]), 0.0))
        if test.drained:
            ratios.append(_slope(eps[rows], second[rows]))
    nu = float(np.clip(0.5 * (1.0 - np.median(ratios)), *NU_BOUNDS)) if ratios else NU
    stiffness = [s if t.drained else 2.0 / 3.0 * (1.0 + nu) * s for s, t in zip(slopes, tests, strict=True)]
    E = float(np.median(stiffness))
    yields, hardening, largest = [], [], 0.0
    for test in tests:
        eps, q, _ = _first_leg(test)
        whole = test.pressure + test.q / 3.0 - (0.0 if test.drained else test.second)
        largest = max(largest, float(np.max(np.abs(test.q) / np.maximum(whole, 0.05 * test.pressure))))
        tail = eps >= TAIL * eps.max()
        S, a = np.polyfit(eps[tail], q[tail], 1) if tail.sum() >= 3 else (0.0, float(q.max()))
        S = float(np.clip(S, 0.0, 0.5 * E))
        at = float(q.max()) if S == 0.0 else float(np.clip(a / (1.0 - S / E), 0.1 * q.max(), q.max()))
        row = int(np.argmax(q >= at))
        drop = 0.0 if test.drained else float(test.second[row])
        yields.append((at, max(test.pressure + at / 3.0 - drop, 0.05 * test.pressure)))
        hardening.append(S / (1.0 - S / E))
    both = np.array(yields)
    slope = max(float(np.median(hardening)), 1e-3 * E)
    return Readings(E=E, nu=nu, q=both[:, 0], pressure=both[:, 1], ratio=largest, hardening=slope)


def _line(x: Array, y: Array, largest: float) -> tuple[float, float]:
    """Intercept and slope of y = a + s x with a ≥ 0 and 0 ≤ s ≤ `largest`, by least squares."""
    spread = np.ptp(x) > 0.05 * np.max(np.abs(x))
    s = float(np.polyfit(x, y, 1)[0]) if len(x) > 1 and spread else float("inf")
    s = float(np.clip(s, 0.0, largest))
    a = float(np.mean(y) - s * np.mean(x))
    if a < 0.0 or not spread:
        return 0.0, float(np.clip(_slope(x, y), 0.0, largest))
    return a, s


def _drucker_prager(read: Readings) -> dict[str, float]:
    C_0, t = _line(read.pressure, read.q / sqrt(3.0), SLOPE)
    modulus = read.hardening * (1.0 / sqrt(3.0) - t / 3.0) ** 2
    return {"C_0": C_0, "theta_f": atan(t), "H": modulus, "t": t}


def _elastic(read: Readings, suffix: str = "") -> dict[str, float]:
    return {f"E{suffix}": read.E, f"nu{suffix}": read.nu}


def _cone(read: Readings) -> dict[str, float]:
    found = _drucker_prager(read)
    return _elastic(read) | {"C_0": found["C_0"], "theta_f": found["theta_f"], "H_i": found["H"]}


def _sand(read: Readings) -> dict[str, float]:
    found = _drucker_prager(read)
    kinematic = found["H"] / (0.5 + found["t"] ** 2 / 3.0)
    return _elastic(read, "_s") | {"C_0": found["C_0"], "theta_f": found["theta_f"], "H_k": kinematic, "H_i": 0.0}


def _mobilised(read: Readings) -> dict[str, float]:
    found = _cone(read)
    return found | {"theta_0": 0.5 * found["theta_f"]}


def _mohr_coulomb(read: Readings) -> dict[str, float]:
    a, s = _line(read.pressure + read.q / 6.0, read.q / 2.0, 0.9)
    phi = asin(s)
    return _elastic(read) | {"phi": phi, "c": a / cos(phi), "H_i": read.hardening * (0.5 * (1.0 - s)) ** 2}


def _von_mises(read: Readings) -> dict[str, float]:
    return _elastic(read) | {"sigma_y": float(np.mean(read.q)), "H_k": read.hardening, "H_i": 0.0}


def _tresca(read: Readings) -> dict[str, float]:
    return _elastic(read) | {"sigma_y": float(np.mean(read.q)), "H_i": read.hardening}


def _cam_clay(read: Readings) -> dict[str, float]:
    return _elastic(read) | {"M": read.ratio}


#: Laws of the library whose parameters the curves tell, wholly or in part.
RULES: dict[str, Callable[[Readings], dict[str, float]]] = {
    "linear_elastic": _elastic,
    "von_mises": _von_mises,
    "tresca": _tresca,
    "drucker_prager": _cone,
    "drucker_prager_cap": _cone,
    "mobilised_friction": _mobilised,
    "mohr_coulomb": _mohr_coulomb,
    "cam_clay": _cam_clay,
    "sand": _sand,
    "sand_k2": _sand,
    "reinforced_sand": _sand,
    "texsol": _sand,
    "texsol_k2": _sand,
}


def start_values(law_name: str, tests: Sequence[LaboratoryTest]) -> dict[str, float]:
    """Start values by parameter for a law of the library; those that the curves do not tell are missing."""
    rule = RULES.get(law_name)
    return {} if rule is None else rule(read_curves(tests))
