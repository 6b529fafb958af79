r"""Claim 32: the force of a link against its strain for the four wire laws, and the rigid laws as limits of the elastic ones.

Closed graphs, with the prestrain π (T the tension, ε = d/l₀ − 1 at the end of the step):

    elastic rod   T = k (ε − π)          elastic wire  T = k ⟨ε − π⟩
    rigid rod     ε = π                  rigid wire    0 ≤ T ⊥ π − ε ≥ 0

A link is driven by the velocities of its two beads; the strain that it would have without force is drawn at random. In straight chains
the tensions of all links follow together from (W + C) r = u + β, of rods by elimination, of wires by Lemke's pivots. With c = l₀/(k h²)
the distance from the rigid solution is of the order of c/W, so 1/k.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Assembly, Drive, Laws, Simulation, Solver, chain
from ..dem.laws import ElasticRod, ElasticWire, RigidRod, RigidWire, WireLaw
from .contact_truth import lemke

__all__ = ["LAWS", "four_graphs", "graph_error", "law_named", "rigid_limit"]

Array = NDArray[np.float64]

LAWS = ("rigid rod", "elastic rod", "rigid wire", "elastic wire")
STEP, SPACING = 1e-3, 0.05  # s, m
SPREAD = 0.01  # of the strains
BEADS = 8


def law_named(name: str, stiffness: float, prestrain: float = 0.0) -> WireLaw:
    """One of the four."""
    if name == "rigid rod":
        return RigidRod(prestrain=prestrain)
    if name == "rigid wire":
        return RigidWire(prestrain=prestrain)
    law = ElasticRod if name == "elastic rod" else ElasticWire
    return law(stiffness=stiffness, prestrain=prestrain)


def graph_error(name: str, strain: Array, tension: Array, stiffness: float) -> Array:
    """Distance of points (ε − π, T) from the graph of a law, both axes scaled by `SPREAD` and by k `SPREAD`."""
    e, t = strain / SPREAD, tension / (stiffness * SPREAD)
    if name == "elastic rod":
        return np.abs(t - e)
    if name == "elastic wire":
        return np.abs(t - np.maximum(e, 0.0))
    return np.abs(e) if name == "rigid rod" else np.abs(np.minimum(t, -e))


def _straight(rng: np.random.Generator, count: int, step: float) -> Assembly:
    """A chain along a random direction, moving along itself so that its links would be strained by about `SPREAD`."""
    direction = rng.normal(size=3)
    x, wire, rank = chain(rng.normal(size=3), direction, count, SPACING)
    mass = 0.01 * rng.uniform(0.5, 2.0, count)
    a = Assembly.of_spheres(x, np.full(count, 0.01 * SPACING), mass, wire=wire, rank=rank)
    along = np.concatenate([[0.0], np.cumsum(rng.uniform(-2.0, 2.0, count - 1))]) * SPREAD * SPACING / step
    a.velocity[:] = along[:, None] * direction / np.linalg.norm(direction)
    return a


def _strained(a: Assembly, law: WireLaw, step: float) -> tuple[Array, Array]:
    """Strains at the end of one step, and tensions [N]."""
    solver = Solver(tolerance=1e-14, sweep_limit=1_000_000, keep_unconverged=True)
    Simulation(a, Laws(wire=law), solver).advance(step, Drive())
    length = np.linalg.norm(a.x[a.links[:, 0]] - a.x[a.links[:, 1]], axis=1)
    return length / SPACING - 1.0, a.link_impulse / step


def _by_algebra(a: Assembly, name: str, stiffness: float, prestrain: float, step: float) -> Array:
    """Tensions [N] of a straight chain before the step, without the sweeps."""
    unit = (a.x[1] - a.x[0]) / np.linalg.norm(a.x[1] - a.x[0])
    difference = np.diff(np.eye(len(a.x)), axis=0)
    w = (difference / a.mass) @ difference.T
    stretch = difference @ (a.velocity @ unit) + (difference @ (a.x @ unit) - (1.0 + prestrain) * SPACING) / step
    if name.startswith("elastic"):
        w = w + np.eye(len(w)) * SPACING / (stiffness * step**2)
    return (np.linalg.solve(w, stretch) if name.endswith("rod") else lemke(w, -stretch)) / step


def four_graphs(pairs: int, chains: int) -> dict[str, Any]:
    """By law: strains and tensions of `pairs` single links (prestrain 0), largest distances from the graph (`pair`, `chain`), of tensions
    of chains from algebra, and the least tension, over random masses, directions, stiffnesses and prestrains.
    """
    out: dict[str, Any] = {}
    for number, name in enumerate(LAWS):
        rng = np.random.default_rng([32, number])
        strain, tension = np.zeros(pairs), np.zeros(pairs)
        found = dict.fromkeys(("pair", "chain", "algebra"), 0.0)
        least = np.inf
        for k in range(pairs):
            (strain[k],), (tension[k],) = _strained(_straight(rng, 2, STEP), law_named(name, 100.0), STEP)
        found["pair"] = float(np.max(graph_error(name, strain, tension, 100.0)))
        for _ in range(chains):
            stiffness, prestrain = 100.0 * 10.0 ** rng.uniform(-1.0, 1.0), rng.uniform(-SPREAD, SPREAD)
            a = _straight(rng, BEADS, STEP)
            expected = _by_algebra(a, name, stiffness, prestrain, STEP)
            e, t = _strained(a, law_named(name, stiffness, prestrain), STEP)
            size = float(np.max(np.abs(expected))) or 1.0
            found["algebra"] = max(found["algebra"], float(np.max(np.abs(t - expected))) / size)
            found["chain"] = max(found["chain"], float(np.max(graph_error(name, e - prestrain, t, stiffness))))
            least = min(least, float(t.min()))
        out[name] = found | {"strain": strain, "tension": tension, "least_tension": min(least, float(tension.min()))}
    return out


def rigid_limit(chains: int, ratios: list[float]) -> dict[str, Any]:
    """‖T_k − T_rigid‖/‖T_rigid‖ (k/k_c, chain) for rods and wires, one step of random straight chains; k_c = l₀ m/(2 h²), m = 10 g."""
    critical = SPACING * 0.01 / (2.0 * STEP**2)
    out: dict[str, Any] = {"ratios": np.array(ratios)}
    for kind in ("rod", "wire"):
        apart = np.zeros((len(ratios), chains))
        for seed in range(chains):
            start = _straight(np.random.default_rng([33, seed]), BEADS, STEP)
            _, limit = _strained(start.copy(), law_named(f"rigid {kind}", 1.0), STEP)
            for k, ratio in enumerate(ratios):
                _, tension = _strained(start.copy(), law_named(f"elastic {kind}", ratio * critical), STEP)
                apart[k, seed] = np.linalg.norm(tension - limit) / np.linalg.norm(limit)
        out[kind] = apart
    return out
