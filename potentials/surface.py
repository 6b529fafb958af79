"""Sections of the elastic domain of a law: the meridian plane and the deviatoric plane, as points on the declared surfaces.

With the mean stress m = tr σ/3 and the unit deviators

    n(θ) = √(2/3) (cos θ, cos(θ − 2π/3), cos(θ + 2π/3))   along three principal axes,

the meridian plane at θ holds the stresses m I + √2 s n(θ), s = ±√J₂, and the deviatoric plane at m those m I + x n(0) + y n(π/2), whose
distance from the hydrostatic axis is ‖dev σ‖ = √2 √J₂. For 0 ≤ θ ≤ π/3 it is Lode's angle, cos 3θ = (3√3/2) J₃/J₂^(3/2): θ = 0 is triaxial
extension along the first axis, π/3 triaxial compression along the third. Tension is positive.

The domain is convex and its section is traced by rays from a point inside, see `convex_section`: every point is where the inequality
changes its truth, corners included.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import DeclarationError, InputError
from .convex_section import TOLERANCE, USUAL, Box, boundary, interior, reach
from .elastic_domain import Domain, domain_of
from .law import Law

__all__ = ["COMPRESSION", "Section", "deviator", "deviatoric", "meridian"]

COMPRESSION = 1.0471975511965976
"""Angle θ = π/3 of triaxial compression along the third axis."""
BEYOND = 3.0  # an unbounded domain is drawn to this many times its finite extent
ROUNDING = 1e8  # a boundary that many times further than the nearest one is rounding
FAR = 1e4  # no boundary within that many times the extent: unbounded


@dataclass(frozen=True)
class Section:
    """A convex section. `points` (n, 2) [Pa] counter-clockwise on its boundary; `cut` (n,) True where the way from a point to the next is
    not a surface but the limit to which an unbounded domain is drawn; `active` (n,) the place of the surface on that way; `centre` (2,)
    inside. A point u stands for the tensor `origin` + u₁ `axes[0]` + u₂ `axes[1]` (6,) Mandel: the stress if `stress`, else the force
    called `symbol`.
    """

    points: Any
    cut: Any
    centre: Any
    origin: Any
    axes: Any
    active: Any
    stress: bool = True
    symbol: str = r"\sigma"

    @property
    def unbounded(self) -> bool:
        """True if the domain goes on beyond what is drawn."""
        return bool(self.cut.any())

    def tensors(self, points: Any = None) -> Any:
        """Tensors (n, 6) [Pa], Mandel, of points (n, 2) of the plane, by default of those of the boundary."""
        import numpy as np

        return self.origin + np.atleast_2d(self.points if points is None else points) @ self.axes

    def coordinates(self, tensors: Any) -> Any:
        """Coordinates (n, 2) [Pa] of the orthogonal projection of tensors (n, 6) on the plane."""
        import numpy as np

        return _project(np.atleast_2d(tensors), self.origin, self.axes)


def deviator(angle: float, frame: Any = None) -> Any:
    """Unit deviator n(θ) in Mandel components (6,), along the columns of `frame` (3, 3), by default the axes of the components."""
    import numpy as np

    from .spectral import from_matrix

    third = 2.0 * np.pi / 3.0
    principal = np.sqrt(2.0 / 3.0) * np.cos([angle, angle - third, angle + third])
    turn = np.eye(3) if frame is None else np.asarray(frame, dtype=float)
    return from_matrix((turn * principal) @ turn.T)


def meridian(
    law: Law,
    values: Mapping[str, Any],
    *,
    angle: float = COMPRESSION,
    state: Mapping[str, Any] | None = None,
    frame: Any = None,
    limit: float | None = None,
    level: float | None = None,
    tolerance: float = TOLERANCE,
) -> Section:
    """Section by the plane of the hydrostatic axis and n(θ), θ = `angle` [rad]; coordinates (tr σ/3, s) [Pa], |s| = √J₂, tension positive.

    `values` of the parameters by name (and of the temperature [K]); `state` the internal variables by name, tensors (6,) Mandel, virgin
    (zero) without; `frame` (3, 3) holds the principal axes as columns. An unbounded domain is drawn to |tr σ/3|, √J₂ ≤ `limit` [Pa], by
    default three times what is bounded of it. `level` [W/m³] takes the level set φ* ≤ level of the finite part in the place of the
    surfaces. No chord is further from the boundary than `tolerance` times the half-width of the section.

    Raises `InputError` for wrong values and where the plane has no point inside the domain, `DeclarationError` for a law without surface.

    >>> from fenchel.potentials.library import drucker_prager
    >>> found = meridian(drucker_prager, dict(E=1e7, nu=0.2, theta_f=0.3, C_0=1e3, H_i=0.0))
    >>> round(float(found.points[:, 0].max()), 3)  # the apex, C_0/tan θ_f
    3232.728
    """
    import numpy as np

    axes = np.array([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], np.sqrt(2.0) * deviator(angle, frame)])
    return section_of(_leveled(law, domain_of(law, values, state), level), np.zeros(6), axes, limit, False, tolerance)


def deviatoric(
    law: Law,
    values: Mapping[str, Any],
    *,
    pressure: float = 0.0,
    state: Mapping[str, Any] | None = None,
    frame: Any = None,
    limit: float | None = None,
    level: float | None = None,
    tolerance: float = TOLERANCE,
) -> Section:
    """Section by the plane −tr σ/3 = `pressure` [Pa]; coordinates (x, y) [Pa] along n(0) and n(π/2), √(x² + y²) = ‖dev σ‖ = √2 √J₂.

    Everything else as in `meridian`.

    >>> from fenchel.potentials.library import tresca
    >>> found = deviatoric(tresca, dict(E=1e7, nu=0.2, sigma_y=1e3, H_i=0.0))
    >>> radius = (found.points**2).sum(axis=1) ** 0.5
    >>> round(float(radius.max()), 3), len(found.points) < 60  # the corners, √(2/3) σ_y
    (816.497, True)
    """
    import numpy as np

    domain = _leveled(law, domain_of(law, values, state), level)
    origin = -float(pressure) * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    axes = np.array([deviator(0.0, frame), deviator(np.pi / 2.0, frame)])
    return section_of(domain, origin, axes, limit, True, tolerance)


def _leveled(law: Law, domain: Domain, level: float | None) -> Domain:
    if level is not None:
        return domain.below(level)
    if not domain.functions:
        raise DeclarationError(f"law '{law.name}' has no surface: its phi_star is finite; give a level [W/m3] of it")
    return domain


def section_of(
    domain: Domain, origin: Any, axes: Any, limit: float | None, equal: bool, tolerance: float = TOLERANCE
) -> Section:
    """Section of a domain by the plane of `axes` (2, 6), orthogonal, through `origin` (6,); `equal`: both coordinates on one scale."""
    import numpy as np

    def gap(points: Any) -> Any:
        return domain.gap(origin + points @ axes)

    hints = _project(domain.hints, origin, axes)
    inside = interior(gap, hints)
    if inside is None:
        raise InputError("the plane of the section has no point inside the elastic domain")
    beyond = ROUNDING * _nearest(domain, origin + inside @ axes)
    inside = _centred(gap, inside, beyond)
    lengths = reach(gap, inside, np.array(ALONG), 50, beyond)
    if (
        lengths.reshape(2, 2).max(axis=1) < 1e-12 * lengths.max(initial=0.0, where=np.isfinite(lengths))
    ).any() or lengths.max() < 1e-15:
        raise InputError("the elastic domain is flat in the plane of the section: it has no point inside")
    box = _box(gap, inside, limit, equal, beyond)
    corners, _ = boundary(gap, np.clip(inside, box.lower + 1e-3 * box.half, box.upper - 1e-3 * box.half), box, 1e-2)
    centre = corners.mean(axis=0) if len(corners) < 3 else _centroid(corners)
    span = Box(corners.min(axis=0), corners.max(axis=0))
    # what is bounded is drawn whole: the faces of the box stand off from it
    margin = 0.1 * span.half
    lower = np.where(box.lower < span.lower - 1e-9 * box.half, span.lower - margin, box.lower)
    upper = np.where(box.upper > span.upper + 1e-9 * box.half, span.upper + margin, box.upper)
    if equal:
        size = max(span.half)
        lower, upper = np.minimum(lower, centre - size), np.maximum(upper, centre + size)
    points, cut = boundary(gap, centre, Box(lower, upper), tolerance)
    between = 0.5 * (points + np.roll(points, -1, axis=0))
    active = domain.active(origin + between @ axes)
    return Section(points, cut, centre, origin, axes, active, domain.stress, domain.symbol)


ALONG = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))


def _centred(gap: Any, inside: Any, beyond: float) -> Any:
    """A point inside, moved to the middle of the chords along the axes where these are finite: away from a boundary that it is near."""
    import numpy as np

    for k in (0, 1, 0, 1):
        lengths = reach(gap, inside, np.array(ALONG[2 * k : 2 * k + 2]), 50, beyond)
        if np.isfinite(lengths).all():
            moved = inside.copy()
            moved[k] += 0.5 * (lengths[0] - lengths[1])
            inside = moved if gap(moved[None])[0] < 0.0 else inside
    return inside


def _nearest(domain: Domain, inside: Any) -> float:
    """Distance [Pa] to the nearest boundary from a tensor inside, along pressures, deviators and shears: rounding refers to it."""
    import numpy as np

    spread = np.vstack([np.eye(6), [[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]], [deviator(k) for k in range(6)]])
    return float(reach(domain.gap, inside, np.vstack([spread, -spread])).min())


def _box(gap: Any, inside: Any, limit: float | None, equal: bool, beyond: float) -> Box:
    """Limits of the coordinates: wide enough for a bounded domain, else to `limit` or a few times what is bounded."""
    import numpy as np

    lengths = reach(gap, inside, np.array(ALONG), 50, beyond)
    finite = np.isfinite(lengths)
    size = float(lengths[finite].max()) if finite.any() else (limit or USUAL)
    sizes = np.array(
        [lengths[:2][finite[:2]].max(initial=0.0) or size, lengths[2:][finite[2:]].max(initial=0.0) or size]
    )
    if equal:
        sizes[:] = sizes.max()
    angles = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False) + 0.005
    directions = np.column_stack([np.cos(angles), np.sin(angles)]) * sizes
    far = reach(gap, inside, directions, 0, beyond / sizes.max())
    hits = inside + np.minimum(far, FAR)[:, None] * directions
    lower, upper = hits.min(axis=0) - sizes, hits.max(axis=0) + sizes
    if (far <= FAR).all() and finite.all():
        return Box(lower, upper)
    ends = np.array([limit, limit], dtype=float) if limit is not None else np.full(2, np.nan)
    return _limited(gap, inside, sizes, ends, lower, upper, beyond)


def _limited(gap: Any, inside: Any, sizes: Any, ends: Any, lower: Any, upper: Any, beyond: float) -> Box:
    """Limits of an unbounded domain: those of the first coordinate, and of the second one where the first does not bound it."""
    import numpy as np

    given = np.isfinite(ends)
    end = np.where(given, ends, np.abs(inside) + BEYOND * sizes)
    if given.all():
        lower, upper = np.maximum(lower, -end), np.minimum(upper, end)
        lower, upper = np.minimum(lower, inside - 1e-3 * end), np.maximum(upper, inside + 1e-3 * end)
        return Box(lower, upper)
    low, high = inside - BEYOND * sizes, inside + BEYOND * sizes
    first = np.array([max(lower[0], low[0]), min(upper[0], high[0])])
    # is it bounded across, between these two?
    edge = np.array([[first[0], inside[1]], [first[1], inside[1]], inside])
    across = np.array([[0.0, 1.0], [0.0, -1.0]])
    wide = [reach(gap, point, across, 0, beyond) for point in edge if gap(point[None])[0] <= 0.0]
    reached = float(np.max(wide)) if wide else np.inf
    second = (
        np.array([inside[1] - 1.5 * reached, inside[1] + 1.5 * reached])
        if np.isfinite(reached)
        else np.array([low[1], high[1]])
    )
    return Box(np.array([first[0], second[0]]), np.array([first[1], second[1]]))


def _centroid(points: Any) -> Any:
    """Centre of area of a polygon."""
    import numpy as np

    base = points.mean(axis=0)
    here, there = points - base, np.roll(points, -1, axis=0) - base
    cross = here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]
    total = cross.sum()
    if not total > 0.0:
        return base
    return base + ((here + there) * cross[:, None]).sum(axis=0) / (3.0 * total)


def _project(tensors: Any, origin: Any, axes: Any) -> Any:
    return (tensors - origin) @ axes.T / (axes * axes).sum(axis=1)
