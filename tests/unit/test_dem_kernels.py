"""Only what a scene requires: code has no symbol of a feature that the scene lacks; memory is told; threads give the same bits."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.candidates import Partition, matched, refresh
from fenchel.dem.kernels import SceneKernels
from fenchel.dem.kernels.text import expand
from fenchel.dem.laws import (
    CONTACT_LAWS,
    WIRE_LAWS,
    CompliantSignoriniCoulomb,
    ElasticRod,
    ElasticWire,
    NewtonRestitution,
    RigidRod,
    RigidWire,
    Signorini,
    SignoriniCoulomb,
)
from fenchel.errors import DeclarationError

# what stands for a feature in the code: none of it may be there without the feature
SYMBOLS = {
    "friction": r"\bmu\b|\bt_0\b|\bslip\b|\bbound\b|\bcut\b|\bsliding\b",
    "rotation": r"\bs_0\b|\bc_0 =|\binertia\b|spin\[",
    "normal compliance": r"\bcn\b",
    "tangential compliance": r"\bct\b|\bx_0 = t_0 - row",
    "third dimension": r"\b\w+_2\b|, 2\] - x",
    "restitution": r"\brestitution\b|\bapproach\b",
    "beads": r"\bbead\b",
}
FRICTIONAL = SignoriniCoulomb(friction=0.5)
COMPLIANT = CompliantSignoriniCoulomb(friction=0.5, k_n=1e4, k_t=8e3)
SCENES = {
    "rigid smooth": (SceneKernels(dimension=3, spin="all", contact=Signorini()), {"third dimension"}),
    "rigid frictional": (SceneKernels(dimension=3, spin="all", contact=FRICTIONAL), {"third dimension", "friction", "rotation"}),
    "locked": (SceneKernels(dimension=3, spin="none", contact=FRICTIONAL), {"third dimension", "friction"}),
    "flat": (SceneKernels(dimension=2, spin="all", contact=FRICTIONAL), {"friction", "rotation"}),
    "flat smooth with walls": (SceneKernels(dimension=2, spin="all", contact=Signorini(), planes="smooth"), set()),
    "compliant": (
        SceneKernels(dimension=3, spin="all", contact=COMPLIANT),
        {"third dimension", "friction", "rotation", "normal compliance", "tangential compliance"},
    ),
    "compliant smooth": (
        SceneKernels(dimension=3, spin="all", contact=CompliantSignoriniCoulomb(friction=0.0, k_n=1e4, k_t=8e3)),
        {"third dimension", "normal compliance"},
    ),
    "restitution": (
        SceneKernels(dimension=3, spin="all", contact=NewtonRestitution(restitution=0.5)),
        {"third dimension", "restitution"},
    ),
    "two coefficients": (
        SceneKernels(dimension=3, spin="all", contact=SignoriniCoulomb(friction=0.5, bead_friction=0.2)),
        {"third dimension", "friction", "rotation", "beads"},
    ),
}  # fmt: skip


def texts(kernels: SceneKernels) -> str:
    """The code of contacts and walls, without comments and texts for the reader."""
    found = "\n".join(kernel.text for kernel in (kernels.pairs, kernels.walls) if kernel is not None)
    return re.sub(r'#.*|""".*?"""', "", found)


@pytest.mark.parametrize("name", SCENES)
def test_code_has_what_the_scene_has_and_nothing_else(name: str) -> None:
    kernels, has = SCENES[name]
    code = texts(kernels)
    for feature, pattern in SYMBOLS.items():
        assert bool(re.search(pattern, code)) == (feature in has), (feature, re.findall(pattern, code)[:3])


def test_a_scene_without_wires_planes_or_contacts_has_no_kernel_of_them() -> None:
    bare = SceneKernels(dimension=3, spin="all", contact=None)
    assert [kernel.kind for kernel in bare.all()] == ["detection", "bodies", "step"]
    assert bare.bytes_per_contact() == {}
    grains = SceneKernels(dimension=3, spin="all", contact=FRICTIONAL)
    assert [kernel.kind for kernel in grains.all()] == ["detection", "bodies", "pairs", "step"]
    assert "links" not in grains.source() and "wall" not in grains.source() and "prange" not in grains.source()
    full = SceneKernels(dimension=3, spin="all", contact=FRICTIONAL, planes="each", wire=RigidRod(), threads=2)
    assert [kernel.kind for kernel in full.all()] == ["detection", "bodies", "pairs", "planes", "links", "step"]
    assert "prange" in full.source()
    # names are hashes of the texts: the same scene is the same code, another one is not
    again = SceneKernels(dimension=3, spin="all", contact=SignoriniCoulomb(friction=0.1))
    assert again.pairs is not None and grains.pairs is not None and again.pairs.name == grains.pairs.name
    assert full.step[0].name != grains.step[0].name


def test_wire_kernels_have_the_terms_of_their_law() -> None:
    for law, has in (
        (RigidRod(corrected=False), set()),
        (RigidRod(), {"bias"}),
        (RigidWire(), {"bias", "sign"}),
        (ElasticRod(stiffness=1.0), {"bias", "compliance"}),
        (ElasticWire(stiffness=1.0), {"bias", "compliance", "sign"}),
    ):
        kernel = SceneKernels(dimension=3, spin="all", contact=None, wire=law).links
        assert kernel is not None
        for term, pattern in (("bias", r"natural\) / step"), ("compliance", r"\bcompliance\b"), ("sign", r"new < 0")):
            assert bool(re.search(pattern, kernel.text)) == (term in has), (law, term)


@pytest.mark.parametrize("name", SCENES)
def test_bytes_per_contact_are_below_the_bound_and_counted_from_the_arrays(name: str) -> None:
    kernels, _ = SCENES[name]
    told = kernels.bytes_per_contact()
    assert all(0 < value < 400 for value in told.values())
    kernel = kernels.pairs
    assert kernel is not None
    dimension = kernels.dimension
    x = np.zeros((2, dimension))
    x[1, 0] = 1.9e-2
    a = Assembly.of_spheres(x, np.full(2, 1e-2), np.ones(2), locked=np.full(2, kernels.spin == "none"))
    simulation = Simulation(a, Laws(contact=kernels.contact), Solver(keep_unconverged=True))
    c = simulation.problem(1e-3, Drive())
    rows = c["contacts"]
    assert len(rows.pair) == 1
    held = (rows.pair, rows.row, rows.cold, rows.candidate, a.pairs, a.pair_impulse)
    assert sum(array.nbytes for array in held) == told["pairs"]


def test_the_frictionless_row_is_one_number_and_rigid_friction_one_cache_line() -> None:
    def columns(law: Signorini | SignoriniCoulomb, dimension: int = 3) -> int:
        kernel = SceneKernels(dimension=dimension, spin="all", contact=law).pairs
        assert kernel is not None
        return kernel.columns.total

    assert columns(Signorini()) == 6  # n, p_n, b, 1/W
    assert columns(FRICTIONAL) == 8
    assert columns(FRICTIONAL, 2) == 6
    assert SceneKernels(dimension=3, spin="all", contact=Signorini()).body_columns.total == 4
    assert SceneKernels(dimension=3, spin="all", contact=FRICTIONAL).body_columns.total == 8


def test_tables_find_every_law_by_name() -> None:
    assert set(CONTACT_LAWS) == {"signorini", "signorini_coulomb", "compliant_signorini_coulomb", "newton_restitution"}
    assert set(WIRE_LAWS) == {"rigid_rod", "elastic_rod", "rigid_wire", "elastic_wire"}
    for name, law in (CONTACT_LAWS | WIRE_LAWS).items():
        assert law.label == name and law.__doc__


def test_the_language_of_the_texts() -> None:
    text = "a_@ = b[@]\ns = SUM(a_@ * (b_@ + 1))\nr_^ = 0  #? spin\nq = $value  #? not spin\n"
    assert (
        expand(text, 2, {"spin": True}, {"value": 3})
        == "a_0 = b[0]\na_1 = b[1]\ns = (a_0 * (b_0 + 1) + a_1 * (b_1 + 1))\nr_0 = 0\n"
    )
    assert expand(text, 3, {"spin": False}, {"value": 3}).endswith("q = 3\n")
    with pytest.raises(DeclarationError, match="spin"):
        expand(text, 2, {}, {})
    with pytest.raises(DeclarationError, match="value"):
        expand(text, 2, {"spin": False}, {})
    with pytest.raises(DeclarationError, match="2 or 3"):
        SceneKernels(dimension=4, spin="all", contact=None)


def settled(threads: int, steps: int = 30) -> Assembly:
    """A pile of 200 spheres in a corner after some steps."""
    rng = np.random.default_rng(2)
    grid = np.array([(i, j, k) for k in range(8) for j in range(5) for i in range(5)], dtype=float)
    a = Assembly.of_spheres(
        0.0205 * grid + 0.011 + 4e-4 * rng.uniform(-1, 1, (200, 3)), np.full(200, 0.01), np.full(200, 0.01)
    )
    planes = [
        Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5),
        *(Plane(normal=n, point=p) for n, p in (((1, 0, 0), (0, 0, 0)), ((-1, 0, 0), (0.1045, 0, 0)))),
        *(Plane(normal=n, point=p) for n, p in (((0, 1, 0), (0, 0, 0)), ((0, -1, 0), (0, 0.1045, 0)))),
    ]
    law = Laws(contact=SignoriniCoulomb(friction=0.5))
    solver = Solver(tolerance=1e-7, sweep_limit=20_000)
    simulation = Simulation(a, law, solver, planes=planes, threads=threads)
    for _ in range(steps):
        simulation.advance(2e-3, Drive(gravity=np.array([0, 0, -9.81])))
    return a


def test_two_threads_are_the_same_bits_every_time_and_one_thread_to_tolerance() -> None:
    one, two, again = settled(1, 6), settled(2, 6), settled(2, 6)
    np.testing.assert_array_equal(two.x, again.x)
    np.testing.assert_array_equal(two.pair_impulse, again.pair_impulse)
    assert np.max(np.abs(one.x - two.x)) < 1e-7


def test_impulses_survive_a_new_list_by_the_identity_of_the_pair() -> None:
    old = np.array([[0, 3], [1, 2], [5, 9]], dtype=np.int32)
    new = np.array([[0, 1], [1, 2], [5, 9], [6, 7]], dtype=np.int32)
    held = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    np.testing.assert_array_equal(matched(new, old, held, 10), [[0, 0], [3, 4], [5, 6], [0, 0]])
    a = settled(1, 20)
    held = {
        tuple(pair): tuple(impulse) for pair, impulse in zip(a.pairs.tolist(), a.pair_impulse.tolist(), strict=True)
    }
    assert sum(impulse[-1] > 0.0 for impulse in held.values()) > 100
    for skin, longer in ((9e-3, True), (1e-6, False)):
        refresh(a, np.zeros((0, 3)), np.zeros(0), skin, 1e-4, None)
        assert (len(a.pairs) > len(held)) == longer and len(a.pairs) != len(held)
        for pair, impulse in zip(a.pairs.tolist(), a.pair_impulse.tolist(), strict=True):
            assert tuple(impulse) == held.get(tuple(pair), (0.0,) * 4)


def test_parts_that_are_swept_at_the_same_time_share_no_body() -> None:
    rng = np.random.default_rng(6)
    x = rng.uniform(0.0, 1.0, (300, 3)) * np.array([1.0, 3.0, 1.0])
    pairs = np.sort(rng.integers(0, 300, (900, 2)), axis=1).astype(np.int32)
    for parts in (2, 3):
        partition = Partition(parts)
        ordered = partition.sort(pairs, x)
        assert sorted(map(tuple, ordered.tolist())) == sorted(map(tuple, pairs.tolist()))
        assert partition.starts[0] == 0 and partition.starts[-1] == len(pairs)
        bodies = [
            set(ordered[a:b].ravel().tolist())
            for a, b in zip(partition.starts[:-2], partition.starts[1:-1], strict=True)
        ]
        assert all(bodies) and all(not (one & other) for k, one in enumerate(bodies) for other in bodies[k + 1 :])
        kept = np.flatnonzero(rng.uniform(size=900) < 0.5).astype(np.int32)
        rows = partition.of_rows(kept)
        assert rows[-1] == len(kept) and np.all(kept[rows[1] :] >= partition.starts[1])
