"""The implicit step of a law as a callable on arrays of points.

    (ε_{n+1}, X_n) ↦ (σ, X_{n+1}):   X_{n+1} = argmin ψ(ε_{n+1}, X) + φ(X − X_n),   σ = ∂ψ/∂ε,

φ the support function of the elastic domain: implicit Euler, and exactly a convex projection of the trial forces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, DeclarationError, InputError, Status
from ..potentials import Law
from .declared import state_layout
from .module_store import load_module
from .packing import StatePacking
from .pointers import StepPointers, step_pointers
from .sensitivity import Sensitivities, sensitivities
from .structure import NoReduction
from .thermal import thermal_input, thermal_results

__all__ = ["StepResult", "Update", "build_update", "packed_values", "step_time"]

Array = NDArray[np.float64]
REDUCED = ("closed", "reduced", "principal")
GENERAL = ("general", "conic", "cvxpy")
EXPLICIT = "explicit"


@dataclass(frozen=True)
class StepResult:
    """Result of one step at n points.

    `stress` [Pa] (n, 6) and `tangent` ∂σ/∂ε [Pa] (n, 6, 6) in Mandel components; `state` by name, tensors (n, 6), scalars (n,);
    `dissipation` of the step [J/m³] (n,), mechanical; `status` (n,) of `Status` codes; `gap` [J/m³] (n,), primal minus dual, if certified.
    `strain` [-] (n, 6) at the end of the step: the given one, or in the stress formulation the answer, with `tangent` ∂ε/∂σ [1/Pa].
    Of a law with a temperature: `entropy` [J/(m³ K)] (n,), and `flux` −q/T [W/(m² K)] (n, 3) if φ* mentions the gradient of temperature.
    """

    stress: Array
    tangent: Array | None
    state: dict[str, Array]
    dissipation: Array
    status: NDArray[np.int64]
    gap: Array | None = None
    entropy: Array | None = None
    flux: Array | None = None
    strain: Array | None = None


@dataclass(frozen=True)
class Update:
    """Compiled implicit step of `law`; `layout` gives the place of each internal variable in a packed state row."""

    law: Law
    module: ModuleType
    tangent: bool = True
    solver: str = "closed"
    layout: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    state_size: int = 0
    why: str = ""

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

    @cached_property
    def pointers(self) -> StepPointers:
        """The compiled step with the law's own functions."""
        return step_pointers(self.module)

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> StepResult:
        """Step to the strains `eps_new` [-], Mandel components, shape (n, 6) or (6,).

        `state` is an earlier `.state` or None; `dt` [s] matters to viscous laws only; `values` are the parameters by name. A law with a
        temperature takes it [K] under its name, a number or (n,), and its gradient [K/m], (3,) or (n, 3), under the name of the
        force that φ* gives it (zero if not given). Raises `InputError` for bad input and `ConvergenceError`, naming the first
        points, where the step fails.
        """
        eps = strain_array(eps_new)
        n = eps.shape[0]
        heat, values = thermal_input(self.law, values, n)
        packed_parameters = packed_values(self, values)
        coefficients = self.pointers.coefficients(packed_parameters, step_time(dt), heat.temperature)
        old = self.pack(state, n)
        new, stress = np.empty_like(old), np.empty((n, 6))
        tangent = np.empty((n, 36)) if self.tangent else np.empty((1, 36))
        dissipation, status = np.empty(n), np.empty(n, dtype=np.int64)
        if n:
            self.pointers.run(eps, old, new, stress, tangent, self.tangent, dissipation, status, coefficients)
        raise_failures(status, eps)
        gap = None
        if certify:
            from .certificate import duality_gap

            heated = heat.temperature if self.law.temperature is not None else None
            gap = duality_gap(self, eps, old, new, packed_parameters, dt=dt, temperature=heated)
        found = self.unpack(new)
        entropy, flux = thermal_results(self.law, heat, eps, found, values)
        shaped = tangent.reshape(n, 6, 6) if self.tangent else None
        return StepResult(stress, shaped, found, dissipation, status, gap, entropy, flux, eps)

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

    def energy(self, eps: Any, state: Mapping[str, Any] | None = None, /, **values: Any) -> Array:
        """Free energy ρψ [J/m³] at the given strains and internal variables, shape (n,)."""
        strain = strain_array(eps)
        heat, values = thermal_input(self.law, values, strain.shape[0])
        packed = self.pack(state, strain.shape[0])
        return self.energies(strain, packed, heat.temperature, packed_values(self, values))

    def energies(self, eps: Array, packed: Array, temperature: Array, parameters: Array) -> Array:
        """ρψ [J/m³] of packed states, shape (n,)."""
        psi = np.empty(eps.shape[0])
        self.module.energies_(eps, packed, temperature, parameters, psi)
        return psi


def step_time(dt: Any) -> float:
    """The time step [s], checked."""
    if not (np.ndim(dt) == 0 and np.isfinite(dt) and dt > 0):
        raise InputError(f"dt = {dt}: the time step must be positive and finite")
    return float(dt)


def strain_array(eps: Any) -> Array:
    """Strains as a contiguous (n, 6) array; refuses other shapes and values that are not finite."""
    try:
        found = np.atleast_2d(np.asarray(eps, dtype=float))
    except (TypeError, ValueError):
        raise InputError("eps_new must be an array of numbers") from None
    if found.ndim != 2 or found.shape[1] != 6:
        raise InputError(f"eps_new has shape {np.shape(eps)}; it must be (n, 6) or (6,), Mandel components")
    if not np.isfinite(found).all():
        row = int(np.argmax(~np.isfinite(found).all(axis=1)))
        raise InputError(f"eps_new holds a value that is not finite (point {row})")
    return np.ascontiguousarray(found)


def packed_values(update: Update, given: Mapping[str, Any]) -> Array:
    """Parameter values as an array in the order of `law.parameters`, checked against bounds and the conditions of admissibility."""
    return np.array(list(update.law.admissible_values(given).values()), dtype=float)


def raise_failures(status: NDArray[np.int64], eps: Array) -> None:
    """`ConvergenceError` that names the first failing points."""
    failed = np.flatnonzero(status)
    if failed.size == 0:
        return
    first = ", ".join(str(int(i)) for i in failed[:5])
    reason = {
        Status.NOT_FINITE: "the stress is not finite",
        Status.INFEASIBLE: "no plastically admissible stress",
        Status.ITERATION_LIMIT: "iteration limit",
    }
    word = reason.get(Status(int(status[failed[0]])), "failure")
    strain = np.array2string(eps[failed[0]], precision=6, max_line_width=1000)
    raise ConvergenceError(
        f"the step fails at {failed.size} of {status.size} points ({word}), first {first}; strain of the first: {strain}"
    )


def build_update(
    law: Law, dimension: str = "3d", *, formulation: str = "strain", solver: str = "auto", tangent: bool = True
) -> Any:
    """Choose the cheapest exact method for the law: `closed`, else `reduced`, else `principal`, else `general` (any convex law); or take
    the one that is named. `.solver` and `.why` of what is returned say which and why."""
    if dimension != "3d":
        raise InputError(f"dimension {dimension!r} is not available; it is '3d'")
    if formulation != "strain":
        raise InputError(f"formulation {formulation!r} is not available for updates; it is 'strain'")
    if solver not in ("auto", *REDUCED, *GENERAL, EXPLICIT):
        raise InputError(
            f"solver {solver!r} is not known; it is one of auto, {', '.join((*REDUCED, *GENERAL, EXPLICIT))}"
        )
    if not isinstance(law, Law):
        raise DeclarationError(f"build_update takes a Law, not {type(law).__name__}")
    law.check_evolution()
    if solver == EXPLICIT:
        from .explicit import ExplicitUpdate

        return ExplicitUpdate(law)
    why = "asked for by name"
    if solver == "auto" or solver in REDUCED:
        try:
            module = load_module(law, solver)
            layout, size = state_layout(law)
            return Update(law, module, tangent, module.METHOD.split()[0], layout, size, module.WHY)
        except NoReduction as reason:
            if solver != "auto":
                raise
            why = f"no cheaper method: {reason}"
    from .general_update import GeneralUpdate

    return GeneralUpdate.of(law, tangent, "general" if solver == "auto" else solver, why)
