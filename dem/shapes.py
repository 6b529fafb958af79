"""Arrangements of bodies that scenes start from: floors of fixed beads, chains of beads, lattices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["chain", "hexagonal_floor", "lattice"]

Array = NDArray[np.float64]


def hexagonal_floor(radius: float, low: tuple[float, float], high: tuple[float, float], *, top: float = 0.0) -> Array:
    """Centres [m] of touching beads on a hexagonal lattice whose highest points lie at z = `top`, shape (n, 3).

    The lattice covers the rectangle from `low` to `high` in the horizontal plane. Beads of infinite mass make it a fixed rough floor.
    Raises `InputError` for an empty rectangle.
    """
    if not (radius > 0.0 and high[0] > low[0] and high[1] > low[1]):
        raise InputError("floor: needs a positive radius and a rectangle with high > low on both axes")
    rows = 1 + int(np.ceil((high[1] - low[1]) / (np.sqrt(3.0) * radius)))
    columns = 1 + int(np.ceil((high[0] - low[0]) / (2.0 * radius)))
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    x = low[0] + 2.0 * radius * (column + 0.5 * (row % 2))
    y = low[1] + np.sqrt(3.0) * radius * row
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, top - radius)], axis=1)


def chain(
    start: Array, direction: Array, beads: int, spacing: float, *, wire: int = 0
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """A straight chain: centres (beads, d) [m], number of the wire and place along it, for `Assembly.of_spheres`.

    Raises `InputError` for fewer than two beads or a direction of zero length.
    """
    length = float(np.linalg.norm(direction))
    if beads < 2 or not length > 0.0 or not spacing > 0.0:
        raise InputError("chain: needs two beads or more, a direction and a positive spacing")
    along = spacing / length * np.asarray(direction, dtype=np.float64)
    x = np.zeros((beads, len(along)))
    x += np.asarray(start, dtype=np.float64) + np.arange(beads)[:, None] * along
    return x, np.full(beads, wire, dtype=np.int64), np.arange(beads, dtype=np.int64)


def lattice(count: int, low: Array, high: Array, pitch: float) -> Array:
    """The first `count` places of a square lattice of the given pitch [m] that fills a block from `low`, last axis slowest.

    Raises `InputError` when the block from `low` to `high` is too small for them.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    # no more along an axis than there are bodies, so that a block of any size is counted
    with np.errstate(over="ignore"):
        fits = np.clip(np.floor((high - low) / pitch + 1e-9), 0, max(count, 1)).astype(np.int64)
    if np.prod(fits) < count:
        raise InputError(
            f"region: {count} bodies of pitch {1e3 * pitch:.3g} mm do not fit {' x '.join(f'{1e3 * s:.3g}' for s in high - low)} mm; "
            "widen the region or take fewer or smaller bodies"
        )
    places = np.stack(np.unravel_index(np.arange(count), tuple(fits[::-1])), axis=1)[:, ::-1]
    return low + pitch * (places + 0.5)
