"""Scenes where numbers get hard: mass ratio, friction, step, stiffness, radii, none and many bodies, overlaps, long wires.

Every cell measures what a closed form, a balance or a theorem says of its scene. The cells that may be refused were listed before any was
run: Gauss–Seidel takes of the order of n² sweeps for a rigid row of n bodies, and the sweep limit says so with the residual.
"""

from __future__ import annotations

import numpy as np
from extreme_rows import Cell, Measured, Row, near, nothing_but, rows_of

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver, chain
from fenchel.dem.detection import find_pairs
from fenchel.dem.laws import (
    CompliantSignoriniCoulomb,
    ElasticRod,
    ElasticWire,
    NewtonRestitution,
    RigidWire,
    SignoriniCoulomb,
)

SUITE = "scenes"
G = 9.81
DOWN = Drive(gravity=np.array([0.0, 0.0, -G]))
FLOOR = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
TIGHT = Solver(tolerance=1e-13, sweep_limit=1_000_000)
REFUSABLE = {"rows and wires, 1e4 rigid grains", "rows and wires, 1e4 rigid beads, hung"}
LIMIT = "raise solve.sweep_limit"


def pressed(ratio: float) -> Measured:
    """A sphere of 10 g with one `ratio` times as heavy on top: what the contacts carry."""
    mass = np.array([0.01, 0.01 * ratio])
    x = np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.03]])
    a = Assembly.of_spheres(x, np.full(2, 0.01), mass)
    # the error of an unfinished iteration is 1/(1 − ρ) times its last change, ρ = ratio/(1 + ratio)
    solver = Solver(tolerance=max(1e-16, 1e-9 / (1.0 + ratio)), sweep_limit=100_000_000)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), solver, planes=[FLOOR])
    for _ in range(3):
        simulation.advance(1e-3, DOWN)
    rows = simulation.contacts
    assert rows is not None
    return {
        "force between them [N]": near(rows.impulse[0, 2] / 1e-3, -mass[1] * G, rel=1e-7),
        "force on the floor [N]": near(rows.wall_impulse[0, 2] / 1e-3, mass.sum() * G, rel=1e-7),
        "speed [m/s]": (float(np.max(np.abs(a.velocity))), 1e-7 * G * 1e-3 * (1.0 + ratio)),
    }


def inclined(mu: float) -> Measured:
    """A locked sphere on a slope of 40°: rest or g (sin θ − μ cos θ)."""
    angle = np.deg2rad(40.0)
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 0.01]]), np.array([0.01]), np.array([0.1]), locked=np.array([True]))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=mu)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT, planes=[floor])
    for _ in range(50):
        simulation.advance(1e-3, Drive(gravity=G * np.array([np.sin(angle), 0.0, -np.cos(angle)])))
    expected = max(0.0, G * (np.sin(angle) - mu * np.cos(angle)) * 0.05)
    return {"speed [m/s]": near(a.velocity[0, 0], expected, rel=1e-11, abs=1e-15)}


def wedged(mu: float) -> Measured:
    """Three spheres in a heap on a floor with the same friction: natural map, cone, no sinking; at rest for good from tan 15° on (statics
    of the heap), else it spreads."""
    r = 0.01
    x = np.array([[-r, 0.0, r], [r, 0.0, r], [0.0, 0.0, r * (1.0 + np.sqrt(3.0))]])
    a = Assembly.of_spheres(x, np.full(3, r), np.full(3, 0.01))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=mu)
    simulation = Simulation(
        a, Laws(contact=SignoriniCoulomb(friction=mu)), Solver(tolerance=1e-11, sweep_limit=1_000_000), planes=[floor]
    )
    residual = sunk = 0.0
    for _ in range(50):
        measures = simulation.advance(1e-3, DOWN)
        residual, sunk = max(residual, measures["natural_map"]), max(sunk, measures["violation_max"])
    speed = float(np.max(np.abs(a.velocity)))
    at_rest = mu > np.tan(np.deg2rad(15.0))
    return {
        "natural map [-]": (residual, 1e-8),
        "violation [m]": (sunk, 1e-6 * r),
        "speed [m/s]" if at_rest else "least speed over speed [-]": (speed, 1e-9) if at_rest else (1e-9 / speed, 1.0),
    }


def landing(step: float) -> Measured:
    """Two spheres fall up to 2 mm onto the floor and onto each other: no energy gained, none sinks, then rest."""
    height = 2e-3 * min(1.0, step / 1e-4)
    x = np.array([[0.0, 0.0, 0.01 + height], [0.0, 0.0, 0.03 + 2.0 * height]])
    a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([0.1, 0.2]))
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT, planes=[FLOOR])
    energy = limit = G * float(a.mass @ a.x[:, 2])
    gained = sunk = 0.0
    measures = {}
    for _ in range(max(50, int(1.2 * np.sqrt(4.0 * height / G) / step))):
        measures = simulation.advance(step, DOWN)
        now = measures["kinetic"] + G * float(a.mass @ a.x[:, 2])
        gained, energy = max(gained, now - energy), now
        sunk = max(sunk, measures["violation_max"])
    return {
        "energy gained in a step [J]": (gained, 1e-12 * limit),
        "violation [m]": (sunk, 1e-12),
        "height at rest [m]": near(a.x[:, 2], [0.01, 0.03], abs=1e-10),
        "kinetic energy at rest [J]": (measures["kinetic"], 1e-20),
    }


def stiff(ratio: float) -> Measured:
    """k = ratio × k_c, k_c = l₀ m/(2 h²): the elastic rod is implicit Euler at any stiffness."""
    m, l0, h = 0.3, 0.5, 0.01
    k = ratio * l0 * m / (2.0 * h**2)
    x = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0]])
    wire, rank = np.zeros(2, dtype=np.int64), np.arange(2)
    a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([np.inf, m]), wire=wire, rank=rank)
    a.link_length[:] = l0
    simulation = Simulation(a, Laws(wire=ElasticRod(stiffness=k)), Solver(tolerance=1e-15, keep_unconverged=True))
    place, v = 0.6, 0.0
    for _ in range(20):
        simulation.advance(h, Drive())
        v = (v - h * k / l0 / m * (place - l0)) / (1.0 + h**2 * k / l0 / m)
        place += h * v
    return {
        "place [m]": near(a.x[1, 0], place, rel=1e-12),
        "speed [m/s]": near(a.velocity[1, 0], v, rel=1e-9, abs=1e-13),
    }


def large_on_small() -> Measured:
    """Radii 100 to 1: a large sphere on three small ones, each with a third of its weight along the common normals; detection complete."""
    small, large = 1e-3, 1e-1
    spread = 2e-3
    corners = spread * np.array([[np.cos(t), np.sin(t)] for t in 2.0 * np.pi * np.arange(3) / 3])
    height = small + np.sqrt((small + large) ** 2 - spread**2)
    x = np.concatenate([np.column_stack([corners, np.full(3, small)]), [[0.0, 0.0, height]]])
    mass = 2600.0 * 4.0 / 3.0 * np.pi * np.array([small, small, small, large]) ** 3
    a = Assembly.of_spheres(x, np.array([small, small, small, large]), mass)
    a.mass[:3] = np.inf
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.0)), TIGHT, skin=1e-4)
    for _ in range(5):
        simulation.advance(1e-4, DOWN)
    rows = simulation.contacts
    assert rows is not None
    force = np.sum(rows.impulse * rows.normal, axis=1) / 1e-4
    rng = np.random.default_rng(1)
    x = rng.uniform(-0.3, 0.3, (400, 3))
    radius = np.where(np.arange(400) % 40 == 0, large, small)
    found = find_pairs(x, radius, np.full(400, -1), np.zeros(400, dtype=np.int64), 1, 1e-3)
    i, j = np.triu_indices(400, 1)
    close = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j] < 1e-3
    return {
        "contacts": nothing_but(len(rows.pair) == 3),
        "force [N]": near(force, mass[3] * G / 3.0 / ((height - small) / (small + large)), rel=1e-9),
        "pairs found": nothing_but(np.array_equal(found, np.stack([i, j], axis=1)[close])),
    }


def nobody() -> Measured:
    """No grain: a step is a step, nothing moves, nothing is divided by."""
    a = Assembly.of_spheres(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT, planes=[FLOOR], threads=2)
    measures = simulation.advance(1e-3, DOWN)
    return {"measures": near(list(measures.values()), 0.0), "time [s]": near(a.time, 1e-3)}


def alone() -> Measured:
    """One grain: free fall, exact."""
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 1e3]]), np.array([1e-3]), np.array([1e-6]))
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT)
    measures = {}
    for _ in range(100):
        measures = simulation.advance(1e-2, DOWN)
    return {"speed [m/s]": near(a.velocity[0, 2], -G, rel=1e-13), "contacts": near(measures["closed"], 0.0)}


def fast() -> Measured:
    """A grain at 100 m/s, a metre a step, does not pass through a floor or through another grain of a centimetre."""
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 3.3]]), np.array([0.01]), np.array([0.1]))
    a.velocity[0, 2] = -100.0
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT, planes=[FLOOR])
    for _ in range(8):
        simulation.advance(1e-2, DOWN)
    on_floor = near(a.x[0, 2], 0.01, abs=1e-12)
    x = np.array([[0.0, 0.0, 3.3], [0.0, 0.0, 0.0]])
    a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([0.1, np.inf]))
    a.velocity[0, 2] = -100.0
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT)
    for _ in range(8):
        simulation.advance(1e-2, Drive())
    return {"height on the floor [m]": on_floor, "height on a grain [m]": near(a.x[0, 2], 0.02, abs=1e-12)}


def column(law: SignoriniCoulomb | CompliantSignoriniCoulomb) -> Measured:
    """1e4 grains one upon the other, started in their equilibrium: every contact carries what lies above it."""
    n, r, mass, h = 10_000, 0.01, 1e-4, 1e-5
    force = mass * G * np.arange(n, 0, -1)
    give = np.cumsum(force) / law.k_n if isinstance(law, CompliantSignoriniCoulomb) else np.zeros(n)
    x = np.zeros((n, 3))
    x[:, 2] = r * (2.0 * np.arange(n) + 1.0) - give
    a = Assembly.of_spheres(x, np.full(n, r), np.full(n, mass))
    limit = 200_000 if isinstance(law, CompliantSignoriniCoulomb) else 2_000
    simulation = Simulation(a, Laws(contact=law), Solver(tolerance=1e-12, sweep_limit=limit), planes=[FLOOR])
    simulation.advance(h, DOWN)
    rows = simulation.contacts
    assert rows is not None
    # a gap is known to a rounding of the height, and the stiffness makes a force of it
    blur = 4.0 * np.finfo(float).eps * x[-1, 2] * (law.k_n if isinstance(law, CompliantSignoriniCoulomb) else 0.0)
    return {
        "force [N]": near(np.sum(rows.impulse * rows.normal, axis=1) / h, force[1:], rel=1e-7, abs=blur),
        "speed [m/s]": (float(np.max(np.abs(a.velocity))), 1e-8 * G * h * n),
    }


def overlapping(law: SignoriniCoulomb | CompliantSignoriniCoulomb | NewtonRestitution, depth: float) -> Measured:
    """Two spheres that start inside one another: rigid ones stay without a kick, compliant ones part as implicit Euler has it."""
    r, m, h = 0.01, 0.1, 1e-4
    x = np.array([[0.0, 0.0, 2.0 * r - depth], [0.0, 0.0, 0.0]])
    a = Assembly.of_spheres(x, np.full(2, r), np.full(2, m))
    simulation = Simulation(a, Laws(contact=law), TIGHT)
    simulation.advance(h, Drive())
    if isinstance(law, CompliantSignoriniCoulomb):
        # (1 + 2 h² k/m) u = 2 h k depth/m for the relative velocity
        w = 2.0 / m
        expected = h * law.k_n * w * depth / (1.0 + h**2 * law.k_n * w)
    else:
        expected = 0.0
    return {
        "speed [m/s]": near(a.velocity[0, 2] - a.velocity[1, 2], expected, rel=1e-10, abs=1e-15),
        "places are finite": nothing_but(bool(np.all(np.isfinite(a.x)))),
        "momentum [kg m/s]": (float(np.abs(a.mass @ a.velocity[:, 2])), 1e-16 * (1.0 + expected)),
    }


def hung(law: RigidWire | ElasticWire, beads: int) -> Measured:
    """A hung wire in its equilibrium: every link pulls with the weight of what hangs below it."""
    mass, spacing, h = 1e-4, 0.01, 1e-5
    force = mass * G * np.arange(beads - 1, 0, -1)
    give = force / law.stiffness if isinstance(law, ElasticWire) else np.zeros(beads - 1)
    x, wire, rank = chain(np.zeros(3), np.array([0.0, 0.0, -1.0]), beads, spacing)
    x[1:, 2] -= spacing * np.cumsum(give)
    masses = np.full(beads, mass)
    masses[0] = np.inf
    a = Assembly.of_spheres(x, np.full(beads, 0.004), masses, wire=wire, rank=rank)
    a.link_length[:] = spacing
    limit = 2_000 if beads > 100 and isinstance(law, RigidWire) else 200_000
    simulation = Simulation(a, Laws(wire=law), Solver(tolerance=1e-12, sweep_limit=limit))
    simulation.advance(h, DOWN)
    blur = (
        4.0 * np.finfo(float).eps * abs(x[-1, 2]) * (law.stiffness / spacing if isinstance(law, ElasticWire) else 0.0)
    )
    return {"tension [N]": near(a.link_impulse / h, force, rel=1e-7, abs=blur)}


def falling(beads: int) -> Measured:
    """A loose wire that falls as a whole: no tension, momentum to round-off."""
    x, wire, rank = chain(np.zeros(3), np.array([1.0, 0.0, 0.0]), beads, 0.01)
    a = Assembly.of_spheres(x, np.full(beads, 0.004), np.full(beads, 1e-4), wire=wire, rank=rank)
    simulation = Simulation(a, Laws(wire=RigidWire()), TIGHT)
    for _ in range(10):
        simulation.advance(1e-3, DOWN)
    truth = np.tile([0.0, 0.0, -G * 1e-2], (beads, 1))
    return {
        "impulse [N s]": (float(np.max(np.abs(a.link_impulse))), 1e-15),
        "velocity [m/s]": near(a.velocity, truth, rel=1e-12, abs=1e-15),
    }


SOFT = CompliantSignoriniCoulomb(friction=0.5, k_n=5e5, k_t=4e5)  # of the order of m/(2 h²) in `column`
HARD = SignoriniCoulomb(friction=0.5)
ROWS, INSIDE = "rows and wires", "overlap at the start"
CELLS: list[Cell] = [
    *(Cell("mass ratio", f"{r:g}", lambda r=r: pressed(r)) for r in (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6)),
    *(
        Cell("friction on a slope", f"{mu:g}", lambda mu=mu: inclined(mu))
        for mu in (0.0, 1e-3, 0.1, 0.5, 1.0, 3.0, 10.0)
    ),
    *(Cell("friction in a heap", f"{mu:g}", lambda mu=mu: wedged(mu)) for mu in (0.0, 0.1, 0.5, 1.0, 3.0, 10.0)),
    *(Cell("time step [s]", f"{h:g}", lambda h=h: landing(h)) for h in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)),
    *(Cell("stiffness over m l₀/2h²", f"{k:g}", lambda k=k: stiff(k)) for k in (1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)),
    Cell("bodies", "none", nobody),
    Cell("bodies", "one", alone),
    Cell("bodies", "radii 100 to 1", large_on_small),
    Cell("bodies", "a metre a step", fast),
    Cell(INSIDE, "half, rigid", lambda: overlapping(HARD, 5e-3)),
    Cell(INSIDE, "half, compliant", lambda: overlapping(SOFT, 5e-3)),
    Cell(INSIDE, "same centre, rigid", lambda: overlapping(HARD, 2e-2)),
    Cell(INSIDE, "same centre, compliant", lambda: overlapping(SOFT, 2e-2)),
    Cell(ROWS, "1e4 compliant grains", lambda: column(SOFT)),
    Cell(ROWS, "1e4 rigid grains", lambda: column(HARD), says=LIMIT),
    Cell(ROWS, "2 rigid beads, hung", lambda: hung(RigidWire(), 2)),
    Cell(ROWS, "2 elastic beads, hung", lambda: hung(ElasticWire(stiffness=10.0), 2)),
    Cell(ROWS, "1e4 elastic beads, hung", lambda: hung(ElasticWire(stiffness=5e3), 10_000)),
    Cell(ROWS, "1e4 rigid beads, hung", lambda: hung(RigidWire(), 10_000), says=LIMIT),
    Cell(ROWS, "1e4 rigid beads, falling", lambda: falling(10_000)),
]


def rows(*, long: bool = False) -> list[Row]:
    """The map of the scenes."""
    return rows_of(SUITE, CELLS, long=long)
