r"""The state of a sample as measures, exports and pictures read it: bodies, closed contacts with their forces, links with their tension.

Forces are impulses over the step, f = p/h, at the configuration in which the contacts were detected, q_m = q − h v: normals, gaps and
forces belong together. A contact is closed where its normal force is positive.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..planes import box_planes

if TYPE_CHECKING:
    from ..bodies import Assembly
    from ..stepping import Simulation

__all__ = ["KINDS", "Network"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

KINDS = ("grain_grain", "grain_bead", "bead_bead")


@dataclass(frozen=True, kw_only=True)
class Network:
    """Bodies (n), closed contacts (m), contacts with walls and planes (w), links (l), in d = 2 or 3 dimensions.

    The normal of a contact points from its second body to its first; forces act on the first one.
    """

    x: Array  # (n, d) centres [m]
    radius: Array  # (n,) [m]
    wire: Ints  # (n,) wire of a bead, -1 for a grain
    rank: Ints  # (n,) place along the wire
    velocity: Array  # (n, d) [m/s]
    fixed: Mask  # (n,) bodies that cannot move
    half: Array  # (d,) half lengths of the box [m], inf: no box
    pair: Ints  # (m, 2)
    normal: Array  # (m, d)
    normal_force: Array  # (m,) > 0, compression [N]
    tangential_force: Array  # (m, d) [N]
    friction: Array  # (m,) Coulomb coefficient [-], nan where it is not known
    wall: Ints  # (w, 2) body and plane; planes 2 axis and 2 axis + 1 are those of the box
    wall_force: Array  # (w,) normal force > 0 [N]
    wall_normal: Array  # (w, d) into the sample; nan for planes that only the simulation knows
    link: Ints  # (l, 2), along the wires
    tension: Array  # (l,) [N], 0 where slack; a rod may have negative ones
    time: float  # [s]

    @classmethod
    def of_assembly(
        cls, assembly: Assembly, *, friction: float = np.nan, bead_friction: float | None = None
    ) -> Network:
        """The network that the last step of an assembly left; without forces where it has made none.

        `friction` [-] of its contacts, `bead_friction` where a bead takes part (default: the same).
        """
        a = assembly
        step = a.step
        d = a.x.shape[1]
        x = a.x - step * a.velocity
        half = a.half - step * a.box_velocity
        pressure = a.pair_impulse[:, -1] if len(a.pairs) else np.zeros(0)
        closed = np.flatnonzero(pressure > 0.0) if step > 0.0 else np.zeros(0, dtype=np.int64)
        pair = a.pairs[closed].astype(np.int64).reshape(-1, 2)
        branch = x[pair[:, 0]] - x[pair[:, 1]]
        distance = np.linalg.norm(branch, axis=1)
        tangential = np.zeros((len(pair), d))
        if len(pair) and a.pair_impulse.shape[1] == d + 1:
            tangential = a.pair_impulse[closed, :d] / step
        beads = (a.wire >= 0)[pair].any(axis=1)
        held = a.wall_impulse.reshape(len(a.walls), -1)[:, -1] if len(a.walls) else np.zeros(0)
        touching = np.flatnonzero(held > 0.0) if step > 0.0 else np.zeros(0, dtype=np.int64)
        wall = a.walls[touching].astype(np.int64).reshape(-1, 2)
        boxed = 2 * d if a.boxed else 0
        wall_normal = np.full((len(wall), d), np.nan)
        of_box = wall[:, 1] < boxed
        wall_normal[of_box] = box_planes(d)[0][wall[of_box, 1]]
        order = np.lexsort((a.rank[a.links[:, 0]], a.wire[a.links[:, 0]]))
        return cls(
            x=x,
            radius=a.radius.copy(),
            wire=a.wire.copy(),
            rank=a.rank.copy(),
            velocity=a.velocity.copy(),
            fixed=np.isinf(a.mass),
            half=half,
            pair=pair,
            normal=branch / np.where(distance > 0.0, distance, 1.0)[:, None],
            normal_force=pressure[closed] / step if len(pair) else np.zeros(0),
            tangential_force=tangential,
            friction=np.where(beads, friction if bead_friction is None else bead_friction, friction),
            wall=wall,
            wall_force=held[touching] / step if len(touching) else np.zeros(0),
            wall_normal=wall_normal,
            link=a.links[order].astype(np.int64),
            tension=a.link_impulse[order] / step if step > 0.0 else np.zeros(len(a.links)),
            time=float(a.time),
        )

    @classmethod
    def of_simulation(cls, simulation: Simulation) -> Network:
        """The network of the last step of a simulation, with the friction that its laws gave to each contact.

        Raises `InputError` when it has made no step yet.
        """
        rows = simulation.contacts
        if rows is None:
            raise InputError("the simulation has made no step yet: there are no forces; call advance() first")
        network = cls.of_assembly(simulation.assembly)
        # closed contacts are candidates with an impulse, rows are candidates within reach: both in the order of the candidates
        of_candidate = np.full(len(simulation.assembly.pairs), np.nan)
        of_candidate[rows.candidate] = rows.friction
        friction = of_candidate[simulation.assembly.pair_impulse[:, -1] > 0.0]
        boxed = 2 * network.dimension if simulation.assembly.boxed else 0
        normal = network.wall_normal.copy()
        for k in np.flatnonzero(network.wall[:, 1] >= boxed):
            normal[k] = simulation.planes[network.wall[k, 1] - boxed].direction
        return replace(network, friction=friction, wall_normal=normal)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.x.shape[1]

    @property
    def is_bead(self) -> Mask:
        """(n,) True for beads."""
        return self.wire >= 0

    @property
    def grain_radius(self) -> float:
        """Mean radius of the grains that can move, else of all bodies [m]."""
        grains = ~self.is_bead & ~self.fixed
        return float(self.radius[grains].mean() if grains.any() else self.radius.mean())

    @property
    def kind(self) -> Ints:
        """(m,) number of beads in a contact: the place of its kind in `KINDS`."""
        return self.is_bead[self.pair].sum(axis=1).astype(np.int64)

    def of_kind(self, kind: str | None) -> Mask:
        """(m,) contacts of one of `KINDS`, or all for None; `InputError` for another word."""
        if kind is None:
            return np.ones(len(self.pair), dtype=bool)
        if kind not in KINDS:
            raise InputError(f"kind = {kind!r}: is one of {', '.join(KINDS)}, or None for all contacts")
        return self.kind == KINDS.index(kind)

    def of_phase(self, phase: str) -> Mask:
        """(n,) bodies of a phase: "grains" (those that can move), "beads", or "all"."""
        if phase == "all":
            return np.ones(len(self.x), dtype=bool)
        if phase not in ("grains", "beads"):
            raise InputError(f'phase = {phase!r}: is "grains", "beads" or "all"')
        return self.is_bead if phase == "beads" else ~self.is_bead & ~self.fixed

    @property
    def link_vector(self) -> Array:
        """(l, d) from the first to the second bead of every link [m]."""
        return self.x[self.link[:, 1]] - self.x[self.link[:, 0]]

    @property
    def link_length(self) -> Array:
        """(l,) present lengths [m]."""
        return np.linalg.norm(self.link_vector, axis=1)

    @property
    def link_wire(self) -> Ints:
        """(l,) the wire of every link."""
        return self.wire[self.link[:, 0]]
