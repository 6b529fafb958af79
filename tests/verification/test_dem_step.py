"""The one-step problem against independent truths: convex program, implicit Euler, dense algebra, conservation."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Material, Simulation, Solver
from fenchel.dem.certificate import contact_program
from fenchel.dem.detection import find_pairs
from fenchel.dem.kernels import SceneKernels
from fenchel.dem.laws import CompliantSignoriniCoulomb
from fenchel.dem.packing import densify
from fenchel.dem.stepping import Contacts
from fenchel.errors import ConvergenceError, InputError

PRESSURE = 5e4


def sample(seed: int = 0, count: int = 40) -> Assembly:
    radius = np.random.default_rng(seed + 100).uniform(0.75e-3, 1.39e-3, count)
    return densify(
        np.random.default_rng(seed),
        radius,
        wire_count=3,
        beads=5,
        spacing=1e-3,
        bead_radius=0.4e-3,
        solid_fraction=0.45,
    )


def step_of(assembly: Assembly) -> float:
    return 0.05 * 2.0 * assembly.grain_radius * np.sqrt(2600.0 / PRESSURE)


def impulses(rows: Contacts) -> np.ndarray:
    return np.concatenate(
        [np.sum(rows.contact[:, :3] * rows.contact[:, 3:6], axis=1), rows.wall_row[:, 0], rows.link_row[:, 3]]
    )


@pytest.mark.parametrize("stiffness", [4e4, np.inf])
@pytest.mark.parametrize("law", ["rigid_rod", "elastic_rod", "rigid_wire", "elastic_wire"])
def test_frictionless_step_equals_the_convex_program(law: str, stiffness: float) -> None:
    a = sample()
    material = Material(
        friction=0.0, bead_friction=0.0, normal_stiffness=stiffness, tangential_stiffness=stiffness, wire_law=law
    )
    simulation = Simulation(a, material, Solver(tolerance=1e-4, sweep_limit=100_000))
    drive = Drive(pressure=np.full(3, PRESSURE))
    h = step_of(a)
    for _ in range(300):
        simulation.advance(h, drive)
    program = contact_program(simulation, h, drive)
    w = program.delassus
    assert np.allclose(w, w.T, rtol=0, atol=1e-12 * w.max())
    assert np.linalg.eigvalsh(w).min() > -1e-10 * w.max()
    simulation.solver = Solver(tolerance=1e-13, sweep_limit=200_000)
    simulation.advance(h, drive)
    assert simulation.contacts is not None
    x, y = program.solve(), impulses(simulation.contacts)
    assert (y > 0.0).sum() > 40  # the sample is loaded, wires included
    assert np.any(y[-12:] > 0.0)
    assert program.residual(x) < 1e-10
    assert program.residual(y) < 1e-8
    velocity = program.inverse_mass * (program.h.T @ x)
    assert np.linalg.norm(velocity - program.inverse_mass * (program.h.T @ y)) < 1e-8 * np.linalg.norm(velocity)
    if np.isfinite(stiffness):  # impulses are unique with compliance
        assert np.linalg.norm(x - y) < 1e-8 * np.linalg.norm(x)


def test_a_step_with_friction_is_refused_as_a_convex_program() -> None:
    with pytest.raises(InputError, match="no convex program"):
        contact_program(Simulation(sample(), Material(), Solver()), 1e-5, Drive())


def natural_map(before: np.ndarray, free: np.ndarray, box_free: np.ndarray, rows: Contacts) -> float:
    """The measure of `dem.residual` again, in dense algebra with explicit rotations, contact by contact."""
    bodies = len(free)
    v = np.concatenate([free[:, :6].ravel(), box_free[:, 0]])
    inverse = np.concatenate([np.repeat(free[:, 6], 6) * np.tile([1, 1, 1, 2.5, 2.5, 2.5], bodies), box_free[:, 1]])
    blocks = []
    for (i, j), row in zip(rows.pair, rows.contact, strict=True):
        h = np.zeros((3, len(v)))
        n = row[:3]
        cross = np.cross(np.eye(3), n)  # (ω̃ × n)_a = Σ_b ω̃_b (e_b × n)_a
        for body, sign in ((i, 1.0), (j, -1.0)):
            h[:, 6 * body : 6 * body + 3] = sign * np.eye(3)
            h[:, 6 * body + 3 : 6 * body + 6] = -cross.T
        p = row[3:6]

        def law(u: np.ndarray, p: np.ndarray = p, n: np.ndarray = n, row: np.ndarray = row) -> np.ndarray:
            return u + (row[9] + rows.cn * (p @ n)) * n + rows.ct * (p - (p @ n) * n - row[6:9])

        blocks.append((h, p, n, row[12], row[10], law))
    for (i, axis, side), row in zip(rows.wall, rows.wall_row, strict=True):
        h = np.zeros((1, len(v)))
        h[0, 6 * i + axis], h[0, 6 * bodies + axis] = -side, 1.0
        blocks.append((h, row[:1], np.ones(1), 0.0, row[2], lambda u, row=row: u + row[1] + rows.cn * row[0]))
    for (i, j), row in zip(rows.link, rows.link_row, strict=True):
        h = np.zeros((1, len(v)))
        h[0, 6 * i : 6 * i + 3], h[0, 6 * j : 6 * j + 3] = -row[:3], row[:3]
        blocks.append((h, row[3:4], np.ones(1), 0.0, row[5], lambda u, row=row: u - row[4] + row[6] * row[3]))
    for h, p, *_ in blocks:
        v = v + inverse * (h.T @ p)
    error = size = 0.0
    for h, p, n, mu, rho, law in blocks:
        u = law(h @ v)
        slip = np.linalg.norm(u - (u @ n) * n) if mu else 0.0
        u = u if mu else (u @ n) * n
        z = p - rho * (u + mu * slip * n)
        zn = z @ n
        zt = z - zn * n
        t = np.linalg.norm(zt)
        if zn >= 0.0 and t <= mu * zn:
            projected = z
        elif mu * t <= -zn:
            projected = 0.0 * z
        else:
            new = (zn + mu * t) / (1.0 + mu**2) if mu else zn
            projected = new * n + (mu * new / t * zt if t > 0.0 else 0.0)
        error += np.sum((p - projected) ** 2)
        size += p @ p
    return float(np.sqrt(error / size))


@pytest.mark.parametrize("stiffness", [4e4, np.inf])
def test_frictional_step_reaches_the_natural_map_and_reports_it_truly(stiffness: float) -> None:
    a = sample(2)
    material = Material(
        friction=0.4, bead_friction=0.4, normal_stiffness=stiffness, tangential_stiffness=0.8 * stiffness
    )
    simulation = Simulation(a, material, Solver(tolerance=1e-4, sweep_limit=100_000))
    drive = Drive(pressure=np.full(3, PRESSURE))
    h = step_of(a)
    for _ in range(200):
        simulation.advance(h, drive)
    for tolerance in (1e-2, 1e-9):
        simulation.solver = Solver(tolerance=tolerance, sweep_limit=200_000)
        probe = Simulation(a.copy(), material, simulation.solver)
        before, free, _, box_free, _, _ = probe.assemble(h, drive)
        measures = simulation.advance(h, drive)
        assert simulation.contacts is not None
        truth = natural_map(before, free, box_free, simulation.contacts)
        assert measures["natural_map"] == pytest.approx(truth, rel=1e-6, abs=1e-13)
    assert measures["natural_map"] < 1e-6
    rows = simulation.contacts
    normal = np.sum(rows.contact[:, :3] * rows.contact[:, 3:6], axis=1)
    tangential = np.linalg.norm(rows.contact[:, 3:6] - normal[:, None] * rows.contact[:, :3], axis=1)
    assert np.all(normal >= 0.0)
    assert np.all(tangential <= 0.4 * normal * (1.0 + 1e-12) + 1e-18)
    assert np.any(tangential > 0.0)


def two_beads(d: float, l0: float, u: float) -> Assembly:
    """A bead of 0.3 kg tied to one so heavy that it stands still."""
    a = Assembly.of_spheres(
        np.array([[0.0, 0.0, 0.0], [d, 0.0, 0.0]]), np.full(2, 0.01), np.array([1e30, 0.3]), np.full(3, 10.0),
        wire=np.zeros(2, dtype=np.int64), rank=np.arange(2),
    )  # fmt: skip
    a.link_length[:] = l0
    a.velocity[1, 0] = u
    return a


def tension(a: Assembly, law: str, k: float, h: float = 0.01) -> float:
    Simulation(a, Material(wire_law=law, wire_stiffness=k), Solver(tolerance=1e-14)).advance(h, Drive())
    return float(a.link_impulse[0])


def test_elastic_rod_is_implicit_euler() -> None:
    # m = 0.3 kg, d = 0.6 m, l0 = 0.5 m, u = 0.2 m/s, k = 40 N, h = 0.01 s
    assert tension(two_beads(0.6, 0.5, 0.2), "elastic_rod", 40.0) == pytest.approx(0.0794805195, abs=5e-11)
    # T(d_{i+1}) h = impulse: force of the spring at the end of the step
    a = two_beads(0.6, 0.5, 0.2)
    p = tension(a, "elastic_rod", 40.0)
    assert p == pytest.approx(0.01 * 40.0 * (a.x[1, 0] - 0.5) / 0.5, rel=1e-12)


@pytest.mark.parametrize("strain", [-0.2, -0.01, 0.01, 0.2])
def test_wire_laws_pull_and_rods_push_too(strain: float) -> None:
    d = 0.5 * (1.0 + strain)
    for law in ("elastic_wire", "rigid_wire"):
        p = tension(two_beads(d, 0.5, 0.0), law, 40.0)
        assert (p > 0.0) if strain > 0.0 else (p == 0.0)
    for law in ("elastic_rod", "rigid_rod"):
        p = tension(two_beads(d, 0.5, 0.0), law, 40.0)
        assert np.sign(p) == np.sign(strain)


def test_prestrain_shifts_the_natural_length() -> None:
    """T = k (d − (1+π) l₀)/l₀: a negative π pre-tensions, a positive one leaves the link slack."""
    k, h = 40.0, 0.01
    for prestrain in (-0.1, 0.1):
        a = two_beads(0.5, 0.5, 0.0)
        law = Material(wire_law="elastic_wire", wire_stiffness=k, prestrain=prestrain)
        Simulation(a, law, Solver(tolerance=1e-14)).advance(h, Drive())
        expected = max(0.0, h * k * (a.x[1, 0] - (1.0 + prestrain) * 0.5) / 0.5)
        assert a.link_impulse[0] == pytest.approx(expected, rel=1e-12)
        assert (a.link_impulse[0] > 0.0) == (prestrain < 0.0)


def test_rigid_is_the_limit_of_elastic_at_rate_one_over_k() -> None:
    limit = tension(two_beads(0.6, 0.5, 0.2), "rigid_wire", 1.0)
    errors = [abs(tension(two_beads(0.6, 0.5, 0.2), "elastic_wire", k) - limit) for k in (1e6, 1e7, 1e8)]
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.01)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.01)


def test_free_fall_and_a_rigid_inelastic_shock() -> None:
    radius, h = 0.01, 1e-3
    a = Assembly.of_spheres(
        np.array([[0.0, 0.0, 0.05], [0.003, 0.0, 0.0]]), np.full(2, radius), np.array([1.0, 2.0]), np.full(3, 1.0)
    )
    a.velocity[0] = [0.3, 0.0, -1.0]
    momentum = a.mass @ a.velocity
    # positions are mid-step: at mid configuration x, angular momentum is Σ m x × v + I ω
    inertia = 0.4 * a.mass * radius  # I ω = 2/5 m r (r ω)

    def angular() -> np.ndarray:
        return (a.mass[:, None] * np.cross(a.x, a.velocity)).sum(axis=0) + (inertia[:, None] * a.spin).sum(axis=0)

    start = angular()
    simulation = Simulation(a, Material(friction=0.3, bead_friction=0.3), Solver(tolerance=1e-14, sweep_limit=10_000))
    touched = False
    energy = np.inf
    for _ in range(60):
        measures = simulation.advance(h, Drive())
        assert simulation.contacts is not None
        touched |= bool(np.any(simulation.contacts.contact[:, 3:6] != 0.0))
        np.testing.assert_allclose(a.mass @ a.velocity, momentum, rtol=0, atol=1e-13)
        assert measures["kinetic"] <= energy * (1.0 + 1e-12)
        energy = measures["kinetic"]
    assert touched
    # impulses act at the middle of the gap: angular momentum is exact when gap is closed, within h at the shock
    np.testing.assert_allclose(angular(), start, atol=2e-3 * np.abs(start).max())
    n = a.x[0] - a.x[1]
    n /= np.linalg.norm(n)
    assert (a.velocity[0] - a.velocity[1]) @ n > -1e-12  # no longer approaching

    fall = Assembly.of_spheres(np.zeros((1, 3)), np.full(1, radius), np.ones(1), np.full(3, 10.0))
    simulation = Simulation(fall, Material(), Solver())
    drive = Drive(gravity=np.array([0.0, 0.0, -9.81]))
    for _ in range(100):
        simulation.advance(h, drive)
    assert fall.velocity[0, 2] == pytest.approx(-9.81 * 0.1, rel=1e-12)
    # leap-frog: x holds the position half a step ahead of v, starting from rest at half a step
    assert fall.x[0, 2] == pytest.approx(-0.5 * 9.81 * h**2 * 100 * 101, rel=1e-12)


def test_a_pair_that_turns_as_a_whole_carries_its_forces_along() -> None:
    """Ten small turns about the axis normal to pressure and friction: both keep their size, friction turns with the tangent plane."""
    radius, stiffness, h = 1e-3, 4e4, 1e-5
    x = np.array([[0.0, 0.0, -0.99 * radius], [0.0, 0.0, 0.99 * radius]])
    impulse = np.array([[2e-6, 0.0, 0.0, 5e-6]])
    pairs = np.array([[0, 1]], dtype=np.int32)
    law = CompliantSignoriniCoulomb(friction=1.0, k_n=stiffness, k_t=stiffness)
    kernels = SceneKernels(dimension=3, spin="all", contact=law)
    assert kernels.pairs is not None
    code, starts = kernels.pairs.module, kernels.pairs.columns.starts
    velocity = np.zeros((2, kernels.body_columns.total))
    velocity[:, kernels.body_columns.starts["w"]] = 1e5
    c, s = np.cos(0.05), np.sin(0.05)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    compliance = 1.0 / (stiffness * h**2)
    force = np.array([2e-6, 0.0, 0.0])
    pair, row = np.zeros((1, 2), dtype=np.int32), np.zeros((1, kernels.pairs.columns.total))
    cold, candidate = np.zeros((1, 2)), np.zeros(1, dtype=np.int32)
    for _ in range(10):
        x, force = x @ turn.T, turn @ force
        count = code.collect(
            x, np.full(2, radius), velocity, np.zeros(2, dtype=bool), pairs, impulse, np.array(law.parameters()), radius, h,
            pair, row, cold, candidate, compliance, compliance, 1.0,
        )  # fmt: skip
        assert count == 1
        code.keep(row, candidate, impulse)
    assert cold[0, 1] == pytest.approx(5e-6, rel=1e-12) and impulse[0, 3] == pytest.approx(5e-6, rel=1e-12)
    e = starts["e"]
    np.testing.assert_allclose(row[0, e : e + 3], force, rtol=0, atol=1e-18)
    np.testing.assert_allclose(impulse[0, :3], force, rtol=0, atol=1e-18)


def test_detection_equals_brute_force() -> None:
    rng = np.random.default_rng(3)
    for scale in (1.0, 30.0):
        x = rng.uniform(-1.0, 1.0, (200, 3)) * np.array([scale, 1.0, 1.0])
        radius = rng.uniform(0.02, 0.2, 200)
        wire, rank = rng.integers(-1, 4, 200), rng.integers(0, 50, 200)
        found = find_pairs(x, radius, wire, rank, 3, 0.05)
        i, j = np.triu_indices(200, 1)
        gap = np.linalg.norm(x[i] - x[j], axis=1) - radius[i] - radius[j]
        tied = (wire[i] >= 0) & (wire[i] == wire[j]) & (np.abs(rank[i] - rank[j]) < 3)
        expected = np.stack([i, j], axis=1)[(gap < 0.05) & ~tied]
        np.testing.assert_array_equal(found, expected)


def test_a_box_that_turns_inside_out_raises() -> None:
    a = Assembly.of_spheres(np.zeros((1, 3)), np.full(1, 1e-3), np.full(1, 1e-5), np.full(3, 1e-1))
    simulation = Simulation(a, Material(), Solver())
    with pytest.raises(ConvergenceError, match="box collapsed"):
        for _ in range(100):
            simulation.advance(1e-2, Drive(pressure=np.full(3, PRESSURE)))
    assert np.all(a.half > 0.0)


def test_an_unconverged_step_raises_unless_it_is_wanted() -> None:
    a = sample(1)
    drive = Drive(pressure=np.full(3, PRESSURE))
    strict = Simulation(a.copy(), Material(), Solver(tolerance=1e-10, sweep_limit=3))
    with pytest.raises(ConvergenceError, match="relative impulse change"):
        for _ in range(50):
            strict.advance(step_of(a), drive)
    wanted = Simulation(a, Material(), Solver(tolerance=1e-10, sweep_limit=3, keep_unconverged=True))
    worst = max(wanted.advance(step_of(a), drive)["natural_map"] for _ in range(50))
    assert worst > 1e-6  # and the residual tells
    with pytest.raises(InputError, match="time step"):
        wanted.advance(np.nan, drive)
