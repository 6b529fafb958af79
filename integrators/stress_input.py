"""Stresses that are handed to a step, and the words for those that cannot be carried."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError, Status

__all__ = ["raise_stress_failures", "stress_array"]

Array = NDArray[np.float64]


def stress_array(sig: Any) -> Array:
    """Stresses as a contiguous (n, 6) array; refuses other shapes and values that are not finite."""
    try:
        found = np.atleast_2d(np.asarray(sig, dtype=float))
    except (TypeError, ValueError):
        raise InputError("sig_new must be an array of numbers") from None
    if found.ndim != 2 or found.shape[1] != 6:
        raise InputError(f"sig_new has shape {np.shape(sig)}; it must be (n, 6) or (6,), Mandel components")
    if not np.isfinite(found).all():
        row = int(np.argmax(~np.isfinite(found).all(axis=1)))
        raise InputError(f"sig_new holds a value that is not finite (point {row})")
    return np.ascontiguousarray(found)


def raise_stress_failures(status: NDArray[np.int64], sig: Array) -> None:
    """`ConvergenceError` that names the first failing points."""
    failed = np.flatnonzero(status)
    if failed.size == 0:
        return
    first = ", ".join(str(int(i)) for i in failed[:5])
    reason = {
        Status.NOT_FINITE: "the strain is not finite",
        Status.INFEASIBLE: "the stress cannot be carried, no strain has it; under the strain formulation the step has an answer",
        Status.ITERATION_LIMIT: "iteration limit",
    }
    word = reason.get(Status(int(status[failed[0]])), "failure")
    stress = np.array2string(sig[failed[0]], precision=6, max_line_width=1000)
    raise ConvergenceError(
        f"the step fails at {failed.size} of {status.size} points ({word}), first {first}; stress of the first: {stress}"
    )
