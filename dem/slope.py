r"""The slope deposit: a densified block is released on a floor of fixed beads and comes to rest as a heap.

The block is a geometrically densified cube, freed of its overlaps between walls that give way, put just above the floor and released at
once with its wires free of tension. Contacts are compliant, k_n = 2000 ρ g H d by default, H the side of a cube of all bodies: the
overlap under the weight of a column stays below 10⁻³ d. The step is √(d/g)/80, halved where the sweeps do not converge. Beads weigh
what their volume weighs: a scaled mass would also scale the weight, and wires that heavy pull the heap down. Beyond the floor lies a
plane that catches what rolls off; such bodies count neither for the energy nor for the angle.

At rest: kinetic energy below 10⁻⁶ of the potential energy that was set free, without that of beads that touch nobody: they swing and
spin on their wires for ever. A release at once of frictional spheres without rolling resistance gives low heaps: compare with and
without wires, not with a table of sands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from .adaptive import AdaptiveStep
from .bodies import Assembly
from .measures import Network, Repose, angle_of_repose
from .planes import Plane
from .shapes import hexagonal_floor
from .stepping import Drive, Material, Simulation, Solver

__all__ = ["SlopeDeposit", "slope_start"]

Array = NDArray[np.float64]


def slope_start(block: Assembly, *, density: float, reach: float = 2.0) -> Assembly:
    """A block at rest above a hexagonal floor of fixed beads of the mean grain radius, whose tops lie at z = 0.

    `block` is a densified sample in its box (see `samples.random_sample`), `density` [kg/m³] that of grains and beads, `reach` how far the
    floor goes beyond the block in heights of it. Links take their present length as reference. Raises `InputError` for a plane sample or
    one without grains.
    """
    if block.dimension != 3 or not np.any(~block.is_bead):
        raise InputError("slope: the block is a sample of spheres in space with at least one grain")
    a = _without_overlap(block, density)
    radius = a.grain_radius
    half = a.half
    side = half[:2] + 2.0 * half[2] * reach
    floor = hexagonal_floor(radius, (-side[0], -side[1]), (side[0], side[1]))
    count = len(floor)
    x = a.x.copy()
    # lattice of the floor: no grain starts inside a bead of it
    x[:, 2] += 1e-3 * radius - (a.x[:, 2] - a.radius).min()
    mass = 4.0 / 3.0 * np.pi * density * a.radius**3
    out = Assembly.of_spheres(
        np.concatenate([x, floor]),
        np.concatenate([a.radius, np.full(count, radius)]),
        np.concatenate([mass, np.full(count, np.inf)]),
        wire=np.concatenate([a.wire, np.full(count, -1)]),
        rank=np.concatenate([a.rank, np.zeros(count, dtype=np.int64)]),
    )
    out.apart = a.apart
    out.release_links()
    return out


def _without_overlap(block: Assembly, density: float) -> Assembly:
    """The block after its overlaps have been pushed apart: each step starts from rest, and the walls give way."""
    a = block.copy()
    a.mass = 4.0 / 3.0 * np.pi * density * a.radius**3
    step = 1e-4
    # a stiffness at which a contact gives way by itself in a few steps
    law = Material(
        friction=0.0, bead_friction=0.0, normal_stiffness=float(a.mass.mean()) / step**2, wire_law="elastic_rod",
        wire_stiffness=0.1 * float(a.mass.mean()) / step**2 * a.grain_radius, links=len(a.links) > 0,
    )  # fmt: skip
    simulation = Simulation(a, law, Solver(tolerance=1e-3, sweep_limit=2000))
    free = Drive()
    for _ in range(2000):
        a.velocity[:] = 0.0
        a.box_velocity[:] = 0.0
        if simulation.advance(step, free)["overlap_max"] < 1e-3 * a.grain_radius:
            break
    a.velocity[:] = 0.0
    return a


_TIGHTEN = (1e-3, 1e-4)  # kinetic energy over the energy set free below which the tolerance falls tenfold


@dataclass(frozen=True, kw_only=True)
class _Levels:
    """Energies of the deposit [J]."""

    kinetic: float
    potential: float


class SlopeDeposit:
    """A deposit in progress: `advance` makes one step, `done` when the heap is at rest, `repose` measures its slope."""

    name = "slope"

    def __init__(
        self,
        assembly: Assembly,
        material: Material,
        *,
        density: float,
        gravity: float = 9.81,
        stiffness_factor: float = 2000.0,
        step_fraction: float = 1.0 / 80.0,
        tolerance: float = 1e-3,
        sweep_limit: int = 3000,
        rest: float = 1e-6,
        step_limit: int = 20_000,
        skin: float = 0.4,
    ) -> None:
        if not (gravity > 0.0 and 0.0 < rest < 1.0):
            raise InputError(f"slope: gravity = {gravity} m/s² and rest = {rest}: need gravity > 0 and 0 < rest < 1")
        self._moving = np.isfinite(assembly.mass)
        # from the bodies alone, not from where they are: a resumed deposit must find the same
        solid = 4.0 / 3.0 * np.pi * float(np.sum(assembly.radius[self._moving] ** 3))
        self.height = (solid / 0.57) ** (1.0 / 3.0)
        radius = assembly.grain_radius
        if not np.isfinite(material.normal_stiffness):
            stiffness = stiffness_factor * density * gravity * self.height * 2.0 * radius
            material = replace(material, normal_stiffness=stiffness, tangential_stiffness=0.8 * stiffness)
        # sweeps that stop early make contacts tremble: the nearer to rest, the tighter
        self._solvers = [
            Solver(tolerance=tolerance * 10.0**-k, sweep_limit=sweep_limit) for k in range(len(_TIGHTEN) + 1)
        ]
        self.tightened = 0
        catch = Plane(normal=(0.0, 0.0, 1.0), point=(0.0, 0.0, -4.0 * radius), friction=material.friction)
        self.simulation = Simulation(assembly, material, self._solvers[0], planes=(catch,), skin=skin * radius)
        self.drive = Drive(gravity=np.array([0.0, 0.0, -gravity]))
        self.gravity = gravity
        step = step_fraction * float(np.sqrt(2.0 * radius / gravity))
        # a step that does not converge is halved: the compliance then weighs four times as much
        self.pace = AdaptiveStep(simulation=self.simulation, most=step, least=step / 64.0)
        self.rest = rest
        self.step_limit = step_limit
        self.steps = 0
        self.calm = 0
        self.ratio = 1.0  # kinetic energy over the energy set free
        self.worst = 0.0  # natural map
        self.overlap = 0.0  # [m], of the last step
        self.settled = 0.0  # largest share of the way to rest so far, on a logarithmic scale
        self.start = self._energy().potential

    @property
    def assembly(self) -> Assembly:
        """The sample with its floor."""
        return self.simulation.assembly

    @property
    def deposited(self) -> NDArray[np.bool_]:
        """(n,) bodies of the heap: they can move and have not rolled off the floor."""
        a = self.assembly
        return self._moving & (a.x[:, 2] > -a.grain_radius)

    def _energy(self) -> _Levels:
        a = self.assembly
        kept = self.deposited
        potential = self.gravity * float(a.mass[kept] @ a.x[kept, 2])
        closed = a.pairs[a.pair_impulse[:, -1] > 0.0] if len(a.pairs) else a.pairs
        # a bead that hangs on its wire and touches nobody swings and spins for ever: links have no moment, there is no air
        counted = kept & (np.bincount(closed.ravel(), minlength=len(a.x)) > 0)
        if 2 * counted.sum() < kept.sum():
            counted = kept
        speed = np.sum(a.velocity[counted] ** 2, axis=1)
        if a.spin.size:
            speed += 0.4 * np.sum(a.spin[counted] ** 2, axis=1)
        return _Levels(kinetic=0.5 * float(a.mass[counted] @ speed), potential=potential)

    @property
    def done(self) -> bool:
        """True when the kinetic energy has been below `rest` times the energy set free for fifty steps."""
        return self.calm >= 50

    @property
    def fraction(self) -> float:
        """Share of the way to rest, on a logarithmic scale."""
        return 1.0 if self.done else self.settled

    def advance(self) -> dict[str, float]:
        """One step; returns its measures.

        Raises `ConvergenceError` when the heap is not at rest after `step_limit` steps, or when a step of a 64th of the length fails.
        """
        measures = self.pace.advance(self.drive)
        self.steps += 1
        level = self._energy()
        free = max(self.start - level.potential, 1e-12 * abs(self.start))
        self.ratio = ratio = level.kinetic / free
        self.worst, self.overlap = max(self.worst, measures["natural_map"]), measures["overlap_max"]
        self.calm = self.calm + 1 if ratio < self.rest else 0
        if self.steps > 80 and self.tightened < len(_TIGHTEN) and ratio < _TIGHTEN[self.tightened]:
            self.tightened += 1
            self.simulation.solver = self._solvers[self.tightened]
        self.settled = max(self.settled, float(np.clip(np.log(max(ratio, 1e-300)) / np.log(self.rest), 0.0, 1.0)))
        if self.steps >= self.step_limit and not self.done:
            raise ConvergenceError(
                f"slope: kinetic energy is {ratio:.1e} of the energy set free > {self.rest:.0e} after {self.steps} steps: "
                "raise step_limit or rest, or tighten tolerance"
            )
        return measures

    def network(self) -> Network:
        """The network of the last step, floor included."""
        return Network.of_simulation(self.simulation)

    def repose(self, *, azimuths: int = 6) -> Repose:
        """Angle of repose of the deposited grains and beads above the tops of the floor."""
        a = self.assembly
        kept = self.deposited
        return angle_of_repose(a.x[kept], a.radius[kept], azimuths=azimuths)

    def state(self) -> dict[str, Any]:
        """What a checkpoint needs beside the assembly."""
        return {
            "steps": self.steps,
            "calm": self.calm,
            "settled": self.settled,
            "ratio": self.ratio,
            "worst": self.worst,
            "overlap": self.overlap,
            "sweeps": self.simulation.total_sweeps,
            "rows": self.simulation.total_rows,
            "start": self.start,
            "tightened": self.tightened,
            "next_step": self.pace.step,
            "cuts": self.pace.cuts,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Inverse of `state`."""
        self.steps, self.calm = int(state["steps"]), int(state["calm"])
        self.settled, self.start = float(state["settled"]), float(state["start"])
        self.ratio, self.worst, self.overlap = (float(state[name]) for name in ("ratio", "worst", "overlap"))
        self.simulation.total_sweeps, self.simulation.total_rows = int(state["sweeps"]), int(state["rows"])
        self.tightened, self.pace.cuts = int(state["tightened"]), int(state["cuts"])
        self.pace.step = float(state["next_step"])
        self.simulation.solver = self._solvers[self.tightened]
