r"""Claims 33 to 35: links neither twist nor bend, chains buckle, and a wire weighs what its beads weigh.

A link has one row, along itself. So the impulse that passes through it, summed from the momenta of the beads on one side, has no part
across it; beads do not start to turn; velocities that leave all lengths alone stay. A chain of more than two beads pushed at its ends
bows out and carries almost nothing, whatever its links can carry in compression.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Assembly, Drive, Laws, Simulation, Solver, chain
from ..dem.laws import ElasticRod, SignoriniCoulomb, WireLaw
from ..dem.packing import densify
from .wire_graphs import LAWS, SPACING, STEP, law_named

__all__ = ["bending", "buckling", "folding", "weighing"]

Array = NDArray[np.float64]

MASS = 0.01  # kg, of a bead
GRAVITY = 9.81  # m/s²
TIGHT = Solver(tolerance=1e-14, sweep_limit=1_000_000, keep_unconverged=True)
FEW = Solver(
    tolerance=1e-12, sweep_limit=200, keep_unconverged=True
)  # where there is nothing to solve, sweeps gather round-off


def _bent(rng: np.random.Generator, count: int) -> Assembly:
    """A chain whose links turn by about 50 degrees from one to the next; small beads that may turn."""
    heading = np.array([1.0, 0.0, 0.0])
    x = np.zeros((count, 3))
    for k in range(1, count):
        heading = heading + 0.5 * rng.normal(size=3)
        heading /= np.linalg.norm(heading)
        x[k] = x[k - 1] + SPACING * heading
    mass = MASS * rng.uniform(0.5, 2.0, count)
    number = np.arange(count)
    return Assembly.of_spheres(
        x, np.full(count, 0.02 * SPACING), mass, wire=np.zeros(count, dtype=np.int64), rank=number
    )


def _directions(a: Assembly) -> Array:
    along = np.diff(a.x, axis=0)
    return along / np.linalg.norm(along, axis=1)[:, None]


def bending(chains: int, beads: int) -> dict[str, Any]:
    """By law, over random bent chains: impulses across links (relative to the largest through one), their part along links against the
    reported tensions, change of spin (relative to the largest spin), and change of velocities and energy under pure folding.
    """
    out: dict[str, Any] = {}
    for number, name in enumerate(LAWS):
        worst = dict.fromkeys(("across", "along", "spin", "flow", "energy"), 0.0)
        laws = Laws(contact=SignoriniCoulomb(friction=0.5), wire=law_named(name, 200.0))
        for seed in range(chains):
            rng = np.random.default_rng([34, number, seed])
            a = _bent(rng, beads)
            n = _directions(a)
            a.velocity[:] = rng.normal(size=(beads, 3))
            a.spin[:] = rng.normal(size=(beads, 3))
            before, spin = a.velocity.copy(), a.spin.copy()
            folded = a.copy()
            Simulation(a, laws, TIGHT).advance(STEP, Drive())
            through = np.cumsum(a.mass[:, None] * (a.velocity - before), axis=0)[:-1]
            tension = np.sum(through * n, axis=1)
            size = float(np.max(np.abs(tension)))
            worst["across"] = max(worst["across"], float(np.max(np.abs(through - tension[:, None] * n))) / size)
            worst["along"] = max(worst["along"], float(np.max(np.abs(tension - a.link_impulse))) / size)
            worst["spin"] = max(worst["spin"], float(np.max(np.abs(a.spin - spin)) / np.max(np.abs(spin))))
            turning = rng.normal(size=n.shape)
            turning -= np.sum(turning * n, axis=1)[:, None] * n
            folded.spin[:] = 0.0
            folded.velocity[1:] = folded.velocity[0] + np.cumsum(turning, axis=0)
            start = folded.velocity.copy()
            energy = 0.5 * float(folded.mass @ np.sum(start**2, axis=1))
            measures = Simulation(folded, laws, FEW).advance(STEP, Drive())
            worst["flow"] = max(worst["flow"], float(np.max(np.abs(folded.velocity - start)) / np.max(np.abs(start))))
            lost = max(abs(measures["kinetic"] - energy), measures["elastic"], abs(measures["wires"]))
            worst["energy"] = max(worst["energy"], lost / energy)
        out[name] = worst
    return out


def folding(steps: list[int]) -> dict[str, Any]:
    """Share of kinetic energy that half a turn of one half of a chain about its middle bead costs, by rigid law and number of steps."""
    half = 4
    count = 2 * half + 1
    out: dict[str, Any] = {"steps": np.array(steps)}
    for name in ("rigid rod", "rigid wire"):
        lost = np.zeros(len(steps))
        for k, n in enumerate(steps):
            x, wire, rank = chain(np.array([-half * SPACING, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), count, SPACING)
            mass = np.full(count, MASS)
            mass[half] = np.inf
            a = Assembly.of_spheres(x, np.full(count, 0.02 * SPACING), mass, wire=wire, rank=rank)
            a.velocity[half + 1 :, 1] = np.pi * x[half + 1 :, 0]  # half a turn in a second
            start = np.sum(a.velocity**2)
            simulation = Simulation(a, Laws(wire=law_named(name, 1.0)), Solver(tolerance=1e-12, sweep_limit=200_000))
            for _ in range(n):
                simulation.advance(1.0 / n, Drive())
            lost[k] = 1.0 - np.sum(a.velocity**2) / start
            out["angle"] = float(np.degrees(np.arctan2(a.x[-1, 1], a.x[-1, 0])))
        out[name] = lost
    return out


def _pulled(count: int, speed: float, law: WireLaw, amplitude: float, seed: int, steps: int) -> tuple[Array, Array]:
    """Change of the distance of the ends (relative), and force of the last link [N], while one end moves; inner beads are damped."""
    rng = np.random.default_rng([35, seed])
    x, wire, rank = chain(np.zeros(3), np.array([1.0, 0.0, 0.0]), count, SPACING)
    x[1:-1, 1:] += amplitude * SPACING * rng.normal(size=(count - 2, 2))
    mass = np.full(count, 0.1 * MASS)
    mass[[0, -1]] = np.inf
    a = Assembly.of_spheres(x, np.full(count, 0.02 * SPACING), mass, wire=wire, rank=rank)
    simulation = Simulation(a, Laws(wire=law), Solver(tolerance=1e-9, sweep_limit=200_000))
    shift, force = np.zeros(steps), np.zeros(steps)
    for k in range(steps):
        a.velocity[1:-1] *= 0.5
        a.velocity[-1, 0] = speed
        simulation.advance(STEP, Drive())
        shift[k] = (a.x[-1, 0] - x[-1, 0]) / ((count - 1) * SPACING)
        force[k] = a.link_impulse[-1] / STEP
    return shift, force


def buckling(counts: list[int], amplitude: float, seeds: int, strain: float = 0.01, steps: int = 300) -> dict[str, Any]:
    """End forces of chains of elastic rods pulled and pushed by `strain`, inner beads off the axis by `amplitude` l₀.

    `ratio` (count, seed): push over pull at the end; `peak`: the largest push on the way over the pull. Curves are those of the first seed.
    """
    law = ElasticRod(stiffness=1e3)
    ratio, peak = np.zeros((len(counts), seeds)), np.zeros((len(counts), seeds))
    out: dict[str, Any] = {"counts": np.array(counts), "stiffness": law.stiffness}
    for k, count in enumerate(counts):
        speed = (count - 1) * SPACING * strain / (steps * STEP)
        for seed in range(seeds):
            pull, tension = _pulled(count, speed, law, amplitude, seed, steps)
            push, compression = _pulled(count, -speed, law, amplitude, seed, steps)
            ratio[k, seed], peak[k, seed] = -compression[-1] / tension[-1], -compression.min() / tension[-1]
            if seed == 0:
                out[f"curve_{count}"] = np.array([np.append(push[::-1], pull), np.append(compression[::-1], tension)])
    return out | {"ratio": ratio, "peak": peak}


def weighing(chains: int, beads: int) -> dict[str, Any]:
    """Σ of bead masses against what moves and what hangs, by law, and the shares of the beads in a sample.

    `momentum`: of a free bent chain after a step of gravity over g h; `hanging`: force in the first link of a string at rest over g; both
    relative to the sum. `sample`: largest deviation of a bead of a sample from an equal share.
    """
    out: dict[str, Any] = {}
    for number, name in enumerate(LAWS):
        down = Drive(gravity=np.array([0.0, 0.0, -GRAVITY]))
        worst = {"momentum": 0.0, "hanging": 0.0}
        for seed in range(chains):
            rng = np.random.default_rng([36, number, seed])
            a = _bent(rng, beads)
            Simulation(a, Laws(wire=law_named(name, 200.0)), TIGHT).advance(STEP, down)
            found = a.mass @ a.velocity / (-GRAVITY * STEP)
            worst["momentum"] = max(
                worst["momentum"], float(np.max(np.abs(found - [0.0, 0.0, a.mass.sum()])) / a.mass.sum())
            )
            x, wire, rank = chain(np.zeros(3), np.array([0.0, 0.0, -1.0]), beads, SPACING)
            mass = MASS * rng.uniform(0.5, 2.0, beads)
            mass[0] = np.inf
            a = Assembly.of_spheres(x, np.full(beads, 0.02 * SPACING), mass, wire=wire, rank=rank)
            simulation = Simulation(a, Laws(wire=law_named(name, 500.0)), TIGHT)
            for _ in range(40):  # velocities taken away: statics, in steps that elastic links find long
                a.velocity[:] = 0.0
                simulation.advance(0.1 if name.startswith("elastic") else STEP, down)
            carried = a.link_impulse[0] / (a.step * GRAVITY)
            worst["hanging"] = max(worst["hanging"], abs(float(carried / mass[1:].sum() - 1.0)))
        out[name] = worst
    wires, per_wire = 4, 12
    radius = np.random.default_rng(36).uniform(0.75e-3, 1.39e-3, 60)
    sample = densify(
        np.random.default_rng(36),
        radius,
        wire_count=wires,
        beads=per_wire,
        spacing=1e-3,
        bead_radius=0.4e-3,
        solid_fraction=0.4,
    )
    mass = sample.mass[sample.is_bead].reshape(wires, per_wire)
    out["sample"] = float(np.max(np.abs(per_wire * mass / mass.sum(axis=1, keepdims=True) - 1.0)))
    out["linear_density"] = float(mass.sum() / (wires * (per_wire - 1) * 1e-3))  # kg/m
    return out
