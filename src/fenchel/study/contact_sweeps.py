r"""Claim 31: how many Gauss–Seidel sweeps a step takes, against the number of bodies and against the stiffness of wires.

Every step starts without impulses and ends at a given relative change of the impulses. Columns of spheres and taut chains carry load
from one end to the other: a sweep moves it by one body and errors diffuse, so n bodies in a row take of the order of n² sweeps. An
elastic chain forgets beyond √(k/k_c) links, k_c = l₀ m/(2 h²), and takes of the order of k/k_c sweeps until this reaches n². Compliant
grains forget likewise, whatever the size of the sample.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..dem import Assembly, Drive, Laws, Material, Plane, Simulation, Solver, chain
from ..dem.laws import ElasticWire, RigidWire, SignoriniCoulomb, WireLaw
from ..dem.one_step import OneStepProblem
from ..dem.one_step.blocks import scaled_blocks
from ..dem.one_step.scenes import problem_of
from ..dem.one_step.sweeps import sweep
from .contact_scenes import STIFF, cold, packing
from .contact_truth import natural_map

__all__ = ["convergence", "over_bodies", "over_stiffness"]

STEP, MASS, SPACING = 1e-3, 0.01, 0.05  # s, kg, m of columns and chains
CRITICAL = SPACING * MASS / (2.0 * STEP**2)  # k_c [N]
DOWN = Drive(gravity=np.array([0.0, 0.0, -9.81]))
EXACT, LOOSE = 1e-8, 1e-4  # relative change at which sweeps stop: columns and chains, packings
SOFT, RIGID = Material(friction=0.4, wire_stiffness=10.0, **STIFF), Material(friction=0.4, wire_stiffness=10.0)


def column(count: int) -> Simulation:
    """Spheres standing on each other on a floor."""
    r = 0.2 * SPACING
    x = np.zeros((count, 3))
    x[:, 2] = r * (2.0 * np.arange(count) + 1.0)
    a = Assembly.of_spheres(x, np.full(count, r), np.full(count, MASS))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    return Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), _solver(EXACT), planes=[floor])


def string(count: int, law: WireLaw) -> Simulation:
    """A chain hanging from its first bead."""
    x, wire, rank = chain(np.zeros(3), np.array([0.0, 0.0, -1.0]), count, SPACING)
    mass = np.full(count, MASS)
    mass[0] = np.inf
    a = Assembly.of_spheres(x, np.full(count, 0.2 * SPACING), mass, wire=wire, rank=rank)
    return Simulation(a, Laws(wire=law), _solver(EXACT))


def _solver(tolerance: float) -> Solver:
    return Solver(tolerance=tolerance, sweep_limit=200_000, keep_unconverged=True)


def _made(simulation: Simulation, step: float, drive: Drive) -> tuple[int, bool]:
    """Sweeps of a step, and whether it reached its tolerance."""
    simulation.advance(step, drive)
    return simulation.sweeps, simulation.change <= simulation.solver.tolerance


def over_bodies(rows: list[int], grains: list[int], seeds: int) -> dict[str, Any]:
    """Sweeps of columns and rigid chains of `rows` bodies and of packings of `grains` (each seed twice: compliant, rigid)."""
    out: dict[str, Any] = {"rows": np.array(rows), "grains": np.array(grains)}
    ended = []
    for name, make in (("columns", column), ("chains", lambda n: string(n, RigidWire()))):
        found = [_made(make(n), STEP, DOWN) for n in rows]
        out[name] = np.array([s for s, _ in found])
        ended += [e for _, e in found]
    compliant, rigid = np.zeros((len(grains), seeds)), np.zeros((len(grains), seeds))
    for k, count in enumerate(grains):
        for seed in range(seeds):
            simulation, step, drive = packing(seed, count, SOFT, wires=max(1, count // 15), tolerance=1e-3)
            for law, place in ((SOFT, compliant), (RIGID, rigid)):
                place[k, seed], end = _made(cold(simulation.assembly, law, LOOSE, 200_000), step, drive)
                ended.append(end)
    return out | {"compliant": compliant, "rigid": rigid, "steps": len(ended), "ended": int(np.sum(ended))}


def over_stiffness(ratios: list[float], count: int, grains: int, seeds: int) -> dict[str, Any]:
    """Sweeps against k/k_c: of a hanging chain of `count` beads, and of compliant packings with wires of ten beads."""
    found = [_made(string(count, ElasticWire(stiffness=ratio * CRITICAL)), STEP, DOWN) for ratio in ratios]
    limit, end = _made(string(count, RigidWire()), STEP, DOWN)
    ended = [e for _, e in found] + [end]
    packed = np.zeros((len(ratios), seeds))
    for seed in range(seeds):
        simulation, step, drive = packing(seed, grains, SOFT, wires=grains // 15, beads=10, tolerance=1e-3)
        a = simulation.assembly
        critical = float(a.link_length.mean() * a.mass[a.is_bead].mean() / (2.0 * step**2))
        for k, ratio in enumerate(ratios):
            law = Material(friction=0.4, wire_stiffness=ratio * critical, **STIFF)
            packed[k, seed], end = _made(cold(a, law, LOOSE, 200_000), step, drive)
            ended.append(end)
    return {
        "ratios": np.array(ratios), "chain": np.array([s for s, _ in found]), "limit": limit, "packings": packed, "beads": count,
        "grains": grains, "steps": len(ended), "ended": int(np.sum(ended)),
    }  # fmt: skip


def convergence(grains: int, sweeps: int, seed: int = 0) -> dict[str, Any]:
    """‖F‖/‖r‖ of the natural map after each sweep from r = 0, by problem."""
    simulation, step, drive = packing(seed, grains, SOFT, wires=max(1, grains // 15), tolerance=1e-3)
    smooth = Material(friction=0.0, bead_friction=0.0, links=False)
    problems = {
        "packing, compliant": problem_of(simulation, step, drive),
        "packing, rigid": problem_of(cold(simulation.assembly, RIGID, LOOSE), step, drive),
        "packing, rigid, no friction": problem_of(cold(simulation.assembly, smooth, LOOSE), step, drive),
        "column of 20 spheres": problem_of(column(20), STEP, DOWN),
        "chain of 20 beads, rigid": problem_of(string(20, RigidWire()), STEP, DOWN),
        "chain of 20 beads, k = 10 k_c": problem_of(string(20, ElasticWire(stiffness=10.0 * CRITICAL)), STEP, DOWN),
    }
    return {name: _curve(problem, sweeps) for name, problem in problems.items()}


def _curve(problem: OneStepProblem, sweeps: int) -> Any:
    b = scaled_blocks(problem)
    rho = 1.0 / problem.delassus.diagonal()[0::3]
    x = np.zeros_like(b.q)
    errors = np.zeros(sweeps)
    for k in range(sweeps):
        sweep(b.pointer, b.column, b.value, b.place, b.q, b.mu, x, False)
        r = b.reactions(x)
        errors[k] = np.linalg.norm(natural_map(problem.velocity(r), r, problem.mu, rho)) / np.linalg.norm(r)
    return errors
