"""Steps in fewer dimensions, in single precision and in threads: the same answers as in three dimensions, and closed forms."""

import re

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.integrators import drive_arrays, path_sensitivities
from fenchel.integrators.dimension import DIMENSIONS
from fenchel.integrators.sensitivity import sensitivities
from fenchel.integrators.spectral_plane import (
    add_positive_derivative_axes,
    add_positive_derivative_plane,
    eigen_axes,
    eigen_plane,
    positive_part_axes,
    positive_part_plane,
)
from fenchel.potentials.library import ENTRIES, LAWS

SOME = ("sand", "texsol", "mohr_coulomb", "cam_clay", "thermo_elasto_plastic", "kelvin_voigt")
KINDS = ("plane_strain", "axisymmetric", "plane_stress", "uniaxial")
CASES = [
    pytest.param(name, kind, marks=[] if name in SOME else pytest.mark.validate) for name in LAWS for kind in KINDS
]


def values_of(name):
    return dict(ENTRIES[name].values) | dict(ENTRIES[name].worked.temperatures)


def given_strains(rng, kind, count):
    """Given components over six decades of size."""
    shape = DIMENSIONS[kind]
    return rng.normal(size=(count, len(shape.given))) * 10.0 ** rng.uniform(-7, -1, size=(count, 1))


def widened(shape, found):
    """A state or a strain of the dimension with six components."""
    if isinstance(found, dict):
        return {k: shape.embedded(v) if v.ndim == 2 and v.shape[1] == shape.size else v for k, v in found.items()}
    return shape.embedded(found)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_two_steps_equal_those_in_three_dimensions(name, kind):
    shape, values = DIMENSIONS[kind], values_of(name)
    small, whole = LAWS[name].compile(kind), LAWS[name].compile()
    state, inside = None, [shape.places[i] for i in shape.given]
    stiff = np.abs(whole(np.zeros((1, 6)), None, **values).tangent).max()
    for scale in (1.0, -0.4):
        eps = scale * given_strains(np.random.default_rng(5), kind, 200)
        out = small(eps, state, **values)
        before = None if state is None else widened(shape, state)
        full = whole(widened(shape, out.strain), before, **values)
        size, rounding = np.abs(full.stress).max(axis=1), 2e-14 * stiff * np.abs(out.strain).max(axis=1)
        assert (np.abs(out.stress - full.stress[:, inside]).max(axis=1) <= 1e-12 * size + rounding).all()
        # every other stress is zero where its strain is free, or where there is no such shear
        free = [shape.places[i] for i in shape.relaxed] + [i for i in range(6) if i not in shape.places]
        assert (np.abs(full.stress[:, free]).max(axis=1, initial=0.0) <= 2e-12 * size + rounding).all()
        assert out.strain[:, list(shape.given)] == pytest.approx(eps, abs=0.0)
        for key, mine in widened(shape, out.state).items():
            assert np.abs(mine - full.state[key]).max() <= 1e-12 * max(np.abs(full.state[key]).max(), 1e-30)
        assert out.dissipation == pytest.approx(
            full.dissipation, rel=1e-9, abs=1e-12 * np.abs(full.dissipation).max() + 1e-300
        )
        state = out.state


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["sand", "texsol", "mohr_coulomb"])
def test_tangent_equals_finite_differences(name, kind):
    shape, values = DIMENSIONS[kind], values_of(name)
    update = LAWS[name].compile(kind)
    eps = given_strains(np.random.default_rng(7), kind, 60)
    out = update(eps, None, **values)
    h = 1e-6 * np.abs(eps).max(axis=1, keepdims=True)
    found = np.empty_like(out.tangent)
    for j in range(len(shape.given)):
        unit = np.eye(len(shape.given))[j]
        ahead, behind = (update(eps + s * h * unit, None, **values).stress for s in (1, -1))
        found[:, :, j] = (ahead - behind) / (2 * h)
    size = np.abs(out.tangent).max(axis=(1, 2))
    error = np.abs(found - out.tangent).max(axis=(1, 2)) / np.maximum(size, 1e-3 * size.max())
    assert np.sort(error)[int(0.9 * len(error))] < 1e-6  # the rest lies beside a kink
    assert out.tangent == pytest.approx(np.swapaxes(out.tangent, 1, 2), abs=1e-9 * size.max())


def test_elastic_moduli_of_plane_and_uniaxial_stress():
    law, values = LAWS["linear_elastic"], dict(E=10e6, nu=0.3)
    plane = law.compile("plane_stress")([1e-3, 0.0, 0.0], None, **values)
    assert plane.stress[0] == pytest.approx(10e6 / 0.91 * np.array([1e-3, 0.3e-3, 0.0]))
    assert plane.strain[0, 2] == pytest.approx(-0.3 / 0.7 * 1e-3)
    assert plane.tangent[0] == pytest.approx(10e6 / 0.91 * np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.7]]), abs=1e-6)
    bar = law.compile("uniaxial")([1e-3], None, **values)
    assert bar.stress[0, 0] == pytest.approx(10e3) and bar.tangent[0, 0, 0] == pytest.approx(10e6)
    assert bar.strain[0] == pytest.approx([1e-3, -0.3e-3, -0.3e-3])


def test_a_bar_of_a_hardening_metal():
    # uniaxial stress: sigma = sigma_y + (E H / (E + H)) (eps - sigma_y / E), isotropic hardening, tension and then compression
    E, sigma_y, H = 2e11, 3e8, 1e10
    bar = LAWS["von_mises"].compile("uniaxial")
    values = dict(E=E, nu=0.3, sigma_y=sigma_y, H_k=0.0, H_i=H)
    slope = E * H / (E + H)
    one = bar([5e-3], None, **values)
    peak = sigma_y + slope * (5e-3 - sigma_y / E)
    assert one.stress[0, 0] == pytest.approx(peak, rel=1e-11)
    assert one.tangent[0, 0, 0] == pytest.approx(slope, rel=1e-9)
    back = 5e-3 - 2 * peak / E
    two = bar([back - 1e-3], one.state, **values)
    assert two.stress[0, 0] == pytest.approx(-peak - slope * 1e-3, rel=1e-10)


def test_plane_strain_takes_the_strain_33_or_leaves_it_out():
    update = LAWS["sand"].compile("plane_strain")
    eps = np.random.default_rng(2).normal(size=(20, 4)) * 1e-3
    eps[:, 2] = 0.0
    short = update(eps[:, [0, 1, 3]], None, **values_of("sand"))
    assert np.array_equal(short.stress, update(eps, None, **values_of("sand")).stress)


def as_matrix(t):
    """3x3 matrix of (11, 22, 33) or (11, 22, 33, sqrt(2)*12)."""
    found = np.diag(t[:3])
    if len(t) == 4:
        found[0, 1] = found[1, 0] = t[3] / np.sqrt(2)
    return found


def components(matrix, size):
    return np.array([*np.diag(matrix), np.sqrt(2) * matrix[0, 1]])[:size]


def positive(t):
    values, vectors = np.linalg.eigh(as_matrix(t))
    return components((vectors * np.maximum(values, 0.0)) @ vectors.T, len(t))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["texsol", "kelvin_voigt"])
def test_stress_and_strain_drive_the_same_step(name, kind):
    values, shape = values_of(name), DIMENSIONS[kind]
    eps = given_strains(np.random.default_rng(8), kind, 40)
    out = LAWS[name].compile(kind)(eps, None, **values)
    back = LAWS[name].compile(kind, formulation="stress")(out.stress, None, **values)
    size = np.abs(out.strain).max(axis=1, keepdims=True)
    assert (np.abs(back.strain - out.strain) <= 1e-9 * size).all()
    product = np.einsum("nij,njk->nik", back.tangent, out.tangent)
    assert product == pytest.approx(np.broadcast_to(np.eye(len(shape.given)), product.shape), abs=1e-6)
    for key, mine in back.state.items():
        assert mine == pytest.approx(out.state[key], rel=1e-8, abs=1e-9 * size.max())


def test_plane_and_diagonal_spectral_operators_equal_the_matrices():
    rng = np.random.default_rng(3)
    sets = [rng.normal(size=(200, 4)), rng.normal(size=(50, 4)) * [1, 1, 1, 1e-9], np.zeros((1, 4))]
    same = np.ones((20, 4)) * rng.normal(size=(20, 1)) + [0, 0, 0, -1]
    for t in np.vstack([*sets, same, 1e150 * sets[0][:20], 1e-150 * sets[0][:20], [[1.0, 1.0, 1.0, 0.0]]]):
        for size, apart, part, add in (
            (4, eigen_plane, positive_part_plane, add_positive_derivative_plane),
            (3, eigen_axes, positive_part_axes, add_positive_derivative_axes),
        ):
            own, found, plus = t[:size].copy(), np.zeros(12), np.zeros(size)
            apart(own, found)
            scale = np.abs(own).max()
            Q = found[3:].reshape(3, 3)
            assert pytest.approx(np.eye(3), abs=1e-14) == Q.T @ Q
            assert (Q * found[:3]) @ Q.T == pytest.approx(as_matrix(own), abs=1e-14 * scale)
            if not 1e-100 < scale < 1e100:
                continue
            total = part(own, found, plus)
            assert plus == pytest.approx(positive(own), abs=1e-14 * scale) and total == pytest.approx(plus @ plus)
            values = np.linalg.eigvalsh(as_matrix(own))
            if np.abs(values).min() < 1e-4 * scale:
                continue
            tangent = np.zeros(size * size)
            add(2.0, found, tangent)
            h = 1e-6 * scale
            slopes = [(positive(own + h * e) - positive(own - h * e)) / h for e in np.eye(size)]
            assert tangent.reshape(size, size) == pytest.approx(np.array(slopes).T, abs=1e-5)


@pytest.mark.parametrize("name", ["sand", "texsol", "mohr_coulomb", "cam_clay"])
def test_single_precision_is_right_to_its_rounding(name):
    values, rng = values_of(name), np.random.default_rng(11)
    eps = (rng.normal(size=(2000, 6)) * 10.0 ** rng.uniform(-7, -1, size=(2000, 1))).astype(np.float32)
    single, double = (LAWS[name].compile(precision=p) for p in ("float32", "float64"))
    out, true = single(eps, None, **values), double(eps, None, **values)
    again, there = (
        single(-eps, out.state, **values),
        double(-eps, {k: v.astype(float) for k, v in out.state.items()}, **values),
    )
    for a, b in ((out, true), (again, there)):
        assert a.stress.dtype == a.tangent.dtype == np.float32 and all(v.dtype == np.float32 for v in a.state.values())
        size = np.abs(b.stress).max(axis=1, keepdims=True)
        assert (np.abs(a.stress - b.stress) <= 2e-7 * size).all()
        assert np.abs(a.tangent - b.tangent).max() <= 2e-7 * np.abs(b.tangent).max()


@pytest.mark.parametrize("name", ["texsol", "mohr_coulomb", "perzyna", "thermo_elasto_plastic"])
def test_threads_change_no_bit(name):
    values, rng = values_of(name), np.random.default_rng(13)
    eps = rng.normal(size=(3001, 6)) * 10.0 ** rng.uniform(-7, -1, size=(3001, 1))
    if name == "thermo_elasto_plastic":
        values["T"] = rng.uniform(280.0, 320.0, size=3001)
    one, three = (LAWS[name].compile(threads=k)(eps, None, **values) for k in (1, 3))
    assert np.array_equal(one.stress, three.stress) and np.array_equal(one.tangent, three.tangent)
    assert np.array_equal(one.dissipation, three.dissipation)
    assert all(np.array_equal(one.state[k], three.state[k]) for k in one.state)


@pytest.mark.parametrize("name", ["texsol", "mohr_coulomb"])
def test_only_components_that_exist_are_emitted(name):
    law = LAWS[name]
    for kind, size in (("3d", 6), ("plane_strain", 4), ("uniaxial", 3)):
        update = law.compile(kind)
        text = update.step_source
        assert f"e{size - 1}" in text and not re.search(rf"\be{size}\b", text)
        assert not re.search(rf"\bt\[{size * size}\]", text) and f"t[{size * size - 1}]" in text
        tensors = sum(getattr(v, "rank", 0) == 2 for v in law.internal)
        assert update.state_size == size * tensors + len(law.internal) - tensors
        assert f"COMPONENTS = {size}" in law.source(kind)
    assert "d[5]" not in law.compile("uniaxial").step_source


def test_wrong_requests_are_refused_in_one_line():
    law = LAWS["sand"]
    with pytest.raises(InputError, match="one of 3d, plane_strain, axisymmetric, plane_stress, uniaxial"):
        law.compile("2d")
    with pytest.raises(InputError, match="float64 or float32"):
        law.compile(precision="half")
    with pytest.raises(InputError, match="whole number of at least 1"):
        law.compile(threads=0)
    with pytest.raises(InputError, match="float32 is there for generated steps"):
        LAWS["kelvin_voigt"].compile(precision="float32")
    with pytest.raises(InputError, match=r"\(n, 3\) or \(3,\), 11, 22, sqrt\(2\)\*12"):
        law.compile("plane_stress")(np.zeros((2, 4)), None, **values_of("sand"))
    with pytest.raises(InputError, match=r"must be \(2, 4\)"):
        update = law.compile("plane_strain")
        update(np.zeros((2, 4)), law.compile().initial_state(2), **values_of("sand"))


@pytest.mark.parametrize("kind", [{"dimension": "plane_strain"}, {"dimension": "uniaxial"}, {"precision": "float32"}])
@pytest.mark.parametrize("name", ["sand", "kelvin_voigt"])
def test_paths_and_sensitivities_take_updates_of_space_only(name, kind):
    """Their compiled loops hold six components in double precision: fewer would be read past their end."""
    if name == "kelvin_voigt" and "precision" in kind:
        kind = {"dimension": "axisymmetric"}
    update, values = LAWS[name].compile(**kind), values_of(name)
    targets = np.zeros((3, 6))
    targets[1:, 2] = -1e-3
    control = np.array([True, True, False, True, True, True])
    for attempt in (
        lambda: drive_arrays(update, control, targets, values),
        lambda: path_sensitivities(update, control, targets, values),
        lambda: sensitivities(update, np.zeros((2, len(update.dimension.given))), None, 1.0, None, None, None, values),
    ):
        with pytest.raises(InputError, match="compile the law for '3d' in float64"):
            attempt()
