"""What can be said of a path after it was followed, by code that did not follow it: duality gaps, and how well unknowns were determined.

Two bounds of the gap of a row, the step from the state of the row before to the strain of this row, which formulation ever made it; the
smaller one counts:

* that of the same step by the general engine, increased by the distance of stress, forces and state to it, weighed with strain, increment
  and force (`certificate.duality_gap`);
* what the optimality conditions of the declaration leave open, |ΔX − Δt ∂φ*(Y) − Σ λ_j ∂f_j(Y)|·|Y| + Σ λ_j |f_j(Y)|, λ ≥ 0 by least
  squares, and |σ − ∂ψ/∂ε|·|ε|. It is not finite at a kink of f, and does not exist for laws that the explicit scheme does not take.

Both are linear in an error, so that a wrong path cannot show a small one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError, FenchelError
from ..potentials import Law
from .certificate import duality_gap
from .declared import declared_step
from .explicit import ExplicitUpdate, Integration
from .general_step import GeneralStep
from .history import History, Plan
from .packing import StatePacking
from .thermal import thermal_input

__all__ = ["PathData", "gaps_or_none", "path_gaps", "path_tangents", "worst_condition"]

Array = NDArray[np.float64]
LOST = 1e15
ACTIVE = 1e-6


@dataclass(frozen=True)
class PathData:
    """What every run of a comparison is given: parameter `values` by name, time `steps` [s] (n,), `temperatures` [K] (n,) or None."""

    law: Law
    values: Mapping[str, Any]
    steps: Array
    temperatures: Array | None

    def given(self, rows: Any) -> dict[str, Any]:
        """Values by name at some rows, the temperature among them."""
        heat = self.law.temperature
        if heat is None or self.temperatures is None:
            return dict(self.values)
        return {**self.values, heat.name: self.temperatures[rows]}

    def groups(self) -> list[tuple[NDArray[np.intp], float]]:
        """(rows, time step), every row in one group; steps that differ by rounding are equal, and all where time does not matter."""
        law = self.law
        if law.phi is None and law.viscous == 0 and law.observable not in law.forces:
            return [(np.arange(len(self.steps)), 1.0)]
        logs = np.round(np.log(self.steps), 11)
        return [(rows := np.flatnonzero(logs == value), float(self.steps[rows[0]])) for value in np.unique(logs)]

    def packed(self, history: History) -> tuple[Array, Array]:
        """(states before, states after) every row of a history, packed; the path begins in the virgin state."""
        packing = StatePacking.of(self.law)
        named = dict(history.state)
        if self.law.observable.name in packing.layout:
            named[self.law.observable.name] = history.eps
        new = packing.pack({name: named[name] for name in packing.layout}, len(history.eps))
        return np.concatenate([np.zeros_like(new[:1]), new[:-1]]), new


def path_gaps(data: PathData, history: History) -> Array:
    """Gap [J/m³] of every row, shape (n,); NaN where neither bound is to be had."""
    return np.fmin(_gaps_by_engine(data, history), _gaps_by_conditions(data, history))


def _gaps_by_conditions(data: PathData, history: History) -> Array:
    old, new = data.packed(history)
    gaps = np.full(len(old), np.nan)
    try:
        update = ExplicitUpdate(data.law)
    except DeclarationError:
        return gaps
    before = np.concatenate([np.zeros((1, 6)), history.eps[:-1]])
    numbers = data.law.values(data.values)
    for rows, dt in data.groups():
        eps, everyone = history.eps[rows], np.arange(len(rows))
        step = Integration(update, numbers, eps, np.hstack([old[rows], before[rows]]), dt)
        with np.errstate(all="ignore"):
            gaps[rows] = _left_open(step, eps, history.sig[rows], new[rows], everyone)
    return gaps


def _left_open(step: Integration, eps: Array, sig: Array, new: Array, everyone: NDArray[np.intp]) -> Array:
    from scipy.optimize import nnls

    y = step.forces(eps, new)
    rest = new - step.old - step.creep_flow(y, everyone)
    f, normals = step.surfaces(y, everyone), step.normals(y, everyone)
    near = f >= -ACTIVE * (1.0 + np.abs(step.surfaces(np.zeros_like(y), everyone)))
    left = np.abs((sig - step.stress(eps, new)) * eps).sum(axis=1)
    for row in everyone:
        active = np.flatnonzero(near[row])
        gradient = normals[row, active]
        if not (np.isfinite(gradient).all() and np.isfinite(rest[row]).all()):
            left[row] = np.nan
            continue
        multipliers = nnls(gradient.T, rest[row])[0] if active.size and rest.shape[1] else np.zeros(len(active))
        apart = rest[row] - multipliers @ gradient
        left[row] += (np.abs(apart) * np.abs(y[row])).sum() + (multipliers * np.abs(f[row, active])).sum()
        left[row] += (np.maximum(f[row], 0.0) * np.abs(rest[row]).max(initial=0.0)).sum()
    return left


def _gaps_by_engine(data: PathData, history: History) -> Array:
    old, new = data.packed(history)
    gaps = np.full(len(old), np.nan)
    for rows, dt in data.groups():
        heat, rest = thermal_input(data.law, data.given(rows), len(rows))
        temperature = heat.temperature if data.law.temperature is not None else None
        numbers = data.law.values(rest)
        eps = np.ascontiguousarray(history.eps[rows])
        step = GeneralStep.of(data.law, numbers, dt, declared_step(data.law))
        best = step.solve(eps, old[rows], temperature, tangent=False)
        own = duality_gap(
            _Named(data.law),
            eps,
            old[rows],
            new[rows],
            np.array(list(numbers.values())),
            dt=dt,
            temperature=temperature,
        )
        apart = np.abs((history.sig[rows] - best.slopes[:, :6]) * eps).sum(axis=1)
        gaps[rows] = np.where(best.status == 0, own + apart, np.nan)
    return gaps


@dataclass(frozen=True)
class _Named:
    law: Law


def path_tangents(data: PathData, update: Any, history: History) -> Array:
    """Consistent tangents ∂σ/∂ε [Pa] (n, 6, 6) at the rows of a history, by an update that is driven by the strain."""
    old, _ = data.packed(history)
    packing = StatePacking.of(data.law)
    found = np.full((len(old), 6, 6), np.nan)
    for rows, dt in data.groups():
        out = update(history.eps[rows], packing.unpack(old[rows]), dt, **data.given(rows))
        found[rows] = out.tangent
    return found


def worst_condition(plan: Plan, tangents: Array, turned: bool) -> float:
    """Largest condition number along the path of the matrix that the unknowns of a step are solved from, V C Z, or V C⁻¹ Z if `turned`;
    1 if nothing is unknown, infinite where it has lost all digits."""
    if plan.unknowns == 0:
        return 1.0
    worst = 1.0
    for tangent in tangents:
        if turned:
            size = np.linalg.svd(tangent, compute_uv=False)
            if not size[-1] > size[0] / LOST:
                return float("inf")
            tangent = np.linalg.inv(tangent)
        values = np.linalg.svd(plan.v @ tangent @ plan.z, compute_uv=False)
        if not values[-1] > values[0] / LOST:
            return float("inf")
        worst = max(worst, float(values[0] / values[-1]))
    return worst


def gaps_or_none(data: PathData, history: History) -> Array | None:
    """`path_gaps`, None where the law has no program for the engine."""
    try:
        found = path_gaps(data, history)
    except (FenchelError, np.linalg.LinAlgError):
        return None
    return found if np.isfinite(found).all() else None
