"""The compiled step of a generated module: which step, which method, the law's own functions, and its row of coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .kernel_types import no_law, no_method
from .kernels import step_kernel, terms_kernel
from .plan import KIND, LINES, METHOD_START, METRIC, ORDERS, SURFACES, UNKNOWNS
from .reduced_affine import affine_method, face_table
from .reduced_projection import projection_method
from .reduced_single import single_method

__all__ = ["StepPointers", "step_pointers"]

Array = NDArray[np.float64]
RANGE = 1e100  # of the moduli of a curved step, and its reciprocal: products of three stay in the range of the exponent


@dataclass(frozen=True)
class StepPointers:
    """Pointers that every call hands to the compiled code."""

    step: Any
    method: Any
    law: Any
    rest: Any
    plan: NDArray[np.int64]
    numbers: Callable[..., Any]
    faces: bool
    curved: bool = False
    memory: dict[bytes, Array] = field(default_factory=dict)

    def run(
        self,
        eps: Array,
        old: Array,
        new: Array,
        stress: Array,
        tangent: Array,
        want: bool,
        dissipation: Array,
        status: NDArray[np.int64],
        coefficients: Array,
    ) -> None:
        """The step at every point; `tangent` has rows of 36."""
        arguments = (eps, old, new, stress, tangent, int(want), dissipation, status, coefficients, self.plan)
        self.step(self.method, self.law, self.rest, *arguments)

    def coefficients(self, values: Array, dt: Any, temperature: Array) -> Array:
        """Rows of coefficients: one, or one per point where the temperature (or dt) has one per point."""
        key = values.tobytes() + np.asarray(dt, dtype=float).tobytes() + temperature.tobytes()
        found = self.memory.get(key)
        if found is None:
            found = self._rows(values, dt, temperature)
            self.memory.clear()
            self.memory[key] = found
        return found

    def _rows(self, values: Array, dt: Any, temperature: Array) -> Array:
        heat = temperature if temperature.size > 1 else temperature[0]
        time = np.asarray(dt, dtype=float) if np.ndim(dt) else np.float64(dt)
        with np.errstate(all="ignore"):
            entries = self.numbers(values, time, heat)
        rows = np.array(np.broadcast_arrays(*entries), dtype=float)
        rows = np.ascontiguousarray(rows.reshape(len(entries), -1).T)
        if self.curved:
            self._check_range(rows)
        if self.faces:
            return np.array([np.concatenate([row, self._table(row)]) for row in rows])
        return rows

    def _check_range(self, rows: Array) -> None:
        n, start = int(self.plan[UNKNOWNS]), int(self.plan[METRIC])
        moduli = np.abs(rows[:, start : start + n * n])
        moduli = moduli[moduli > 0.0]
        if moduli.size and not (moduli.min() >= 1.0 / RANGE and moduli.max() <= RANGE):
            raise InputError(
                f"moduli of the step from {moduli.min():.0e} to {moduli.max():.0e}: their products leave the range of the exponent; "
                "give stresses in another unit"
            )

    def _table(self, row: Array) -> Array:
        n, surfaces, orders, start, metric = (int(self.plan[i]) for i in (UNKNOWNS, SURFACES, ORDERS, LINES, METRIC))
        lines = row[start : start + surfaces * (n + 1)].reshape(surfaces, n + 1)
        order = np.zeros((orders, n))
        if self.plan[KIND] == 1:
            order[0, :2], order[1, 1:3] = (-1.0, 1.0), (-1.0, 1.0)
        elif orders:
            order[0, 0] = -1.0
        normals = np.concatenate([lines[:, :n], order])
        limits = np.concatenate([-lines[:, n], np.zeros(orders)])
        return face_table(normals, limits, row[metric : metric + n * n].reshape(n, n))


def step_pointers(module: ModuleType, precision: str = "float64") -> StepPointers:
    """Pointers of a generated module, for arrays of a precision."""
    plan = np.array(module.PLAN, dtype=np.int64)
    method, size = module.METHOD, module.COMPONENTS
    rest = module.rest_ if module.OWN_STRAIN_ENERGY else terms_kernel(size) if module.STRAIN_ENERGY else no_law()
    kind = "closed" if method == "closed" else "reduced"
    step = step_kernel(kind, size, module.PLAN, precision == "float32")
    if method == "closed":
        return StepPointers(step, no_method(), no_law(), rest, plan, module.coefficients_, False)
    if method.endswith("affine"):
        plan[METHOD_START] = module.SIZE
        chosen = affine_method(int(plan[UNKNOWNS]), int(plan[SURFACES] + plan[ORDERS]))
        return StepPointers(step, chosen, no_law(), rest, plan, module.coefficients_, True)
    chosen = single_method(plan) if method.endswith("single") else projection_method(plan)
    return StepPointers(step, chosen, module.functions_, rest, plan, module.coefficients_, False, True)
