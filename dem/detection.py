"""Which pairs may touch: cell list with a skin, rebuilt when a body has moved by half of it.

A pair enters the list when its gap g = |x_i − x_j| − r_i − r_j is below the skin. Pairs are stored with i < j, sorted, so that the
order of the Gauss–Seidel sweep is a function of the state alone. Beads of one wire closer in rank than `apart` never touch: they would
overlap on a straight wire. Others do, also neighbours: without that, the pressure around them pushes slack neighbours into one
another and the wire loses its length (measured: a tenth of the links below 5 % of the spacing after compression).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from .kernels import detection

__all__ = ["find_near_planes", "find_pairs", "spatial_order"]

Array = NDArray[np.float64]


def find_pairs(
    x: Array,
    radius: Array,
    wire: NDArray[np.int64],
    rank: NDArray[np.int64],
    apart: int,
    skin: float,
    *,
    fixed: NDArray[np.bool_] | None = None,
) -> NDArray[np.int32]:
    """Pairs (i < j, sorted) with gap below `skin` [m], shape (pair_count, 2); x has shape (n, 2) or (n, 3).

    `wire` is the wire of each body (-1: a grain), `rank` its place along the wire,
    `apart` the least difference of ranks at which two beads of a wire may touch. Two `fixed` bodies are no pair.
    """
    if x.shape[0] < 2:
        return np.empty((0, 2), dtype=np.int32)
    dimension = x.shape[1]
    chained = bool((wire >= 0).any())
    find = detection(dimension, chained).module.find
    chains = (wire, rank, apart) if chained else ()
    offsets = np.array(list(product((-1, 0, 1), repeat=dimension)), dtype=np.int64)
    held = np.zeros(len(x), dtype=bool) if fixed is None else fixed
    pairs = np.empty((16 * x.shape[0], 2), dtype=np.int32)
    while True:
        found = find(x, radius, held, *chains, skin, offsets, pairs)
        if found <= len(pairs):
            return pairs[:found].copy()
        pairs = np.empty((found, 2), dtype=np.int32)


def find_near_planes(
    x: Array, radius: Array, fixed: NDArray[np.bool_], normal: Array, place: Array, skin: float
) -> NDArray[np.int32]:
    """Bodies that can move within `skin` [m] of the planes n·x = place, as rows (body, plane), plane by plane."""
    if not len(normal):
        return np.empty((0, 2), dtype=np.int32)
    find = detection(x.shape[1]).module.find_near_planes
    rows = np.empty((x.shape[0] + 64, 2), dtype=np.int32)
    while True:
        found = find(x, radius, fixed, normal, place, skin, rows)
        if found <= len(rows):
            return rows[:found].copy()
        rows = np.empty((found, 2), dtype=np.int32)


def spatial_order(x: Array, cell: float) -> NDArray[np.int64]:
    """An order of bodies in which neighbours in space are neighbours in memory: by cells of the given size [m], layer by layer.

    Sweeps over a hundred thousand bodies run out of the fast memory otherwise; sort a sample once, before it is made.
    """
    places = np.floor((x - x.min(axis=0)) / cell).astype(np.int64) if len(x) else np.zeros(x.shape, dtype=np.int64)
    return np.lexsort(places.T)
