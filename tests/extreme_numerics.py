"""Numerics at their limits: accumulated round-off, denormals, cancellation, order of summation, explicit options, ill-conditioned fits.

The cells are written by subject in the modules named here; each says where its truth comes from and why its bound is what it is.
"""

from __future__ import annotations

import extreme_roundoff
from extreme_rows import Cell, Row, rows_of

SUITE = "numerics"
CELLS: list[Cell] = [*extreme_roundoff.CELLS]


def rows(*, long: bool = False) -> list[Row]:
    """The map of the numerics; the long cells only if asked."""
    return rows_of(SUITE, CELLS, long=long)
