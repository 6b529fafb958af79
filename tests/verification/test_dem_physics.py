"""Motion of a few bodies against closed forms: flight, bounce, friction, rolling, stacks, momentum, energy; disks as their own case."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fenchel.dem import AdaptiveStep, Assembly, Drive, Laws, Plane, Simulation, Solver, relax
from fenchel.dem.laws import (
    CompliantSignoriniCoulomb,
    ContactLaw,
    ElasticRod,
    ElasticWire,
    NewtonRestitution,
    Signorini,
    SignoriniCoulomb,
)
from fenchel.errors import ConvergenceError, InputError

G = 9.81
FLOOR = Plane(normal=(0, 0, 1), point=(0, 0, 0))
TIGHT = Solver(tolerance=1e-14, sweep_limit=2_000_000)


def slope(degrees: float) -> Drive:
    """Gravity seen from an inclined plane z = 0, downhill along x."""
    angle = np.deg2rad(degrees)
    return Drive(gravity=G * np.array([np.sin(angle), 0.0, -np.cos(angle)]))


def down(dimension: int = 3) -> Drive:
    """Gravity along the last axis."""
    gravity = np.zeros(dimension)
    gravity[-1] = -G
    return Drive(gravity=gravity)


def ball(height: float, *, locked: bool = False, velocity: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Assembly:
    """A sphere of 1 cm radius and 100 g above the plane z = 0."""
    a = Assembly.of_spheres(
        np.array([[0.0, 0.0, height]]), np.array([0.01]), np.array([0.1]), locked=np.array([locked])
    )
    a.velocity[0] = velocity
    return a


@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
def test_free_fall_in_leap_frog(theta: float) -> None:
    """v = −g t exactly; q_m = q + h(1−θ)v follows from the scheme: z_m after n steps is z₀ − g h² n(n+1)/2."""
    a = ball(10.0)
    simulation = Simulation(a, Laws(), Solver(), theta=theta)
    h, n = 1e-3, 500
    damping = work = 0.0
    for _ in range(n):
        measures = simulation.advance(h, down())
        damping += measures["damping"]
        work += measures["weight"]
    assert a.velocity[0, 2] == pytest.approx(-G * n * h, rel=1e-13)
    assert a.x[0, 2] == pytest.approx(10.0 - 0.5 * G * h**2 * n * (n + 1), rel=1e-13)
    # θ = ½ is exact for a uniform field, more loses (θ − ½) m g² h² a step
    assert damping == pytest.approx((theta - 0.5) * 0.1 * (G * h) ** 2 * n, rel=1e-10, abs=1e-18)
    assert measures["kinetic"] == pytest.approx(work - damping, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.8, 1.0])
def test_bounce(restitution: float) -> None:
    """After the shock v⁺ = −e v⁻; the next rise is e² of the fall, up to what a step of free flight makes uncertain."""
    a = ball(0.11)
    simulation = Simulation(a, Laws(contact=NewtonRestitution(restitution=restitution)), TIGHT, planes=[FLOOR])
    h = 1e-4
    before = 0.0
    for _ in range(4000):
        measures = simulation.advance(h, down())
        if measures["closed"]:
            break
        before = a.velocity[0, 2]
    assert a.velocity[0, 2] == pytest.approx(-restitution * before, rel=1e-12, abs=1e-15)
    assert before == pytest.approx(-np.sqrt(2.0 * G * 0.1), rel=1e-3)
    # a single shock takes ½(1 − e²) m v² less what the weight does meanwhile
    lost = measures["shock"] - 0.5 * (1.0 - restitution**2) * 0.1 * before**2
    assert abs(lost) < 0.1 * G * h * abs(before)
    highest = 0.0
    for _ in range(4000):
        highest = max(highest, a.x[0, 2])
        simulation.advance(h, down())
    assert highest - 0.01 == pytest.approx(restitution**2 * 0.1, abs=2e-4)


def test_locked_sphere_sticks_below_the_angle_of_friction_and_slides_above() -> None:
    mu = 0.4
    threshold = np.rad2deg(np.arctan(mu))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=mu)
    for degrees, slides in ((threshold - 1e-6, False), (threshold + 1e-6, True), (threshold + 5.0, True)):
        a = ball(0.01, locked=True)
        simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=mu)), TIGHT, planes=[floor])
        for _ in range(200):
            simulation.advance(1e-3, slope(degrees))
        angle = np.deg2rad(degrees)
        expected = G * (np.sin(angle) - mu * np.cos(angle)) * 0.2 if slides else 0.0
        assert a.velocity[0, 0] == pytest.approx(
            expected, rel=1e-9 / 1e-6 if abs(degrees - threshold) < 1e-3 else 1e-10, abs=1e-15
        )
        assert simulation.kernels.turning == "none" and a.spin.shape == (1, 0)


@pytest.mark.validate
def test_no_creep_in_a_hundred_thousand_steps() -> None:
    """Rigid and compliant: below the angle of friction the sphere stays where the first steps have put it."""
    for law in (SignoriniCoulomb(friction=0.4), CompliantSignoriniCoulomb(friction=0.4, k_n=1e5, k_t=8e4)):
        a = ball(0.01, locked=True)
        floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.4)
        simulation = Simulation(a, Laws(contact=law), TIGHT, planes=[floor])
        rigid = isinstance(law, SignoriniCoulomb)
        for _ in range(2000):
            simulation.advance(1e-3, slope(20.0))
        start = a.x.copy()
        for _ in range(98_000 if rigid else 3_000):
            simulation.advance(1e-3, slope(20.0))
        assert np.max(np.abs(a.x - start)) < 1e-15
        deflection = 0.0 if rigid else 0.1 * G * np.sin(np.deg2rad(20.0)) / 8e4
        assert a.x[0, 0] == pytest.approx(deflection, rel=1e-9, abs=1e-18)


@pytest.mark.parametrize(("dimension", "share", "limit"), [(3, 5.0 / 7.0, 3.5), (2, 2.0 / 3.0, 3.0)])
def test_rolling_and_sliding_into_rolling(dimension: int, share: float, limit: float) -> None:
    """a = 5/7 g sin θ (disk: 2/3) while tan θ < 7/2 μ (3 μ), g (sin θ − μ cos θ) beyond; on a level floor sliding ends at 5/7 (2/3) v₀."""
    mu, h = 0.3, 1e-3
    normal = (0.0,) * (dimension - 1) + (1.0,)
    floor = Plane(normal=normal, point=(0.0,) * dimension, friction=mu)
    position = np.array([[*(0.0,) * (dimension - 1), 0.01]])

    def run(degrees: float, steps: int, velocity: float = 0.0) -> Assembly:
        a = Assembly.of_spheres(position, np.array([0.01]), np.array([0.1]))
        a.velocity[0, 0] = velocity
        simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=mu)), TIGHT, planes=[floor])
        angle = np.deg2rad(degrees)
        gravity = np.zeros(dimension)
        gravity[0], gravity[-1] = G * np.sin(angle), -G * np.cos(angle)
        for _ in range(steps):
            simulation.advance(h, Drive(gravity=gravity))
        return a

    below, above = np.rad2deg(np.arctan(limit * mu)) + np.array([-1.0, 1.0])
    rolls = run(below, 300)
    assert rolls.velocity[0, 0] == pytest.approx(share * G * np.sin(np.deg2rad(below)) * 0.3, rel=1e-11)
    assert np.linalg.norm(rolls.spin) == pytest.approx(rolls.velocity[0, 0], rel=1e-11)
    slips = run(above, 300)
    angle = np.deg2rad(above)
    assert slips.velocity[0, 0] == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)) * 0.3, rel=1e-11)
    thrown = run(0.0, 300, velocity=0.5)
    assert thrown.velocity[0, 0] == pytest.approx(share * 0.5, rel=1e-11)


@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_a_stack_with_the_heavy_ball_on_top_stands(ratio: float) -> None:
    """Five equal spheres and one `ratio` times as heavy on top: every contact carries exactly what lies above it."""
    r, light, count = 0.01, 0.01, 6
    mass = np.full(count, light)
    mass[-1] *= ratio
    x = np.zeros((count, 3))
    x[:, 2] = r * (2.0 * np.arange(count) + 1.0)
    a = Assembly.of_spheres(x, np.full(count, r), mass)
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), TIGHT, planes=[floor])
    for _ in range(20):
        simulation.advance(1e-3, down())
    rows = simulation.contacts
    assert rows is not None
    force = np.sum(rows.impulse * rows.normal, axis=1) / 1e-3
    above = G * np.cumsum(mass[::-1])[::-1]
    np.testing.assert_allclose(force, above[1:], rtol=1e-9)
    assert rows.wall_impulse[0, 2] / 1e-3 == pytest.approx(above[0], rel=1e-9)
    np.testing.assert_allclose(a.x, x, rtol=0, atol=1e-12)


def test_momentum_and_angular_momentum_are_kept_to_round_off() -> None:
    """A cloud that collides in free space, with friction and wires: contacts act at one point on both bodies, links along their axis."""
    rng = np.random.default_rng(4)
    n, h = 60, 1e-4
    x = rng.uniform(-0.022, 0.022, (n, 3))
    wire = np.where(np.arange(n) < 12, np.arange(n) // 6, -1)
    for k in range(2):  # two straight chains of six
        x[6 * k : 6 * k + 6] = np.array([[0.0, 0.06 + 0.03 * k, 0.0]]) + 0.012 * np.arange(6)[:, None] * np.array(
            [[1.0, 0, 0]]
        )
    a = Assembly.of_spheres(x, np.full(n, 0.005), rng.uniform(0.001, 0.01, n), wire=wire, rank=np.arange(n) % 6)
    a.velocity[:] = -10.0 * x + rng.normal(size=(n, 3)) * 0.2
    a.spin[:] = rng.normal(size=(n, 3)) * 0.2
    law = CompliantSignoriniCoulomb(friction=0.4, k_n=1e4, k_t=8e3)
    simulation = Simulation(a, Laws(contact=law, wire=ElasticWire(stiffness=50.0)), Solver(tolerance=1e-8))
    scale = np.sum(a.mass * np.linalg.norm(a.velocity, axis=1))
    closed = 0.0
    for _ in range(200):
        linear, turning = a.mass @ a.velocity, spin_of(a)
        at = a.x.copy()
        closed = max(closed, simulation.advance(h, Drive())["closed"])
        np.testing.assert_allclose(a.mass @ a.velocity, linear, rtol=0, atol=1e-14 * scale)
        # the impulses act at the configuration of detection: about it the sum of moments is zero, whatever the gap
        moment = np.cross(at, a.mass[:, None] * a.velocity).sum(axis=0)
        assert simulation.contacts is not None
        gap, n_, p = simulation.contacts.gap, simulation.contacts.normal, simulation.contacts.impulse
        # an open or overlapping contact has its two points a gap apart
        lever = np.cross(gap[:, None] * n_, p).sum(axis=0)
        change = moment + rotation(a) - turning
        np.testing.assert_allclose(change, lever, rtol=0, atol=1e-14 * scale)
    assert closed > 20


def rotation(a: Assembly) -> np.ndarray:
    """Σ I ω with I = 2/5 m r²."""
    return (0.4 * a.mass * a.radius) @ a.spin


def spin_of(a: Assembly) -> np.ndarray:
    """Angular momentum about the origin at the configuration of detection."""
    return np.cross(a.x, a.mass[:, None] * a.velocity).sum(axis=0) + rotation(a)


@pytest.mark.parametrize(("step", "theta"), [(1e-4, 0.5), (1e-3, 1.0), (1e-2, 0.5), (1e-1, 0.75)])
def test_energy_never_rises_with_inelastic_contacts(step: float, theta: float) -> None:
    """E = kinetic + weight at q_m: ΔE = p·u⁺ − ½Δv·MΔv ≤ 0 at any step, since p·u⁺ ≤ 0 contact by contact.

    (theorem of the scheme; it holds for rigid inelastic contacts from a state without overlaps)
    """
    rng = np.random.default_rng(7)
    n = 40
    grid = np.array([(i, j, k) for i in range(4) for j in range(4) for k in range(3)], dtype=float)[:n]
    radius = rng.uniform(0.003, 0.005, n)
    a = Assembly.of_spheres(0.011 * grid + 0.01, radius, 1e4 * radius**3)
    a.velocity[:] = rng.normal(size=(n, 3)) * 0.3
    walls = (((0, 0, 1), (0, 0, 0)), ((1, 0, 0), (0, 0, 0)), ((-1, 0, 0), (0.06, 0, 0)), ((0, 1, 0), (0, 0, 0)))
    planes = [Plane(normal=n_, point=p, friction=0.5) for n_, p in (*walls, ((0, -1, 0), (0, 0.06, 0)))]
    law = SignoriniCoulomb(friction=0.5)
    solver = Solver(tolerance=1e-11, sweep_limit=200_000)
    simulation = Simulation(a, Laws(contact=law), solver, planes=planes, theta=theta)

    def energy(kinetic: float) -> float:
        return kinetic + G * float(a.mass @ a.x[:, 2])

    last = energy(0.5 * float(a.mass @ np.sum(a.velocity**2, axis=1)))
    scale = last
    touched = 0.0
    for _ in range({1e-4: 400, 1e-1: 12}.get(step, 40)):
        measures = simulation.advance(step, down())
        now = energy(measures["kinetic"])
        assert now <= last + 1e-9 * scale
        last = now
        touched = max(touched, measures["closed"])
        for name in ("friction", "damping"):
            assert measures[name] >= -1e-12 * scale
    assert touched > 10


def test_every_term_of_the_energy_closes() -> None:
    """ΔE_kin = weight + drive + contacts − damping to round-off, with pushed, driven and servo planes, compliance, friction and rods."""
    rng = np.random.default_rng(3)
    n = 30
    grid = np.array([(i, j, k) for i in range(3) for j in range(3) for k in range(4)], dtype=float)[:n]
    radius = rng.uniform(0.004, 0.005, n)
    wire = np.where(np.arange(n) < 4, 0, -1)
    a = Assembly.of_spheres(0.0095 * grid + 0.006, radius, 1e4 * radius**3, wire=wire, rank=np.arange(n))
    planes = [
        Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5, velocity=(0.02, 0, 0.01)),
        Plane(normal=(0, 0, -1), point=(0, 0, 0.045), friction=0.2, force=3.0, mass=0.05),
        Plane(normal=(1, 0, 0), point=(0, 0, 0), friction=0.1, pressure=500.0, area=1e-3, mobility=0.05),
        Plane(normal=(-1, 0, 0), point=(0.03, 0, 0)),
        Plane(normal=(0, 1, 0), point=(0, 0, 0)),
        Plane(normal=(0, -1, 0), point=(0, 0.03, 0)),
    ]
    law = CompliantSignoriniCoulomb(friction=0.5, k_n=2e4, k_t=1.6e4)
    simulation = Simulation(
        a, Laws(contact=law, wire=ElasticRod(stiffness=10.0)), Solver(tolerance=1e-10), planes=planes, theta=0.6
    )
    kinetic = elastic = 0.0
    total = dict.fromkeys(("weight", "drive", "friction", "algorithmic", "shock", "damping", "wires"), 0.0)
    worst = 0.0
    for _ in range(400):
        measures = simulation.advance(2e-4, down())
        given = (
            measures["external"]
            - measures["friction"]
            - measures["algorithmic"]
            - measures["shock"]
            - measures["damping"]
        )
        change = measures["kinetic"] - kinetic + measures["elastic"] - elastic
        worst = max(worst, abs(change - given + measures["balance"]))
        kinetic, elastic = measures["kinetic"], measures["elastic"]
        for name in total:
            total[name] += measures[name]
        assert measures["external"] == pytest.approx(measures["weight"] + measures["drive"], abs=1e-18)
        assert min(measures["friction"], measures["algorithmic"], measures["damping"], measures["wires"]) > -1e-15
    assert worst < 1e-13
    assert all(value != 0.0 for value in total.values())
    rows = simulation.contacts
    assert rows is not None
    # the servo carries its force once all is at rest
    for _ in range(6000):
        simulation.planes = (Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5), *planes[1:])
        measures = simulation.advance(2e-4, down())
    rows = simulation.contacts
    assert rows is not None
    on = rows.touching[:, 1] == 2
    assert rows.wall_impulse[on, 0].sum() / 2e-4 == pytest.approx(0.5, rel=1e-3)
    assert a.plane_velocity[2] == pytest.approx(0.0, abs=1e-5)
    lid = rows.touching[:, 1] == 1
    assert -rows.wall_impulse[lid, 2].sum() / 2e-4 == pytest.approx(3.0, rel=1e-2)


def test_a_belt_drags_a_locked_sphere_to_its_speed() -> None:
    """Friction μ g until the sphere has the speed of the belt; the drive's work is heat and kinetic energy in equal parts."""
    mu, speed, h = 0.3, 0.2, 1e-3
    belt = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=mu, velocity=(speed, 0, 0))
    a = ball(0.01, locked=True)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=mu)), TIGHT, planes=[belt])
    drive = friction = 0.0
    for k in range(100):
        measures = simulation.advance(h, down())
        drive += measures["drive"]
        friction += measures["friction"] + measures["shock"]
        assert a.velocity[0, 0] == pytest.approx(min(speed, mu * G * h * (k + 1)), rel=1e-12)
    assert friction == pytest.approx(0.5 * drive, rel=1e-9)
    assert drive == pytest.approx(0.1 * speed**2, rel=1e-9)


def test_frictionless_disks_know_no_third_component() -> None:
    """Two dimensions: arrays, rows and code; a disk that hits another one head-on with e shares its speed as in one dimension."""
    a = Assembly.of_spheres(np.array([[0.0, 0.0], [0.025, 0.0]]), np.full(2, 0.01), np.array([1.0, 3.0]))
    a.velocity[0] = (1.0, 0.0)
    simulation = Simulation(a, Laws(contact=NewtonRestitution(restitution=0.6)), TIGHT)
    for _ in range(20):
        simulation.advance(1e-3, Drive())
    np.testing.assert_allclose(a.velocity[:, 0], [(1.0 - 3.0 * 0.6) / 4.0, (1.0 + 0.6) / 4.0], rtol=1e-12)
    for array in (a.x, a.velocity, a.half, a.listed_x, simulation.contacts.normal if simulation.contacts else None):
        assert array is not None and array.shape[1 if array.ndim > 1 else 0] == 2
    code = "\n".join(kernel.text for kernel in simulation.kernels.all() if kernel.kind != "step")
    assert not re.search(r"_2\b|\bspin\[|\bmu\b|\bt_0\b", code)


def test_a_law_from_outside_is_one_class() -> None:
    """Cohesion: p_n ≥ −C h. Two spheres hold together below the force C and part above it; the residual knows the shifted cone."""
    from dataclasses import dataclass

    from fenchel.dem.laws import ContactRule

    @dataclass(frozen=True, kw_only=True)
    class Cohesive(ContactLaw):
        friction: float
        adhesion: float  # N

        def rule(self) -> ContactRule:
            return ContactRule(
                bias="max(gap, 0.0) / step", friction="friction", least="-adhesion * step", touching="gap <= 1e-9"
            )

    for pull, holds in ((0.9, True), (1.1, False)):
        x = np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 0.0]])
        a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([np.inf, 0.1]))
        simulation = Simulation(a, Laws(contact=Cohesive(friction=0.5, adhesion=1.0)), TIGHT)
        for _ in range(10):
            measures = simulation.advance(1e-3, Drive(gravity=np.array([0.0, 0.0, -pull / 0.1])))
            if holds:
                assert measures["natural_map"] < 1e-12
        assert (a.velocity[1, 2] == pytest.approx(0.0, abs=1e-12)) == holds
    for lateral, holds in (
        (0.45, True),
        (0.55, False),
    ):  # the cone has its apex at −C h: friction holds up to μ C without any pressure
        x = np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 0.0]])
        a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([np.inf, 0.1]), locked=np.full(2, True))
        simulation = Simulation(a, Laws(contact=Cohesive(friction=0.5, adhesion=1.0)), TIGHT)
        measures = simulation.advance(1e-4, Drive(gravity=np.array([lateral / 0.1, 0.0, 0.0])))
        assert measures["natural_map"] < 1e-12
        slid = 0.0 if holds else 1e-4 * (lateral - 0.5) / 0.1
        assert a.velocity[1, 0] == pytest.approx(slid, rel=1e-9, abs=1e-15)
    with pytest.raises(InputError, match="mentions colour"):

        @dataclass(frozen=True, kw_only=True)
        class Wrong(ContactLaw):
            def rule(self) -> ContactRule:
                return ContactRule(bias="colour / step")

        _ = Simulation(a, Laws(contact=Wrong()), TIGHT).kernels.pairs
    assert Signorini().rule().friction == ""


def test_bad_planes_are_one_line() -> None:
    for words, rule in (
        ({"normal": (0, 0, 0)}, "direction"),
        ({"friction": -0.1}, "friction"),
        ({"velocity": (1.0, 0.0)}, "velocity"),
        ({"force": 1.0}, "mass"),
        ({"force": 1.0, "mass": 1.0, "velocity": (0, 0, 1)}, "both given"),
        ({"pressure": 1.0}, "area"),
        ({"mobility": 1.0}, "force or a pressure"),
        ({"force": 1.0, "mobility": -1.0}, "positive"),
    ):
        with pytest.raises(InputError, match=rule) as info:
            Plane(**({"normal": (0, 0, 1), "point": (0, 0, 0)} | words))
        assert "\n" not in str(info.value)
    simulation = Simulation(ball(1.0), Laws(), Solver(), planes=[FLOOR])
    simulation.planes = (Plane(normal=(0, 0, 2), point=(0, 0, 0), velocity=(0, 0, 1)),)
    for other in (
        (),
        (Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.1),),
        (Plane(normal=(0, 1, 1), point=(0, 0, 0)),),
    ):
        with pytest.raises(InputError, match="for the life"):
            simulation.planes = other
    with pytest.raises(InputError, match="components"):
        Simulation(ball(1.0), Laws(), Solver(), planes=[Plane(normal=(0, 1), point=(0, 0))])
    with pytest.raises(InputError, match="theta"):
        Simulation(ball(1.0), Laws(), Solver(), theta=0.4)


def test_the_step_adapts_to_flight_and_to_sweeps_and_grows_again() -> None:
    """A ball thrown fast is followed in short steps, one that rests in long ones; q keeps its place when the step changes."""
    a = ball(0.5, velocity=(0.0, 0.0, -2.0))
    # a longer step moves the mid configuration of a landing ball into the floor: a little recovery brings it back
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.4, recovery=0.2)), TIGHT, planes=[FLOOR])
    pace = AdaptiveStep(simulation=simulation, most=1e-2, least=1e-6, travel=0.5)
    lengths = []
    while a.time < 1.0 - 1e-12:
        before, velocity, step = a.x[0, 2], a.velocity[0, 2], a.step
        pace.advance(down(), until=1.0)
        lengths.append(a.step)
        if a.velocity[0, 2] != 0.0 and step:
            # q = q_m − h v/2 at the start of the step, exact flight in between
            q = before - 0.5 * step * velocity
            after = a.x[0, 2] - 0.5 * a.step * a.velocity[0, 2]
            if after > 0.011:
                assert after - q == pytest.approx(0.5 * a.step * (velocity + a.velocity[0, 2]), rel=1e-9, abs=1e-15)
                assert a.velocity[0, 2] == pytest.approx(velocity - G * a.step, rel=1e-12)
    assert a.time == pytest.approx(1.0, abs=1e-12)
    assert min(lengths) < 2.5e-3 and max(lengths[-20:-1]) == 1e-2 and pace.cuts > 0
    assert a.x[0, 2] == pytest.approx(0.01, abs=1e-7)
    strict = Simulation(
        pile(), Laws(contact=SignoriniCoulomb(friction=0.4)), Solver(tolerance=1e-10, sweep_limit=30), planes=[FLOOR]
    )
    with pytest.raises(ConvergenceError):
        stubborn = AdaptiveStep(simulation=strict, most=1e-2, least=5e-3, travel=10.0)
        for _ in range(50):
            stubborn.advance(down())
    with pytest.raises(InputError, match="least"):
        AdaptiveStep(simulation=strict, most=1e-3, least=1e-2)


def pile() -> Assembly:
    """Thirty spheres in a loose column."""
    x = np.stack([1e-3 * (np.arange(30) % 2), np.zeros(30), 0.0101 + 0.0201 * np.arange(30)], axis=1)
    return Assembly.of_spheres(x, np.full(30, 0.01), np.full(30, 0.01))


def test_relaxation_finds_the_equilibrium_of_a_compliant_pile() -> None:
    """Column of six spheres: deflection of contact k is the weight above over k_n, found without waiting for the oscillations to die."""
    count, k = 6, 1e4
    x = np.stack([np.zeros(count), np.zeros(count), 0.01 + 0.02 * np.arange(count)], axis=1)
    a = Assembly.of_spheres(x, np.full(count, 0.01), np.full(count, 0.05))
    law = CompliantSignoriniCoulomb(friction=0.4, k_n=k, k_t=k)
    simulation = Simulation(a, Laws(contact=law), Solver(tolerance=1e-13, sweep_limit=100_000), planes=[FLOOR])
    out = relax(simulation, down(), 1e-2, tolerance=1e-9)
    assert out.unbalanced < 1e-9 and out.steps < 100
    weight = 0.05 * G * np.arange(count, 0, -1)
    gaps = np.diff(np.concatenate([[-0.01], a.x[:, 2]])) - 0.02
    np.testing.assert_allclose(gaps, -weight / k, rtol=1e-8)
    with pytest.raises(ConvergenceError, match="relaxation"):
        relax(Simulation(ball(1.0), Laws(contact=law), TIGHT, planes=[FLOOR]), down(), 1e-3, step_limit=5)


@pytest.mark.parametrize("theta", [0.5, 0.8])
def test_nothing_of_the_energy_is_left_over_where_directions_do_not_turn(theta: float) -> None:
    """Two locked spheres dropped on a belt, compliant in both directions, bouncing and sliding: `balance` is round-off in every step."""
    x = np.array([[0.0, 0.0, 0.0101], [0.0, 0.0, 0.0302]])
    a = Assembly.of_spheres(x, np.full(2, 0.01), np.array([0.1, 0.05]), locked=np.full(2, True))
    law = CompliantSignoriniCoulomb(friction=0.6, k_n=1e3, k_t=8e2)
    belt = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.2, velocity=(0.05, 0, 0))
    simulation = Simulation(a, Laws(contact=law), TIGHT, planes=[belt], theta=theta, reach=1e-2)
    scale = 0.1 * G * 1e-2
    worst, losses = 0.0, np.zeros(3)
    for _ in range(300):
        # only what happens along the axes of the first contact may move: the upper sphere stays above the lower one
        a.x[1, 0], a.velocity[1, 0] = a.x[0, 0], a.velocity[0, 0]
        measures = simulation.advance(5e-4, down())
        worst = max(worst, abs(measures["balance"]))
        losses += [measures["friction"], measures["algorithmic"], measures["shock"]]
    assert worst < 1e-13 * scale
    assert np.all(losses[:2] > 1e-3 * scale)
