r"""How wires lie before densification: persistent random walks in the whole box, or in horizontal layers as a machine lays them.

The number of wires follows from the wanted length per volume ρ_L: with N wires of B beads spaced by l₀, in a box of volume
V = (V_g + N B V_b)/φ, ρ_L V = N (B − 1) l₀ gives N = ρ_L V_g/(φ (B − 1) l₀ − ρ_L B V_b).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

__all__ = ["lay_layers", "wire_count_of"]

Array = NDArray[np.float64]


def wire_count_of(
    wire_density: float, grain_volume: float, *, beads: int, spacing: float, bead_radius: float, solid_fraction: float
) -> int:
    """Number of wires that gives a wire length per volume [m⁻²] beside `grain_volume` [m³] of grains; 0 only for a density of 0.

    Raises `InputError` where the beads alone would take more room than there is.
    """
    if not wire_density >= 0.0:
        raise InputError(f"wire_density = {wire_density}: a length per volume is ≥ 0, in m⁻²")
    if wire_density == 0.0:
        return 0
    bead_volume = 4.0 / 3.0 * np.pi * bead_radius**3
    room = solid_fraction * (beads - 1) * spacing - wire_density * beads * bead_volume
    if not room > 0.0:
        most = solid_fraction * (beads - 1) * spacing / (beads * bead_volume)
        raise InputError(
            f"wire_density = {wire_density:.3g} m⁻²: beads of {1e3 * bead_radius:.3g} mm would fill all space at {most:.3g} m⁻²; "
            "thinner beads, or a larger spacing"
        )
    return max(1, round(wire_density * grain_volume / room))


def lay_layers(
    rng: np.random.Generator,
    count: int,
    beads: int,
    spacing: float,
    half: Array,
    *,
    layers: int,
    bend: float = 0.25,
    thickness: float = 0.0,
) -> Array:
    """Wires in `layers` horizontal planes, evenly spaced along the last axis, shape (count, beads, 3).

    In its plane a wire is a persistent random walk of step `spacing` [m] with direction noise `bend` per step, reflected at the walls;
    `thickness` [m] is the standard deviation of the height of a wire about its plane. Layers get equally many wires, up to one.
    """
    if layers < 1:
        raise InputError(f"layers = {layers}: wires lie in one layer or more")
    height = (np.arange(layers) + 0.5) / layers * 2.0 * half[2] - half[2]
    layer = rng.permutation(np.arange(count) % layers)
    walks = np.empty((count, beads, 3))
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    heading = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    place = rng.uniform(-half[:2], half[:2], (count, 2))
    walks[:, :, 2] = np.clip(height[layer] + thickness * rng.normal(size=count), -half[2], half[2])[:, None]
    for b in range(beads):
        walks[:, b, :2] = place
        heading += bend * rng.normal(size=heading.shape)
        heading /= np.linalg.norm(heading, axis=1, keepdims=True)
        heading[np.abs(place + spacing * heading) > half[:2]] *= -1.0
        place = np.clip(place + spacing * heading, -half[:2], half[:2])
    return walks
