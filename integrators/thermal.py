"""Temperature and its gradient as given data of a step, and what follows from them: entropy and −q/T.

ρs = −ρ ∂ψ/∂T,    −q/T ∈ ∂φ*/∂∇T.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..potentials import Law

__all__ = ["ThermalData", "thermal_input", "thermal_results"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ThermalData:
    """Temperature [K], shape (1,) or (n,), one where the law has none; gradient [K/m] (n, 3) or None."""

    temperature: Array
    gradient: Array | None = None


def thermal_input(law: Law, values: Mapping[str, Any], count: int) -> tuple[ThermalData, dict[str, Any]]:
    """Take temperature and gradient out of `values`, checked; returns them and the rest, the parameters."""
    rest = dict(values)
    if law.temperature is None:
        return ThermalData(np.ones(1)), rest
    name = law.temperature.name
    if name not in rest:
        raise InputError(f"law '{law.name}' has a temperature: give {name}=... [K], a number or one per point")
    temperature = _array(law, name, rest.pop(name), (count,)).reshape(-1)
    if not (temperature > 0.0).all():
        raise InputError(f"law '{law.name}': the temperature '{name}' must be positive, it is in kelvin")
    force = law.forces.get(law.temperature)
    if force is None:
        return ThermalData(temperature), rest
    given = rest.pop(force.name, None)
    gradient = np.zeros((count, 3)) if given is None else _array(law, force.name, given, (count, 3))
    return ThermalData(temperature, np.ascontiguousarray(np.broadcast_to(gradient, (count, 3)))), rest


def _array(law: Law, name: str, value: Any, shape: tuple[int, ...]) -> Array:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"law '{law.name}': '{name}' must be numbers") from None
    if found.shape not in (shape[1:], shape):
        wanted = " or ".join(str(s) for s in dict.fromkeys((shape[1:] or "a number", shape)))
        raise InputError(f"law '{law.name}': '{name}' has shape {found.shape}; it must be {wanted}")
    if not np.isfinite(found).all():
        raise InputError(f"law '{law.name}': '{name}' holds a value that is not finite")
    return np.ascontiguousarray(found)


def thermal_results(
    law: Law, heat: ThermalData, eps: Array, state: Mapping[str, Array], values: Mapping[str, Any]
) -> tuple[Array | None, Array | None]:
    """Entropy [J/(m³ K)] (n,) and −q/T [W/(m² K)] (n, 3) at the end of a step; None where the law has no such quantity."""
    if law.temperature is None:
        return None, None
    from ..potentials.derivative import partial
    from ..potentials.evaluate import evaluate

    numbers = law.values(values)
    table: dict[Any, Any] = {p: numbers[p.name] for p in law.parameters}
    table |= {law.observable: eps, **{v: state[v.name] for v in law.internal}}
    table[law.temperature] = heat.temperature
    entropy = np.broadcast_to(evaluate(law.entropy, table), (len(eps),)).copy()
    force = law.forces.get(law.temperature)
    potential = law.force_potential
    if force is None or potential is None or force.role != "force":
        return entropy, None
    slope = partial(potential.finite, force)
    flux = evaluate(slope, table | {force: heat.gradient})
    return entropy, np.broadcast_to(flux, (len(eps), 3)).copy()
