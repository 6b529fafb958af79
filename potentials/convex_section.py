"""Boundary of a convex set in a plane, by root finding along rays from a point inside.

A set {u : g(u) ≤ 0}, g convex, with g(c) < 0 meets every ray from c in one segment, so that one number per ray, found by bisection of the
inequality itself, is the boundary. Points are added until no chord is further from the boundary than a tolerance: the distance to a chord
is a concave function along it, and therefore at most twice that at its middle. Corners are found as what they are: two straight
neighbours are prolonged, and the ray through their crossing is tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["TOLERANCE", "USUAL", "Box", "boundary", "interior", "reach"]

TOLERANCE = 2e-4
"""Largest distance of a chord from the boundary, relative to the half-width of what is drawn."""
HALVINGS = 56
ROUNDS = 60
FIRST = 36
POWERS = (-60, 100)  # lengths that are tried, as powers of two: 1e-18 to 1e30 in SI units

USUAL = 1e5  # Pa, where nothing else gives a size

Gap = Callable[[Any], Any]


@dataclass(frozen=True)
class Box:
    """Limits `lower` and `upper` (2,) of the coordinates that are drawn."""

    lower: Any
    upper: Any

    @property
    def half(self) -> Any:
        """Half-widths (2,)."""
        return 0.5 * (self.upper - self.lower)

    def along(self, centre: Any, directions: Any) -> Any:
        """Length of each ray from a centre inside to the face that it leaves by, directions (n, 2)."""
        import numpy as np

        with np.errstate(divide="ignore", invalid="ignore"):
            upper = np.where(directions > 0.0, (self.upper - centre) / directions, np.inf)
            lower = np.where(directions < 0.0, (self.lower - centre) / directions, np.inf)
        return np.minimum(upper, lower).min(axis=1)

    def on_face(self, points: Any) -> Any:
        """True where a point lies on a face, up to rounding."""
        import numpy as np

        near = 1e-9 * self.half
        return ((np.abs(points - self.lower) < near) | (np.abs(points - self.upper) < near)).any(axis=1)


def interior(gap: Gap, hints: Any) -> Any:
    """A point with g < 0, or None where none is found: the hints (k, 2) themselves, points at all distances around them, then a minimum."""
    import numpy as np
    from scipy.optimize import minimize

    hints = np.atleast_2d(hints)
    around = np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [-1, 0.1], [-1, -0.1]], dtype=float)
    lengths = np.exp2(np.arange(*POWERS, 0.5))
    far = (hints[:, None, None, :] + lengths[None, :, None, None] * around[None, None]).reshape(-1, 2)
    values = np.concatenate([gap(hints), gap(far)])
    values = np.where(np.isfinite(values), values, np.inf)
    points = np.concatenate([hints, far])
    if (values[: len(hints)] < 0.0).any():
        return hints[np.argmin(values[: len(hints)])]
    if (values < 0.0).any():
        # of those inside, which may span many orders of magnitude, the one of the most usual size
        away = np.abs(points - hints[0]).max(axis=1)
        order = np.abs(np.log(np.maximum(away, 1e-300) / USUAL))
        return points[np.argmin(np.where(values < 0.0, order, np.inf))]
    start = points[np.argmin(values)]
    size = max(float(np.abs(start).max()), 1e-12)
    answer = minimize(
        lambda u: float(gap((start + size * u)[None])[0]), np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9}
    )
    return start + size * answer.x if answer.fun < 0.0 else None


def reach(gap: Gap, centre: Any, directions: Any, halvings: int = 0, beyond: float = float("inf")) -> Any:
    """Length of each ray from the centre inside the set, (n,), up to a factor of two and then halved in doubt `halvings` times; infinite
    where no boundary is found within 1e30 or within `beyond`, where a boundary would be rounding."""
    import numpy as np

    lengths = np.exp2(np.arange(*POWERS, dtype=float))
    points = centre + lengths[:, None, None] * directions
    inside = gap(points.reshape(-1, directions.shape[1])).reshape(len(lengths), len(directions)) <= 0.0
    first = np.where(inside.all(axis=0), len(lengths), np.argmin(inside, axis=0))
    high = lengths[np.minimum(first, len(lengths) - 1)]
    low = np.where(first > 0, 0.5 * high, 0.0)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        held = gap(centre + middle[:, None] * directions) <= 0.0
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return np.where((first == len(lengths)) | (high > beyond), np.inf, high)


def boundary(gap: Gap, centre: Any, box: Box, tolerance: float = TOLERANCE) -> tuple[Any, Any]:
    """Points (n, 2) of the boundary of the set inside the box, counter-clockwise, and (n,) True where the chord from a point to the next
    lies on a face of the box, not on the boundary of the set."""
    import numpy as np

    half = box.half

    def shoot(angles: Any) -> Any:
        directions = np.column_stack([np.cos(angles), np.sin(angles)]) * half
        end = box.along(centre, directions)
        free = gap(centre + end[:, None] * directions) <= 0.0
        root = _root(lambda t: gap(centre + t[:, None] * directions), end)
        return np.where(free, end, root)

    turn = 2.0 * np.pi
    angles = np.arange(FIRST) * (turn / FIRST) + 0.01
    radii = shoot(angles)
    fresh = np.ones(len(angles), dtype=bool)  # chords whose middle has not been tried
    for _ in range(ROUNDS):
        points = _polar(angles, radii)
        after = np.roll(points, -1, axis=0)
        tried = np.flatnonzero(fresh)
        if not tried.size:
            break
        middle = 0.5 * (points[tried] + after[tried])
        crossing, usable = _crossings(points, tried)
        between, corners = _angles(middle), _angles(crossing)
        found, reached = np.split(shoot(np.concatenate([between, corners])), 2)
        wide = 2.0 * _distance(_polar(between, found), points[tried], after[tried]) > tolerance
        new = np.concatenate([between[wide], corners[wide & usable]])
        sizes = np.concatenate([found[wide], reached[wide & usable]])
        fresh = np.zeros(len(angles), dtype=bool)
        fresh[tried[wide]] = True
        angles, place = np.unique(np.concatenate([angles, new]), return_index=True)
        radii = np.concatenate([radii, sizes])[place]
        fresh = np.concatenate([fresh, np.ones(len(new), dtype=bool)])[place]
    points = centre + _polar(angles, radii) * half
    # where the boundary of the set meets a face: between a point of the one and a point of the other
    face = box.on_face(points)
    mixed = np.flatnonzero(face != np.roll(face, -1))
    if mixed.size:
        one, other = angles[mixed], angles[(mixed + 1) % len(angles)]
        other = np.where(other < one, other + turn, other)
        starts = face[mixed]
        for _ in range(HALVINGS):
            between = 0.5 * (one + other)
            directions = np.column_stack([np.cos(between), np.sin(between)]) * half
            free = gap(centre + box.along(centre, directions)[:, None] * directions) <= 0.0
            one, other = np.where(free == starts, between, one), np.where(free == starts, other, between)
        angles, place = np.unique(np.concatenate([angles, np.mod(one, turn)]), return_index=True)
        radii = np.concatenate([radii, shoot(one)])[place]
        points = centre + _polar(angles, radii) * half
    return points, box.on_face(0.5 * (points + np.roll(points, -1, axis=0)))


def _root(function: Callable[[Any], Any], end: Any) -> Any:
    """Largest t (n,) with f(t) ≤ 0, each f convex, f(0) < 0 < f(end), up to rounding: a bracket shrunk from both sides.

    By convexity the secant through a point inside and one outside crosses zero inside, and the line through two points inside crosses it
    outside; where that does not halve the bracket (f flat, or not finite), its middle does.
    """
    import numpy as np

    low, high = np.zeros(len(end)), end.copy()
    below, above = function(low), function(high)
    before, earlier = low, below

    def tried(t: Any) -> None:
        nonlocal low, high, below, above, before, earlier
        # one rounding inside the bracket, so that the last steps close it; what is no number stands for the middle
        step = 3e-16 * high
        t = np.where(np.isfinite(t), np.clip(t, low + step, np.maximum(high - step, low + step)), 0.5 * (low + high))
        f = function(t)
        inside = f <= 0.0
        before, earlier = np.where(inside, low, before), np.where(inside, below, earlier)
        low, below = np.where(inside, t, low), np.where(inside, f, below)
        high, above = np.where(inside, high, t), np.where(inside, above, f)

    for _ in range(HALVINGS):
        width = high - low
        if not (width > 1e-15 * high).any():
            break
        with np.errstate(all="ignore"):
            tried(low - below * (high - low) / (above - below))
            tried(low - below * (low - before) / (below - earlier))
        if (high - low > 0.5 * width).any():
            tried(0.5 * (low + high))
    return low


def _angles(points: Any) -> Any:
    import numpy as np

    return np.mod(np.arctan2(points[:, 1], points[:, 0]), 2.0 * np.pi)


def _polar(angles: Any, radii: Any) -> Any:
    import numpy as np

    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def _distance(points: Any, start: Any, end: Any) -> Any:
    import numpy as np

    chord = end - start
    length = np.maximum(np.hypot(chord[:, 0], chord[:, 1]), 1e-300)
    return np.abs(chord[:, 0] * (points - start)[:, 1] - chord[:, 1] * (points - start)[:, 0]) / length


def _crossings(points: Any, places: Any) -> tuple[Any, Any]:
    """Where the chords before and after each chord cross when they are prolonged, and True where that lies in the sector of the chord."""
    import numpy as np

    count = len(points)
    before, here = points[(places - 1) % count], points[places]
    there, behind = points[(places + 1) % count], points[(places + 2) % count]
    one, other = here - before, behind - there
    across = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    gap = there - here
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (gap[:, 0] * other[:, 1] - gap[:, 1] * other[:, 0]) / across
        crossing = here + s[:, None] * one
    crossing = np.where(np.isfinite(crossing).all(axis=1, keepdims=True), crossing, 0.0)
    left = here[:, 0] * crossing[:, 1] - here[:, 1] * crossing[:, 0]
    right = crossing[:, 0] * there[:, 1] - crossing[:, 1] * there[:, 0]
    usable = (left > 0.0) & (right > 0.0)
    return crossing, usable
