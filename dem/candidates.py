"""Which pairs may touch, kept between steps: listed anew when something has moved, impulses matched by the identity of the pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bodies import Assembly
from .detection import find_near_planes, find_pairs

__all__ = ["Partition", "refresh"]

Ints = NDArray[np.int32]


class Partition:
    """The candidates in parts that share no body (slabs along the longest axis with equally many bodies), then those that cross."""

    def __init__(self, parts: int) -> None:
        self.parts = parts
        self.starts = np.zeros(parts + 2, dtype=np.int64)  # of the parts among the candidates

    def sort(self, pairs: Ints, x: NDArray[np.float64]) -> Ints:
        """The pairs in the order of the parts, each part in the order given."""
        if not len(pairs):
            self.starts[:] = 0
            return pairs
        axis = int(np.argmax(x.max(axis=0) - x.min(axis=0)))
        bounds = np.quantile(x[:, axis], np.arange(1, self.parts) / self.parts)
        part = np.searchsorted(bounds, x[:, axis])
        of_pair = np.where(part[pairs[:, 0]] == part[pairs[:, 1]], part[pairs[:, 0]], self.parts)
        order = np.argsort(of_pair, kind="stable")
        self.locate(of_pair[order])
        return pairs[order]

    def locate(self, of_pair: NDArray[np.int64]) -> None:
        """Where the parts start in sorted candidates."""
        self.starts = np.searchsorted(of_pair, np.arange(self.parts + 2)).astype(np.int64)
        self.starts[-1] = len(of_pair)

    def of_rows(self, candidate: Ints) -> NDArray[np.int64]:
        """Where the parts start among the rows made of these candidates."""
        return np.searchsorted(candidate, self.starts).astype(np.int64)


def matched(new: Ints, old: Ints, impulse: NDArray[np.float64], base: int) -> NDArray[np.float64]:
    """Impulses of the new pairs: those of the same pairs of the old list, zero for pairs that were not in it."""
    out = np.zeros((len(new), impulse.shape[1]))
    if len(old) and len(new):
        key = old[:, 0].astype(np.int64) * base + old[:, 1]
        wanted = new[:, 0].astype(np.int64) * base + new[:, 1]
        order = np.argsort(key, kind="stable")
        key = key[order]
        at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        known = key[at] == wanted
        out[known] = impulse[order[at[known]]]
    return out


def refresh(
    a: Assembly,
    normal: NDArray[np.float64],
    place: NDArray[np.float64],
    skin: float,
    reach: float,
    partition: Partition | None,
) -> None:
    """List the candidates anew and carry their impulses over; `place` are those of the planes, box first."""
    pairs = find_pairs(a.x, a.radius, a.wire, a.rank, a.apart, skin, fixed=np.isinf(a.mass))
    if partition is not None:
        pairs = partition.sort(pairs, a.x)
    walls = find_near_planes(a.x, a.radius, np.isinf(a.mass), normal, place, skin)
    a.pair_impulse = matched(pairs, a.pairs, a.pair_impulse, len(a.x))
    a.wall_impulse = matched(walls, a.walls, a.wall_impulse, max(1, len(normal)))
    a.pairs, a.walls = pairs, walls
    a.listed_x, a.listed_place, a.listed_reach = a.x.copy(), place.copy(), reach
