"""Random dense samples: a size distribution, a wire density, a solid fraction."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...errors import InputError
from ..bodies import Assembly
from ..packing import densify, lay_wires
from .sizes import Sizes, draw_radii
from .wire_layout import lay_layers, wire_count_of

__all__ = ["random_sample"]


def random_sample(
    rng: np.random.Generator,
    sizes: Sizes,
    count: int,
    *,
    solid_fraction: float = 0.57,
    density: float = 2600.0,
    wire_density: float = 0.0,
    beads: int = 20,
    spacing: float | None = None,
    bead_radius: float | None = None,
    laying: Literal["walks", "layers"] = "walks",
    layers: int = 8,
    bend: float = 0.25,
) -> Assembly:
    """A geometrically densified sample in a cube: `count` grains of `sizes`, wires of `wire_density` [m⁻²], at rest and without forces.

    `solid_fraction` [-] counts grains and beads, `density` [kg/m³] is that of the grains. A wire has `beads` of `bead_radius` [m] (default
    0.4 mean grain radii) spaced by `spacing` [m] (default: one); it lies as a persistent walk of direction noise `bend` per step, anywhere
    ("walks") or in horizontal `layers`. Compression to a pressure is for `IsotropicStage`. Raises `InputError` for what does not fit.
    """
    radius = draw_radii(sizes, rng, count)
    spacing = float(radius.mean()) if spacing is None else spacing
    bead_radius = 0.4 * float(radius.mean()) if bead_radius is None else bead_radius
    if beads < 2 or not spacing > 0.0 or not bead_radius > 0.0:
        raise InputError("wires: a wire has two beads or more, a positive spacing and a positive bead radius")
    grain_volume = 4.0 / 3.0 * np.pi * float(np.sum(radius**3))
    wires = wire_count_of(
        wire_density, grain_volume, beads=beads, spacing=spacing, bead_radius=bead_radius, solid_fraction=solid_fraction
    )
    bead_volume = 4.0 / 3.0 * np.pi * bead_radius**3 * wires * beads
    half = np.full(3, 0.5 * ((grain_volume + bead_volume) / solid_fraction) ** (1.0 / 3.0))
    if laying == "layers":
        walks = lay_layers(rng, wires, beads, spacing, half, layers=layers, bend=bend, thickness=0.25 * spacing)
    elif laying == "walks":
        walks = lay_wires(rng, wires, beads, spacing, half, bend=bend)
    else:
        raise InputError(f'laying = {laying!r}: is "walks" or "layers"')
    return densify(
        rng,
        radius,
        walks=walks,
        spacing=spacing,
        bead_radius=bead_radius,
        solid_fraction=solid_fraction,
        density=density,
    )
