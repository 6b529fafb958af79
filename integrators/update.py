"""The implicit step of a law as a callable on arrays of points.

    (ε_{n+1}, X_n) ↦ (σ, X_{n+1}):   X_{n+1} = argmin ψ(ε_{n+1}, X) + φ(X − X_n),   σ = ∂ψ/∂ε,

φ the support function of the elastic domain: implicit Euler, and exactly a convex projection of the trial forces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError, InputError
from ..potentials import Law
from .compiled_step import CompiledStep, packed_values, step_time
from .declared import state_layout
from .dimension import dimension_named
from .failures import raise_failures
from .kernels import step_text
from .module_store import load_module
from .packing import StatePacking
from .pointers import StepPointers, step_pointers
from .points import run_points
from .relaxed import Evaluation, condensed, relax
from .sensitivity import Sensitivities, sensitivities
from .step_result import StepResult
from .structure import NoReduction
from .thermal import ThermalData, thermal_input, thermal_results
from .threads import checked_threads

__all__ = ["Update", "build_update"]

Array = NDArray[np.float64]
REDUCED = ("closed", "reduced", "principal")
GENERAL = ("general", "conic", "cvxpy")
EXPLICIT = "explicit"


@dataclass(frozen=True, repr=False)
class Update(CompiledStep):
    """Compiled implicit step of a law, driven by the strain; `precision` of its arrays, `threads` that share the points."""

    precision: str = "float64"
    threads: int = 1

    @cached_property
    def pointers(self) -> StepPointers:
        """The compiled step with the law's own functions."""
        return step_pointers(self.module, self.precision)

    @property
    def step_source(self) -> str:
        """Text of the emitted step: only the components and variables that exist stand in it."""
        kind = "closed" if self.solver == "closed" else "reduced"
        return step_text(kind, self.dimension.size, self.module.PLAN, self.precision == "float32")

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> StepResult:
        """Step to the strains `eps_new` [-], Mandel components, shape (n, 6) or (6,), or the given components of the dimension.

        `state` is an earlier `.state` or None; `dt` [s] matters to viscous laws only; `values` are the parameters by name. A law with a
        temperature takes it [K] under its name, a number or (n,), and its gradient [K/m], (3,) or (n, 3), under the name of the
        force that φ* gives it (zero if not given). Raises `InputError` for bad input and `ConvergenceError`, naming the first
        points, where the step fails.
        """
        eps = self.dimension.strains(eps_new)
        n = eps.shape[0]
        heat, values = thermal_input(self.law, values, n)
        packed_parameters = packed_values(self, values)
        coefficients = self.pointers.coefficients(packed_parameters, step_time(dt), heat.temperature)
        old = self.pack(state, n)
        if self.dimension.relaxed:
            eps, (new, stress, tangent, dissipation, status) = self._relaxed(eps, old, coefficients)
        else:
            new, stress, tangent, dissipation, status = self.run(eps, old, coefficients, self.tangent)
        raise_failures(status, eps)
        gap = None
        if certify:
            from .certificate import duality_gap

            heated = heat.temperature if self.law.temperature is not None else None
            before, after = (self.packing.whole(packed, self.dimension) for packed in (old, new))
            strain = self.dimension.embedded(eps)
            gap = duality_gap(self, strain, before, after, packed_parameters, dt=dt, temperature=heated)
        found = self.unpack(new)
        entropy, flux = self._thermal(heat, eps, new, values)
        shaped = tangent.reshape(n, *self._square) if tangent is not None else None
        return StepResult(stress, shaped, found, dissipation, status, gap, entropy, flux, eps)

    def _thermal(self, heat: ThermalData, eps: Array, packed: Array, values: Mapping[str, Any]) -> Any:
        if self.law.temperature is None:
            return None, None
        whole = StatePacking.of(self.law).unpack(self.packing.whole(packed, self.dimension))
        return thermal_results(self.law, heat, self.dimension.embedded(eps), whole, values)

    @property
    def _square(self) -> tuple[int, int]:
        size = len(self.dimension.given) if self.dimension.relaxed else self.dimension.size
        return size, size

    def run(self, eps: Array, old: Array, coefficients: Array, want: bool) -> tuple[Array, Array, Any, Array, Any]:
        """(packed new state, stress, tangent in rows or None, dissipation, status) of packed rows; statuses are not looked at."""
        return run_points(self.pointers, eps, old, coefficients, want, threads=self.threads, precision=self.precision)

    def _relaxed(
        self, eps: Array, old: Array, coefficients: Array
    ) -> tuple[Array, tuple[Array, Array, Any, Array, Any]]:
        """`run` at strains whose relaxed components make their stress zero; stress and tangent of the given components."""
        size, given, relaxed = self.dimension.size, list(self.dimension.given), self.dimension.relaxed

        def evaluate(strains: Array, points: Any) -> Evaluation:
            rows = coefficients[points] if len(coefficients) > 1 else coefficients
            new, stress, tangent, lost, status = self.run(strains, old[points], rows, True)
            return Evaluation(stress, tangent.reshape(-1, size, size), status, (new, lost))

        eps, found = relax(evaluate, eps, relaxed, rounding=float(np.finfo(self.precision).eps))
        new, lost = found.rest
        tangent = condensed(found.tangent, self.dimension.given, relaxed) if self.tangent else None
        return eps, (new, found.stress[:, given], tangent, lost, found.status)

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
        """Exact derivatives of the step by parameters, arguments as for the step itself.

        `wrt` names k parameters (all of them, in order, if None; the temperature may be among them); `d_state` by name, (n, …, k), and
        `d_eps` (n, 6, k) are the derivatives of the old state and of the strain, zero if not given. Raises as the step does.
        """
        return sensitivities(self, eps_new, state, dt, wrt, d_state, d_eps, values)


def build_update(
    law: Law,
    dimension: str = "3d",
    *,
    formulation: str = "strain",
    solver: str = "auto",
    tangent: bool = True,
    precision: str = "float64",
    threads: int = 1,
    tolerance: float | None = None,
    accuracy: float | None = None,
) -> Any:
    """Choose the cheapest exact method for the law: `closed`, else `reduced`, else `principal`, else `general` (any convex law); or take
    the one that is named. `.solver` and `.why` of what is returned say which and why.

    `dimension` is one of `DIMENSIONS`; `formulation` "strain" or "stress", what drives the step; with `precision` "float32" the arrays of
    generated steps are in single precision, their arithmetic stays double; `threads` share the points.

    `tolerance` is for methods that iterate to one: of general and conic the residual relative to the data, of cvxpy clarabel's, of explicit
    the error per sub-step relative to the stress. `accuracy` (relative error of the stress) chooses solver, tolerance and precision by what
    was measured, and checks the answers; see `fenchel.integrators.accuracy`.
    """
    if accuracy is not None:
        return _accurate(law, dimension, formulation, solver, tangent, precision, threads, tolerance, accuracy)
    kinds = dimension_named(dimension)
    if formulation not in ("strain", "stress"):
        raise InputError(f"formulation {formulation!r} is not known; it is 'strain' or 'stress'")
    if solver not in ("auto", *REDUCED, *GENERAL, EXPLICIT):
        raise InputError(
            f"solver {solver!r} is not known; it is one of auto, {', '.join((*REDUCED, *GENERAL, EXPLICIT))}"
        )
    if precision not in ("float64", "float32"):
        raise InputError(f"precision {precision!r} is not known; it is float64 or float32")
    checked_threads(threads)
    if tolerance is not None and not (np.isfinite(tolerance) and 1e-15 <= tolerance < 1.0):
        raise InputError(f"tolerance = {tolerance:g}: it lies between 1e-15 and 1")
    if not isinstance(law, Law):
        raise DeclarationError(f"build_update takes a Law, not {type(law).__name__}")
    law.check_evolution()
    if formulation == "stress":
        from .stress_update import build_stress_update

        if precision != "float64":
            raise InputError("precision float32 is there for the strain formulation")
        driven = build_stress_update(law, solver, tangent, threads, tolerance)
        if kinds.name == "3d":
            return driven
        from .embedded import EmbeddedUpdate

        return EmbeddedUpdate.of(driven, kinds, tangent)
    why = "asked for by name"
    if solver == "auto" or solver in REDUCED:
        try:
            module = load_module(law, solver, kinds.size)
            layout, size = state_layout(law, kinds.size)
            method = module.METHOD.split()[0]
            if tolerance is not None:
                raise InputError(
                    f"law '{law.name}': method '{method}' has no tolerance, its answers are exact to rounding: leave it out"
                )
            return Update(law, module, tangent, method, layout, size, module.WHY, kinds, precision, threads)
        except NoReduction as reason:
            if solver != "auto":
                raise
            why = f"no cheaper method: {reason}"
    if precision != "float64":
        raise InputError(
            f"law '{law.name}': precision float32 is there for generated steps; the step of this law is 'general'"
        )
    if solver == EXPLICIT:
        from .explicit import ExplicitUpdate

        found: Any = ExplicitUpdate(law) if tolerance is None else ExplicitUpdate(law, tolerance)
    else:
        from .general_update import GeneralUpdate

        found = GeneralUpdate.of(
            law,
            tangent or bool(kinds.relaxed),
            "general" if solver == "auto" else solver,
            why,
            threads=threads,
            tolerance=tolerance,
        )
    if kinds.name == "3d":
        return found
    from .embedded import EmbeddedUpdate

    return EmbeddedUpdate.of(found, kinds, tangent)


def _accurate(
    law: Law,
    dimension: str,
    formulation: str,
    solver: str,
    tangent: bool,
    precision: str,
    threads: int,
    tolerance: float | None,
    accuracy: float,
) -> Any:
    """The step with the setting that is known to be the cheapest one of that accuracy."""
    from .accuracy import AccurateUpdate, choose

    if solver != "auto" or precision != "float64" or tolerance is not None:
        raise InputError("accuracy chooses solver, precision and tolerance: leave them out, or leave accuracy out")
    build = partial(build_update, law, dimension, formulation=formulation, tangent=tangent, threads=threads)
    exact = build()
    choice = choose(law, exact.solver, dimension, formulation, accuracy)
    setting = dict(choice.setting)
    if setting == {"solver": exact.solver}:
        return AccurateUpdate(exact, choice, exact)
    return AccurateUpdate(build(**setting), choice, exact)
