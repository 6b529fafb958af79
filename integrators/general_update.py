"""The step of any declared convex law: its cone program at every point, by the general engine.

Same call as `Update`. ψ may be any convex energy with a conic form, φ* any sum of a finite convex part and indicators (or φ of the rates),
with frozen state and temperature. A law with a force (or rate) of its observable, as Kelvin–Voigt, keeps the old strain in its state under
the observable's name. The dissipation of the step is Y·(X − X_n) + σ^ir:(ε − ε_n), with the forces at its end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError, InputError
from ..potentials import Law
from ..potentials.evaluate import evaluate
from .declared import DeclaredStep, components, declared_step
from .dimension import SPACE
from .failures import raise_failures
from .general_step import TOLERANCE, GeneralStep, StepSolution
from .packing import StatePacking
from .sensitivity import Sensitivities, sensitivities
from .step_result import StepResult
from .summary import step_words
from .thermal import thermal_input, thermal_results
from .threads import checked_threads

__all__ = ["GeneralUpdate"]

Array = NDArray[np.float64]
KEPT = 8
CLARABEL = 1e-8  # what clarabel asks of its gap and residuals by itself


@dataclass(frozen=True)
class GeneralUpdate:
    """`solver` is "general" (the engine), "conic" (clarabel polished by the engine) or "cvxpy" (neither polished nor fast); the engine
    takes its points in `threads`, which does not change an answer. `tolerance` of the residual relative to the data: of the engine, where
    clarabel's answer is polished too, of clarabel itself under "cvxpy".

    Of the formulation "stress" the step takes stresses, with the strain among the unknowns of the program.
    """

    law: Law
    packing: StatePacking
    declared: DeclaredStep
    tangent: bool = True
    solver: str = "general"
    why: str = ""
    formulation: str = "strain"
    threads: int = 1
    tolerance: float = TOLERANCE
    _steps: dict[Any, GeneralStep] = field(default_factory=dict, compare=False, repr=False)

    def __repr__(self) -> str:
        return step_words(self)

    @classmethod
    def of(
        cls,
        law: Law,
        tangent: bool = True,
        solver: str = "general",
        why: str = "",
        formulation: str = "strain",
        threads: int = 1,
        tolerance: float | None = None,
    ) -> GeneralUpdate:
        """Update of a law; refuses in one line a law with a term that has no conic form, as far as that shows before values are given."""
        checked_threads(threads)
        declared = declared_step(law, whole=solver != "general" or formulation == "stress")
        if tolerance is None:
            tolerance = CLARABEL if solver == "cvxpy" else TOLERANCE
        found = cls(law, StatePacking.of(law), declared, tangent, solver, why, formulation, threads, tolerance)
        found._rehearse()
        return found

    @property
    def layout(self) -> Mapping[str, tuple[int, int]]:
        """Place of each state variable in a packed row."""
        return self.packing.layout

    @property
    def state_size(self) -> int:
        """Length of a packed row."""
        return self.packing.state_size

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state."""
        return self.packing.initial_state(point_count)

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> Any:
        """See `Update.__call__`.

        Raises `InputError` for bad input, for values at which ψ or φ* is not convex and where f(0) > 0, and `ConvergenceError`, naming the
        first points, where the step has no solution or none is found.
        """
        driven = SPACE.stresses(eps_new) if self.turned else SPACE.strains(eps_new)
        old = self.packing.pack(state, len(driven))
        heat, given = thermal_input(self.law, values, len(driven))
        numbers = self.law.admissible_values(given)
        temperature = heat.temperature if self.law.temperature is not None else None
        found, gap = self.solve(driven, old, dt, numbers, temperature), None
        raise_failures(found.status, driven, self.formulation)
        answer, tangent = self.response(found)
        eps, stress = (answer, driven) if self.turned else (driven, answer)
        new, lost = self.outcome(eps, old, found)
        if certify:
            from .certificate import solution_gap

            gap = solution_gap(found, len(driven))
        named = self.packing.unpack(new)
        entropy, flux = thermal_results(self.law, heat, eps, named, given)
        return StepResult(stress, tangent, named, lost, found.status, gap, entropy, flux, eps)

    @property
    def turned(self) -> bool:
        """True if the stress drives the step."""
        return self.formulation == "stress"

    def response(self, found: StepSolution) -> tuple[Array, Array | None]:
        """(stress, ∂σ/∂ε) of a solution, or (strain, ∂ε/∂σ) of one that is driven by the stress."""
        if not self.turned:
            return found.slopes[:, :6].copy(), found.tangent
        return -found.slopes[:, :6], None if found.tangent is None else -found.tangent

    def sensitivities(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        wrt: Sequence[str] | str | None = None,
        d_state: Mapping[str, Any] | None = None,
        d_eps: Any = None,
        **values: Any,
    ) -> Sensitivities:
        """See `Update.sensitivities`. `DeclarationError` for powers, exponentials and logarithms: reduced steps only."""
        return sensitivities(self, eps_new, state, dt, wrt, d_state, d_eps, values)

    def arguments(self, values: Mapping[str, Any], count: int) -> tuple[dict[str, float], Array | None]:
        """Checked parameters by name, and the temperature at every point."""
        heat, given = thermal_input(self.law, values, count)
        temperature = heat.temperature if self.law.temperature is not None else None
        return self.law.admissible_values(given), temperature

    def step(self, numbers: Mapping[str, float], dt: float) -> GeneralStep:
        """Programs at these parameters and time step, kept for the next call."""
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt = {dt}: the time step must be positive and finite")
        key = (tuple(numbers.values()), float(dt))
        if key not in self._steps:
            if len(self._steps) >= KEPT:
                self._steps.pop(next(iter(self._steps)))
            self._steps[key] = GeneralStep.of(self.law, numbers, float(dt), self.declared, self.turned)
        return self._steps[key]

    def solve(
        self,
        eps: Array,
        old: Array,
        dt: float,
        numbers: Mapping[str, float],
        temperature: Array | None,
        *,
        tangent: bool | None = None,
        start: StepSolution | None = None,
    ) -> StepSolution:
        """The step on packed arrays; statuses are not looked at."""
        wanted = self.tangent if tangent is None else tangent
        step = self.step(numbers, dt)
        if self.solver == "cvxpy":
            from .conic import reference

            return reference(step, eps, old, temperature, self.tolerance)
        method = "conic" if self.solver == "conic" else "general"
        return step.solve(
            eps,
            old,
            temperature,
            tangent=wanted,
            method=method,
            tolerance=self.tolerance,
            start=start,
            threads=self.threads,
        )

    def outcome(self, eps: Array, old: Array, found: StepSolution) -> tuple[Array, Array]:
        """(packed new state, dissipation of the step [J/m³])."""
        size = found.increment.shape[1]
        new = old.copy()
        new[:, :size] += found.increment
        change = found.increment
        if old.shape[1] > size:
            change = np.hstack([change, eps - old[:, size:]])
            new[:, size:] = eps
        return new, -np.einsum("ij,ij->i", found.slopes[:, 6:], change)

    def energy(self, eps: Any, state: Mapping[str, Any] | None = None, /, **values: Any) -> Array:
        """Free energy ψ [J/m³] at the given strains and internal variables, shape (n,)."""
        strain = SPACE.strains(eps)
        packed = self.packing.pack(state, len(strain))
        numbers, temperature = self.arguments(values, len(strain))
        known: dict[Any, Any] = {p: numbers[p.name] for p in self.law.parameters}
        known[self.law.observable] = strain
        for variable in self.law.internal:
            start, _ = self.layout[variable.name]
            length = components(variable)
            known[variable] = packed[:, start] if length == 1 else packed[:, start : start + length]
        if temperature is not None:
            known[self.law.temperature] = temperature
        return np.broadcast_to(evaluate(self.law.energy, known), (len(strain),)).copy()

    def _rehearse(self) -> None:
        """Make the program once at harmless values, so that a term without conic form is refused when the law is compiled."""
        numbers = {p.name: _harmless(p) for p in self.law.parameters}
        step = GeneralStep.of(self.law, numbers, 1.0, self.declared, self.turned)
        temperature = None if self.law.temperature is None else np.array([300.0])
        try:
            rows = self.declared.coefficient_rows(step.parameters, np.zeros((1, self.state_size)), temperature)
            step.program(np.where(np.isfinite(rows[0]), rows[0], 1.0))
        except DeclarationError:
            raise
        except (InputError, ArithmeticError, ValueError, np.linalg.LinAlgError):
            pass  # a matter of these values, not of the declaration


def _harmless(parameter: Any) -> float:
    if parameter.default is not None:
        return float(parameter.default)
    return 0.5 * (max(parameter.lower, 0.1) + min(parameter.upper, 0.4))
