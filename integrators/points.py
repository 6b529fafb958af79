"""The compiled step at many points: output arrays, threads."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .threads import shared

__all__ = ["run_points"]

Array = NDArray[np.float64]


def run_points(
    pointers: Any,
    given: Array,
    old: Array,
    coefficients: Array,
    want: bool,
    *,
    threads: int = 1,
    precision: str = "float64",
) -> tuple[Array, Array, Array | None, Array, NDArray[np.int64]]:
    """(packed new state, what comes out, tangent in rows or None, dissipation, status); statuses are not looked at.

    `given` (n, size) is what drives the step, `old` the packed states, `coefficients` one row or one per point.
    """
    n, size = given.shape
    kind = np.dtype(precision)
    given, old = given.astype(kind, copy=False), old.astype(kind, copy=False)
    new, found = np.empty_like(old), np.empty((n, size), dtype=kind)
    tangent = np.empty((n if want else 1, size * size), dtype=kind)
    dissipation, status = np.empty(n, dtype=kind), np.empty(n, dtype=np.int64)

    def part(start: int, stop: int) -> None:
        rows = slice(start, stop)
        pointers.run(
            given[rows], old[rows], new[rows], found[rows], tangent[rows] if want else tangent, want, dissipation[rows],
            status[rows], coefficients[rows] if len(coefficients) > 1 else coefficients,
        )  # fmt: skip

    if n:
        shared(part, n, threads)
    return new, found, tangent if want else None, dissipation, status
