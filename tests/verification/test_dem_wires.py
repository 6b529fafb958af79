"""Chains of beads at rest and in motion: a hanging string, the catenary, implicit Euler, the rigid limit, folding without energy."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Laws, Simulation, Solver, chain
from fenchel.dem.laws import ElasticRod, ElasticWire, RigidRod, RigidWire, WireLaw

G = 9.81
DOWN = Drive(gravity=np.array([0.0, 0.0, -G]))
LAWS = {
    "rigid_rod": RigidRod(),
    "elastic_rod": ElasticRod(stiffness=500.0),
    "rigid_wire": RigidWire(),
    "elastic_wire": ElasticWire(stiffness=500.0),
}


def string(count: int, mass: float = 0.01, spacing: float = 0.05) -> Assembly:
    """A vertical string hung at its first bead."""
    x, wire, rank = chain(np.zeros(3), np.array([0.0, 0.0, -1.0]), count, spacing)
    masses = np.full(count, mass)
    masses[0] = np.inf
    return Assembly.of_spheres(x, np.full(count, 0.2 * spacing), masses, wire=wire, rank=rank)


def to_rest(a: Assembly, law: WireLaw, step: float, steps: int, tolerance: float = 1e-15) -> Simulation:
    """Steps with the velocities taken away: what is left is statics."""
    simulation = Simulation(a, Laws(wire=law), Solver(tolerance=tolerance, sweep_limit=100_000, keep_unconverged=True))
    for _ in range(steps):
        a.velocity[:] = 0.0
        simulation.advance(step, DOWN)
    return simulation


@pytest.mark.parametrize("name", LAWS)
def test_static_string_of_ten_beads(name: str) -> None:
    """Tension and elongation of every link against statics: T_k = (weights below), ΔL = T l₀/k; rigid laws keep their length.

    Bounds are those that the field's code reaches: 3e-8 for the elastic laws, 1e-10 for the rigid ones (relative to the length).
    """
    count, mass, spacing = 10, 0.01, 0.05
    a = string(count, mass, spacing)
    # implicit Euler with the velocities taken away goes to rest by a factor of hundreds a step
    step = 0.1 if "elastic" in name else 1e-3
    to_rest(a, LAWS[name], step, 60)
    hung = mass * G * np.arange(count - 1, 0, -1)
    np.testing.assert_allclose(a.link_impulse / a.step, hung, rtol=1e-9)
    length = np.linalg.norm(np.diff(a.x, axis=0), axis=1)
    if "elastic" in name:
        expected = spacing * (1.0 + hung / 500.0)
        assert np.max(np.abs(length - expected)) < 3e-8 * spacing
    else:
        assert np.max(np.abs(length - spacing)) < 1e-10 * spacing


@pytest.mark.parametrize("law", [RigidRod(), RigidWire()])
def test_a_hanging_chain_has_the_shape_and_the_tension_of_a_chain_of_links(law: WireLaw) -> None:
    """Statics of n links between two fixed ends at one height: the horizontal tension is the same in all, the vertical one jumps by m g.

    Independent solution: tan of link k's slope is ((n−1)/2 − k) m g / H with H from the span (bisection).
    """
    count, mass, spacing, span = 21, 0.01, 0.05, 0.8
    links = count - 1
    steep = mass * G * ((links - 1) / 2.0 - np.arange(links))

    def width(horizontal: float) -> float:
        return float(np.sum(spacing / np.sqrt(1.0 + (steep / horizontal) ** 2)))

    low, high = 1e-6, 1e3
    for _ in range(200):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if width(middle) < span else (low, middle)
    slope = steep / low
    dx = spacing / np.sqrt(1.0 + slope**2)
    shape = np.zeros((count, 3))
    shape[1:, 0], shape[1:, 2] = np.cumsum(dx), -np.cumsum(slope * dx)
    tension = np.hypot(low, steep)
    # started from a flat triangle, let go under damping by resets
    x = np.zeros((count, 3))
    x[:, 0] = np.linspace(0.0, span, count)
    half = np.minimum(np.arange(count), links - np.arange(count))
    x[:, 2] = -half * np.sqrt(spacing**2 - (span / links) ** 2)
    masses = np.full(count, mass)
    masses[[0, -1]] = np.inf
    a = Assembly.of_spheres(
        x, np.full(count, 0.01), masses, wire=np.zeros(count, dtype=np.int64), rank=np.arange(count)
    )
    simulation = Simulation(a, Laws(wire=law), Solver(tolerance=1e-13, sweep_limit=100_000))
    for _ in range(1500):
        a.velocity *= 0.9
        simulation.advance(5e-3, DOWN)
    np.testing.assert_allclose(a.x, shape, rtol=0, atol=1e-6 * span)
    np.testing.assert_allclose(a.link_impulse / 5e-3, tension, rtol=1e-5)


def test_elastic_rods_are_implicit_euler() -> None:
    """A chain of three rods along its axis for 50 steps against (M + h² K) v⁺ = M v⁻ − h K x in dense algebra, to 1e-11."""
    mass, spacing, strength, h = np.array([0.2, 0.1, 0.3, 0.15]), 0.1, 40.0, 0.01
    x0 = np.stack([spacing * np.arange(4) * 1.03, np.zeros(4), np.zeros(4)], axis=1)
    a = Assembly.of_spheres(x0, np.full(4, 0.01), mass, wire=np.zeros(4, dtype=np.int64), rank=np.arange(4))
    a.link_length[:] = spacing
    a.velocity[:, 0] = [0.3, -0.2, 0.1, 0.0]
    simulation = Simulation(a, Laws(wire=ElasticRod(stiffness=strength)), Solver(tolerance=1e-15, sweep_limit=100_000))
    difference = np.diff(np.eye(4), axis=0)
    stiffness = strength / spacing * difference.T @ difference
    x, v = x0[:, 0].copy(), a.velocity[:, 0].copy()
    for k in range(50):
        measures = simulation.advance(h, Drive())
        force = -stiffness @ x + strength * difference.T @ np.ones(3)
        # the rods do not turn: every loss has its name, once the first step has found the energy of the start
        assert k == 0 or abs(measures["balance"]) < 1e-15
        v = v + np.linalg.solve(np.diag(mass) + h**2 * stiffness, h * force - h**2 * stiffness @ v)
        x = x + h * v
    np.testing.assert_allclose(a.velocity[:, 0], v, rtol=0, atol=1e-11)
    np.testing.assert_allclose(a.x[:, 0], x, rtol=0, atol=1e-11)
    # an elastic rod has no moment and no tangential row: three numbers and a tension
    assert simulation.kernels.pairs is None and measures["friction"] == 0.0


@pytest.mark.parametrize(("elastic", "rigid"), [(ElasticRod, RigidRod()), (ElasticWire, RigidWire())])
def test_the_rigid_string_is_the_limit_at_rate_one_over_k(elastic: type, rigid: WireLaw) -> None:
    """After 20 steps of a swinging string of four beads the distance to the rigid one falls tenfold with k."""

    def swing(law: WireLaw) -> np.ndarray:
        a = string(4)
        a.velocity[1:, 0] = 0.3
        simulation = Simulation(
            a, Laws(wire=law), Solver(tolerance=1e-15, sweep_limit=1_000_000, keep_unconverged=True)
        )
        for _ in range(20):
            simulation.advance(1e-3, DOWN)
        return a.x.copy()

    limit = swing(rigid)
    far = [np.linalg.norm(swing(elastic(stiffness=k)) - limit) for k in (1e6, 1e7, 1e8)]
    assert far[0] / far[1] == pytest.approx(10.0, rel=0.05)
    assert far[1] / far[2] == pytest.approx(10.0, rel=0.05)


def test_a_chain_folds_freely_and_a_bent_rod_chain_does_not_carry_compression() -> None:
    """Two halves of a chain closed like a ruler cost nothing; pushed together, a chain with a bend carries under 1 % of what it pulls."""
    count, spacing = 9, 0.05
    angle = np.linspace(0.0, 2.5, count - 1)
    steps = spacing * np.stack([np.cos(angle), np.sin(angle), np.zeros(count - 1)], axis=1)
    x = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    a = Assembly.of_spheres(
        x, np.full(count, 0.01), np.full(count, 0.02), wire=np.zeros(count, dtype=np.int64), rank=np.arange(count)
    )
    # velocities of a fold: perpendicular to every link, link by link
    across = np.stack([-np.sin(angle), np.cos(angle), np.zeros(count - 1)], axis=1) * 1e-3
    a.velocity[1:] = np.cumsum(across * np.arange(1, count)[:, None], axis=0)
    before = a.velocity.copy()
    simulation = Simulation(a, Laws(wire=RigidRod(corrected=False)), Solver(tolerance=1e-9))
    simulation.advance(1e-6, Drive())
    np.testing.assert_allclose(a.velocity, before, rtol=0, atol=1e-15)

    def end_force(speed: float) -> float:
        x = np.zeros((3 * 7, 3))[:7]
        x[:, 0] = spacing * np.arange(7)
        x[1:-1:2, 1] = 1e-2 * spacing
        masses = np.full(7, 1e-3)
        masses[[0, -1]] = np.inf
        a = Assembly.of_spheres(x, np.full(7, 1e-3), masses, wire=np.zeros(7, dtype=np.int64), rank=np.arange(7))
        simulation = Simulation(a, Laws(wire=ElasticRod(stiffness=1e3)), Solver(tolerance=1e-12, sweep_limit=100_000))
        total = 0.0
        for _ in range(400):
            a.velocity[1:-1] *= 0.5
            a.velocity[-1, 0] = speed
            simulation.advance(1e-3, Drive())
            total = a.link_impulse[-1] / 1e-3
        return float(total)

    assert abs(end_force(-0.01)) < 0.01 * end_force(0.01)


def test_wire_mass_is_that_of_its_beads() -> None:
    """Momentum that a pull gives to a free string: the sum of its beads, links weigh nothing."""
    a = string(5)
    a.mass[0] = 0.04
    simulation = Simulation(a, Laws(wire=RigidRod()), Solver(tolerance=1e-14))
    simulation.advance(1e-3, DOWN)
    assert a.mass @ a.velocity[:, 2] == pytest.approx(-0.08 * G * 1e-3, rel=1e-13)
