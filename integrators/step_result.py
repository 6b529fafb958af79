"""What a step returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .summary import array_rows, as_html, as_text, status_words

__all__ = ["StepResult"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepResult:
    """Result of one step at n points.

    `stress` [Pa] (n, m) and `tangent` ∂σ/∂ε [Pa] (n, m, m) in Mandel components, m = 6 or those of the dimension; `state` by name,
    tensors (n, 6), scalars (n,); `dissipation` of the step [J/m³] (n,), mechanical; `status` (n,) of `Status` codes; `gap` [J/m³] (n,),
    primal minus dual, if certified. `strain` [-] (n, 6) at the end of the step: the given one and what follows from a stress of zero, or in
    the stress formulation the answer, with `tangent` ∂ε/∂σ [1/Pa]. Of a law with a temperature: `entropy` [J/(m³ K)] (n,), and `flux` −q/T
    [W/(m² K)] (n, 3) if φ* mentions the gradient of temperature. Tensors of a state and strains have the components of `Dimension`.
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

    def _summary(self) -> tuple[str, list[tuple[str, ...]]]:
        names = ("stress", "strain", "tangent", "dissipation", "gap", "entropy", "flux")
        rows = array_rows({name: getattr(self, name) for name in names}, self.state)
        count = len(self.status)
        return f"step of {count} point{'' if count == 1 else 's'}: {status_words(self.status)}", rows

    def __repr__(self) -> str:
        return as_text(*self._summary())

    def _repr_html_(self) -> str:
        return as_html(*self._summary())
