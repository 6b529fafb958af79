"""The implicit step driven by the stress, as a callable on arrays of points.

    (σ_{n+1}, X_n) ↦ (ε, X_{n+1}):   X_{n+1} = argmin −ψ*(σ_{n+1}, X) + φ(X − X_n),   ε = ∂ψ*/∂σ,

ψ* the conjugate of ψ in the strain alone. The tangent is the compliance ∂ε/∂σ = D²W_n*(σ), the inverse of that of the strain formulation.
If ψ is quadratic in the strain, −ψ* has the form of ψ and goes through the same compiled steps (`conjugate_moduli`). With an energy of the
strain alone beside it, ∇W_n(ε) = σ is solved (`inverse_step`, `inverse_unilateral`). All else is the cone program with the strain as an
unknown (`general_update`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..potentials import Law
from .compiled_step import CompiledStep, packed_values, step_time
from .declared import state_layout
from .failures import raise_failures
from .inverse_step import InversePointers, inverse_pointers
from .module_store import load_module
from .pointers import StepPointers, step_pointers
from .points import run_points
from .step_result import StepResult
from .structure import NoReduction, find_moduli
from .thermal import thermal_input, thermal_results

__all__ = ["StressUpdate", "build_stress_update"]

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class StressUpdate(CompiledStep):
    """Compiled step of `law` from stresses; `layout` gives the place of each internal variable in a packed state row.

    `inverse` is false if `module` holds the numbers of −ψ*, and true if it holds those of ψ, whose step is inverted.
    """

    inverse: bool = False
    threads: int = 1

    formulation = "stress"

    @cached_property
    def pointers(self) -> StepPointers | InversePointers:
        """The compiled step with the law's own functions."""
        found = step_pointers(self.module)
        if not self.inverse:
            return found
        return inverse_pointers(found, self.module)

    @property
    def compiled_path(self) -> bool:
        """True if the compiled path loop can call this step."""
        return isinstance(self.pointers, StepPointers)

    def __call__(
        self,
        sig_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> Any:
        """Step to the stresses `sig_new` [Pa], Mandel components, shape (n, 6) or (6,).

        The result holds the strain that carries them and the compliance ∂ε/∂σ [1/Pa] as `.tangent`. Other arguments are those of
        `Update.__call__`. Raises `InputError` for bad input and `ConvergenceError`, naming the first points, where the step fails: a
        stress that cannot be carried has the status `INFEASIBLE`.
        """
        sig = self.dimension.stresses(sig_new)
        n = sig.shape[0]
        heat, values = thermal_input(self.law, values, n)
        packed_parameters = packed_values(self, values)
        coefficients = self.coefficients(packed_parameters, step_time(dt), heat.temperature)
        old = self.pack(state, n)
        new, eps, compliance, dissipation, status = run_points(
            self.pointers, sig, old, coefficients, self.tangent, threads=self.threads
        )
        raise_failures(status, sig, "stress")
        gap = None
        if certify:
            from .stress_certificate import stress_gap

            heated = heat.temperature if self.law.temperature is not None else None
            gap = stress_gap(self, sig, eps, old, new, packed_parameters, dt=dt, temperature=heated)
        found = self.unpack(new)
        entropy, flux = thermal_results(self.law, heat, eps, found, values)
        shaped = None if compliance is None else compliance.reshape(n, 6, 6)
        return StepResult(sig, shaped, found, dissipation, status, gap, entropy, flux, eps)

    def coefficients(self, parameters: Array, dt: Any, temperature: Array) -> Array:
        """Numbers of the step; `InputError` where ψ* is not finite for these values."""
        found = self.pointers.coefficients(parameters, dt, temperature)
        if not np.isfinite(found).all():
            raise InputError(
                f"law '{self.law.name}': psi has no stiffness in the strain for these values, its conjugate psi* is not finite; "
                "use the strain formulation"
            )
        return found


def build_stress_update(
    law: Law, solver: str = "auto", tangent: bool = True, threads: int = 1, tolerance: float | None = None
) -> Any:
    """The cheapest exact method for the step driven by the stress, or the one that is named; see `build_update`."""
    why = "asked for by name"
    if solver == "explicit":
        raise InputError("solver 'explicit' integrates strain paths; it is not available in the stress formulation")
    if solver in ("auto", "closed", "reduced", "principal"):
        try:
            return _reduced(law, solver, tangent, threads)
        except NoReduction as reason:
            if solver != "auto":
                raise
            why = f"no cheaper method: {reason}"
    from .general_update import GeneralUpdate

    return GeneralUpdate.of(law, tangent, "general" if solver == "auto" else solver, why, "stress", threads, tolerance)


def _reduced(law: Law, solver: str, tangent: bool, threads: int) -> StressUpdate:
    layout, size = state_layout(law)
    module = load_module(law, solver)
    method = module.METHOD.split()[0]
    if not module.STRAIN_ENERGY:
        module = load_module(law, solver, formulation="stress")
        why = f"{module.WHY}; psi is quadratic in the strain, so its conjugate has the same step"
        return StressUpdate(law, module, tangent, method, layout, size, why, threads=threads)
    c0, c1 = find_moduli(law).strain
    if c0 == 0 or (c0 + 3 * c1) == 0:
        raise NoReduction(f"law '{law.name}': psi has no quadratic energy that resists every strain")
    why = f"{module.WHY}; with an energy of the strain alone, its inverse is found by Newton's method"
    return StressUpdate(law, module, tangent, method, layout, size, why, inverse=True, threads=threads)
