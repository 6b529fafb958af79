r"""Solid fraction in a measuring sphere: the volume of the bodies that lies inside, exactly, over that of the sphere.

Two spheres of radii R, r at distance d share the lens π (R + r − d)² (d² + 2d(R + r) − 3(R − r)²)/(12 d); two disks the sum of two circular
segments. Bodies count with their parts, so that the fraction does not jump when a centre crosses the surface. The overlap
of bodies with one another counts twice: second order in the overlap for contacts, not small for beads that overlap on their wire.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = ["shared_volume", "solid_fraction"]

Array = NDArray[np.float64]


def shared_volume(distance: Array, radius: Array, sphere: float, *, dimension: int = 3) -> Array:
    """Volume [m³], in the plane area [m²], that bodies of `radius` (n,) at `distance` (n,) share with a sphere of radius `sphere` [m]."""
    d = np.asarray(distance, dtype=float)
    r = np.asarray(radius, dtype=float)
    small = np.minimum(r, sphere)
    ball = 4.0 / 3.0 * np.pi * small**3 if dimension == 3 else np.pi * small**2
    crossing = (d < sphere + r) & (d > np.abs(sphere - r))
    out = np.where(d <= np.abs(sphere - r), ball, 0.0)
    d, r = d[crossing], r[crossing]
    gap = sphere + r - d
    if dimension == 3:
        out[crossing] = np.pi * gap**2 * (d**2 + 2.0 * d * (sphere + r) - 3.0 * (sphere - r) ** 2) / (12.0 * d)
        return out
    for one, other in ((r, np.full_like(r, sphere)), (np.full_like(r, sphere), r)):
        cosine = np.clip((d**2 + one**2 - other**2) / (2.0 * d * one), -1.0, 1.0)
        angle = np.arccos(cosine)
        out[crossing] += one**2 * (angle - cosine * np.sin(angle))
    return out


def solid_fraction(network: Network, sphere: float, *, centre: Array | None = None, phase: str = "all") -> float:
    """Solid fraction [-] of a phase in a sphere of radius `sphere` [m] about `centre` (d,) (default 0); the porosity is 1 minus it.

    Raises `InputError` for a sphere that is not positive or sticks out of the box.
    """
    d = network.dimension
    centre = np.zeros(d) if centre is None else np.asarray(centre, dtype=float)
    if not sphere > 0.0:
        raise InputError(f"sphere = {sphere} m: a measuring sphere has a positive radius")
    if np.any(np.abs(centre) + sphere > network.half * (1.0 + 1e-12)):
        raise InputError(
            f"sphere = {sphere:.3g} m: sticks out of the box; at most {np.min(network.half - np.abs(centre)):.3g} m here"
        )
    chosen = network.of_phase(phase)
    distance = np.linalg.norm(network.x[chosen] - centre, axis=1)
    whole = 4.0 / 3.0 * np.pi * sphere**3 if d == 3 else np.pi * sphere**2
    return float(shared_volume(distance, network.radius[chosen], sphere, dimension=d).sum() / whole)
