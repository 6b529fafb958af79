r"""Claim 36: motions of a few bodies that are known in closed form.

Flight (exact in the leap-frog form: z_n = z_0 − g h² n (n+1)/2), bounce with restitution e, the angle at which a block begins to slide
(tan θ = μ, found by bisection) and how it slides (g (sin θ − μ cos θ)), a stack under a heavy sphere (each contact carries what lies above
it), a pendulum (T = m g cos φ + m v²/l), and a chain hung at two ends (equal horizontal tension H in all links, vertical ones that differ
by a bead's weight; H from the span by bisection), the discrete catenary.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Assembly, Drive, Laws, Plane, Simulation, Solver, chain
from ..dem.laws import NewtonRestitution, RigidRod, RigidWire, SignoriniCoulomb

__all__ = ["G", "catenary", "flight_and_bounce", "pendulum", "sliding", "stack"]

Array = NDArray[np.float64]

G, RADIUS, MASS = 9.81, 0.01, 0.1  # m/s², m, kg
DOWN = Drive(gravity=np.array([0.0, 0.0, -G]))
TIGHT = Solver(tolerance=1e-14, sweep_limit=1_000_000)
CALM = Solver(tolerance=1e-12, sweep_limit=1_000_000)  # where a heavy body rests on light ones


def _floor(friction: float = 0.0) -> Plane:
    return Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=friction)


def _ball(height: float, *, locked: bool = False) -> Assembly:
    return Assembly.of_spheres(
        np.array([[0.0, 0.0, height]]), np.array([RADIUS]), np.array([MASS]), locked=np.array([locked])
    )


def flight_and_bounce(restitutions: list[float], step: float = 5e-4) -> dict[str, Any]:
    """Relative errors of velocity and place after a flight of 600 steps; −v⁺/v⁻ at a bounce, and the next rise over the fall (e²)."""
    a = _ball(10.0)
    simulation = Simulation(a, Laws(), Solver())
    n = 600
    for _ in range(n):
        simulation.advance(step, DOWN)
    fallen = 0.5 * G * step**2 * n * (n + 1)
    out: dict[str, Any] = {
        "speed": abs(float(a.velocity[0, 2]) / (-G * n * step) - 1.0),
        "place": abs(float(10.0 - a.x[0, 2]) / fallen - 1.0),
    }
    found, rise, path = np.zeros(len(restitutions)), np.zeros(len(restitutions)), []
    drop = 0.1
    for k, e in enumerate(restitutions):
        a = _ball(RADIUS + drop)
        simulation = Simulation(a, Laws(contact=NewtonRestitution(restitution=e)), TIGHT, planes=[_floor()])
        heights, before, after, top = [], 0.0, np.nan, 0.0
        for _ in range(int(0.5 / step)):
            before = float(a.velocity[0, 2])
            measures = simulation.advance(step, DOWN)
            heights.append(float(a.x[0, 2]) - RADIUS)
            if measures["closed"] and np.isnan(after):
                after = float(a.velocity[0, 2])
                found[k] = -after / before
            elif not np.isnan(after):
                top = max(top, heights[-1])
        rise[k] = top / drop
        path.append(heights[::4])
    return out | {
        "restitutions": np.array(restitutions),
        "found": found,
        "rise": rise,
        "path": np.array(path),
        "interval": 4 * step,
    }


def _slides(mu: float, angle: float, steps: int) -> float:
    """Speed [m/s] of a block on a slope after `steps` ms."""
    a = _ball(RADIUS, locked=True)
    law = SignoriniCoulomb(friction=mu)
    simulation = Simulation(a, Laws(contact=law), TIGHT, planes=[_floor(mu)])
    drive = Drive(gravity=G * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    for _ in range(steps):
        simulation.advance(1e-3, drive)
    return float(a.velocity[0, 0])


def sliding(coefficients: list[float]) -> dict[str, Any]:
    """Angle [rad] at which a block begins to slide, by bisection; relative error of its acceleration 5 degrees beyond."""
    angle, acceleration, creep = np.zeros(len(coefficients)), np.zeros(len(coefficients)), 0.0
    for k, mu in enumerate(coefficients):
        low, high = 0.0, 0.5 * np.pi
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if _slides(mu, middle, 2) > 1e-14 else (middle, high)
        angle[k] = 0.5 * (low + high)
        beyond = np.arctan(mu) + np.radians(5.0)
        expected = G * (np.sin(beyond) - mu * np.cos(beyond)) * 0.2
        acceleration[k] = _slides(mu, beyond, 200) / expected - 1.0
        creep = max(creep, abs(_slides(mu, np.arctan(mu) - 1e-6, 500)))
    return {"coefficients": np.array(coefficients), "angle": angle, "acceleration": acceleration, "creep": creep}


def stack(count: int, ratios: list[float]) -> dict[str, Any]:
    """Largest relative error of the forces in a stack whose top sphere is `ratio` times as heavy; how far it moves, in radii."""
    error, moved = 0.0, 0.0
    for ratio in ratios:
        mass = np.full(count, MASS)
        mass[-1] *= ratio
        x = np.zeros((count, 3))
        x[:, 2] = RADIUS * (2.0 * np.arange(count) + 1.0)
        a = Assembly.of_spheres(x, np.full(count, RADIUS), mass)
        simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), CALM, planes=[_floor(0.5)])
        for _ in range(20):
            simulation.advance(1e-3, DOWN)
        contacts = simulation.contacts
        assert contacts is not None
        force = np.append(contacts.wall_impulse[:, 2], np.sum(contacts.impulse * contacts.normal, axis=1)) / 1e-3
        above = G * np.cumsum(mass[::-1])[::-1]
        error = max(error, float(np.max(np.abs(force / above - 1.0))))
        moved = max(moved, float(np.max(np.abs(a.x - x))) / RADIUS)
    return {"error": error, "moved": moved}


def pendulum(steps: list[int], start: float = 1.0, time: float = 1.0) -> dict[str, Any]:
    """Largest error of the tension of a bead on a rigid rod let go at an angle [rad], over m g, for numbers of steps in `time` [s]."""
    length, worst = 0.5, np.zeros(len(steps))
    path: Any = np.zeros((0, 0))
    for k, n in enumerate(steps):
        x = length * np.array([[0.0, 0.0, 0.0], [np.sin(start), 0.0, -np.cos(start)]])
        a = Assembly.of_spheres(
            x, np.full(2, RADIUS), np.array([np.inf, MASS]), wire=np.zeros(2, dtype=np.int64), rank=np.arange(2)
        )
        simulation = Simulation(a, Laws(wire=RigidRod()), Solver(tolerance=1e-11, sweep_limit=10_000))
        angle, tension = np.zeros(n), np.zeros(n)
        for m in range(n):
            angle[m] = np.arctan2(a.x[1, 0], -a.x[1, 2])
            simulation.advance(time / n, DOWN)
            tension[m] = a.link_impulse[0] / (time / n)
        exact = 3.0 * np.cos(angle) - 2.0 * np.cos(start)  # energy: m v²/l = 2 m g (cos φ − cos φ₀)
        # in the first steps the impulse makes up for the rest at which the bead starts in the mid configuration
        worst[k] = float(np.max(np.abs(tension / (MASS * G) - exact)[2:]))
        path = np.array([angle, tension / (MASS * G)])
    return {"steps": np.array(steps), "error": worst, "path": path, "start": start}


def _hung(count: int, spacing: float, span: float, mass: float) -> tuple[Array, Array]:
    """Places (count, 3) and tensions of the statics of a chain of links between two points at one height."""
    links = count - 1
    steep = mass * G * ((links - 1) / 2.0 - np.arange(links))
    low, high = 1e-6, 1e3
    for _ in range(200):
        middle = np.sqrt(low * high)
        wide = np.sum(spacing / np.sqrt(1.0 + (steep / middle) ** 2))
        low, high = (middle, high) if wide < span else (low, middle)
    slope = steep / low
    dx = spacing / np.sqrt(1.0 + slope**2)
    x = np.zeros((count, 3))
    x[1:, 0], x[1:, 2] = np.cumsum(dx), -np.cumsum(slope * dx)
    return x, np.hypot(low, steep)


def catenary(count: int = 21, span: float = 0.8, steps: int = 1500) -> dict[str, Any]:
    """A chain let go as a flat triangle under damping: largest error of places over the span, and of tensions, for rod and wire."""
    spacing, mass = 1.0 / (count - 1), 0.01
    exact, expected = _hung(count, spacing, span, mass)
    out: dict[str, Any] = {"exact": exact, "expected": expected}
    links = count - 1
    for name, law in (("rod", RigidRod()), ("wire", RigidWire())):
        x, wire, rank = chain(np.zeros(3), np.array([1.0, 0.0, 0.0]), count, span / links)
        x[:, 2] = -np.minimum(np.arange(count), links - np.arange(count)) * np.sqrt(spacing**2 - (span / links) ** 2)
        weights = np.full(count, mass)
        weights[[0, -1]] = np.inf
        a = Assembly.of_spheres(x, np.full(count, 0.2 * spacing), weights, wire=wire, rank=rank)
        simulation = Simulation(a, Laws(wire=law), Solver(tolerance=1e-12, sweep_limit=100_000))
        for _ in range(steps):
            a.velocity *= 0.9
            simulation.advance(5e-3, DOWN)
        tension = a.link_impulse / 5e-3
        out[name] = {
            "x": a.x, "tension": tension, "place_error": float(np.max(np.abs(a.x - exact))) / span,
            "tension_error": float(np.max(np.abs(tension / expected - 1.0))),
        }  # fmt: skip
    return out
