r"""From a densified sample to an isotropic state at a chosen pressure.

A stage brings all three pairs of walls to a pressure (ramped, then held) under given laws, and ends when the sample is at rest: mean
unbalanced force below 1 % of the mean contact force and wall stresses within 1 % of the pressure, for twenty steps in a row.
Wires hold together during the compression (loose beads would be scattered: measured, links stretched to five spacings). Unless they are
to be prestressed, their reference lengths then follow the present ones every twenty steps while compression goes on, so that tension
dies out gently and the packing densifies to rest without it; they are off when friction comes on. The test with links and the
control without start from one and the same state, at rest without them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from .bodies import Assembly
from .homogenise import wall_stress
from .packing import densify
from .scene import Grains, Sample, SceneSolve, Wires
from .stepping import Drive, Material, Simulation, Solver
from .triaxial import inertial_time

__all__ = ["IsotropicStage", "make_sample", "material_of", "preparation", "pressure_change"]


class IsotropicStage:
    """One stage of isotropic compression in progress; `advance` makes one step."""

    def __init__(
        self,
        assembly: Assembly,
        material: Material,
        solver: Solver,
        *,
        name: str,
        pressure: float,
        density: float,
        pressure_before: float | None = None,
        ramp: float = 0.0,
        least: float = 20.0,
        most: float = 400.0,
        step_fraction: float = 0.05,
        slacken: bool = False,
        quench: float = 0.0,
        to_rest: bool = True,
    ) -> None:
        self.simulation = Simulation(assembly, material, solver, reach=0.04 * assembly.grain_radius)
        self.name = name
        self.slacken = slacken
        self.to_rest = to_rest
        self.quench_steps = round(quench / step_fraction)
        self.pressure = pressure
        self.before = pressure if pressure_before is None else pressure_before
        scale = inertial_time(assembly, max(pressure, self.before), density)
        self.step = step_fraction * scale
        self.ramp_steps = round(ramp / step_fraction)
        self.least = self.ramp_steps + round(least / step_fraction)
        self.most = self.least + round(most / step_fraction)
        self.steps = 0
        self.calm = 0

    @property
    def assembly(self) -> Assembly:
        """The sample."""
        return self.simulation.assembly

    @property
    def done(self) -> bool:
        """True when the least duration is over and, if asked for, the sample has been at rest for twenty steps."""
        return self.steps >= self.least and (self.calm >= 20 or not self.to_rest)

    @property
    def fraction(self) -> float:
        """Share of the least duration that is behind."""
        return min(1.0, self.steps / self.least)

    def advance(self) -> dict[str, float]:
        """One step; returns its measures. Raises `ConvergenceError` when the sample does not come to rest in the longest duration."""
        share = min(1.0, (self.steps + 1) / self.ramp_steps) if self.ramp_steps else 1.0
        pressure = self.before + share * (self.pressure - self.before)
        a = self.assembly
        self.simulation.push_out = self.steps < self.quench_steps
        if self.steps < self.quench_steps:  # overlaps of the start state are removed without flying apart
            a.velocity[:] = 0.0
            a.spin[:] = 0.0
        if self.slacken and self.steps % 20 == 0:
            a.release_links()
        measures = self.simulation.advance(self.step, Drive(pressure=np.full(3, pressure)))
        self.steps += 1
        rows = self.simulation.contacts
        assert rows is not None
        off = np.max(np.abs(wall_stress(rows) / -pressure - 1.0))
        self.calm = self.calm + 1 if measures["unbalanced"] < 1e-2 and off < 1e-2 and share >= 1.0 else 0
        if self.steps >= self.most and not self.done:
            raise ConvergenceError(
                f"{self.name}: not at rest after {self.steps} steps (unbalanced over contact force {measures['unbalanced']:.1e}, "
                f"wall pressure off by {100 * off:.2g} %): lower sample.solid_fraction or tighten sample.tolerance"
            )
        return measures

    def state(self) -> dict[str, Any]:
        """What a checkpoint needs beside the assembly."""
        return {"steps": self.steps, "calm": self.calm}

    def restore(self, state: dict[str, Any]) -> None:
        """Inverse of `state`."""
        self.steps, self.calm = int(state["steps"]), int(state["calm"])


def material_of(grains: Grains, wires: Wires | None) -> Material:
    """The laws of the test."""
    kn = np.inf if grains.normal_stiffness is None else grains.normal_stiffness
    law = Material(
        friction=grains.friction,
        bead_friction=grains.friction,
        normal_stiffness=kn,
        tangential_stiffness=kn * grains.stiffness_ratio,
        links=False,
    )
    if wires is None or wires.count == 0:
        return law
    return replace(
        law,
        bead_friction=grains.friction if wires.friction is None else wires.friction,
        wire_law=wires.law,
        wire_stiffness=wires.stiffness,
        prestrain=wires.prestrain,
        links=True,
    )


def make_sample(grains: Grains, wires: Wires | None, sample: Sample, seed: int) -> Assembly:
    """The densified sample of a seed."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(grains.radius[0], grains.radius[1], grains.count)
    chains: dict[str, Any] = {}
    if wires is not None and wires.count:
        chains = {
            "wire_count": wires.count,
            "beads": wires.beads,
            "spacing": wires.spacing,
            "bead_radius": wires.bead_radius,
        }
    return densify(rng, radius, solid_fraction=sample.solid_fraction, density=grains.density, **chains)


def preparation(
    grains: Grains, wires: Wires | None, sample: Sample, solve: SceneSolve, pressure: float
) -> list[Callable[[Assembly], IsotropicStage]]:
    """Makers of the stages from a densified sample to rest at `pressure` under the friction and the tolerance of the test."""
    law = material_of(grains, wires)
    prestressed = wires is not None and wires.state == "prestressed"
    loose = Solver(tolerance=sample.tolerance, sweep_limit=solve.sweep_limit)
    tight = Solver(tolerance=solve.tolerance, sweep_limit=solve.sweep_limit)
    smooth = replace(law, friction=sample.friction, bead_friction=sample.friction)
    loose_beads = replace(law, links=law.links and prestressed)
    stage = partial(IsotropicStage, pressure=pressure, density=grains.density, step_fraction=solve.step)
    coarse = partial(stage, material=smooth, solver=loose, least=60.0, step_fraction=2 * solve.step)
    compression = partial(coarse, name="compression", quench=10.0)
    slackening = partial(coarse, name="slackening", slacken=True, to_rest=False)
    friction_on = partial(stage, material=loose_beads, solver=loose, name="friction on", least=20.0)
    rest = partial(stage, material=loose_beads, solver=tight, name="rest", least=5.0)
    if prestressed or not law.links:
        return [compression, friction_on, rest]
    return [compression, slackening, friction_on, rest]


def pressure_change(
    assembly: Assembly, grains: Grains, wires: Wires | None, solve: SceneSolve, before: float, pressure: float
) -> IsotropicStage:
    """From rest at one pressure to rest at another, under the friction and the tolerance of the test."""
    law = material_of(grains, wires)
    law = replace(law, links=law.links and wires is not None and wires.state == "prestressed")
    return IsotropicStage(
        assembly,
        law,
        Solver(tolerance=solve.tolerance, sweep_limit=solve.sweep_limit),
        name=f"to {pressure / 1e3:g} kPa",
        pressure=pressure,
        pressure_before=before,
        density=grains.density,
        ramp=20.0,
        least=20.0,
        step_fraction=solve.step,
    )
