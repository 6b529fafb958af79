"""What the generated steps share, whichever of strain and stress drives them: the law, its module, and its states and energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..potentials import Law
from .dimension import SPACE, Dimension
from .packing import StatePacking
from .summary import step_words
from .thermal import thermal_input

__all__ = ["CompiledStep", "packed_values", "step_time"]

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class CompiledStep:
    """Generated `module` of `law`; `layout` gives the place of each internal variable in a packed state row."""

    law: Law
    module: ModuleType
    tangent: bool = True
    solver: str = "closed"
    layout: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    state_size: int = 0
    why: str = ""
    dimension: Dimension = SPACE

    def __repr__(self) -> str:
        return step_words(self)

    @cached_property
    def packing(self) -> StatePacking:
        """The state by name and in packed rows."""
        return StatePacking(self.law, self.layout, self.state_size)

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state: all internal variables zero."""
        return self.packing.initial_state(point_count)

    def unpack(self, packed: Array) -> dict[str, Array]:
        """Views of a packed state (n, state_size) by name."""
        return self.packing.unpack(packed)

    def pack(self, state: Mapping[str, Any] | None, point_count: int) -> Array:
        """Packed copy of a state by name; None is the virgin state. `InputError` for unknown names, shapes and NaN."""
        return self.packing.pack(state, point_count)

    def energy(self, eps: Any, state: Mapping[str, Any] | None = None, /, **values: Any) -> Array:
        """Free energy ρψ [J/m³] at strains (all components of the dimension) and internal variables, shape (n,)."""
        strain = self.dimension.complete(eps)
        heat, values = thermal_input(self.law, values, strain.shape[0])
        packed = self.pack(state, strain.shape[0])
        return self.energies(strain, packed, heat.temperature, packed_values(self, values))

    def energies(self, eps: Array, packed: Array, temperature: Array, parameters: Array) -> Array:
        """ρψ [J/m³] of packed states, shape (n,)."""
        psi = np.empty(eps.shape[0])
        self.module.energies_(eps, packed, temperature, parameters, psi)
        return psi


def packed_values(update: Any, given: Mapping[str, Any]) -> Array:
    """Parameter values as an array in the order of `law.parameters`, checked against bounds and the conditions of admissibility."""
    return np.array(list(update.law.admissible_values(given).values()), dtype=float)


def step_time(dt: Any) -> float:
    """The time step [s], checked."""
    if not (np.ndim(dt) == 0 and np.isfinite(dt) and dt > 0):
        raise InputError(f"dt = {dt}: the time step must be positive and finite")
    return float(dt)
