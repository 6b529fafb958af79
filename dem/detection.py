"""Which pairs may touch: cell list with a skin, rebuilt when a body has moved by half of it.

A pair enters the list when its gap g = |x_i − x_j| − r_i − r_j is below the skin. Pairs are stored with i < j, sorted, so that the
order of the Gauss–Seidel sweep is a function of the state alone. Beads of one wire closer in rank than `apart` never touch: they would
overlap on a straight wire. Others do, also neighbours: without that, the pressure around them pushes slack neighbours into one
another and the wire loses its length (measured: a tenth of the links below 5 % of the spacing after compression).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit

__all__ = ["find_pairs", "find_wall_pairs"]


@njit
def _pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    wire: NDArray[np.int64],
    rank: NDArray[np.int64],
    apart: int,
    skin: float,
    capacity: int,
) -> tuple[int, NDArray[np.int32]]:
    count = x.shape[0]
    out = np.empty((capacity, 2), dtype=np.int32)
    low = np.empty(3)
    cells = np.empty(3, dtype=np.int64)
    size = 2.0 * radius.max() + skin
    for a in range(3):
        low[a] = x[:, a].min()
        # no more cells along one axis than bodies: a lone far body must not exhaust the memory
        cells[a] = int(min((x[:, a].max() - low[a]) / size, float(count))) + 1
    span = np.empty(3)
    for a in range(3):
        span[a] = max(size, (x[:, a].max() - low[a]) / cells[a] * (1.0 + 1e-12))
    while cells[0] * cells[1] * cells[2] > 8 * count + 64:
        a = int(np.argmax(cells))
        cells[a] = (cells[a] + 1) // 2
        span[a] = max(span[a] * 2.0, size)
    total = cells[0] * cells[1] * cells[2]
    head = np.full(total, -1, dtype=np.int64)
    following = np.full(count, -1, dtype=np.int64)
    place = np.empty((count, 3), dtype=np.int64)
    for i in range(count - 1, -1, -1):
        for a in range(3):
            place[i, a] = min(int((x[i, a] - low[a]) / span[a]), cells[a] - 1)
        c = (place[i, 0] * cells[1] + place[i, 1]) * cells[2] + place[i, 2]
        following[i] = head[c]
        head[c] = i
    found = 0
    near = np.empty(count, dtype=np.int64)
    for i in range(count):
        near_count = 0
        for dx in range(-1, 2):
            cx = place[i, 0] + dx
            if cx < 0 or cx >= cells[0]:
                continue
            for dy in range(-1, 2):
                cy = place[i, 1] + dy
                if cy < 0 or cy >= cells[1]:
                    continue
                for dz in range(-1, 2):
                    cz = place[i, 2] + dz
                    if cz < 0 or cz >= cells[2]:
                        continue
                    j = head[(cx * cells[1] + cy) * cells[2] + cz]
                    while j >= 0:
                        if j > i:
                            reach = radius[i] + radius[j] + skin
                            d0 = x[i, 0] - x[j, 0]
                            d1 = x[i, 1] - x[j, 1]
                            d2 = x[i, 2] - x[j, 2]
                            tied = wire[i] >= 0 and wire[i] == wire[j] and abs(rank[i] - rank[j]) < apart
                            if not tied and d0 * d0 + d1 * d1 + d2 * d2 < reach * reach:
                                near[near_count] = j
                                near_count += 1
                        j = following[j]
        near[:near_count].sort()
        for k in range(near_count):
            if found < capacity:
                out[found, 0] = i
                out[found, 1] = near[k]
            found += 1
    return found, out


def find_pairs(
    x: NDArray[np.float64],
    radius: NDArray[np.float64],
    wire: NDArray[np.int64],
    rank: NDArray[np.int64],
    apart: int,
    skin: float,
) -> NDArray[np.int32]:
    """Pairs (i < j, sorted) with gap below `skin` [m], shape (pair_count, 2).

    `wire` is the wire of each body (-1: a grain), `rank` its place along the wire,
    `apart` the least difference of ranks at which two beads of a wire may touch.
    """
    if x.shape[0] < 2:
        return np.empty((0, 2), dtype=np.int32)
    capacity = 16 * x.shape[0]
    while True:
        found, pairs = _pairs(x, radius, wire, rank, apart, skin, capacity)
        if found <= capacity:
            return pairs[:found].copy()
        capacity = found


def find_wall_pairs(
    x: NDArray[np.float64], radius: NDArray[np.float64], half: NDArray[np.float64], skin: float
) -> NDArray[np.int32]:
    """Bodies within `skin` of a wall of the box |x_a| ≤ half_a, as rows (body, axis, side ±1), shape (pair_count, 3)."""
    rows = []
    for axis in range(3):
        for side in (-1, 1):
            gap = half[axis] - side * x[:, axis] - radius
            bodies = np.flatnonzero(gap < skin)
            rows.append(np.stack([bodies, np.full_like(bodies, axis), np.full_like(bodies, side)], axis=1))
    return np.concatenate(rows).astype(np.int32)
