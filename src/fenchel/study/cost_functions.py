"""Identify the law with strains, with stresses, or with the duality gap between both as what is made small.

Of a triaxial test strain ε_k and stress σ_k are known at every frame k, axisymmetric about z and each with its noise. X is the state of
the law, W_n(ε) = min over X of ψ(ε, X) + φ(X − X_n) the energy of a step (Ortiz and Stainier 1999), W_n* its conjugate, σ̂ = ∂W_n(ε_k) the
answer of the strain formulation, ε̂ = ∂W_n*(σ_k) that of the stress formulation. Residuals, summed over frames and tests,

    strain side:  σ̂_k − σ_k over max|q|; the measured strain drives the law. "strain": the whole tensor does; "axial": ε_zz does, at the
                  measured lateral stress, as the identification replays a test;
    stress side:  ε̂_k − ε_k over max‖ε‖; the measured stress drives the law;
    gap:          √e_k,  e_k = W_n(ε_k) + W_n*(σ_k) − σ_k:ε_k = W_n(ε_k) − W_n(ε̂_k) − σ_k:(ε_k − ε̂_k) ≥ 0 over max|q| max‖ε‖, the Fenchel
                  residual of the step: the error in constitutive relation (Ladevèze and Leguillon 1983), as a cost of identification
                  see Feissel and Allix (2007). X_n is that of the path driven by the measured strain.

With ℂ the tangent of a step, e ≈ ½(σ̂−σ):ℂ⁻¹:(σ̂−σ) and ε̂−ε ≈ −ℂ⁻¹(σ̂−σ): the same misfit weighed by 1, ℂ⁻½ and ℂ⁻¹, but for what the
states remember. √e has a kink where it vanishes. It is given the direction of ε_k − ε̂_k in the norm of the elastic energy: two numbers
whose squares sum to e_k exactly, smooth, so that Gauss–Newton applies (the direction does not move the minimum). e is a difference of
energies; its root is known to the root of rounding, 1e-7.

Unknowns are t = tan θ_f, C_0, H_k, H_i and, if asked for, E_s, none negative. Intervals are those of the linearised problem: covariance
s² (JᵀJ)⁻¹ with s² = ‖r‖²/(n − k), which holds if the residuals are independent and of one size: what it is worth is counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from ..identify.bounded_fit import bounded_least_squares
from ..identify.curves import Curves, axial, deviator, lateral, thin
from ..identify.hardening import MAX_SLOPE
from ..identify.parameters import LawParameters
from ..potentials.library import texsol
from .models import model_values

__all__ = [
    "COSTS", "FREE", "NAMES", "Fit", "Measured", "Problem", "fit", "gap", "guess", "measured", "plastic_path", "values_by_name",
]  # fmt: skip

Array = NDArray[np.float64]
COSTS = ("axial", "strain", "stress", "gap")
NAMES = ("t", "C_0", "H_k", "H_i")
FREE = (*NAMES, "E_s")
GAIN = 1e-6  # of the cost, at which a fit ends; one standard deviation of an unknown is 1/n of it, n the number of residuals
STRAINS, STRESSES = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)
AXIAL = np.array([True, True, False, True, True, True])


@dataclass(frozen=True)
class Measured:
    """One test: `strain` [-] and `stress` [Pa] (n, 6), axisymmetric about z, from no strain and an isotropic stress."""

    strain: Array
    stress: Array

    @property
    def pressure(self) -> float:
        """At the start [Pa]."""
        return -float(self.stress[0, 2])

    @property
    def largest_q(self) -> float:
        """max|q| [Pa]."""
        return float(np.abs(deviator(self.stress)).max())

    @property
    def largest_strain(self) -> float:
        """max‖ε‖ [-]."""
        return float(np.linalg.norm(self.strain, axis=1).max())


def measured(test: Curves, frames: int | None = None) -> Measured:
    """The axisymmetric part of a test, thinned to about `frames`; a deviator that the stress had at the start is taken off."""
    kept = test if frames is None else thin(test, frames)
    strain, stress = np.zeros_like(kept.strain), np.zeros_like(kept.total)
    strain[:, :2], strain[:, 2] = (kept.lateral_strain - kept.lateral_strain[0])[:, None], kept.axial_strain
    strain[:, 2] -= strain[0, 2]
    side = -kept.lateral_pressure
    stress[:, :2], stress[:, 2] = side[:, None], side - kept.q
    return Measured(strain, stress)


# -- the law ----------------------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def _update(formulation: str) -> Any:
    return texsol.compile(formulation=formulation)


def _values(law: LawParameters) -> dict[str, float]:
    return model_values(texsol, law.to_json() | {"nu_s": law.nu, "nu_w": law.nu})


def _start(law: LawParameters, pressure: float) -> dict[str, Array]:
    """The state in which no strain carries the isotropic stress −P, all of it in the sand."""
    plastic = np.zeros((1, 6))
    plastic[0, :3] = pressure / (3.0 * law.bulk)
    return {"eps_p": plastic, "alpha": np.zeros((1, 6)), "p": np.zeros(1)}


def _drive(law: LawParameters, test: Measured, formulation: str, control: Array, targets: Array) -> Any:
    from ..integrators import drive_arrays

    return drive_arrays(_update(formulation), control, targets, _values(law), initial_state=_start(law, test.pressure))


# -- the residuals of one test ----------------------------------------------------------------------------------------------------


def _two(tensor: Array) -> Array:
    """(√2 a_r, a_z): two numbers per frame of the same norm as the tensor."""
    return np.stack([np.sqrt(2.0) * lateral(tensor), axial(tensor)], axis=-1).ravel()


def _by_axial_strain(law: LawParameters, test: Measured) -> tuple[Array, int]:
    targets = np.where(AXIAL, test.stress, test.strain)
    found = _drive(law, test, "strain", AXIAL, targets)
    turns = int(np.sum(found.iterations))
    return axial(found.sig - test.stress) / test.largest_q, len(targets) + turns


def _by_strain(law: LawParameters, test: Measured) -> tuple[Array, int]:
    found = _drive(law, test, "strain", STRAINS, test.strain)
    return _two(found.sig - test.stress) / test.largest_q, len(test.strain)


def _by_stress(law: LawParameters, test: Measured) -> tuple[Array, int]:
    found = _drive(law, test, "stress", STRESSES, test.stress)
    return _two(found.eps - test.strain) / test.largest_strain, len(test.strain)


def gap(law: LawParameters, test: Measured) -> tuple[Array, Array]:
    """e_k [J/m³] at every frame, shape (n,), and ε_k − ε̂_k, shape (n, 6)."""
    path = _drive(law, test, "strain", STRAINS, test.strain)
    start = _start(law, test.pressure)
    before = {k: np.concatenate([start[k], v[:-1]]) for k, v in path.state.items()}
    update, values = _update("stress"), _values(law)
    back = update(test.stress, before, **values)
    here = path.psi + np.diff(path.dissipation, prepend=0.0)
    there = update.energy(back.strain, back.state, **values) + back.dissipation
    apart = test.strain - back.strain
    return np.maximum(here - there - (test.stress * apart).sum(axis=1), 0.0), apart


def _by_gap(law: LawParameters, test: Measured) -> tuple[Array, int]:
    error, apart = gap(law, test)
    shear = law.E_s / (2.0 * (1.0 + law.nu))
    volume = np.sqrt(law.bulk) * apart[:, :3].sum(axis=1)
    direction = np.stack([volume, np.sqrt(4.0 / 3.0 * shear) * deviator(apart)], axis=-1)
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    unit = direction / np.where(length > 0.0, length, 1.0)
    root = np.sqrt(error / (test.largest_q * test.largest_strain))
    return (root[:, None] * unit).ravel(), 2 * len(error)


RESIDUALS: dict[str, Callable[[LawParameters, Measured], tuple[Array, int]]] = {
    "axial": _by_axial_strain, "strain": _by_strain, "stress": _by_stress, "gap": _by_gap,
}  # fmt: skip


def plastic_path(law: LawParameters, test: Measured, cost: str) -> float:
    """p at the end of the path that a cost follows [-]: what noise adds to it is flow that never was."""
    kind, control, targets = {
        "axial": ("strain", AXIAL, np.where(AXIAL, test.stress, test.strain)),
        "stress": ("stress", STRESSES, test.stress),
    }.get(cost, ("strain", STRAINS, test.strain))
    return float(_drive(law, test, kind, control, targets).state["p"][-1])


# -- the fit ----------------------------------------------------------------------------------------------------------------------


def values_by_name(law: LawParameters, names: Sequence[str]) -> Array:
    """t [-], C_0, H_k, H_i, E_s [Pa] of a law, those that are named."""
    known = law.to_json() | {"t": law.t}
    return np.array([known[name] for name in names])


class Problem:
    """The residuals of all tests, each test with the same weight; counts evaluations and steps of the law."""

    def __init__(self, cost: str, tests: Sequence[Measured], base: LawParameters, names: Sequence[str]) -> None:
        self.cost, self.tests, self.base, self.names = cost, list(tests), base, tuple(names)
        self.evaluations = self.law_steps = self.refused = 0
        level = float(np.mean([test.pressure for test in tests]))
        scales = {"t": 0.3, "C_0": 0.1 * level, "H_k": 0.1 * base.E_s, "H_i": 0.1 * base.E_s, "E_s": base.E_s}
        self.units = np.array([scales[name] for name in self.names])
        self.upper = np.array([{"t": MAX_SLOPE / 0.3, "E_s": 10.0}.get(name, 100.0) for name in self.names])

    def law(self, y: Array) -> LawParameters:
        """Parameters of unknowns in units of order one; the least H_k, C_0 and E_s keep the law regular."""
        found = dict(zip(self.names, (np.maximum(y, 0.0) * self.units).tolist(), strict=True))
        floors = {"C_0": 1e-2, "H_k": 1e-7 * self.base.E_s, "E_s": 0.02 * self.base.E_s}
        found = {name: max(value, floors.get(name, 0.0)) for name, value in found.items()}
        if "t" in found:
            found["theta_f"] = float(np.arctan(found.pop("t")))
        return replace(self.base, **found)

    def unknowns(self, law: LawParameters) -> Array:
        """The reverse of `law`."""
        return values_by_name(law, self.names) / self.units

    def residual(self, law: LawParameters) -> Array:
        """All tests, stacked, each over the root of its number of frames; raises `ConvergenceError` where the law cannot follow."""
        self.evaluations += 1
        out = []
        for test in self.tests:
            found, steps = RESIDUALS[self.cost](law, test)
            self.law_steps += steps
            out.append(found / np.sqrt(len(test.strain)))
        return np.concatenate(out)

    def misfit(self, law: LawParameters) -> float:
        """Root of the mean over the tests of the sum of squares."""
        return float(np.linalg.norm(self.residual(law)) / np.sqrt(len(self.tests)))

    def at(self, y: Array) -> Array:
        """Residuals at unknowns, infinite where the law cannot follow the test: a step there is taken back."""
        if not np.isfinite(y).all():
            raise ConvergenceError(f"{self.cost}: the law cannot follow the tests beside a point of the fit")
        try:
            return self.residual(self.law(y))
        except ConvergenceError:
            self.refused += 1
            width = 1 if self.cost == "axial" else 2
            return np.full(width * sum(len(test.strain) for test in self.tests), np.inf)

    def jacobian(self, law: LawParameters, step: float = 1e-4) -> Array:
        """∂r/∂ln θ by central differences (of unknowns near zero forward and per unit), shape (count, len(names))."""
        y, columns = self.unknowns(law), []
        for k in range(len(y)):
            h = step * max(float(y[k]), 0.1)
            up, down = y.copy(), y.copy()
            up[k], down[k] = y[k] + h, max(y[k] - h, 0.0)
            slope = (self.residual(self.law(up)) - self.residual(self.law(down))) / (up[k] - down[k])
            columns.append(slope * (y[k] if y[k] > 1e-6 else 1.0))
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class Fit:
    """Fitted `law`, half the linearised 95 % interval of each unknown in its unit (NaN on a bound), condition number of ∂r/∂ln θ, and
    counts without those of the intervals; `failure` says why there is no fit (`law` is then the start)."""

    law: LawParameters
    half: Array
    misfit: float
    condition: float
    evaluations: int
    law_steps: int
    refused: int
    failure: str = ""


def guess(base: LawParameters, tests: Sequence[Measured]) -> LawParameters:
    """Where a fit begins, without a look at the answer."""
    level = float(np.mean([test.pressure for test in tests]))
    return replace(base, theta_f=0.2, C_0=0.06 * level, H_k=0.05 * base.E_s, H_i=0.05 * base.E_s)


def fit(
    cost: str,
    tests: Sequence[Measured],
    base: LawParameters,
    *,
    names: Sequence[str] = NAMES,
    start: LawParameters | None = None,
) -> Fit:
    """Fit the named unknowns by one of `COSTS`; the other parameters are those of `base`. A fit that fails is a result as well."""
    problem = Problem(cost, tests, base, names)
    begin = guess(base, tests) if start is None else start
    empty = np.full(len(problem.names), np.nan)
    try:
        with np.errstate(invalid="ignore"):  # where the law is refused
            y = bounded_least_squares(problem.at, problem.unknowns(begin), problem.upper, ftol=GAIN)
        counts = (problem.evaluations, problem.law_steps, problem.refused)
        y = np.where(y <= 1e-6, 0.0, y)
        law = problem.law(y)
        r, jacobian = problem.residual(law), problem.jacobian(law)
    except ConvergenceError as error:
        counts = (problem.evaluations, problem.law_steps, problem.refused)
        return Fit(begin, empty, float("nan"), float("nan"), *counts, str(error))
    inside = (y > 0.0) & (y < problem.upper)
    return Fit(
        law, _half(r, jacobian, inside) * values_by_name(law, names), float(np.linalg.norm(r) / np.sqrt(len(problem.tests))),
        _condition(jacobian[:, inside]), *counts,
    )  # fmt: skip


def _half(r: Array, jacobian: Array, inside: NDArray[np.bool_]) -> Array:
    """Relative half-widths of 95 %; NaN for what sits on a bound or cannot be told."""
    from scipy.stats import t as student

    half = np.full(len(inside), np.nan)
    used = jacobian[:, inside]
    free = len(r) - used.shape[1]
    if used.shape[1] and np.linalg.matrix_rank(used) == used.shape[1]:
        covariance = float(r @ r) / free * np.linalg.inv(used.T @ used)
        half[inside] = float(student.ppf(0.975, free)) * np.sqrt(np.diag(covariance))
    return half


def _condition(jacobian: Array) -> float:
    if not jacobian.shape[1]:
        return float("nan")
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")
