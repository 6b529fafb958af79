"""Quasi-static relaxation: steps that each start from rest, until nothing is left to move a body."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import ConvergenceError
from .stepping import Drive, Simulation

__all__ = ["Relaxation", "relax"]


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """How a relaxation ended: steps made, mean net force of bodies over mean contact force, and the largest speed left [m/s]."""

    steps: int
    unbalanced: float
    speed: float


def relax(
    simulation: Simulation, drive: Drive, step: float, *, tolerance: float = 1e-3, step_limit: int = 5000
) -> Relaxation:
    """Advance with all velocities set to zero before each step until the unbalanced force stays below `tolerance` for ten steps.

    Each step is then a proximal step of the statics, min_v ½ v·M v/h − F·v under the contact laws: inertia only tells how far a body may
    go at once. Longer steps relax faster; loose bodies fall h² g a step. Raises `ConvergenceError` at the step limit.
    """
    a = simulation.assembly
    calm = 0
    unbalanced = speed = float("inf")
    for done in range(1, step_limit + 1):
        a.velocity[:] = 0.0
        a.spin[:] = 0.0
        a.box_velocity[:] = 0.0
        a.plane_velocity[:] = 0.0
        measures = simulation.advance(step, drive)
        unbalanced = measures["unbalanced"]
        speed = simulation.fastest(drive, 0.0)
        calm = calm + 1 if measures["closed"] and unbalanced < tolerance else 0
        if calm >= 10:
            a.velocity[:] = 0.0
            a.spin[:] = 0.0
            return Relaxation(steps=done, unbalanced=unbalanced, speed=speed)
    raise ConvergenceError(
        f"relaxation: unbalanced over contact force is {unbalanced:.1e} > {tolerance:.0e} after {step_limit} steps: "
        "take a longer step, a larger step_limit, or a looser tolerance"
    )
