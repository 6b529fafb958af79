"""Yield and effective hardening of the sand, from its own stress and its own mean stress.

Law: f = √J₂(σ_s + χ) + t/3 tr(σ_s + χ) + R − C_0 ≤ 0, t = tan θ_f, χ = −H_k α, R = −H_i p. Start of the test: σ_s = −P
I, α = 0,
p = 0. While one leg loads monotonically, dev(σ_s + χ) keeps its direction n, ‖n‖ = 1, and flow gives

    α̇ = ε̇^p = ṗ (n/√2 + t/3 I)   ⇒   dev α = (p/√2) n,  tr α = t p,  p = √2 ‖dev ε^p‖.

Put into f = 0: √J₂(σ_s) − H_k p/2 + t/3 (tr σ_s − H_k t p) − H_i p − C_0 = 0, that is

    √J₂(σ_s) = C_0 + t P_s + H_eff p,        H_eff = H_k (½ + t²/3) + H_i,

exactly, with P_s = −tr σ_s/3 of the sand itself; wires change P_s, not the formula. It is linear in (C_0, t, H_eff):
least squares
over the points of the first legs of all pressures whose p lies in a stated window. ε^p = ε_s − K_s⁻¹(σ_s − σ_s0); of it
only the deviator enters, hence only the shear modulus.

Beside it the yield stress by a stated criterion (offset of axial plastic strain), read with the mean stress of the phase and,
as the reference study reads it, τ_y = C_0 + P tan θ_f with the confining pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .curves import Curves, axial, by_pressure, deviator, lateral, pressure
from .options import IdentifyOptions

__all__ = ["LineFit", "YieldFit", "effective_hardening", "fit_yield", "least_absolute_line", "least_squares_line"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LineFit:
    """τ = C_0 + slope · x: cohesion [Pa] and slope [-]; `unique` False when other lines fit exactly as well."""

    C_0: float
    slope: float
    unique: bool = True

    @property
    def angle(self) -> float:
        """arctan of the slope [rad]."""
        return float(np.arctan(self.slope))


@dataclass(frozen=True, kw_only=True)
class YieldFit:
    """Staged yield values: C_0 [Pa], t = tan θ_f [-], H_eff [Pa], and the yield stresses τ_y = √J₂ [Pa] of the offset
    criterion."""

    C_0: float
    t: float
    H_eff: float
    misfit: float  # rms residual of √J₂ / largest √J₂ [-]
    point_count: int
    at_bound: tuple[str, ...]
    tau_y: dict[float, float]  # by confining pressure
    mean_pressure_at_yield: dict[float, float]  # P_s
    own_least_squares: LineFit | None  # f = 0 with the mean stress of the phase
    own_least_absolute: LineFit | None
    study_least_squares: LineFit | None  # τ_y = C_0 + P tan θ_f, confining pressure
    study_least_absolute: LineFit | None

    @property
    def theta_f(self) -> float:
        """Friction angle of the law [rad]."""
        return float(np.arctan(self.t))


def effective_hardening(H_k: float, H_i: float, t: float) -> float:
    """H_eff = H_k(½ + t²/3) + H_i [Pa]: all that a monotonic leg feels of the two moduli."""
    return H_k * (0.5 + t * t / 3.0) + H_i


def least_squares_line(x: Array, y: Array) -> LineFit:
    """Line of least squares through (x, y); two or more distinct x."""
    slope, intercept = np.polyfit(np.asarray(x, float), np.asarray(y, float), 1)
    return LineFit(C_0=float(intercept), slope=float(slope))


def least_absolute_line(x: Array, y: Array) -> LineFit:
    """Line of least absolute deviations, Σ|y − C_0 − slope x| → min, exactly.

    The minimum of this linear program is reached at a vertex, that is on a line through two of the points: all pairs are
    tried (few pressures). Insensitive to one outlier, but not always unique: of equally good vertices the one with the smallest
    median deviation is taken, and `unique` is False. (The yield stresses of the reference study are such a case: the lines
    through its rows 0.5 and 0.7 bar and through 0.5 and 0.6 bar tie at 5351 Pa.)
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    found: list[tuple[float, float, float, float]] = []
    for i, j in combinations(range(len(x)), 2):
        if x[i] == x[j]:
            continue
        slope = (y[j] - y[i]) / (x[j] - x[i])
        intercept = y[i] - slope * x[i]
        deviation = np.abs(y - intercept - slope * x)
        found.append((float(deviation.sum()), float(np.median(deviation)), float(intercept), float(slope)))
    if not found:
        raise InputError("a line needs yield stresses at two or more different pressures")
    tie = min(found)[0] + 1e-9 * float(np.abs(y).sum())
    _, _, intercept, slope = min((line for line in found if line[0] <= tie), key=lambda line: line[1])
    slack = 1e-6 * max(abs(slope), 1e-9)
    unique = all(abs(line[3] - slope) <= slack for line in found if line[0] <= tie)
    return LineFit(C_0=intercept, slope=slope, unique=unique)


def plastic_strain(test: Curves, E_s: float, nu: float) -> tuple[Array, Array]:
    """Axial plastic strain and p = (2/√3)|ε^p_r − ε^p_z| (signed: positive on shortening), shape (frame_count,) each [-]."""
    shear = E_s / (2.0 * (1.0 + nu))
    change = test.sand - test.sand[0]
    q = deviator(change)
    axial_elastic = (axial(change) - 2.0 * nu * lateral(change)) / E_s
    p = 2.0 / np.sqrt(3.0) * (deviator(test.strain) - deviator(test.strain[0]) - q / (2.0 * shear))
    return axial(test.strain) - axial(test.strain[0]) - axial_elastic, p


def _yield_point(test: Curves, E_s: float, nu: float, offset: float) -> tuple[float, float] | None:
    """(√J₂, P_s) of the sand where its axial plastic shortening first reaches `offset` on the first leg; None if never."""
    plastic, _ = plastic_strain(test, E_s, nu)
    first = test.leg == 0
    shortening = -plastic[first]
    root = deviator(test.sand)[first] / np.sqrt(3.0)
    mean = pressure(test.sand)[first]
    above = np.flatnonzero(shortening >= offset)
    if len(above) == 0 or above[0] == 0:
        return None
    i = int(above[0])
    w = (offset - shortening[i - 1]) / (shortening[i] - shortening[i - 1])
    return float(root[i - 1] + w * (root[i] - root[i - 1])), float(mean[i - 1] + w * (mean[i] - mean[i - 1]))


def fit_yield(tests: Sequence[Curves], E_s: float, nu: float, options: IdentifyOptions) -> YieldFit:
    """(C_0, t, H_eff) by bounded linear regression over the first legs, every test with the same weight; yield stresses beside.

    All three are bounded below by zero (the law refuses softening); a value at its bound is named in `at_bound`.
    Raises `InputError` when fewer than three points lie in the plastic window.
    """
    from scipy.optimize import lsq_linear

    rows, values, weights = [], [], []
    low, high = options.plastic_window
    for test in tests:
        _, p = plastic_strain(test, E_s, nu)
        inside = (test.leg == 0) & (p >= low) & (p <= high)
        count = int(inside.sum())
        if count == 0:
            continue
        rows.append(np.stack([np.ones(count), pressure(test.sand)[inside], p[inside]], axis=1))
        values.append(deviator(test.sand)[inside] / np.sqrt(3.0))
        weights.append(np.full(count, count**-0.5))
    if not rows or sum(map(len, values)) < 3:
        raise InputError(
            f"no plastic flow on the first leg: fewer than 3 points with plastic strain in {options.plastic_window}; "
            "shorten further or widen identify.plastic_window"
        )
    matrix, root, weight = np.concatenate(rows), np.concatenate(values), np.concatenate(weights)
    scale = np.array([np.mean(matrix[:, 1]), 1.0, np.mean(root) / np.mean(matrix[:, 2])])
    solution = lsq_linear(weight[:, None] * matrix * scale, weight * root, bounds=(0.0, np.inf), tol=1e-14)
    C_0, t, H_eff = (float(v) for v in solution.x * scale)
    names = ("C_0", "theta_f", "H_eff")
    at_bound = tuple(n for n, x, m in zip(names, solution.x, solution.active_mask, strict=True) if m != 0 or x < 1e-9)
    C_0, t, H_eff = (0.0 if n in at_bound else v for n, v in zip(names, (C_0, t, H_eff), strict=True))
    residual = matrix @ np.array([C_0, t, H_eff]) - root

    tau: dict[float, float] = {}
    mean: dict[float, float] = {}
    for level, group in by_pressure(tests).items():
        points = [point for test in group if (point := _yield_point(test, E_s, nu, options.yield_offset)) is not None]
        if points:
            tau[level], mean[level] = (float(v) for v in np.mean(points, axis=0))
    confining = np.array(list(tau))
    own, stress = np.array(list(mean.values())), np.array(list(tau.values()))
    enough = len(tau) >= 2
    return YieldFit(
        C_0=C_0,
        t=t,
        H_eff=H_eff,
        misfit=float(np.sqrt(np.mean(residual**2)) / np.max(np.abs(root))),
        point_count=len(root),
        at_bound=at_bound,
        tau_y=tau,
        mean_pressure_at_yield=mean,
        own_least_squares=least_squares_line(own, stress) if enough else None,
        own_least_absolute=least_absolute_line(own, stress) if enough else None,
        study_least_squares=least_squares_line(confining, stress) if enough else None,
        study_least_absolute=least_absolute_line(confining, stress) if enough else None,
    )
