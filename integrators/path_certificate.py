"""What can be said of a path after it was followed, by code that did not follow it: duality gaps, and how well unknowns were determined.

Gap of a row: that of the step from the state of the row before to the strain of this row by the general engine, increased by the distance
of stress, forces and state to it, weighed with strain, increment and force (`certificate.duality_gap`). It is linear in an error, so that
a wrong path cannot show a small one; which formulation made the path does not matter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FenchelError
from ..potentials import Law
from .certificate import duality_gap
from .declared import declared_step
from .general_step import GeneralStep
from .history import History, Plan
from .packing import StatePacking
from .thermal import thermal_input

__all__ = ["PathData", "gaps_or_none", "path_gaps", "path_tangents", "worst_condition"]

Array = NDArray[np.float64]
LOST = 1e15


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
        """(rows, time step) such that every row is in one group; steps that differ by rounding are equal."""
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
    """Gap [J/m³] of every row, shape (n,); NaN where the engine itself finds no solution."""
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
