"""What a step returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
