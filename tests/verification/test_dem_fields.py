"""Homogenised fields: identities to round-off, and one small triaxial test within the ranges of the field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Material, Simulation, Solver, TriaxialRecord, TriaxialTest, mandel
from fenchel.dem.homogenise import _inside, fit_sums, moments, wall_stress
from fenchel.dem.preparation import make_sample, material_of, preparation
from fenchel.dem.scene import Grains, Sample, SceneSolve, Wires
from fenchel.dem.triaxial import QUALITY

PRESSURE = 5e4
GRAINS = Grains(count=300, normal_stiffness=4.3e4)
WIRES = Wires(count=20, beads=20)


@pytest.fixture(scope="module", params=[1, 2])
def rested(request: pytest.FixtureRequest) -> Assembly:
    assembly = make_sample(GRAINS, WIRES, Sample(), request.param)
    for make in preparation(GRAINS, WIRES, Sample(), SceneSolve(), PRESSURE):
        stage = make(assembly)
        while not stage.done:
            stage.advance()
    return assembly


def triaxial(
    assembly: Assembly, *, linked: bool, path: tuple[float, ...], inertial: float = 1e-3, **law: float
) -> TriaxialTest:
    test = TriaxialTest(
        assembly.copy(),
        replace(material_of(GRAINS, WIRES), links=linked, **law),
        Solver(tolerance=1e-5),
        pressure=PRESSURE,
        density=GRAINS.density,
        strain_path=path,
        inertial_number=inertial,
    )
    while not test.done:
        test.advance()
    return test


def loaded(assembly: Assembly) -> Simulation:
    """A state with tensions in the links, not quite in equilibrium."""
    return triaxial(assembly, linked=True, path=(0.0, -1e-3)).simulation


def test_love_weber_and_the_split_by_phase(rested: Assembly) -> None:
    simulation = loaded(rested)
    rows, a = simulation.contacts, simulation.assembly
    assert rows is not None
    radius = 0.8 * float(a.half.min())
    m = moments(a, rows, radius)
    assert np.linalg.norm(m[2, 8]) > 0.0 and np.linalg.norm(m[1, 8]) > 0.0
    # Σ f ⊗ ℓ over contacts and links with the branch between centres; walls with the branch from centre to wall
    whole = np.zeros((3, 3))
    for (i, j), row in zip(rows.pair, rows.contact, strict=True):
        whole += np.outer(row[3:6] / rows.step, rows.x[j] - rows.x[i])
    for (i, axis, side), row in zip(rows.wall, rows.wall_row, strict=True):
        force, branch = np.zeros(3), np.zeros(3)
        force[axis] = -side * row[0] / rows.step
        branch[axis] = side * rows.half[axis] - rows.x[i, axis]
        whole += np.outer(force, branch)
    for (i, j), row in zip(rows.link, rows.link_row, strict=True):
        n = (rows.x[j] - rows.x[i]) / np.linalg.norm(rows.x[j] - rows.x[i])
        whole += row[3] / rows.step * np.linalg.norm(rows.x[j] - rows.x[i]) * np.outer(n, n)
    assert np.linalg.norm(m[:, 8].sum(axis=0) - whole) < 1e-12 * np.linalg.norm(whole)
    # a sphere around everything is the whole; smaller ones hold the octants apart without loss
    everything = moments(a, rows, 10.0 * float(a.half.max()))
    np.testing.assert_allclose(
        everything[:, :8].sum(axis=1), everything[:, 8], rtol=0, atol=1e-12 * np.linalg.norm(whole)
    )


def test_the_sphere_takes_its_part_of_every_branch(rested: Assembly) -> None:
    """Σ f ⊗ (part of the branch inside), the part by counting points along it."""
    simulation = loaded(rested)
    rows, a = simulation.contacts, simulation.assembly
    assert rows is not None
    radius = 0.6 * float(a.half.min())
    t = (np.arange(4000) + 0.5) / 4000
    expected = np.zeros((3, 3))

    def add(start: np.ndarray, end: np.ndarray, force: np.ndarray) -> None:
        points = start + t[:, None] * (end - start)
        expected[:] += np.mean(np.sum(points**2, axis=1) < radius**2) * np.outer(force, end - start)

    for (i, j), row in zip(rows.pair, rows.contact, strict=True):
        force = row[3:6] / rows.step
        if force.any():
            point = rows.x[i] - (a.radius[i] + 0.5 * row[13]) * row[:3]
            add(rows.x[i], point, force)
            add(rows.x[j], point, -force)
    for (i, j), row in zip(rows.link, rows.link_row, strict=True):
        add(rows.x[i], rows.x[j], -row[3] / rows.step * row[:3])
    # walls lie outside of this sphere
    found = moments(a, rows, radius)[:, :8].sum(axis=(0, 1))
    assert np.linalg.norm(found - expected) < 1e-3 * np.linalg.norm(expected)


def test_part_of_a_segment_in_a_sphere() -> None:
    rng = np.random.default_rng(5)
    t = (np.arange(20_000) + 0.5) / 20_000
    for _ in range(50):
        start, end = rng.uniform(-1.5, 1.5, (2, 3))
        points = start + t[:, None] * (end - start)
        part, octant = _inside(start, end, 1.0)
        share = np.mean(np.sum(points**2, axis=1) < 1.0)
        assert part == pytest.approx(share, abs=2e-4)
        if share > 0.01:
            middle = points[np.sum(points**2, axis=1) < 1.0].mean(axis=0)
            if np.min(np.abs(middle)) > 1e-3:
                assert octant == int((middle > 0.0) @ np.array([1, 2, 4]))


def test_equilibrium_gives_the_wall_stress(rested: Assembly) -> None:
    simulation = Simulation(rested.copy(), replace(material_of(GRAINS, WIRES), links=False), Solver(tolerance=1e-8))
    step = 0.05 * 2.0 * rested.grain_radius * np.sqrt(GRAINS.density / PRESSURE)
    for _ in range(5):
        simulation.advance(step, Drive(pressure=np.full(3, PRESSURE)))
    rows = simulation.contacts
    assert rows is not None
    stress = moments(rested, rows, 1.0)[:, 8].sum(axis=0) / (8.0 * np.prod(rows.half))
    np.testing.assert_allclose(np.diag(stress), wall_stress(rows), rtol=1e-2)
    np.testing.assert_allclose(wall_stress(rows), -PRESSURE, rtol=1e-2)
    assert np.linalg.norm(stress - stress.T) < 1e-2 * np.linalg.norm(stress)


def test_best_fit_strain_is_exact_on_affine_fields() -> None:
    rng = np.random.default_rng(6)
    x = rng.uniform(-1.0, 1.0, (80, 3))
    gradient = rng.normal(size=(3, 3)) * 1e-3
    octant = ((x > 0.0) @ np.array([1, 2, 4])).astype(np.int64)
    sums = fit_sums(x, x @ gradient.T + 0.1, np.ones(80, dtype=bool), octant)[None]
    zero = np.zeros((1, 8, 3, 3))
    record = TriaxialRecord(
        pressure=1.0, seed=0, linked=True, leg=np.zeros(1, dtype=np.int64), axial_strain=np.zeros(1), wall_strain=np.zeros((1, 6)),
        wall_stress=np.zeros((1, 6)), box_stress=np.zeros((1, 6)), octant_volume=np.ones(8), grain_moment=zero, bead_moment=zero,
        link_moment=zero, grain_fit=sums, bead_fit=sums,
    )  # fmt: skip
    for weights in (None, np.array([0.0, 1, 1, 1, 1, 1, 1, 1])):
        np.testing.assert_allclose(record.history(weights).strain_sand[0], mandel(gradient), rtol=0, atol=1e-13)


def test_triaxial_with_links_and_the_control(rested: Assembly) -> None:
    path = (0.0, -0.01, 0.004)
    linked = triaxial(rested, linked=True, path=path).record(seed=0, settings={})
    control = triaxial(rested, linked=False, path=path).record(seed=0, settings={})
    for record in (linked, control):
        quality = record.quality
        assert set(quality) == set(QUALITY)
        assert quality["violation_over_radius"] < 1e-3
        assert quality["unbalanced_max"] < 1e-2
        assert quality["natural_map_max"] < 1e-4
        assert quality["wall_box_difference"] < 0.05
        assert quality["energy_error"] < 2e-3
        assert quality["inertial_number"] <= 1e-3 * (1 + 1e-12)
        for name in ("friction", "algorithmic"):
            assert np.all(np.diff(record.series[name]) >= -1e-15)
        lateral = record.wall_stress[:, :2]
        np.testing.assert_allclose(lateral, -PRESSURE, rtol=0.02)
        np.testing.assert_allclose(record.box_stress[:, :3], record.wall_stress[:, :3], rtol=0.05)
        assert record.axial_strain.min() == pytest.approx(-0.01, abs=1e-4)
        assert set(record.leg) == {0, 1}
        q = record.wall_stress[:, 2] - lateral.mean(axis=1)
        first = np.searchsorted(-record.axial_strain[record.leg == 0], 1e-3)
        modulus = (q[first] - q[0]) / record.axial_strain[first]
        assert 5e6 < modulus < 16e6
        end = np.flatnonzero(record.leg == 0)[-1]
        assert 0.5 < -q[end] / PRESSURE < 1.7
        assert q[-1] > 0.0  # extension
    assert np.all(control.history().stress_links == 0.0)
    links = linked.history().stress_links[np.flatnonzero(linked.leg == 0)[-1]]
    assert links[0] > 10.0 and links[1] > 10.0  # lateral tension, Pa
    assert 1e5 < linked.quality["wire_density"] < 3e5


def test_stiffness_does_not_come_from_the_solver(rested: Assembly) -> None:
    """E at half the tolerance and half the step moves by less than 10 % with compliant grains."""

    def secant(fraction: float, tolerance: float) -> float:
        test = TriaxialTest(
            rested.copy(), material_of(GRAINS, WIRES), Solver(tolerance=tolerance), pressure=PRESSURE, density=GRAINS.density,
            strain_path=(0.0, -3e-4), step_fraction=fraction, frame_strain=2e-5,
        )  # fmt: skip
        while not test.done:
            test.advance()
        record = test.record(seed=0, settings={})
        q = record.wall_stress[:, 2] - record.wall_stress[:, :2].mean(axis=1)
        return float(-(np.interp(2e-4, -record.axial_strain, q) - q[0]) / 2e-4)

    base = secant(0.05, 1e-5)
    assert secant(0.025, 5e-6) == pytest.approx(base, rel=0.1)


def test_another_seed_gives_other_numbers_and_the_same_seed_the_same_bits() -> None:
    a, b, c = (make_sample(GRAINS, WIRES, Sample(), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.x, b.x)
    assert not np.array_equal(a.radius, c.radius)


def test_a_small_sample_with_wedged_beads_is_made_and_comes_to_rest() -> None:
    """Densification leaves a bead wedged by 0.8 of its radius here; the compression removes it."""
    grains, wires = Grains(count=200, normal_stiffness=4.3e4), Wires(count=12, beads=20)
    assembly = make_sample(grains, wires, Sample(), 1)
    for make in preparation(grains, wires, Sample(), SceneSolve(), PRESSURE)[:1]:
        stage = make(assembly)
        while not stage.done:
            measures = stage.advance()
    assert measures["overlap_max"] < 0.05 * assembly.grain_radius


def test_prestressed_wires_pull_before_the_test() -> None:
    wires = Wires(count=20, beads=20, state="prestressed")
    assembly = make_sample(GRAINS, wires, Sample(), 3)
    for make in preparation(GRAINS, wires, Sample(), SceneSolve(), PRESSURE):
        stage = make(assembly)
        while not stage.done:
            stage.advance()
    assert np.mean(assembly.link_impulse > 0.0) > 0.1
    test = TriaxialTest(
        assembly,
        material_of(GRAINS, wires),
        Solver(),
        pressure=PRESSURE,
        density=GRAINS.density,
        strain_path=(0.0, -1e-4),
        prestressed=True,
    )
    worst = 0.0
    while not test.done:
        worst = max(worst, test.advance()["unbalanced"])
    record = test.record(seed=3, settings={})
    # the worst of a run is over all of its steps, also those between two frames
    assert record.quality["unbalanced_max"] == worst
    history = record.history()
    assert np.trace(np.diag(history.stress_links[0, :3])) > 100.0


def test_material_without_wires_has_no_links() -> None:
    law = material_of(GRAINS, None)
    assert isinstance(law, Material) and not law.links
    assert material_of(Grains(), None).normal_stiffness == np.inf
