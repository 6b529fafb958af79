"""A solved step with planes, locked bodies and in two dimensions, measured again in dense algebra with explicit moments."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.laws import CompliantSignoriniCoulomb, SignoriniCoulomb
from fenchel.dem.rows import Contacts


def heap(dimension: int, locked: str) -> tuple[Assembly, list[Plane]]:
    """Bodies that settle in a corner of a tilted floor, one wall pushed by a force, one servo."""
    rng = np.random.default_rng(5)
    count = 24
    side = (4, 6) if dimension == 2 else (3, 3, 3)
    grid = np.stack(np.unravel_index(np.arange(count), side[::-1]), axis=1)[:, ::-1].astype(float)
    radius = rng.uniform(0.008, 0.01, count)
    x = 0.0205 * grid + 0.0105 + 2e-4 * rng.normal(size=grid.shape)
    lock = {"none": np.zeros(count, dtype=bool), "some": np.arange(count) % 3 == 0, "all": np.ones(count, dtype=bool)}[
        locked
    ]
    a = Assembly.of_spheres(x, radius, 50.0 * radius**2, locked=lock)
    unit = np.eye(dimension)
    wide = side[0] * 0.0205
    planes = [
        Plane(normal=tuple(unit[-1] + 0.05 * unit[0]), point=(0.0,) * dimension, friction=0.6),
        Plane(normal=tuple(unit[0]), point=(0.0,) * dimension, friction=0.2),
        Plane(normal=tuple(-unit[0]), point=tuple(wide * unit[0]), force=0.05, mass=0.02),
    ]
    if dimension == 3:
        planes.append(Plane(normal=(0, 1, 0), point=(0, 0, 0), friction=0.1))
        planes.append(Plane(normal=(0, -1, 0), point=(0, wide, 0), force=0.03, mobility=1.0))
    return a, planes


def levers(dimension: int, normal: np.ndarray) -> np.ndarray:
    """d u/d(r ω) of a body whose contact point lies at −r n (d, rotations): columns e_k × (−n)."""
    if dimension == 3:
        return -np.array([np.cross(axis, normal) for axis in np.eye(3)]).T
    return np.array([[normal[1]], [-normal[0]]])


def natural_map(
    simulation: Simulation, rows: Contacts, before: dict[str, np.ndarray], step: float, gravity: np.ndarray
) -> tuple[float, float]:
    """Residual and error of the rebuilt velocities, contact by contact, all in the global vector of velocities."""
    a, d = simulation.assembly, simulation.assembly.dimension
    n, s = len(a.x), 3 if d == 3 else 1
    planes = simulation.planes
    factor = 2.5 if d == 3 else 2.0
    v = np.concatenate([(before["velocity"] + step * gravity).ravel(), before["spin"].ravel(), np.zeros(len(planes))])
    inverse = np.concatenate(
        [np.repeat(1.0 / a.mass, d), np.repeat(np.where(a.locked, 0.0, factor / a.mass), s), np.zeros(len(planes))]
    )
    for k, plane in enumerate(planes):
        place = n * (d + s) + k
        if plane.mass is not None and plane.force is not None:
            v[place], inverse[place] = before["plane"][k] + step * plane.force / plane.mass, 1.0 / plane.mass
        elif plane.mobility is not None and plane.force is not None:
            v[place], inverse[place] = plane.mobility * plane.force, plane.mobility / step
    blocks = []
    held = []  # tangential impulses of the step before
    for kernel, row in ((simulation.kernels.pairs, rows.row), (simulation.kernels.walls, rows.touching_row)):
        assert kernel is not None
        held.append(row[:, kernel.columns.starts.get("e", 0) :][:, :d])
    law = simulation.laws.contact
    stiff = isinstance(law, CompliantSignoriniCoulomb)
    cn, ct = (1.0 / (law.k_n * step**2), 1.0 / (law.k_t * step**2)) if stiff else (0.0, 0.0)
    for k, (i, j) in enumerate(rows.pair):
        h = np.zeros((d, len(v)))
        normal = (before["x"][i] - before["x"][j]) / np.linalg.norm(before["x"][i] - before["x"][j])
        gap = np.linalg.norm(before["x"][i] - before["x"][j]) - a.radius[i] - a.radius[j]
        h[:, d * i : d * i + d], h[:, d * j : d * j + d] = np.eye(d), -np.eye(d)
        for b in (i, j):
            h[:, n * d + s * b : n * d + s * b + s] += levers(d, normal)
        blocks.append((h, rows.impulse[k], normal, 0.5, gap, held[0][k]))
    for k, (i, b) in enumerate(rows.touching):
        h = np.zeros((d, len(v)))
        normal = planes[b].direction
        gap = normal @ before["x"][i] - before["place"][b] - a.radius[i]
        h[:, d * i : d * i + d] = np.eye(d)
        h[:, n * d + s * i : n * d + s * i + s] = levers(d, normal)
        h[:, n * (d + s) + b] = -normal
        blocks.append((h, rows.wall_impulse[k], normal, planes[b].friction, gap, held[1][k]))
    for h, p, *_ in blocks:
        v = v + inverse * (h.T @ p)
    error = size = 0.0
    for h, p, normal, mu, gap, row in blocks:
        delassus = (h * inverse) @ h.T
        rho = 1.0 / (normal @ delassus @ normal + cn)
        u = h @ v
        un, pn = u @ normal, p @ normal
        un = un + (gap if gap > 0.0 or stiff else 0.0) / step + cn * pn
        ut = u - (u @ normal) * normal
        if stiff:
            start = row[:d]
            ut = ut + ct * (p - pn * normal - start)
        slip = np.linalg.norm(ut) if mu else 0.0
        z_n, z_t = pn - rho * (un + mu * slip), (p - pn * normal - rho * ut) if mu else 0.0 * p
        t = np.linalg.norm(z_t)
        if z_n >= 0.0 and t <= mu * z_n:
            projected = z_n * normal + z_t
        elif mu * t <= -z_n:
            projected = 0.0 * p
        else:
            new = (z_n + mu * t) / (1.0 + mu**2)
            projected = new * normal + (mu * new / t * z_t if t > 0.0 else 0.0)
        error += np.sum((p - projected) ** 2)
        size += p @ p
    moved = np.max(np.abs(v[: n * d].reshape(n, d) - a.velocity))
    if a.spin.shape[1]:
        moved = max(moved, np.max(np.abs(v[n * d : n * (d + s)].reshape(n, s) - a.spin)))
    moved = max(moved, np.max(np.abs(v[n * (d + s) :] - a.plane_velocity)))
    return float(np.sqrt(error / size)), float(moved)


@pytest.mark.parametrize(
    ("dimension", "locked", "stiff"), [(3, "none", False), (3, "some", True), (2, "none", True), (2, "all", False)]
)
def test_the_reported_residual_is_that_of_dense_algebra(dimension: int, locked: str, stiff: bool) -> None:
    a, planes = heap(dimension, locked)
    law = CompliantSignoriniCoulomb(friction=0.5, k_n=2e3, k_t=1.5e3) if stiff else SignoriniCoulomb(friction=0.5)
    gravity = np.zeros(dimension)
    gravity[-1] = -9.81
    step = 1e-3
    simulation = Simulation(a, Laws(contact=law), Solver(tolerance=1e-6, sweep_limit=200_000), planes=planes)
    for _ in range(150):
        simulation.advance(step, Drive(gravity=gravity))
    for tolerance in (1e-2, 1e-12):
        simulation.solver = Solver(tolerance=tolerance, sweep_limit=500_000)
        turning = a.spin if a.spin.shape[1] else np.zeros((len(a.x), 3 if dimension == 3 else 1))
        before = {"x": a.x, "velocity": a.velocity, "spin": turning, "place": a.plane_place, "plane": a.plane_velocity}
        before = {name: array.copy() for name, array in before.items()}
        measures = simulation.advance(step, Drive(gravity=gravity))
        rows = simulation.contacts
        assert rows is not None
        assert {tuple(t) for t in rows.touching.tolist()} and measures["closed"] >= 10
        # the pushed plane and the servo take part in it
        carried = np.bincount(
            rows.touching[:, 1], weights=np.linalg.norm(rows.wall_impulse, axis=1), minlength=len(planes)
        )
        assert np.all(carried[[2] if dimension == 2 else [2, 4]] > 0.0)
        truth, moved = natural_map(simulation, rows, before, step, gravity)
        assert moved < 1e-13
        assert measures["natural_map"] == pytest.approx(truth, rel=1e-6, abs=1e-13)
    assert measures["natural_map"] < 1e-9
    assert not stiff or np.any(a.spin != 0.0) or locked == "all"
