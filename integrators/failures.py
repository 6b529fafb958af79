"""What a step says of the points where it fails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, Status

__all__ = ["raise_failures"]

_REASONS = {
    "strain": {
        Status.NOT_FINITE: "stress or dissipation is not finite",
        Status.INFEASIBLE: "no plastically admissible stress",
        Status.ITERATION_LIMIT: "iteration limit",
    },
    "stress": {
        Status.NOT_FINITE: "the strain is not finite",
        Status.INFEASIBLE: "the stress cannot be carried, no strain has it; under the strain formulation the step has an answer",
        Status.ITERATION_LIMIT: "iteration limit",
    },
}


def raise_failures(status: NDArray[np.int64], driven: NDArray[np.float64], formulation: str = "strain") -> None:
    """`ConvergenceError` that names the first failing points; `driven` (n, …) holds the strains, or stresses, that drive the step."""
    failed = np.flatnonzero(status)
    if failed.size == 0:
        return
    first = ", ".join(str(int(i)) for i in failed[:5])
    word = _REASONS[formulation].get(Status(int(status[failed[0]])), "failure")
    input_ = np.array2string(driven[failed[0]], precision=6, max_line_width=1000)
    raise ConvergenceError(
        f"the step fails at {failed.size} of {status.size} points ({word}), first {first}; {formulation} of the first: {input_}"
    )
