"""The step of a law without closed form: the conic program solved at every point. Slow (about 50 ms per point), right, any conic law.

The tangent is a central difference of the program's stress, with steps of 1e-4 of the strain scale: good to about 1e-5, and between two
elements of the generalised derivative at a kink.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ConvergenceError, DeclarationError, InputError
from ..potentials import Law
from .atoms import energy_atoms, flow_atoms
from .closed import state_layout
from .conic import declare
from .update import Array, StepResult, Update, strain_array

__all__ = ["ConicUpdate"]


@dataclass(frozen=True)
class ConicUpdate:
    """Same call as `Update`."""

    law: Law
    packing: Update
    tangent: bool = True
    solver: str = "conic"

    @classmethod
    def of(cls, law: Law, tangent: bool) -> ConicUpdate:
        """Update by the conic program; refuses, naming the term, a law that has none."""
        layout, size = state_layout(law)
        ones = {p.name: 0.5 * (max(p.lower, 0.1) + min(p.upper, 0.4)) for p in law.parameters}
        try:
            energy_atoms(law, ones)
            flow_atoms(law, ones)
        except DeclarationError:
            raise
        except InputError:
            pass  # a matter of these values, not of the declaration
        return cls(law, Update(law, None, tangent, "conic", layout, size), tangent)  # type: ignore[arg-type]

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state: all internal variables zero."""
        return self.packing.initial_state(point_count)

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> StepResult:
        """See `Update.__call__`; `certify` is not available here."""
        if certify:
            raise InputError("certify=True is not available with the conic solver, which is its own certificate")
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt = {dt}: the time step must be positive and finite")
        eps = strain_array(eps_new)
        n = eps.shape[0]
        old = self.packing.pack(state, n)
        numbers = self.law.admissible_values(values)
        energy, flow = energy_atoms(self.law, numbers), flow_atoms(self.law, numbers)
        stress, new, dissipation = np.empty((n, 6)), old.copy(), np.zeros(n)
        tangent = np.empty((n, 6, 6)) if self.tangent else None
        layout, _ = state_layout(self.law)

        def solved(strain: Array, row: int) -> Any:
            try:
                return declare(self.law, energy, flow, strain, old[row]).solve()
            except ConvergenceError as error:
                raise ConvergenceError(f"the step fails at point {row}, strain {strain}: {error}") from None

        for row in range(n):
            found = solved(eps[row], row)
            stress[row] = found.stress
            for name, (start, length) in layout.items():
                new[row, start : start + length] = np.reshape(found.state[name], length)
            forces = -(energy.hessian @ np.concatenate([eps[row], new[row]]) + energy.linear)[6:]
            dissipation[row] = forces @ (new[row] - old[row])
            if tangent is not None:
                width = 1e-4 * max(float(np.abs(eps[row]).max()), self._yield_strain(energy.hessian, flow.limits))
                for j in range(6):
                    h = width * np.eye(6)[j]
                    tangent[row, :, j] = (solved(eps[row] + h, row).stress - solved(eps[row] - h, row).stress) / (
                        2 * width
                    )
        return StepResult(stress, tangent, self.packing.unpack(new), dissipation, np.zeros(n, dtype=np.int64), None)

    @staticmethod
    def _yield_strain(hessian: Array, limits: tuple[float, ...]) -> float:
        stiffness = float(np.abs(np.diag(hessian)).max(initial=0.0)) or 1.0
        return max((abs(k) for k in limits), default=0.0) / stiffness or 1e-6
