r"""Stress in spheres anywhere in a sample, from the network that a test left.

Along the segment from x_a to x_b of a contact the force f on a (and −f on b) carries f ⊗ (x_b − x_a); the part inside the sphere counts,
tension positive. The same partial branches as `fenchel.dem.homogenise`, whose sphere stands at the centre of the box.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem.measures import Network
from .statistics import Mean, mean_of

__all__ = ["Branches", "branches", "mean_pressure", "scatter", "sphere_stress"]

Array = NDArray[np.float64]
Branches = tuple[Array, Array, Array]  # start (k, 3), vector (k, 3), force on the start (k, 3)


def branches(network: Network, *, links: bool | None = None) -> Branches:
    """Start, vector and force of every contact with grains and walls and of every link; `links` True: links alone, False: without them."""
    start, vector, force = [], [], []
    if links is not True:
        i, j = network.pair.T
        start.append(network.x[i])
        vector.append(network.x[j] - network.x[i])
        force.append(network.normal_force[:, None] * network.normal + network.tangential_force)
        body, plane = network.wall.T
        axis, side = plane // 2, np.where(plane % 2, 1.0, -1.0)
        # the normal points into the sample
        side = -np.take_along_axis(network.wall_normal, axis[:, None], axis=1)[:, 0]
        to_wall = np.zeros((len(body), 3))
        place = side * network.half[axis]
        np.put_along_axis(to_wall, axis[:, None], (place - network.x[body, axis])[:, None], axis=1)
        start.append(network.x[body])
        vector.append(to_wall)
        force.append(network.wall_force[:, None] * network.wall_normal)
    if links is not False and len(network.link):
        start.append(network.x[network.link[:, 0]])
        vector.append(network.link_vector)
        force.append(network.tension[:, None] * network.link_vector / network.link_length[:, None])
    return np.concatenate(start), np.concatenate(vector), np.concatenate(force)


def sphere_stress(parts: Branches, centre: Array, radius: float) -> Array:
    """Stress (3, 3) [Pa] in a sphere."""
    start, vector, force = parts
    s = start - centre
    aa = np.sum(vector**2, axis=1)
    bb = np.sum(s * vector, axis=1)
    cc = np.sum(s**2, axis=1) - radius**2
    root = np.sqrt(np.maximum(bb**2 - aa * cc, 0.0))
    safe = np.where(aa > 0.0, aa, 1.0)
    low, high = np.clip((-bb - root) / safe, 0.0, 1.0), np.clip((-bb + root) / safe, 0.0, 1.0)
    share = np.where(aa > 0.0, high - low, 0.0)
    return np.einsum("k,ki,kj->ij", share, force, vector) / (4.0 / 3.0 * np.pi * radius**3)


def mean_pressure(stress: Array) -> float:
    """−tr σ/3 [Pa]."""
    return float(-np.trace(stress) / 3.0)


def scatter(network: Network, radii: Array, rng: np.random.Generator, *, places: int = 40) -> Mapping[str, Any]:
    """Standard deviation over places of the pressure in spheres of `radii` [m], relative to its mean: (r,); the same of the link stress.

    The places are drawn in the part of the box where a sphere keeps a distance of two grain radii from the walls.
    """
    all_parts, link_parts = branches(network), branches(network, links=True)
    out, wires = np.empty(len(radii)), np.full(len(radii), np.nan)
    margin = 2.0 * network.grain_radius
    for k, radius in enumerate(radii):
        room = network.half - margin - radius
        centres = rng.uniform(-1.0, 1.0, (places, 3)) * np.maximum(room, 0.0)
        found = np.array([mean_pressure(sphere_stress(all_parts, c, radius)) for c in centres])
        out[k] = found.std(ddof=1) / abs(found.mean())
        if len(network.link):
            pulled = np.array([-mean_pressure(sphere_stress(link_parts, c, radius)) for c in centres])
            wires[k] = pulled.std(ddof=1) / abs(pulled.mean()) if pulled.mean() else np.nan
    return {"pressure": out, "wires": wires}


def over_seeds(rows: list[Array]) -> list[Mean]:
    """Column-wise means of rows, one row a seed."""
    table = np.array(rows)
    return [mean_of(table[:, k]) for k in range(table.shape[1])]
