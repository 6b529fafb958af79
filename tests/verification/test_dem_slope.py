"""The slope deposit: its start, its rest (the floor carries the weight), and that it goes on bit for bit."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

from fenchel.cli import main
from fenchel.dem import Assembly, Material, Progress
from fenchel.dem.measures import coordination
from fenchel.dem.samples import UniformByNumber, random_sample
from fenchel.dem.slope import SlopeDeposit, slope_start
from fenchel.dem.slope_scene import QUALITY, read_slope_scene, run_slope
from fenchel.errors import ConvergenceError, InputError

RADIUS = 0.4e-3
DENSITY = 2600.0
LAW = Material(friction=0.5, bead_friction=0.5, wire_stiffness=100.0)


@pytest.fixture(scope="module")
def start() -> Assembly:
    sizes = UniformByNumber(small=0.7 * RADIUS, large=1.3 * RADIUS)
    block = random_sample(
        np.random.default_rng(2),
        sizes,
        120,
        wire_density=0.5 / (2.0 * RADIUS) ** 2,
        beads=12,
        laying="layers",
        layers=4,
    )
    return slope_start(block, density=DENSITY, reach=1.5)


@pytest.fixture(scope="module")
def settled(start: Assembly) -> SlopeDeposit:
    deposit = SlopeDeposit(start.copy(), LAW, density=DENSITY)
    while not deposit.done:
        deposit.advance()
    return deposit


def test_the_block_starts_free_of_overlap_above_a_hexagonal_floor(start: Assembly) -> None:
    fixed = np.isinf(start.mass)
    assert fixed.sum() > 100 and np.all(start.x[fixed, 2] == -start.radius[fixed][0])
    floor = start.x[fixed][:, :2]
    distance = np.linalg.norm(floor[:, None] - floor[None], axis=2) / (2.0 * start.radius[fixed][0])
    inner = np.all(np.abs(floor) < 0.5 * floor.max(axis=0), axis=1)
    assert np.all(np.sum(np.abs(distance[inner] - 1.0) < 1e-9, axis=1) == 6)  # touching, six neighbours
    i, j = np.triu_indices(len(start.x), 1)
    gap = np.linalg.norm(start.x[i] - start.x[j], axis=1) - start.radius[i] - start.radius[j]
    tied = (
        (start.wire[i] >= 0) & (start.wire[i] == start.wire[j]) & (np.abs(start.rank[i] - start.rank[j]) < start.apart)
    )
    assert gap[~tied & ~(fixed[i] & fixed[j])].min() > -3e-3 * RADIUS
    assert np.all(start.x[~fixed, 2] > start.radius[~fixed])
    np.testing.assert_allclose(start.mass[~fixed], DENSITY * 4.0 / 3.0 * np.pi * start.radius[~fixed] ** 3)  # beads too
    d = np.linalg.norm(start.x[start.links[:, 0]] - start.x[start.links[:, 1]], axis=1)
    np.testing.assert_allclose(start.link_length, d, rtol=1e-12)


def test_at_rest_the_floor_carries_the_weight(settled: SlopeDeposit) -> None:
    """Statics from outside: the vertical contact forces on the fixed bodies against the weight of all that lies on them."""
    network, a = settled.network(), settled.assembly
    force = network.normal_force[:, None] * network.normal + network.tangential_force
    total = np.zeros((len(a.x), 3))
    np.add.at(total, network.pair[:, 0], force)
    np.add.at(total, network.pair[:, 1], -force)
    vector = network.tension[:, None] * network.link_vector / network.link_length[:, None]
    np.add.at(total, network.link[:, 0], vector)
    np.add.at(total, network.link[:, 1], -vector)
    kept = settled.deposited
    weight = 9.81 * a.mass[kept].sum()
    on_floor = total[network.fixed].sum(axis=0)
    assert on_floor[2] == pytest.approx(-weight, rel=0.01) and np.linalg.norm(on_floor[:2]) < 0.01 * weight
    # body by body: contacts, links and weight leave little over
    left = total[kept] - 9.81 * a.mass[kept, None] * np.array([0.0, 0.0, 1.0])
    assert np.linalg.norm(left, axis=1).mean() < 0.02 * network.normal_force.mean()


def test_the_heap(settled: SlopeDeposit, start: Assembly) -> None:
    kept = settled.deposited
    moving = np.isfinite(start.mass)
    assert kept.sum() > 0.95 * moving.sum() and settled.fraction == 1.0
    before = float((start.x[moving, 2] + start.radius[moving]).max())
    found = settled.repose(azimuths=2)
    assert 1.0 < found.angle < 30.0 and 2.0 * RADIUS < found.height < 0.8 * before
    assert coordination(settled.network(), phase="grains").mean > 3.0
    level = settled._energy()
    assert level.kinetic < 1e-6 * (settled.start - level.potential)


def test_a_deposit_goes_on_bit_for_bit(start: Assembly) -> None:
    whole = SlopeDeposit(start.copy(), LAW, density=DENSITY)
    for _ in range(200):
        whole.advance()
    first = SlopeDeposit(start.copy(), LAW, density=DENSITY)
    for _ in range(120):
        first.advance()
    state = pickle.loads(pickle.dumps((first.assembly.arrays(), first.state())))
    again = SlopeDeposit(Assembly.from_arrays(state[0]), LAW, density=DENSITY)
    again.restore(state[1])
    for _ in range(80):
        again.advance()
    for name, value in whole.assembly.arrays().items():
        np.testing.assert_array_equal(value, again.assembly.arrays()[name])
    assert whole.state() == again.state()


def test_a_settled_deposit_goes_on_bit_for_bit(settled: SlopeDeposit) -> None:
    """Near rest the sweeps stop later: that, too, is part of the state."""
    assert settled.tightened == 2
    state = pickle.loads(pickle.dumps((settled.assembly.arrays(), settled.state())))
    again = SlopeDeposit(Assembly.from_arrays(state[0]), LAW, density=DENSITY)
    again.restore(state[1])
    for _ in range(20):
        assert settled.advance() == again.advance()
    np.testing.assert_array_equal(settled.assembly.x, again.assembly.x)
    assert settled.state() == again.state()


def test_what_is_no_deposit(start: Assembly) -> None:
    impatient = SlopeDeposit(start.copy(), LAW, density=DENSITY, step_limit=5)
    with pytest.raises(ConvergenceError, match="step_limit"):
        for _ in range(6):
            impatient.advance()
    with pytest.raises(InputError, match="rest"):
        SlopeDeposit(start.copy(), LAW, density=DENSITY, rest=0.0)
    with pytest.raises(InputError, match="spheres in space"):
        slope_start(Assembly.of_spheres(np.zeros((1, 2)), np.ones(1), np.ones(1), np.ones(2)), density=DENSITY)


SCENE = """
seed = 3
[slope]
reach = 1.2
solid_fraction = 0.5
azimuths = 2
rest = 1e-3
[grains]
count = 120
sizes = "sieve"
opening = [0.56e-3, 0.8e-3, 1.0e-3]
passing = [0.0, 0.5, 1.0]
[wires]
density = 4e5
beads = 8
"""


def test_a_scene_of_a_deposit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, run = tmp_path / "slope.toml", tmp_path / "slope.h5"
    scene.write_text(SCENE)
    assert main(["dem", str(scene), "-o", str(run), "--quiet", "--json", "--export", "xyz"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told["quality"]) == set(QUALITY) and told["quality"]["kinetic"] < 1e-3
    assert told["quality"]["angle_low"] < told["quality"]["angle"] < told["quality"]["angle_high"]
    assert len(told["profile"]["angles"]) == 2 and told["measures"]["link_taut"] > 0
    assert told["quality"]["natural_map_max"] < 0.1
    # stopped at any step and gone on with: the same bytes
    whole = run.read_bytes()
    run.unlink()

    class Stop(Exception):
        pass

    def watch(progress: Progress) -> None:
        if progress.step > 100:
            raise Stop

    with pytest.raises(Stop):
        run_slope(scene, run, progress=watch, every=0.0)
    assert run.read_bytes() != whole
    run_slope(scene, run, resume=True)
    assert run.read_bytes() == whole


def test_a_heap_too_small_for_an_angle_is_a_result_without_one(tmp_path: Path) -> None:
    scene = tmp_path / "few.toml"
    scene.write_text("[slope]\nreach = 1.0\nsolid_fraction = 0.4\nrest = 1e-2\n[grains]\ncount = 10\n")
    content = run_slope(scene, tmp_path / "few.h5")
    assert np.isnan(content["quality"]["angle"]) and content["quality"]["kinetic"] < 1e-2
    assert len(content["profile"]["angles"]) == 0 and (tmp_path / "few.h5").exists()


def test_a_bad_scene_of_a_deposit_is_one_line(tmp_path: Path) -> None:
    scene = tmp_path / "bad.toml"
    for text, words in {
        '[slope]\n[grains]\nsizes = "lognormal"\n': ("grains.median", "lognormal"),
        '[slope]\n[grains]\nsizes = "sieve"\nopening = [1e-3, 2e-3]\npassing = [0.0, 90.0]\n': (
            "grains.opening",
            "no per cent",
        ),
        "[slope]\n[grains]\nradius = [2e-3, 1e-3]\n": ("grains.radius", "smallest"),
        "[slope]\ngravity = -1.0\n": ("slope.gravity", "> 0"),
        "[slope]\nangle = 3\n": ("slope", "angle", "reach"),
        "[slope]\n[wires]\ndensity = 1e5\nspacing = -1.0\n": ("wires.spacing", "positive"),
        "[slope]\n[wires]\n": ("wires", "density"),
    }.items():
        scene.write_text(text)
        with pytest.raises(InputError) as refused:
            read_slope_scene(scene)
        assert "\n" not in str(refused.value) and all(word in str(refused.value) for word in words), refused.value
