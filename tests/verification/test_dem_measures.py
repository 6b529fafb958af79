"""Measures of a sample against closed forms, exact counts, quadrature and other code."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise, product
from math import comb, factorial

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Material, Simulation, Solver
from fenchel.dem.homogenise import fit_sums, moments
from fenchel.dem.measures import (
    SUMMARY,
    Network,
    accumulated_gradient,
    active_length,
    angle_of_repose,
    anisotropy,
    bead_slip,
    best_fit_gradient,
    boundary_gradient,
    contact_counts,
    contact_fabric,
    coordination,
    delaunay_cells,
    delaunay_gradient,
    expected_longest_run,
    fabric,
    force_distribution,
    force_values,
    mobilised_friction,
    permutation_test,
    phase_mismatch,
    rattlers,
    shared_volume,
    sliding_fraction,
    solid_fraction,
    straightness,
    strong_contacts,
    summary,
    wire_fabric,
    wire_fabric_interval,
    wire_isotropy_test,
)
from fenchel.dem.packing import densify
from fenchel.dem.record import _best_fit_strain, mandel
from fenchel.errors import InputError


def touching(x: np.ndarray, radius: float | np.ndarray, **other) -> Network:
    """Bodies whose contacts are the pairs that touch, each under 1 N; no walls, no box."""
    n, d = x.shape
    radius = np.broadcast_to(radius, n).astype(float)
    i, j = np.triu_indices(n if radius.max() > 1e-9 else 0, 1)  # wires alone touch nothing
    near = np.linalg.norm(x[i] - x[j], axis=1) < (radius[i] + radius[j]) * (1.0 + 1e-9)
    pair = np.stack([i[near], j[near]], axis=1)
    branch = x[pair[:, 0]] - x[pair[:, 1]]
    wire = other.pop("wire", np.full(n, -1))
    rank = other.pop("rank", np.zeros(n, dtype=int))
    beads = np.flatnonzero(wire >= 0)
    same = wire[beads[1:]] == wire[beads[:-1]]
    link = np.stack([beads[:-1][same], beads[1:][same]], axis=1)
    values = {
        "normal_force": np.ones(len(pair)),
        "tangential_force": np.zeros((len(pair), d)),
        "friction": np.full(len(pair), 0.5),
        "wall": np.zeros((0, 2), dtype=int),
        "wall_force": np.zeros(0),
        "wall_normal": np.zeros((0, d)),
        "tension": np.zeros(len(link)),
    }
    return Network(
        x=x,
        radius=radius,
        wire=wire,
        rank=rank,
        velocity=np.zeros((n, d)),
        fixed=np.zeros(n, dtype=bool),
        half=np.full(d, np.inf),
        pair=pair,
        normal=branch / np.linalg.norm(branch, axis=1, keepdims=True),
        link=link,
        time=0.0,
        **(values | other),
    )


def wires_of(walks: np.ndarray, tension: np.ndarray) -> Network:
    """Wires alone, walks (w, b, d), with tensions (w, b − 1)."""
    count, beads, d = walks.shape
    return touching(
        walks.reshape(-1, d),
        1e-12,
        wire=np.repeat(np.arange(count), beads),
        rank=np.tile(np.arange(beads), count),
        tension=tension.ravel(),
    )


@pytest.fixture(scope="module")
def loaded() -> tuple[Simulation, dict[str, float], Network]:
    """A small sample with wires under load and sheared, and the measures of its last step."""
    rng = np.random.default_rng(3)
    a = densify(
        rng,
        rng.uniform(0.75e-3, 1.39e-3, 150),
        wire_count=8,
        beads=12,
        spacing=1.07e-3,
        bead_radius=0.43e-3,
        solid_fraction=0.58,
    )
    law = Material(
        friction=0.4, bead_friction=0.3, normal_stiffness=4.3e4, tangential_stiffness=3.4e4, wire_stiffness=100.0
    )
    simulation = Simulation(a, law, Solver(tolerance=1e-8, sweep_limit=5000))
    drive = Drive(pressure=np.full(3, 5e4))
    for _ in range(60):
        simulation.advance(2.4e-5, drive)
        a.velocity *= 0.9
    drive.rate[2] = -0.02 * a.half[2]
    measures = {}
    for _ in range(40):
        measures = simulation.advance(2.4e-5, drive)
    return simulation, measures, Network.of_simulation(simulation)


# --- the network


def test_the_network_is_what_the_step_solved(loaded) -> None:
    simulation, _, network = loaded
    rows = simulation.contacts
    closed = rows.contact[:, 3:6] @ np.ones(3) != 0.0
    row = rows.contact[closed]
    np.testing.assert_array_equal(network.pair, rows.pair[closed])
    np.testing.assert_allclose(network.normal, row[:, :3], atol=1e-11)
    force = network.normal_force[:, None] * network.normal + network.tangential_force
    np.testing.assert_allclose(force, row[:, 3:6] / rows.step, atol=1e-9 * network.normal_force.max())
    np.testing.assert_array_equal(network.friction, row[:, 12])
    assert set(np.unique(network.friction)) == {0.3, 0.4}
    np.testing.assert_allclose(network.tension, rows.link_row[:, 3] / rows.step, rtol=1e-12)
    # the stress of the box from the network alone, in equilibrium or not: contacts, walls, links
    whole = np.einsum("ki,kj->ij", force, network.x[network.pair[:, 1]] - network.x[network.pair[:, 0]])
    vector = network.link_vector
    whole += np.einsum("k,ki,kj->ij", network.tension / network.link_length, vector, vector)
    for body, push, normal in zip(network.wall[:, 0], network.wall_force, network.wall_normal, strict=True):
        whole += push * np.outer(normal, -normal * (normal @ network.x[body] + network.half @ np.abs(normal)))
    expected = moments(simulation.assembly, rows, 1.0)[:, 8].sum(axis=0)
    assert np.linalg.norm(whole - expected) < 1e-9 * np.linalg.norm(expected)


def test_a_sample_without_steps_has_no_forces() -> None:
    a = Assembly.of_spheres(np.zeros((1, 3)), np.ones(1), np.ones(1), np.full(3, 2.0))
    network = Network.of_assembly(a)
    assert len(network.pair) == len(network.link) == len(network.wall) == 0
    assert np.isnan(contact_fabric(network)).all() and coordination(network).mean == 0.0
    with pytest.raises(InputError, match="no step yet"):
        Network.of_simulation(Simulation(a, Material(), Solver()))
    with pytest.raises(InputError, match="no force"):
        force_distribution(force_values(network))
    with pytest.raises(InputError, match="grain_grain"):
        contact_fabric(network, kind="sand")


def test_counts_by_kind(loaded) -> None:
    simulation, _, network = loaded
    rows = simulation.contacts
    expected = dict.fromkeys(("grain_grain", "grain_bead", "bead_bead", "grain_wall", "bead_wall"), 0)
    bead = simulation.assembly.wire >= 0
    for (i, j), row in zip(rows.pair, rows.contact, strict=True):
        if row[:3] @ row[3:6] > 0.0:
            expected[("grain_grain", "grain_bead", "bead_bead")[int(bead[i]) + int(bead[j])]] += 1
    for (i, _, _), row in zip(rows.wall, rows.wall_row, strict=True):
        if row[0] > 0.0:
            expected["bead_wall" if bead[i] else "grain_wall"] += 1
    counts = contact_counts(network)
    assert {k: counts[k] for k in expected} == expected and min(expected.values()) >= 0 and expected["grain_bead"] > 10
    assert counts["link_taut"] + counts["link_slack"] == len(rows.link) and counts["link_taut"] > 0


# --- fabric


@pytest.mark.parametrize("d", [2, 3])
def test_fabric_of_a_known_density_of_directions(d: int) -> None:
    """E(n) ∝ 1 + n·D n integrated by quadrature that is exact for it."""
    rng = np.random.default_rng(1)
    s = rng.normal(size=(d, d))
    deviator = 0.1 * (s + s.T - 2.0 * np.trace(s) / d * np.eye(d))
    turn = 2.0 * np.pi * (np.arange(16) + 0.5) / 16
    if d == 3:
        node, weight = np.polynomial.legendre.leggauss(8)
        z, t = np.meshgrid(node, turn, indexing="ij")
        n = np.stack([np.sqrt(1 - z**2) * np.cos(t), np.sqrt(1 - z**2) * np.sin(t), z], axis=-1).reshape(-1, 3)
        w = np.repeat(weight, 16)
    else:
        n, w = np.stack([np.cos(turn), np.sin(turn)], axis=1), np.ones(16)
    found = fabric(3.7 * n, w * (1.0 + np.einsum("ki,ij,kj->k", n, deviator, n)))
    assert np.trace(found) == pytest.approx(1.0, abs=1e-14)
    read, values = anisotropy(found)
    np.testing.assert_allclose(read, deviator, atol=1e-13)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(deviator), atol=1e-13)


def test_wire_fabric_is_weighed_by_length_and_tension() -> None:
    walks = np.array([[[0, 0, 0], [2.0, 0, 0], [2.0, 1.0, 0]], [[5.0, 5, 5], [5, 5, 6], [5, 5, 6.5]]])
    network = wires_of(walks, np.array([[1.0, 0.0], [3.0, -1.0]]))
    np.testing.assert_allclose(wire_fabric(network), np.diag([2.0, 1.0, 1.5]) / 4.5, atol=1e-15)
    np.testing.assert_allclose(wire_fabric(network, by_tension=True), np.diag([2.0, 0.0, 3.0]) / 5.0, atol=1e-15)


def persistent(rng: np.random.Generator, count: int, beads: int, flat: float) -> np.ndarray:
    heading = rng.normal(size=(count, 3)) * np.array([1, 1, flat])
    steps = np.empty((count, beads - 1, 3))
    for k in range(beads - 1):
        heading = heading / np.linalg.norm(heading, axis=1, keepdims=True)
        steps[:, k] = heading
        heading = heading + 0.2 * rng.normal(size=(count, 3)) * np.array([1, 1, flat])
    return np.concatenate([np.zeros((count, 1, 3)), np.cumsum(steps, axis=1)], axis=1) + 100.0 * rng.random(
        (count, 1, 3)
    )


def test_isotropy_of_wires_is_decided_by_wires_and_not_by_segments() -> None:
    """Persistent wires: p is uniform without preferred direction, although the segments alone would be far from isotropic."""
    rng = np.random.default_rng(7)
    p, covered = [], 0
    for _ in range(40):
        network = wires_of(persistent(rng, 30, 20, 1.0), np.zeros((30, 19)))
        p.append(wire_isotropy_test(network, rng, samples=99).p_value)
        low, high = wire_fabric_interval(network, rng, samples=300)
        covered += bool(low[2, 2] < 1.0 / 3.0 < high[2, 2])
    assert 0.3 < np.mean(p) < 0.7 and np.mean(np.array(p) < 0.1) < 0.3
    assert covered >= 33  # 95 % nominal; percentile intervals of 30 wires are a little short
    flat = wires_of(persistent(rng, 30, 20, 0.3), np.zeros((30, 19)))
    assert wire_isotropy_test(flat, rng, samples=99).p_value == pytest.approx(0.01)
    low, high = wire_fabric_interval(flat, rng)
    assert high[2, 2] < 1.0 / 3.0 and low[2, 2] < wire_fabric(flat)[2, 2] < high[2, 2]
    assert np.all(low <= high)


# --- coordination

LATTICES = {
    "cubic": (np.eye(3), 6),
    "face-centred": (np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2), 12),
    "body-centred": (np.array([[1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3), 8),
    "hexagonal 2D": (np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]]), 6),
    "square 2D": (np.eye(2), 4),
}


@pytest.mark.parametrize("name", LATTICES)
def test_coordination_and_fabric_of_lattices(name: str) -> None:
    basis, expected = LATTICES[name]
    d = len(basis)
    x = np.array(list(product(range(-3, 4), repeat=d))) @ basis
    network = touching(x, 0.5)
    found = coordination(network)
    inner = np.linalg.norm(x, axis=1) < 1.2
    assert np.all(found.by_body[inner] == expected) and inner.sum() > d
    assert found.mean == pytest.approx(2.0 * len(network.pair) / len(x))
    core = inner[network.pair].any(axis=1) & (np.linalg.norm(x[network.pair].mean(axis=1), axis=1) < 0.6)
    np.testing.assert_allclose(fabric(network.normal[core]), np.eye(d) / d, atol=1e-14)


def test_rattlers_are_what_the_largest_core_leaves() -> None:
    """The core is the union of all sets in which everybody has enough contacts: by trying every set."""
    rng = np.random.default_rng(2)
    for trial in range(9):
        n, least = 8, 2 + trial % 3
        every = np.array(list(combinations(range(n), 2)))
        pair = every[rng.random(len(every)) < 0.45]
        wall = np.stack([rng.integers(0, n, 3), rng.integers(0, 6, 3)], axis=1)
        base = touching(rng.random((n, 3)), 1e-9)
        network = replace(base, pair=pair, wall=wall, normal_force=np.ones(len(pair)))
        core: set[int] = set()
        for size in range(1, n + 1):
            for group in map(set, combinations(range(n), size)):
                degree = {
                    b: sum(b in p and set(p.tolist()) <= group for p in pair) + int(np.sum(wall[:, 0] == b))
                    for b in group
                }
                if all(value >= least for value in degree.values()):
                    core |= group
        loose = rattlers(network, least=least)
        assert set(np.flatnonzero(~loose).tolist()) == core
        found = coordination(network, least=least)
        kept = sorted(core)
        inside = sum(set(p.tolist()) <= core for p in pair)
        on_wall = sum(b in core for b in wall[:, 0].tolist())
        if kept:
            assert found.without_rattlers == pytest.approx((2 * inside + on_wall) / len(kept))
        assert found.rattler_fraction == pytest.approx(1.0 - len(kept) / n)
        assert found.surplus == inside + on_wall - 3 * len(kept)


def test_two_contacts_hold_with_friction_and_d_plus_one_without() -> None:
    """A grain on two others, all of them between walls: with friction an arch, without it the keystone slips through in space."""
    x = np.array([[-0.9, 0.0, 0.0], [0.9, 0.0, 0.0], [0.0, 0.0, np.sqrt(1 - 0.81)]])
    wall = np.array([[0, 0], [0, 2], [0, 4], [1, 1], [1, 2], [1, 4]])
    arch = replace(touching(x, 0.5), wall=wall)
    assert not rattlers(arch).any()
    smooth = replace(arch, friction=np.zeros(2))
    assert rattlers(smooth).tolist() == [True, True, True]  # without the keystone the others have three contacts only
    assert rattlers(smooth, least=3).tolist() == [False, False, True]


def test_a_bead_is_held_by_taut_links_and_a_fixed_body_never_rattles() -> None:
    walks = np.array([[[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]])
    taut = wires_of(walks, np.array([[1.0, 1.0]]))
    assert rattlers(taut, least=2).all() and not rattlers(taut, least=1).any()
    held = replace(taut, fixed=np.array([True, False, True]))
    assert not rattlers(held, least=2).any()
    assert rattlers(replace(held, tension=np.array([1.0, 0.0])), least=2).tolist() == [False, True, False]
    assert coordination(held, phase="beads").mean == 0.0


# --- sliding and force distributions


def test_sliding_is_what_the_residual_counts(loaded) -> None:
    """Separate code counts contacts on the cone, with walls (no friction) among all."""
    _, measures, network = loaded
    on = sliding_fraction(network) * len(network.pair)
    assert measures["sliding"] > 0.05
    found = np.array([on, on + len(network.wall)]) / measures["closed"]
    assert np.abs(found - measures["sliding"]).min() < 2.5 / measures["closed"]
    assert np.all(mobilised_friction(network) <= 1.0 + 1e-12)


def test_sliding_up_to_the_tolerance() -> None:
    x = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]])
    t = np.array([0.5, 0.5 * (1 - 1e-7), 0.5 * (1 - 1e-3), 0.0])
    network = touching(x, 0.5, tangential_force=np.stack([0 * t, t, 0 * t], axis=1))
    assert sliding_fraction(network) == 0.5 and sliding_fraction(network, tolerance=1e-2) == 0.75
    assert sliding_fraction(network, tolerance=0.0) == 0.25
    np.testing.assert_allclose(mobilised_friction(network), t / 0.5)
    smooth = replace(network, friction=np.array([0.0, 0.5, 0.5, 0.5]))
    assert sliding_fraction(smooth) == pytest.approx(1.0 / 3.0)
    with pytest.raises(InputError, match="not known"):
        sliding_fraction(replace(network, friction=np.full(4, np.nan)))


def test_distribution_of_exponential_forces() -> None:
    n = 200_000
    force = -3.0 * np.log(1.0 - (np.arange(n) + 0.5) / n)
    found = force_distribution(force)
    assert found.mean == pytest.approx(3.0, rel=1e-4) and found.count == n
    exact = -np.diff(np.exp(-found.edges)) / np.diff(found.edges)
    np.testing.assert_allclose(found.density, exact, rtol=2e-3, atol=1.0 / (n * 0.2))
    for k in (2, 3, 4):
        assert found.moments[k] == pytest.approx(factorial(k), rel=5e-3)
    assert found.participation == pytest.approx(0.5, rel=1e-3) and found.decay == pytest.approx(1.0, rel=1e-3)
    one = force_distribution(np.array([0.0, 0.0, 5.0, 0.0]))
    assert one.participation == pytest.approx(0.25)
    equal = force_distribution(np.full(7, 2.0))
    assert equal.participation == pytest.approx(1.0) and np.isnan(equal.decay)


def test_forces_by_kind(loaded) -> None:
    _, _, network = loaded
    parts = [force_values(network, kind=kind) for kind in ("grain_grain", "grain_bead", "bead_bead")]
    assert sum(len(part) for part in parts) == len(network.pair)
    assert sum(part.sum() for part in parts) == pytest.approx(network.normal_force.sum())
    strong = strong_contacts(network)
    assert 0.2 < strong.mean() < 0.5  # fewer than half of the contacts carry more than the mean
    tangential = force_values(network, "tangential")
    assert np.all(tangential <= network.friction * network.normal_force * (1 + 1e-9))
    assert np.all(force_values(network, "tension") > 0.0)
    with pytest.raises(InputError, match="tension"):
        force_values(network, "shear")


# --- solid fraction


@pytest.mark.parametrize("d", [2, 3])
def test_shared_volume_against_quadrature(d: int) -> None:
    from scipy.integrate import quad

    rng = np.random.default_rng(4)
    for _ in range(60):
        big, small, apart = rng.uniform(0.2, 1.5, 3)

        def cut(s: float, big: float = big, small: float = small, apart: float = apart) -> float:
            """Of the smaller of the two sections at s along the line of centres: concentric in both dimensions."""
            a, b = max(0.0, big**2 - s**2), max(0.0, small**2 - (s - apart) ** 2)
            return np.pi * min(a, b) if d == 3 else 2.0 * np.sqrt(min(a, b))

        ends = sorted(
            {-big, big, apart - small, apart + small, np.clip((big**2 - small**2 + apart**2) / (2 * apart), -9, 9)}
        )
        expected = sum(quad(cut, *span, limit=200, epsabs=1e-11)[0] for span in pairwise(ends))
        found = shared_volume(np.array([apart]), np.array([small]), big, dimension=d)[0]
        assert found == pytest.approx(expected, abs=2e-8)


def test_solid_fraction_of_a_crystal() -> None:
    """The mean over all places of the centre is that of the crystal, however small the sphere."""
    basis, _ = LATTICES["face-centred"]
    x = np.array(list(product(range(-6, 7), repeat=3))) @ basis
    network = touching(x[np.linalg.norm(x, axis=1) < 4.2], 0.5)
    shift = (np.array(list(product(range(8), repeat=3))) + 0.5) / 8 @ basis
    mean = np.mean([solid_fraction(network, 1.3, centre=c - basis.sum(axis=0) / 2) for c in shift])
    assert mean == pytest.approx(np.pi / np.sqrt(18), rel=2e-4)
    assert solid_fraction(network, 0.3) == pytest.approx(1.0)
    boxed = replace(network, half=np.full(3, 1.0))
    with pytest.raises(InputError, match="sticks out"):
        solid_fraction(boxed, 1.1)
    with pytest.raises(InputError, match="positive"):
        solid_fraction(network, 0.0)


def test_phases_share_the_solid_fraction(loaded) -> None:
    _, _, network = loaded
    sphere = 0.9 * network.half.min()
    both = solid_fraction(network, sphere, phase="grains") + solid_fraction(network, sphere, phase="beads")
    assert solid_fraction(network, sphere) == pytest.approx(both, rel=1e-12) and 0.5 < both < 0.75


# --- strain


@pytest.mark.parametrize("d", [2, 3])
def test_strains_are_exact_on_affine_fields_and_bagi_depends_on_the_hull_alone(d: int) -> None:
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(5)
    x = 1e-3 * rng.normal(size=(300, d)) + 7.0
    gradient = rng.normal(size=(d, d))
    u = x @ gradient.T + 3.0
    scale = np.abs(gradient).max()
    for measure in (delaunay_gradient, boundary_gradient):
        np.testing.assert_allclose(measure(x, u)[0], gradient, atol=3e-12 * scale)
    np.testing.assert_allclose(best_fit_gradient(x, u), gradient, atol=3e-12 * scale)
    # any field, any flat cells left out: volume average = boundary average
    noise = u + 1e-4 * rng.normal(size=u.shape)
    for quality in (0.0, 1e-3, 0.05):
        inner, volume = delaunay_gradient(x, noise, quality=quality)
        outer, again = boundary_gradient(x, noise, quality=quality)
        np.testing.assert_allclose(inner, outer, atol=1e-12 * np.abs(inner).max())
        assert volume == pytest.approx(again, rel=1e-12)
    hull = ConvexHull(x - 7.0)
    assert delaunay_gradient(x, noise, quality=0.0)[1] == pytest.approx(hull.volume, rel=1e-12)
    moved = noise.copy()
    inside = np.setdiff1d(np.arange(len(x)), hull.vertices)
    moved[inside] += rng.normal(size=(len(inside), d))
    np.testing.assert_allclose(
        delaunay_gradient(x, moved, quality=0.0)[0], delaunay_gradient(x, noise, quality=0.0)[0], atol=2e-9
    )


def test_best_fit_is_that_of_the_record() -> None:
    rng = np.random.default_rng(6)
    x, u = rng.normal(size=(2, 100, 3))
    sums = fit_sums(x, u, np.ones(100, dtype=bool), np.zeros(100, dtype=np.int64)).sum(axis=0)
    np.testing.assert_allclose(mandel(best_fit_gradient(x, u)), _best_fit_strain(sums[None])[0], atol=1e-12)


def test_quality_of_cells() -> None:
    regular = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert (
        len(delaunay_cells(regular, quality=1.0 - 1e-12)) == 1
        and len(delaunay_cells(regular, quality=1.0 + 1e-12)) == 0
    )
    triangle = np.array([[0.0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
    assert len(delaunay_cells(triangle, quality=1.0 - 1e-12)) == 1
    # stretched by s along one axis: quality s / ((2 + s²)/3)^1.5 for the regular tetrahedron with edges along the diagonals of a cube
    s = 1e-2
    stretched = regular * np.array([1.0, 1.0, s])
    expected = s / ((2.0 + s * s) / 3.0) ** 1.5
    assert len(delaunay_cells(stretched, quality=expected * 0.999)) == 1
    assert len(delaunay_cells(stretched, quality=expected * 1.001)) == 0
    with pytest.raises(InputError, match="plane"):
        delaunay_cells(np.random.default_rng(0).random((20, 3)) * np.array([1.0, 1.0, 0.0]))
    with pytest.raises(InputError, match="plane"):
        best_fit_gradient(*(np.random.default_rng(0).random((2, 20, 3)) * np.array([1.0, 1.0, 0.0])))
    with pytest.raises(InputError, match="needs 4"):
        best_fit_gradient(np.zeros((3, 3)), np.zeros((3, 3)))


def test_accumulated_strain_tends_to_the_logarithm_at_first_order() -> None:
    rng = np.random.default_rng(8)
    x = rng.random((60, 3))
    errors = []
    for frames in (20, 40):
        path = [x * np.array([np.exp(-0.2 * t), 1.0, np.exp(0.1 * t)]) for t in np.linspace(0, 1, frames + 1)]
        found = accumulated_gradient(path, delaunay_gradient)
        np.testing.assert_allclose(found, accumulated_gradient(path), atol=1e-12)
        errors.append(np.abs(found - np.diag([-0.2, 0.0, 0.1])).max())
    assert errors[0] < 1.1e-3 and errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)


def test_mismatch_of_phases() -> None:
    rng = np.random.default_rng(9)
    x = rng.normal(size=(400, 3))
    wire = np.where(np.arange(400) < 250, -1, np.arange(400) // 10)
    sand, wires = np.diag([1e-3, 1e-3, -4e-3]), np.diag([1e-3, 1e-3, -3e-3])
    u = np.where((wire >= 0)[:, None], x @ wires, x @ sand)
    exact = np.linalg.norm(sand - wires) / np.linalg.norm(sand)
    found = phase_mismatch(x, u, wire, rng, samples=50)
    assert found.mismatch == pytest.approx(exact, rel=1e-9) and found.high - found.low < 1e-9 and found.noise < 1e-9
    quiet = [phase_mismatch(x, u + 5e-4 * rng.normal(size=x.shape), wire, rng, samples=100) for _ in range(20)]
    assert sum(m.low < exact < m.high for m in quiet) >= 15
    # a norm of something noisy is too large; most of that is taken off
    loud = [phase_mismatch(x, u + 4e-3 * rng.normal(size=x.shape), wire, rng, samples=100) for _ in range(30)]
    raw, corrected = (np.mean([getattr(m, name) ** 2 for m in loud]) for name in ("mismatch", "corrected"))
    assert raw > 1.3 * exact**2 and abs(corrected - exact**2) < 0.4 * (raw - exact**2)
    assert all(m.corrected <= m.mismatch and m.noise > 0.0 for m in loud)
    with pytest.raises(InputError, match="2 wires"):
        phase_mismatch(x, u, np.where(wire < 0, -1, 0), rng)


def test_slip_of_beads_against_grains() -> None:
    rng = np.random.default_rng(10)
    x = rng.random((80, 3))
    wire = np.where(np.arange(80) >= 20, -1, 0)
    u = np.full((80, 3), 2.0)
    np.testing.assert_allclose(bead_slip(x, u, wire), 0.0, atol=1e-14)
    u[5] += [0.0, 0.5, 0.0]
    slip = bead_slip(x, u, wire)
    assert np.linalg.norm(slip, axis=1).sum() == pytest.approx(0.5) and slip[5, 1] == pytest.approx(0.5)
    # the neighbours are the nearest: by brute force
    u = rng.random((80, 3))
    distance = np.linalg.norm(x[:20, None] - x[None, 20:], axis=2)
    expected = u[:20] - u[20:][np.argsort(distance, axis=1)[:, :4]].mean(axis=1)
    np.testing.assert_allclose(bead_slip(x, u, wire), expected, atol=1e-14)


# --- characteristic length


def chain(tension: np.ndarray, spacing: float = 1.0) -> Network:
    """Straight wires (w, links) side by side."""
    count, links = tension.shape
    walks = np.zeros((count, links + 1, 3))
    walks[:, :, 0] = spacing * np.arange(links + 1)
    walks[:, :, 1] = 5.0 * np.arange(count)[:, None]
    return wires_of(walks, tension)


def by_hand(network: Network, m: float) -> float:
    """The pass along every wire of the definition."""
    length = network.link_length
    mean = sum(abs(p) * d for p, d in zip(network.tension, length, strict=True)) / length.sum()
    best = run = 0.0
    before = -1
    for wire, p, d in zip(network.link_wire, network.tension, length, strict=True):
        if wire != before:
            run = 0.0
        before = wire
        run = run + d if abs(p) >= m * mean else 0.0
        best = max(best, run)
    return best


def test_active_length_by_hand_and_its_properties() -> None:
    rng = np.random.default_rng(11)
    tension = rng.exponential(size=(12, 30)) * (rng.random((12, 30)) < 0.6)
    network = chain(tension)
    x = network.x + 0.2 * rng.random(network.x.shape)
    network = replace(network, x=x)
    found = [active_length(network, m=m).length for m in (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)]
    np.testing.assert_allclose(found, [by_hand(network, m) for m in (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)], rtol=1e-12)
    assert np.all(np.diff(found) <= 0.0) and found[2] > 0.0
    per_wire = np.bincount(network.link_wire, weights=network.link_length)
    assert found[0] == pytest.approx(per_wire.max(), rel=1e-12)
    scaled = replace(network, tension=1e-7 * network.tension)
    assert active_length(scaled).length == active_length(network).length
    above = network.tension.max() / active_length(network).mean_tension
    assert active_length(network, m=above * (1 + 1e-9)).length == 0.0
    assert active_length(network, m=above * (1 - 1e-9)).links == 1
    # over taut links alone the mean is larger, by the share of taut length
    taut = active_length(network, taut_only=True)
    share = network.link_length[network.tension > 0].sum() / network.link_length.sum()
    assert taut.mean_tension * share == pytest.approx(active_length(network).mean_tension, rel=1e-12)
    slack = replace(network, tension=np.zeros(len(network.tension)))
    assert active_length(slack).length == 0.0 and active_length(slack, m=0.0).length == pytest.approx(per_wire.max())
    with pytest.raises(InputError, match="no links"):
        active_length(touching(np.zeros((1, 3)), 1.0))


def exact_longest_run(n: int, k: int) -> float:
    """Mean longest run of k ones placed at random among n: P(longest ≤ r) = Σ_j (−1)^j C(n−k+1, j) C(n−j(r+1), n−k)/C(n, k)."""
    total, mean = comb(n, k), 0.0
    for r in range(k):
        ways = sum(
            (-1) ** j * comb(n - k + 1, j) * comb(n - j * (r + 1), n - k)
            for j in range(k // (r + 1) + 1)
            if n - j * (r + 1) >= 0
        )
        at_most = ways / total
        mean += 1.0 - at_most
        if at_most > 1.0 - 1e-12:
            break
    return mean


def test_null_model_of_the_longest_run() -> None:
    """10⁴ links of exponential tension: 3.05 by the leading term; the permutation mean is the exact one of placing ones at random."""
    assert expected_longest_run(10_000, np.exp(-3.0)) == pytest.approx(3.05, abs=0.005)
    rng = np.random.default_rng(12)
    network = chain(rng.exponential(size=(1, 10_000)))
    found = active_length(network)
    assert found.links in (3, 4) and found.share == pytest.approx(np.exp(-3.0), rel=0.1)
    test = permutation_test(network, rng, samples=50)
    assert test.p_value > 0.05 and test.expected_links == pytest.approx(3.05, abs=0.2)
    network = chain(rng.exponential(size=(1, 1000)))
    share = active_length(network, m=2.0).share
    test = permutation_test(network, rng, samples=1000, m=2.0)
    assert test.null_mean == pytest.approx(exact_longest_run(1000, round(share * 1000)), abs=0.08)
    assert exact_longest_run(4, 2) == pytest.approx((3 * 2 + 3 * 1) / 6)  # of six placings three are adjacent


def test_permutation_finds_what_is_planted_and_nothing_else() -> None:
    rng = np.random.default_rng(13)
    p = [permutation_test(chain(rng.exponential(size=(20, 40))), rng, samples=99).p_value for _ in range(30)]
    assert np.mean(np.array(p) <= 0.05) < 0.2
    tension = rng.exponential(size=(20, 40))
    tension[7, 10:22] = 6.0
    network = chain(tension)
    found = active_length(network)
    assert found.length == pytest.approx(12.0, abs=1.5)
    assert permutation_test(network, rng, samples=199).p_value == pytest.approx(1.0 / 200.0)
    # one wire wholly taut: nothing to permute within it, but much over the network
    alone = np.full((20, 40), 0.1)
    alone[3] = 10.0
    assert permutation_test(chain(alone), rng, samples=99).p_value == 1.0
    assert permutation_test(chain(alone), rng, samples=99, within_wires=False).p_value == pytest.approx(0.01)


def test_straightness_of_arcs() -> None:
    """Regular polygons: chord over arc of n links turning by θ each is sin(nθ/2)/(n sin(θ/2))."""
    links, theta = 12, 0.3
    turn = theta * np.arange(links + 1)
    arc = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    line = np.stack([3.0 + np.arange(links + 1), 0 * turn, 0 * turn], axis=1)
    network = wires_of(np.stack([arc, line]), np.array([np.zeros(links), np.ones(links)]))
    for n in (2, 3, 5):
        found = straightness(network, m=1.0, links=n)
        assert found.active == pytest.approx(1.0, abs=1e-12)
        assert found.inactive == pytest.approx(np.sin(n * theta / 2) / (n * np.sin(theta / 2)), rel=1e-12)
        assert found.active_pieces == found.inactive_pieces == links - n + 1


# --- angle of repose


def heap(rng: np.random.Generator, slope: float, radius: float, *, d: int = 3, oval: float = 1.0, cut: float = 1.0):
    """Bodies dense and in no order under a cone (a roof in the plane) of height 1 and the slope given [degrees]: tops at most there.

    Cut off at the height `cut`.
    """
    reach = 1.0 / np.tan(np.radians(slope))
    axes = [np.arange(-reach, reach, 2.0 * radius)] * (d - 1) + [np.arange(radius, 1.0, 2.0 * radius)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    x += rng.uniform(-radius, radius, x.shape)
    far = np.linalg.norm(x[:, :-1], axis=1)
    x = x[x[:, -1] + radius <= np.minimum(1.0 - far / reach, cut)]
    x[:, 0] *= oval
    return x, np.full(len(x), radius)


@pytest.mark.parametrize("slope", [12.0, 25.0, 38.0])
def test_angle_of_a_cone(slope: float) -> None:
    rng = np.random.default_rng(14)
    found = angle_of_repose(*heap(rng, slope, 0.03))
    assert found.angle == pytest.approx(slope, abs=1.0)
    assert found.low < found.angle < found.high and found.high - found.low < 4.0
    assert found.height == pytest.approx(1.0, abs=0.12)
    assert found.reach == pytest.approx(1.0 / np.tan(np.radians(slope)), rel=0.12)
    assert np.all(np.diff(found.profile[:-2]) < 0.0)


def test_top_and_toe_do_not_count() -> None:
    rng = np.random.default_rng(16)
    x, _ = heap(rng, 30.0, 0.02, cut=0.6)
    skirt = np.concatenate([rng.uniform(-4.0, 4.0, (20_000, 2)), np.full((20_000, 1), 0.02)], axis=1)
    found = angle_of_repose(np.concatenate([x, skirt]), np.full(len(x) + len(skirt), 0.02))
    assert found.angle == pytest.approx(30.0, abs=1.5) and found.height == pytest.approx(0.6, abs=0.03)


def test_angle_of_a_roof_and_of_an_oval_heap() -> None:
    rng = np.random.default_rng(15)
    x, radius = heap(rng, 25.0, 0.01, d=2)
    flat = angle_of_repose(x + np.array([40.0, 7.0]), radius, floor=7.0)
    assert flat.angle == pytest.approx(25.0, abs=1.0) and len(flat.angles) == 2
    oval = angle_of_repose(*heap(rng, 25.0, 0.03, oval=1.6))
    assert oval.high - oval.low > 4.0  # it says that the deposit is not round
    with pytest.raises(InputError, match="fewer azimuths"):
        angle_of_repose(*heap(rng, 25.0, 0.2))


def test_the_summary_is_the_measures_one_by_one(loaded) -> None:
    _, _, network = loaded
    found = summary(network, samples=19)
    assert list(found) == list(SUMMARY) and not any(np.isnan(value) for value in found.values())
    assert found["coordination"] == coordination(network).mean and found["sliding"] == sliding_fraction(network)
    assert (
        found["fabric_zz"] == contact_fabric(network)[2, 2] and found["active_length"] == active_length(network).length
    )
    assert found["solid_fraction_sphere"] == solid_fraction(network, 0.8 * network.half.min())
    assert found["strong"] == strong_contacts(network).mean()
    empty = summary(Network.of_assembly(Assembly.of_spheres(np.zeros((1, 3)), np.ones(1), np.ones(1))))
    assert list(empty) == list(SUMMARY) and empty["coordination"] == 0.0 and np.isnan(empty["active_length"])
