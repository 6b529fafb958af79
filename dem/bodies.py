"""The state of a sample: spheres or disks (grains and beads), a box of frictionless walls, links, and the impulses carried over.

Positions are those of the mid configuration of the leap-frog form of Moreau–Jean, q_m = q + h(1−θ)v: detection there, x ← x + h v.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..notebook import Summary

__all__ = ["Assembly"]

Array = NDArray[np.float64]


@dataclass(repr=False)
class Assembly(Summary):
    """Everything a step needs and nothing that it can derive; arrays over bodies (n), links (m), candidates (c), planes (k).

    In two dimensions (d = 2) bodies are disks and nothing has a third component; `spin` then has one column. Where no body turns it has
    none. Box: |x_a| ≤ half_a with one degree of freedom per axis, the half length; both walls of a pair move symmetrically; half
    lengths inf: no box. A body of infinite mass is fixed, or goes on with the velocity it has (the work that takes is in no term of the
    energy).
    """

    UNITS: ClassVar[Mapping[str, str]] = {
        "x": "m",
        "radius": "m",
        "mass": "kg",
        "velocity": "m/s",
        "spin": "m/s",
        "half": "m",
        "box_velocity": "m/s",
        "box_mass": "kg",
        "plane_place": "m",
        "plane_velocity": "m/s",
        "link_length": "m",
        "link_impulse": "N s",
        "pair_impulse": "N s",
    }

    x: Array  # (n, d) centres [m]
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg], inf: fixed
    wire: NDArray[np.int64]  # (n,) wire of a bead, -1 for a grain
    rank: NDArray[np.int64]  # (n,) place along the wire
    velocity: Array  # (n, d) [m/s]
    spin: Array  # (n, 3), (n, 1) or (n, 0) radius times angular velocity [m/s]
    locked: NDArray[np.bool_]  # (n,) bodies that do not turn
    half: Array  # (d,) half lengths of the box [m]
    box_velocity: Array  # (d,) of the half lengths [m/s]
    box_mass: Array  # (d,) of a pair of walls [kg]
    plane_place: Array  # (k,) n·x of the planes [m]
    plane_velocity: Array  # (k,) along their normals [m/s]
    links: NDArray[np.int32]  # (m, 2) consecutive beads
    link_length: Array  # (m,) reference length [m]
    link_impulse: Array  # (m,) tension impulse of the last step [N s]
    pairs: NDArray[np.int32]  # (c, 2) candidates
    pair_impulse: Array  # (c, d + 1) of the last step: tangential part on the first body, and pressure [N s]; (c, 1) without friction
    walls: NDArray[np.int32]  # (w, 2) candidates (body, plane); planes 2 axis and 2 axis + 1 are those of the box
    wall_impulse: Array  # (w, 1 or d + 1) [N s]
    listed_x: Array  # (n, d) positions when the candidates were listed
    listed_place: Array  # places of walls and planes then
    apart: int = 1  # least difference of ranks at which beads of one wire may touch
    listed_reach: float = 0.0  # the largest gap of a contact for which they were listed [m]
    step: float = 0.0  # the step that the impulses belong to [s]; 0: none yet
    elastic_energy: float = 0.0  # stored in contacts and links [J]
    time: float = 0.0  # [s]

    def _title(self) -> str:
        return f"{len(self.x)} bodies, {len(self.links)} links, {len(self.pairs)} candidates"

    @classmethod
    def of_spheres(
        cls,
        x: Array,
        radius: Array,
        mass: Array,
        half: Array | None = None,
        *,
        wire: NDArray[np.int64] | None = None,
        rank: NDArray[np.int64] | None = None,
        box_mass: Array | None = None,
        locked: NDArray[np.bool_] | None = None,
    ) -> Assembly:
        """Spheres, or disks where x has two columns, at rest; `half` None: no box.

        `wire` and `rank` say which of them are beads of which wire (links join neighbours), `locked` which do not turn; without friction
        nothing turns anyway.
        """
        n, d = x.shape
        half = np.full(d, np.inf) if half is None else half
        locked = np.zeros(n, dtype=bool) if locked is None else np.array(locked, dtype=bool)
        turning = 0 if n and locked.all() else 3 if d == 3 else 1
        moving = np.isfinite(mass)
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
            velocity=np.zeros((n, d)),
            spin=np.zeros((n, turning)),
            locked=locked,
            half=np.array(half, dtype=float),
            box_velocity=np.zeros(d),
            box_mass=np.full(d, 0.4 * mass[moving].sum() or 1.0)
            if box_mass is None
            else np.array(box_mass, dtype=float),
            plane_place=np.zeros(0),
            plane_velocity=np.zeros(0),
            links=links,
            link_length=lengths,
            link_impulse=np.zeros(len(links)),
            pairs=np.empty((0, 2), dtype=np.int32),
            pair_impulse=np.zeros((0, 1)),
            walls=np.empty((0, 2), dtype=np.int32),
            wall_impulse=np.zeros((0, 1)),
            listed_x=np.full((n, d), np.inf),
            listed_place=np.zeros(0),
            apart=apart,
        )

    @property
    def is_bead(self) -> NDArray[np.bool_]:
        """(n,) True for beads."""
        return self.wire >= 0

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.x.shape[1]

    @property
    def boxed(self) -> bool:
        """Whether there is a box."""
        return bool(np.all(np.isfinite(self.half)))

    @property
    def grain_radius(self) -> float:
        """Mean radius of the grains that can move, else of all bodies [m]."""
        grains = ~self.is_bead & np.isfinite(self.mass)
        if not len(self.radius):
            return 1.0
        return float(self.radius[grains].mean() if grains.any() else self.radius.mean())

    @property
    def volume(self) -> float:
        """Of the box [m3], inf without a box."""
        return float(np.prod(2.0 * self.half))

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


_SCALARS = {"apart": int, "listed_reach": float, "step": float, "elastic_energy": float, "time": float}
