"""Samples: distributions against quadrature, wire density and layout, isotropic states at a chosen friction and density."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fenchel.dem.homogenise import wall_stress
from fenchel.dem.measures import Network, anisotropy, wire_fabric
from fenchel.dem.preparation import material_of
from fenchel.dem.samples import (
    LogNormal,
    Sieve,
    UniformByNumber,
    UniformByVolume,
    draw_radii,
    isotropic_state,
    lay_layers,
    random_sample,
    wire_count_of,
)
from fenchel.dem.scene import Grains, Sample
from fenchel.dem.stepping import Drive, Simulation, Solver
from fenchel.errors import InputError

SAND = Sieve(opening=(0.5e-3, 1.0e-3, 1.4e-3, 2.0e-3, 2.8e-3), passing=(0.0, 0.1, 0.55, 0.9, 1.0))
SIZES = {
    "number": UniformByNumber(small=0.7e-3, large=1.3e-3),
    "volume": UniformByVolume(small=0.3e-3, large=1.5e-3),
    "log-normal": LogNormal(median=0.8e-3, spread=0.35),
    "sieve": SAND,
}


@pytest.mark.parametrize("name", SIZES)
def test_mass_curve_is_the_integral_of_the_numbers(name: str) -> None:
    """∫ r³ dN over the quantiles by the midpoint rule, against the closed form of the mass finer."""
    sizes = SIZES[name]
    n = 400_000
    r = sizes.quantile((np.arange(n) + 0.5) / n)
    assert np.all(np.diff(r) >= 0.0)
    mass = np.cumsum(r**3) / np.sum(r**3)
    at = np.linspace(1000, n - 1000, 60).astype(int)
    np.testing.assert_allclose(sizes.finer(r[at]), mass[at], atol=2e-4)
    assert sizes.finer(np.array([0.5 * r[0], 2.0 * r[-1]])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("name", SIZES)
def test_drawn_radii_follow_number_and_mass(name: str) -> None:
    sizes = SIZES[name]
    n = 4000
    r = draw_radii(sizes, np.random.default_rng(1), n)
    assert not np.all(np.diff(r) > 0.0)  # in no order
    edges = sizes.quantile(np.arange(n + 1) / n)
    assert np.all(
        (np.sort(r) >= edges[:-1] * (1 - 1e-12)) & (np.sort(r) <= edges[1:] * (1 + 1e-12))
    )  # one in each stratum
    s = np.sort(r)
    np.testing.assert_allclose(np.cumsum(s**3) / np.sum(s**3), sizes.finer(s), atol=0.01)


def test_the_sieve_curve_is_met_at_its_openings() -> None:
    r = draw_radii(SAND, np.random.default_rng(2), 5000)
    for opening, passing in zip(SAND.opening, SAND.passing, strict=True):
        assert np.sum(r[2 * r <= opening] ** 3) / np.sum(r**3) == pytest.approx(passing, abs=0.01)


def test_distributions_that_are_none() -> None:
    for opening, passing in {
        (1e-3, 2e-3): (0.0, 90.0),
        (2e-3, 1e-3): (0.0, 1.0),
        (1e-3, 2e-3, 3e-3): (0.0, 1.0),
        (1e-3, 2e-3, 4e-3): (0.0, 0.6, 0.4),
    }.items():
        with pytest.raises(InputError, match="sizes"):
            Sieve(opening=opening, passing=passing)
    with pytest.raises(InputError, match="smallest"):
        UniformByVolume(small=2e-3, large=1e-3)
    with pytest.raises(InputError, match="positive median"):
        LogNormal(median=-1.0, spread=0.2)
    assert np.ptp(draw_radii(UniformByVolume(small=1e-3, large=1e-3), np.random.default_rng(0), 5)) == 0.0
    gap = Sieve(
        opening=(1e-3, 2e-3, 3e-3, 4e-3), passing=(0.0, 0.5, 0.5, 1.0)
    )  # gap-graded: no grain in the middle class
    r = draw_radii(gap, np.random.default_rng(0), 2000)
    assert not np.any((r > 1.0001e-3) & (r < 1.4999e-3)) and np.any(r > 1.5e-3)


@pytest.mark.parametrize("laying", ["walks", "layers"])
def test_a_random_sample_has_the_density_of_grains_and_wires_that_was_asked_for(laying) -> None:
    rng = np.random.default_rng(3)
    a = random_sample(rng, SIZES["number"], 400, wire_density=1.5e5, beads=15, laying=laying, layers=5)
    assert a.solid_fraction() == pytest.approx(0.57, rel=1e-12)
    one = 14 * a.link_length[0] / a.volume
    assert np.sum(a.link_length) / a.volume == pytest.approx(1.5e5, abs=0.5 * one)
    assert a.wire_density() == pytest.approx(1.5e5, rel=0.1)  # links as they lie after densification
    assert np.all(a.mass[~a.is_bead] == pytest.approx(2600.0 * 4.0 / 3.0 * np.pi * a.radius[~a.is_bead] ** 3))
    i, j = np.triu_indices(len(a.x), 1)
    distance = np.linalg.norm(a.x[i] - a.x[j], axis=1)
    near = (a.radius[i] + a.radius[j] - distance) / np.minimum(a.radius[i], a.radius[j])
    tied = (a.wire[i] == a.wire[j]) & (a.wire[i] >= 0)
    assert near[~tied].max() < 0.6 and np.mean(near[~tied] > 0.05) < 1e-3
    assert np.all(np.abs(a.x) + a.radius[:, None] <= a.half * (1 + 1e-12))
    network = Network.of_assembly(a)
    upright = wire_fabric(network)[2, 2]
    if laying == "layers":
        assert upright < 0.2
    else:
        assert 0.2 < upright < 0.47 and np.abs(anisotropy(wire_fabric(network))[1]).max() < 1.5


def test_layers_before_densification() -> None:
    rng = np.random.default_rng(4)
    half = np.array([1.0, 2.0, 3.0])
    walks = lay_layers(rng, 40, 30, 0.2, half, layers=6, bend=0.25)
    height = walks[:, :, 2]
    assert np.ptp(height, axis=1).max() == 0.0
    np.testing.assert_allclose(np.unique(np.round(height, 12)), -3.0 + 6.0 * (np.arange(6) + 0.5) / 6)
    assert np.bincount(np.searchsorted(np.unique(height), height[:, 0])).tolist() == [7, 7, 7, 7, 6, 6]
    step = np.linalg.norm(np.diff(walks, axis=1), axis=2)
    inside = np.all(np.abs(walks) < half - 0.21, axis=2)
    np.testing.assert_allclose(step[inside[:, :-1] & inside[:, 1:]], 0.2, rtol=1e-12)
    assert np.all(np.abs(walks) <= half)
    # persistence: the mean cosine of successive steps of noise b in the plane is about 1 − b²/2
    move = np.diff(walks, axis=1)
    cosine = np.sum(move[:, 1:] * move[:, :-1], axis=2)[inside[:, :-2] & inside[:, 1:-1] & inside[:, 2:]] / 0.04
    assert cosine.mean() == pytest.approx(1.0 - 0.25**2 / 2.0, abs=0.01)


def test_wire_count_solves_for_the_density() -> None:
    number = dict(beads=20, spacing=1e-3, bead_radius=0.4e-3, solid_fraction=0.57)
    grains = 5e-6
    count = wire_count_of(2e5, grains, **number)
    volume = (grains + count * 20 * 4.0 / 3.0 * np.pi * (0.4e-3) ** 3) / 0.57
    assert count * 19e-3 / volume == pytest.approx(2e5, rel=0.6 / count)
    assert wire_count_of(0.0, grains, **number) == 0
    with pytest.raises(InputError, match="fill all space"):
        wire_count_of(1e7, grains, **number)
    with pytest.raises(InputError, match="≥ 0"):
        wire_count_of(-1.0, grains, **number)
    with pytest.raises(InputError, match="walks"):
        random_sample(np.random.default_rng(0), SIZES["number"], 50, laying="heaps")  # pyright: ignore[reportArgumentType]


GRAINS = Grains(count=150, normal_stiffness=4.3e4)
PRESSURE = 5e4


def test_isotropic_state_at_a_chosen_friction_and_density() -> None:
    start = Sample(solid_fraction=0.5)
    with pytest.raises(InputError, match="a looser start widens") as refused:
        isotropic_state(GRAINS, None, start, pressure=PRESSURE, seed=1, solid_fraction=0.7)
    dense, loose = map(float, re.findall(r"0\.5\d{3}", str(refused.value)))
    assert dense == pytest.approx(0.57, abs=0.03) and loose < dense - 0.01
    wanted = 0.5 * (loose + dense)
    found = isotropic_state(GRAINS, None, start, pressure=PRESSURE, seed=1, solid_fraction=wanted)
    assert found.solid_fraction == pytest.approx(wanted, abs=1e-3) and found.compaction_friction > 0.0
    assert found.assembly.solid_fraction() == found.solid_fraction
    # and it is at rest at this pressure under the friction of the grains
    simulation = Simulation(found.assembly, material_of(GRAINS, None), Solver(tolerance=1e-6))
    step = 0.05 * 2.0 * found.assembly.grain_radius * np.sqrt(GRAINS.density / PRESSURE)
    for _ in range(20):
        measures = simulation.advance(step, Drive(pressure=np.full(3, PRESSURE)))
    assert measures["unbalanced"] < 1e-2
    np.testing.assert_allclose(wall_stress(simulation.contacts), -PRESSURE, rtol=0.01)
    assert found.assembly.solid_fraction() == pytest.approx(found.solid_fraction, abs=5e-4)
