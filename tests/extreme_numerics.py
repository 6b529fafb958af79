"""Numerics at their limits: accumulated round-off, denormals, cancellation, order of summation, explicit options, ill-conditioned fits.

The cells are written by subject in the modules named here; each says where its truth comes from and why its bound is what it is.
"""

from __future__ import annotations

import extreme_cancellation
import extreme_explicit
import extreme_identification
import extreme_roundoff
import extreme_threads
from extreme_rows import Cell, Row, rows_of

SUITE = "numerics"
SUBJECTS: dict[str, list[Cell]] = {
    "round-off and denormals": extreme_roundoff.CELLS,
    "cancellation": extreme_cancellation.CELLS,
    "order of summation": extreme_threads.CELLS,
    "largest stable steps": extreme_explicit.CELLS,
    "identification": extreme_identification.CELLS,
}
CELLS: list[Cell] = [cell for cells in SUBJECTS.values() for cell in cells]


def rows(*, subject: str | None = None, long: bool = False) -> list[Row]:
    """The map of the numerics, or of one subject of it; the long cells only if asked."""
    return rows_of(SUITE, CELLS if subject is None else SUBJECTS[subject], long=long)
