r"""Geometric densification: random spheres and wires grown to a wanted solid fraction without dynamics.

Radii grow in stages from 40 % to 100 %; after each stage overlaps are shared out (each pair in proportion to 1/r²) and link lengths are
projected to the bead spacing. Wires start as persistent random walks, uniform in position and direction, reflected at the walls.
What overlap remains (a few per cent of a radius) is for the dynamic compression to remove.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit
from ..errors import InputError
from .bodies import Assembly
from .detection import find_pairs

__all__ = ["densify", "lay_wires"]

Array = NDArray[np.float64]


def lay_wires(
    rng: np.random.Generator, count: int, beads: int, spacing: float, half: Array, *, bend: float = 0.25
) -> Array:
    """Persistent random walks of step `spacing` [m] inside the box, shape (count, beads, 3); `bend` is the direction noise per step."""
    walks = np.empty((count, beads, 3))
    for w in range(count):
        place = rng.uniform(-half, half)
        heading = rng.normal(size=3)
        heading /= np.linalg.norm(heading)
        for b in range(beads):
            walks[w, b] = place
            heading += bend * rng.normal(size=3)
            heading /= np.linalg.norm(heading)
            following = place + spacing * heading
            out = np.abs(following) > half
            heading[out] *= -1.0
            place = np.clip(place + spacing * heading, -half, half)
    return walks


@njit
def _spread(
    x: Array, radius: Array, pairs: NDArray[np.int32], links: NDArray[np.int32], spacing: float, half: Array
) -> float:
    """One pass of overlap removal and link projection; returns the worst overlap over the smaller radius."""
    worst = 0.0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        d0 = x[i, 0] - x[j, 0]
        d1 = x[i, 1] - x[j, 1]
        d2 = x[i, 2] - x[j, 2]
        distance = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        overlap = radius[i] + radius[j] - distance
        if overlap <= 0.0:
            continue
        worst = max(worst, overlap / min(radius[i], radius[j]))
        wi = 1.0 / (radius[i] * radius[i])
        wj = 1.0 / (radius[j] * radius[j])
        if distance == 0.0:
            d0, d1, d2, distance = 1e-3, 0.0, 0.0, 1e-3
        s = overlap / distance / (wi + wj)
        x[i, 0] += s * wi * d0
        x[i, 1] += s * wi * d1
        x[i, 2] += s * wi * d2
        x[j, 0] -= s * wj * d0
        x[j, 1] -= s * wj * d1
        x[j, 2] -= s * wj * d2
    for k in range(links.shape[0]):
        i, j = links[k, 0], links[k, 1]
        distance = np.sqrt((x[i, 0] - x[j, 0]) ** 2 + (x[i, 1] - x[j, 1]) ** 2 + (x[i, 2] - x[j, 2]) ** 2)
        if distance > 0.0:
            for a in range(3):
                shift = 0.5 * (distance - spacing) / distance * (x[i, a] - x[j, a])
                x[i, a] -= shift
                x[j, a] += shift
    for i in range(x.shape[0]):
        for a in range(3):
            limit = half[a] - radius[i]
            if x[i, a] > limit:
                x[i, a] = limit
            elif x[i, a] < -limit:
                x[i, a] = -limit
    return worst


def densify(
    rng: np.random.Generator,
    grain_radius: Array,
    *,
    walks: Array | None = None,
    wire_count: int = 0,
    beads: int = 0,
    spacing: float = 0.0,
    bead_radius: float = 0.0,
    solid_fraction: float = 0.57,
    density: float = 2600.0,
    stages: int = 40,
    passes: int = 10,
    final_passes: int = 600,
) -> Assembly:
    """A sample of grains (radii [m]) and wires in a cube sized for `solid_fraction` (grains and beads).

    Wires lie as `walks` says, shape (count, beads, 3) [m], or as `lay_wires` does. Beads have the mass of a mean grain: legitimate without
    gravity, and it keeps the sweeps few. Raises `InputError` when a wire is longer than fits or bodies are larger than the box.
    """
    if walks is not None:
        wire_count, beads = walks.shape[:2]
    bead_count = wire_count * beads
    radius = np.concatenate([grain_radius, np.full(bead_count, bead_radius)])
    side = (4.0 / 3.0 * np.pi * np.sum(radius**3) / solid_fraction) ** (1.0 / 3.0)
    half = np.full(3, 0.5 * side)
    if 2.0 * radius.max() > side:
        raise InputError(
            f"grains: the largest ({2e3 * radius.max():.3g} mm) does not fit a box of {1e3 * side:.3g} mm; use more grains"
        )
    n = len(grain_radius)
    x = np.empty((n + bead_count, 3))
    x[:n] = rng.uniform(-half, half, size=(n, 3))
    x[n:] = (lay_wires(rng, wire_count, beads, spacing, half) if walks is None else walks).reshape(-1, 3)
    wire = np.concatenate([np.full(n, -1), np.repeat(np.arange(wire_count), beads)]).astype(np.int64)
    rank = np.concatenate([np.zeros(n), np.tile(np.arange(beads), wire_count)]).astype(np.int64)
    mean_mass = float(density * 4.0 / 3.0 * np.pi * np.mean(grain_radius**3))
    mass = np.concatenate([density * 4.0 / 3.0 * np.pi * grain_radius**3, np.full(bead_count, mean_mass)])
    assembly = Assembly.of_spheres(x, radius, mass.astype(np.float64), half, wire=wire, rank=rank)
    x = assembly.x
    for scale in np.linspace(0.4, 1.0, stages):
        _relax(assembly, scale * radius, spacing, passes, 0.0)
    worst = _relax(assembly, radius, spacing, final_passes, 0.01)
    # beads wedged between grains are pushed out by the compression; a centre inside another body is not a packing
    if not np.all(np.isfinite(x)) or worst > 1.0:
        raise InputError(
            f"sample: solid fraction {solid_fraction} cannot be reached (overlaps of {100 * worst:.0f} % of a radius are left); lower it"
        )
    assembly.link_length = np.full(len(assembly.links), spacing)
    return assembly


def _relax(assembly: Assembly, radius: Array, spacing: float, passes: int, goal: float) -> float:
    """Passes of `_spread` at the given radii, candidates re-listed as bodies move."""
    x = assembly.x
    skin = 0.3 * float(radius.mean())
    listed = np.full_like(x, np.inf)
    pairs = assembly.pairs
    worst = 0.0
    for _ in range(passes):
        if not np.max(np.sum((x - listed) ** 2, axis=1)) < (0.5 * skin) ** 2:
            pairs = find_pairs(x, radius, assembly.wire, assembly.rank, assembly.apart, skin)
            listed = x.copy()
        worst = float(_spread(x, radius, pairs, assembly.links, spacing, assembly.half))
        if worst < goal:
            break
    return worst
