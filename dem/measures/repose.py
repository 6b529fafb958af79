r"""Angle of repose of a deposit: slope of its free surface in several azimuths, with an interval.

Around the axis of the deposit (through the centre of the upper bodies) the surface is the tops z + r of the highest bodies in cells of
azimuth and distance. In each azimuth a straight line is fitted to them over the distances in which the mean profile falls from 85 to 15 %
of the height: the choice is one of distance and the same for all azimuths, as a choice by height would flatten the line. The angle is the
mean over azimuths, the interval is Student's over azimuths: it says how round the deposit is, not how other samples would come out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

__all__ = ["Repose", "angle_of_repose"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Repose:
    """Free surface of a deposit; angles in degrees."""

    angle: float
    low: float
    high: float
    angles: Array  # (azimuth_count,)
    height: float  # of the deposit above the floor [m]
    reach: float  # distance at which the mean profile falls to 5 % of the height [m]
    distance: Array  # (k,) of the mean profile from the axis [m]
    profile: Array  # (k,) its height above the floor [m]


def angle_of_repose(
    x: Array,
    radius: Array,
    *,
    floor: float = 0.0,
    azimuths: int = 6,
    cell: float | None = None,
    between: tuple[float, float] = (0.15, 0.85),
    level: float = 0.95,
) -> Repose:
    """Slope of a heap of bodies x (n, d) [m] with `radius` (n,) [m] on a floor at the height `floor` [m]; the last axis points up.

    `cell` [m] is the width of the rings (default: four mean radii). In two dimensions the azimuths are the two sides. Raises `InputError`
    when the surface has too few points to be fitted.
    """
    from scipy.stats import t as student

    x, radius = np.asarray(x, dtype=float), np.asarray(radius, dtype=float)
    d = x.shape[1]
    azimuths = 2 if d == 2 else azimuths
    if azimuths < 2:
        raise InputError(f"azimuths = {azimuths}: an interval needs two or more")
    cell = 4.0 * float(radius.mean()) if cell is None else cell
    top = x[:, -1] + radius - floor
    upper = top >= 0.5 * top.max()
    flat = x[:, :-1] - np.average(x[upper, :-1], axis=0)
    distance = np.linalg.norm(flat, axis=1)
    turn = np.arctan2(flat[:, 1], flat[:, 0]) if d == 3 else np.where(flat[:, 0] > 0.0, 0.5, -0.5) * np.pi
    sector = np.minimum(((turn + np.pi) / (2.0 * np.pi) * azimuths).astype(np.int64), azimuths - 1)
    ring = (distance / cell).astype(np.int64)
    rings = int(ring.max()) + 1
    points = [_surface(distance, top, turn, ring, sector == s, cell) for s in range(azimuths)]
    profile = np.zeros((azimuths, rings))
    for s, (_, height, place) in enumerate(points):
        total = np.bincount(place, minlength=rings)
        profile[s] = np.bincount(place, weights=height, minlength=rings) / np.maximum(total, 1)
    mean = profile.mean(axis=0)
    height = float(mean.max())
    middle = np.asarray((np.arange(rings) + 0.5) * cell, dtype=np.float64)
    near, far = (_crossing(middle, mean, share * height) for share in (between[1], between[0]))
    angles = np.empty(azimuths)
    for s, (where, tops, _) in enumerate(points):
        chosen = (where >= near) & (where <= far)
        if chosen.sum() < 4:
            raise InputError(
                f"angle of repose: {int(chosen.sum())} points of the surface in an azimuth between {near:.3g} and {far:.3g} m: "
                "take fewer azimuths, a smaller cell, or a larger heap"
            )
        angles[s] = np.degrees(np.arctan(-np.polyfit(where[chosen], tops[chosen], 1)[0]))
    spread = float(student.ppf(0.5 * (1.0 + level), azimuths - 1) * angles.std(ddof=1) / np.sqrt(azimuths))
    angle = float(angles.mean())
    return Repose(
        angle=angle,
        low=angle - spread,
        high=angle + spread,
        angles=angles,
        height=height,
        reach=_crossing(middle, mean, 0.05 * height),
        distance=middle,
        profile=mean,
    )


def _surface(
    distance: Array, top: Array, turn: Array, ring: NDArray[np.int64], chosen: NDArray[np.bool_], cell: float
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Distance, height and ring of the highest body in every cell of a sector; cells are about as long as wide."""
    at = np.flatnonzero(chosen)
    around = np.floor(turn[at] * (ring[at] + 0.5)).astype(np.int64)
    order = np.lexsort((top[at], around, ring[at]))
    last = np.ones(len(order), dtype=bool)
    last[:-1] = (np.diff(ring[at][order]) != 0) | (np.diff(around[order]) != 0)
    best = at[order[last]]
    return distance[best], top[best], ring[best]


def _crossing(distance: Array, profile: Array, level: float) -> float:
    """The largest distance at which the profile is still above the level, interpolated."""
    above = np.flatnonzero(profile >= level)
    k = int(above[-1]) if len(above) else 0
    if k + 1 >= len(distance):
        return float(distance[-1])
    drop = profile[k] - profile[k + 1]
    return float(distance[k] + (distance[k + 1] - distance[k]) * ((profile[k] - level) / drop if drop > 0.0 else 0.5))
