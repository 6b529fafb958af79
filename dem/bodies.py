"""The state of a sample: spheres (grains and beads), a box of six frictionless walls, links, and the impulses carried over.

Positions are those of the mid configuration of the leap-frog form of Moreau–Jean (θ = ½): detection there, x ← x + h v.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Assembly"]

Array = NDArray[np.float64]


@dataclass
class Assembly:
    """Everything a step needs and nothing that it can derive; arrays over bodies (n), links (m), candidates (c).

    Box: |x_a| ≤ half_a with one degree of freedom per axis, the half length; both walls of a pair move symmetrically.
    """

    x: Array  # (n, 3) centres [m]
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg]
    wire: NDArray[np.int64]  # (n,) wire of a bead, -1 for a grain
    rank: NDArray[np.int64]  # (n,) place along the wire
    velocity: Array  # (n, 3) [m/s]
    spin: Array  # (n, 3) radius times angular velocity [m/s]
    half: Array  # (3,) half lengths of the box [m]
    box_velocity: Array  # (3,) of the half lengths [m/s]
    box_mass: Array  # (3,) of a pair of walls [kg]
    links: NDArray[np.int32]  # (m, 2) consecutive beads
    link_length: Array  # (m,) reference length [m]
    link_impulse: Array  # (m,) tension impulse of the last step [N s]
    pairs: NDArray[np.int32]  # (c, 2) candidates
    pair_impulse: Array  # (c, 4) of the last step: tangential part on the first body, and pressure [N s]
    walls: NDArray[np.int32]  # (w, 3) candidates (body, axis, side)
    wall_impulse: Array  # (w,) [N s]
    listed_x: Array  # (n, 3) positions when the candidates were listed
    listed_half: Array  # (3,)
    apart: int = 1  # least difference of ranks at which beads of one wire may touch
    step: float = 0.0  # the step that the impulses belong to [s]; 0: none yet
    elastic_energy: float = 0.0  # stored in contacts and links [J]
    time: float = 0.0  # [s]

    @classmethod
    def of_spheres(
        cls,
        x: Array,
        radius: Array,
        mass: Array,
        half: Array,
        *,
        wire: NDArray[np.int64] | None = None,
        rank: NDArray[np.int64] | None = None,
        box_mass: Array | None = None,
    ) -> Assembly:
        """Spheres at rest in a box; `wire` and `rank` say which of them are beads of which wire (links join neighbours)."""
        n = x.shape[0]
        wire = np.full(n, -1, dtype=np.int64) if wire is None else wire
        rank = np.zeros(n, dtype=np.int64) if rank is None else rank
        beads = np.flatnonzero(wire >= 0)
        order = beads[np.lexsort((rank[beads], wire[beads]))]
        same = wire[order[1:]] == wire[order[:-1]]
        links = np.stack([order[:-1][same], order[1:][same]], axis=1).astype(np.int32)
        x = np.array(x, dtype=float)
        lengths = np.linalg.norm(x[links[:, 0]] - x[links[:, 1]], axis=1)
        # beads that overlap on a straight wire are bonded, not in contact
        apart = 1 + int(2.0 * radius[links[:, 0]].max() / lengths.mean() * (1.0 + 1e-9)) if len(links) else 1
        return cls(
            x=x,
            radius=np.array(radius, dtype=float),
            mass=np.array(mass, dtype=float),
            wire=wire,
            rank=rank,
            velocity=np.zeros((n, 3)),
            spin=np.zeros((n, 3)),
            half=np.array(half, dtype=float),
            box_velocity=np.zeros(3),
            box_mass=np.full(3, 0.4 * mass.sum()) if box_mass is None else np.array(box_mass, dtype=float),
            links=links,
            link_length=lengths,
            link_impulse=np.zeros(len(links)),
            pairs=np.empty((0, 2), dtype=np.int32),
            pair_impulse=np.zeros((0, 4)),
            walls=np.empty((0, 3), dtype=np.int32),
            wall_impulse=np.zeros(0),
            listed_x=np.full((n, 3), np.inf),
            listed_half=np.full(3, np.inf),
            apart=apart,
        )

    @property
    def is_bead(self) -> NDArray[np.bool_]:
        """(n,) True for beads."""
        return self.wire >= 0

    @property
    def grain_radius(self) -> float:
        """Mean radius of the grains [m]."""
        grains = ~self.is_bead
        return float(self.radius[grains].mean() if grains.any() else self.radius.mean())

    @property
    def volume(self) -> float:
        """Of the box [m3]."""
        return float(8.0 * np.prod(self.half))

    def solid_fraction(self, *, grains_only: bool = False) -> float:
        """Volume of spheres over the volume of the box."""
        chosen = ~self.is_bead if grains_only else slice(None)
        return float(4.0 / 3.0 * np.pi * np.sum(self.radius[chosen] ** 3) / self.volume)

    def wire_density(self) -> float:
        """Wire length per unit volume [m⁻²], from the current link lengths."""
        d = self.x[self.links[:, 0]] - self.x[self.links[:, 1]]
        return float(np.linalg.norm(d, axis=1).sum() / self.volume)

    def copy(self) -> Assembly:
        """An independent copy."""
        return replace(self, **{f.name: getattr(self, f.name).copy() for f in fields(self) if f.name not in _SCALARS})

    def arrays(self) -> dict[str, Any]:
        """All fields by name, for storage."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def from_arrays(cls, data: dict[str, Any]) -> Assembly:
        """Inverse of `arrays`."""
        return cls(
            **{f.name: _SCALARS[f.name](data[f.name]) if f.name in _SCALARS else data[f.name] for f in fields(cls)}
        )

    def release_links(self) -> None:
        """Make the present link lengths the reference lengths: wires without force."""
        if len(self.links):
            self.link_length = np.linalg.norm(self.x[self.links[:, 0]] - self.x[self.links[:, 1]], axis=1)
            self.link_impulse = np.zeros(len(self.links))


_SCALARS = {"apart": int, "step": float, "elastic_energy": float, "time": float}
