"""The step of a law at given numbers, by cone programs: one set of arrays per law, values and time step, then the engine at every point.

Data that vary from point to point (temperature, frozen state) enter through coefficients. Where the arrays depend on them in right sides
only, they become further data of one program; where they change a matrix, points are grouped by equal coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError, InputError, Status
from ..potentials import Law
from ..potentials.derivative import second_derivative
from .batch import INFEASIBLE, BatchSolution, interior_start, solve_batch
from .declared import DeclaredStep, declared_step, packed_layout, strain_flows
from .general import NOT_FINITE, ROUNDING
from .law_forms import law_forms
from .step_program import StepProgram, assemble, flow_of_dual, flow_of_rates
from .strain_energy import operator_matrices

__all__ = ["GeneralStep", "Part", "StepSolution"]

Array = NDArray[np.float64]
TOLERANCE = 1e-13
NOISE = 1e-13


@dataclass(frozen=True)
class Part:
    """Points that share one program, their data and what the engine found."""

    points: Any
    program: StepProgram
    data: Array
    found: BatchSolution


@dataclass
class StepSolution:
    """`slopes` (n, 6 + …): ∂W/∂(ε, X_n, ε_n), stress, minus the forces, minus σ^ir; `increment` X − X_n; codes of `Status`; `parts`
    by group of points. Driven by the stress, slopes and tangent begin with −ε and minus the compliance."""

    slopes: Array
    tangent: Array | None
    increment: Array
    residual: Array
    status: NDArray[np.int64]
    counts: NDArray[np.int64]
    parts: list[Part]


@dataclass
class GeneralStep:
    """Programs of one law at parameter values and a time step, made when asked for and kept; driven by the stress if `stress`."""

    law: Law
    parameters: Mapping[Any, float]
    dt: float
    declared: DeclaredStep
    stress: bool = False
    _programs: dict[bytes, StepProgram] = field(default_factory=dict)
    _affine: tuple[Array, StepProgram] | bool | None = None

    @classmethod
    def of(
        cls,
        law: Law,
        values: Mapping[str, float],
        dt: float,
        declared: DeclaredStep | None = None,
        stress: bool = False,
    ) -> GeneralStep:
        """`values` by name, checked already; driven by the stress, all of ψ is in the program."""
        numbers = {p: float(values[p.name]) for p in law.parameters}
        return cls(law, numbers, dt, declared or declared_step(law, whole=stress), stress)

    @property
    def program_size(self) -> int:
        """Number of components of the internal variables."""
        return packed_layout(self.law)[1]

    def program(self, row: Array) -> StepProgram:
        """Program at one row of coefficients."""
        key = row.tobytes()
        if key not in self._programs:
            if len(self._programs) > 4096:
                self._programs.clear()
            self._programs[key] = self._assembled(row)
        return self._programs[key]

    def _assembled(self, row: Array) -> StepProgram:
        forms = law_forms(self.declared, {**self.parameters, **self.declared.numbers(row)})
        make = flow_of_dual if forms.dual else flow_of_rates
        flow = None if forms.flow is None else make(forms.flow, self.dt)
        _, size = packed_layout(self.law)
        found = assemble(forms.energy, flow, forms.moved, size, strain_flows(self.law), self.stress)
        if found.unbounded and self.stress:
            raise DeclarationError(
                f"law '{self.law.name}': psi does not resist every strain, its conjugate psi* is not finite; "
                "use the strain formulation"
            )
        if found.unbounded:
            raise InputError(
                f"law '{self.law.name}': the step has no solution for these values: the energy decreases without bound"
            )
        return found

    def groups(self, eps: Array, old: Array, temperature: Array | None) -> list[tuple[Any, StepProgram, Array]]:
        """(points, program, data) such that every point is in one group."""
        n = len(eps)
        data = np.ascontiguousarray(np.hstack([eps, old]))
        rows = self.declared.coefficient_rows(self.parameters, old, temperature)
        if not np.isfinite(rows).all():
            raise InputError(
                f"law '{self.law.name}': a coefficient of the temperature or of frozen state is not finite"
            )
        if rows.shape[1] == 0 or n == 0:
            return [(slice(None), self.program(np.zeros(rows.shape[1])), data)]
        distinct, place = np.unique(rows, axis=0, return_inverse=True)
        if len(distinct) > 2 + rows.shape[1]:
            affine = self._affine_program(distinct)
            if affine is not None:
                base, program = affine
                return [(slice(None), program, np.ascontiguousarray(np.hstack([data, rows - base])))]
        place = place.reshape(-1)
        found = []
        for k, row in enumerate(distinct):
            points = np.flatnonzero(place == k)
            found.append((points, self.program(row), data[points]))
        return found

    def _affine_program(self, rows: Array) -> tuple[Array, StepProgram] | None:
        """(base row, program with the coefficients as further data), or None where a matrix depends on them."""
        if self._affine is not None:
            return None if isinstance(self._affine, bool) else self._affine
        self._affine = False
        base, test = rows[0], rows[-1]
        start = self.program(base)
        wide = start
        for k in range(rows.shape[1]):
            span = rows[:, k] - base[k]
            far = int(np.abs(span).argmax())
            step = span[far]
            if step == 0.0:
                wide = _with_column(wide, start, start, 1.0)
                continue
            moved = base.copy()
            moved[k] = rows[far, k]
            other = self.program(moved)
            if not _same_matrices(start, other):
                return None
            wide = _with_column(wide, start, other, step)
        last = self.program(test)
        if not _same_matrices(start, last) or not _agrees(wide, last, test - base):
            return None
        self._affine = (base, wide)
        return self._affine

    def solve(
        self,
        eps: Array,
        old: Array,
        temperature: Array | None = None,
        *,
        tangent: bool = True,
        method: str = "general",
        tolerance: float = TOLERANCE,
        start: StepSolution | None = None,
        threads: int = 1,
    ) -> StepSolution:
        """The step at every point, (n, 6) strains (or stresses), (n, …) packed old states; `method` "general", or "conic" to polish
        clarabel's answer.

        `start`, an earlier solution at the same number of points and groups, warms the engine.
        """
        n = len(eps)
        width = 6 + old.shape[1]
        slopes, increment = np.zeros((n, width)), np.zeros((n, packed_layout(self.law)[1]))
        tangents = np.zeros((n, 6, 6)) if tangent else None
        residual, status, counts = np.zeros(n), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        parts: list[Part] = []
        for k, (points, program, data) in enumerate(self.groups(eps, old, temperature)):
            warm = None
            if (
                start is not None
                and k < len(start.parts)
                and start.parts[k].found.y.shape == (len(data), program.compact.program.p.size)
            ):
                warm = start.parts[k].found.y, start.parts[k].found.multipliers
            if method == "conic":
                warm, _ = interior_start(program, data)
            found = solve_batch(program, data, tangent=tangent, tolerance=tolerance, start=warm, threads=threads)
            slopes[points] = found.slopes[:, :width]
            increment[points] = _increments(program.compact.program, data, found.y)
            if tangents is not None and found.tangent is not None:
                tangents[points] = found.tangent
            residual[points], counts[points] = found.residual, found.counts
            status[points] = _codes(program, data, found)
            parts.append(Part(points, program, data, found))
        known: dict[Any, Any] = {**self.parameters, self.law.observable: eps}
        if temperature is not None:
            known[self.law.temperature] = temperature
        self.declared.strain_energy.add(slopes[:, :6], tangents, known)
        if tangents is not None:
            self._elastic(tangents, known, old, np.flatnonzero((status == 0) & ~increment.any(axis=1)))
        return StepSolution(slopes, tangents, increment, residual, status, counts, parts)

    def _elastic(self, tangents: Array, known: Mapping[Any, Any], old: Array, rest: Any) -> None:
        """∂²ψ/∂ε² at the points `rest` where nothing flows, for φ* an indicator: the derivative there, or the one-sided one on a surface.

        The cone program has it too, but not at coinciding principal values, where the multipliers of its cones are many.
        """
        law, step = self.law, self.declared
        if self.stress or not step.surfaces or step.finite != 0 or step.word != "phi_star" or strain_flows(law):
            return
        operator = second_derivative(law.energy, law.observable, law.observable)
        if operator.extremes or operator.sandwiched or not rest.size:
            return
        layout, _ = packed_layout(law)
        here = {k: v[rest] if np.ndim(v) and len(v) == len(tangents) else v for k, v in known.items()}
        for variable in law.internal:
            start, length = layout[variable.name]
            here[variable] = old[rest, start] if length == 1 else old[rest, start : start + length]
        tangents[rest] = operator_matrices(operator, here, rest.size)


def _increments(program: StepProgram, data: Array, y: Array) -> Array:
    """X − X_n; what is below the rounding of the step is zero, so that an elastic step leaves the state as it was."""
    found = program.increments(data, y)
    q, h = program.q0 + data @ program.q1.T, program.h0 + data @ program.h1.T
    size = np.maximum(np.abs(q).max(axis=1, initial=0.0), np.abs(h).max(axis=1, initial=0.0))
    noise = NOISE * size[:, None] * np.abs(program.increment_y).sum(axis=1)
    return np.where(np.abs(found) <= noise, 0.0, found)


def _codes(program: StepProgram, data: Array, found: BatchSolution) -> NDArray[np.int64]:
    codes = np.full(len(data), int(Status.ITERATION_LIMIT))
    codes[found.status <= ROUNDING] = int(Status.CONVERGED)
    codes[found.status == NOT_FINITE] = int(Status.NOT_FINITE)
    codes[found.status == INFEASIBLE] = int(Status.INFEASIBLE)
    missed = program.misfit_0 + data @ program.misfit_d.T
    codes[np.abs(missed).max(axis=1, initial=0.0) > 1e-9] = int(Status.INFEASIBLE)
    return codes


def _same_matrices(a: StepProgram, b: StepProgram) -> bool:
    return (
        a.p.shape == b.p.shape
        and a.cones == b.cones
        and np.array_equal(a.p, b.p)
        and np.array_equal(a.G, b.G)
        and np.array_equal(a.increment_y, b.increment_y)
    )


def _with_column(wide: StepProgram, base: StepProgram, other: StepProgram, step: float) -> StepProgram:
    """`wide` with one more datum, along which the right sides go from those of `base` to those of `other` over `step`."""

    def column(matrix: Array, one: Array, two: Array) -> Array:
        return np.ascontiguousarray(np.hstack([matrix, ((two - one) / step)[:, None]]))

    size = wide.C.shape[0]
    C = np.zeros((size + 1, size + 1))
    C[:size, :size] = wide.C
    C[: base.c1.size, size] = (other.c1 - base.c1) / step
    return replace(
        wide,
        q1=column(wide.q1, base.q0, other.q0),
        h1=column(wide.h1, base.h0, other.h0),
        C=C,
        c1=np.append(wide.c1, 0.0),
        increment_d=column(wide.increment_d, base.increment_0, other.increment_0),
        misfit_d=column(wide.misfit_d, base.misfit_0, other.misfit_0),
    )


def _agrees(wide: StepProgram, other: StepProgram, shift: Array) -> bool:
    """True if the right sides at `shift` of the coefficients are those of the program made there."""
    k = shift.size
    for at, slope, true in (
        (wide.q0, wide.q1[:, -k:], other.q0),
        (wide.h0, wide.h1[:, -k:], other.h0),
        (wide.c1[:-k], wide.C[:-k, -k:], other.c1),
        (wide.increment_0, wide.increment_d[:, -k:], other.increment_0),
    ):
        size = max(float(np.abs(true).max(initial=0.0)), float(np.abs(at).max(initial=0.0)))
        if np.abs(at + slope @ shift - true).max(initial=0.0) > 1e-12 * size:
            return False
    return True
