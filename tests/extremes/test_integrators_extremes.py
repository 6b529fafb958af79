"""The step at the ends of what can be asked: stiffness ratios, sizes, degenerate strains, steps much too large."""

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.integrators import drive_arrays
from fenchel.integrators.spectral import eigen
from fenchel.potentials.library import LAWS, sand, texsol

SAND = {"E_s": 12e6, "nu_s": 0.2, "theta_f": 0.079, "C_0": 2842.0, "H_k": 944e3, "H_i": 472e3}
WIRE = {"lambda_w": 6e6 * 0.2 / 1.2 / 0.6, "mu_w": 6e6 / 2.4}
STRAINS = 1e-3 * np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1, 1, 1, 0, 0, 0],
        [-1, -1, -1, 0, 0, 0],
        [1, 1, -3, 0, 0, 0],
        [1, 1 + 1e-15, 1 - 1e-15, 1e-16, 0, 0],
        [0, 0, 0, 1, 1, 1],
        [1, 0, 0, 0, 0, 0],
        [0.3, -0.2, 0.7, 0.1, -0.4, 0.25],
    ]
)


@pytest.mark.parametrize("exponent", [-150, -100, -12, 0, 6, 100, 150])
@pytest.mark.parametrize("law", [sand, texsol], ids=lambda law: law.name)
def test_sizes_of_strain(law, exponent):
    values = SAND | (WIRE if law is texsol else {})
    out = law.compile()(STRAINS * 1e3 * 10.0**exponent, None, **values)
    for part in (out.stress, out.tangent, out.dissipation, *out.state.values()):
        assert np.isfinite(part).all()
    # forces are differences of numbers of the size of the trial: beyond 1e10 yield strains their product is rounding
    assert exponent > 6 or (out.dissipation >= 0).all()


@pytest.mark.parametrize("exponent", [-150, 150])
def test_units_of_stress(exponent):
    scale = 10.0**exponent
    stiff = {k: v * (1 if k in ("nu_s", "theta_f") else scale) for k, v in (SAND | WIRE).items()}
    plain = texsol.compile()(STRAINS, None, **SAND, **WIRE)
    out = texsol.compile()(STRAINS, None, **stiff)
    assert np.allclose(out.stress / scale, plain.stress, rtol=1e-9, atol=1e-7)
    assert np.allclose(out.state["p"], plain.state["p"], rtol=1e-9, atol=1e-16)


@pytest.mark.parametrize("ratio", [1e-9, 1e9])
@pytest.mark.parametrize("name", ["lambda_w", "mu_w", "H_k", "H_i"])
def test_stiffness_ratios(name, ratio):
    values = SAND | WIRE | {name: 12e6 * ratio}
    out = texsol.compile()(STRAINS, None, **values)
    assert np.isfinite(out.stress).all() and np.isfinite(out.tangent).all()
    A = out.stress - LAWS["wire"].compile()(STRAINS, None, lambda_w=values["lambda_w"], mu_w=values["mu_w"]).stress
    B = A - values["H_k"] * out.state["alpha"]
    mean = B[:, :3].mean(axis=1)
    dev = B - mean[:, None] * np.array([1.0, 1, 1, 0, 0, 0])
    f = np.linalg.norm(dev, axis=1) / np.sqrt(2) + np.tan(0.079) * mean - values["H_i"] * out.state["p"] - 2842.0
    rounding = 1e-15 * (
        np.abs(out.stress).max(axis=1) + values["H_k"] * np.abs(out.state["alpha"]).max(axis=1) + 12e6 * 3e-3
    )
    assert (f <= 1e-10 * 2842 + 20 * rounding).all()


@pytest.mark.parametrize(
    "change",
    [
        {"theta_f": 0.0},
        {"theta_f": 1.5},
        {"nu_s": -0.99},
        {"nu_s": 0.499999},
        {"C_0": 0.0},
        {"H_k": 0.0},
        {"H_i": 0.0},
        {"H_k": 0.0, "H_i": 0.0},
    ],
)
def test_ends_of_the_parameters(change):
    out = texsol.compile()(STRAINS, None, **SAND | WIRE | change)
    assert np.isfinite(out.stress).all() and np.isfinite(out.tangent).all()
    scale = np.abs(out.tangent).max()
    assert np.linalg.eigvalsh(0.5 * (out.tangent + out.tangent.transpose(0, 2, 1))).min() >= -1e-8 * scale


@pytest.mark.parametrize("nu", [0.5, -1.0])
def test_infinite_moduli_are_refused(nu):
    with pytest.raises(InputError, match="infinite"):
        sand.compile()(STRAINS, None, **SAND | {"nu_s": nu})


def test_one_step_of_all_the_strain_there_is():
    history = drive_arrays(
        texsol.compile(), [True, True, False, True, True, True], [[-5e4, -5e4, -1.0, 0, 0, 0]], SAND | WIRE
    )
    assert history.sig[0, :2] == pytest.approx(-5e4, rel=1e-6)
    small = drive_arrays(
        texsol.compile(),
        [True, True, False, True, True, True],
        np.array([[-5e4, -5e4, -1.0 * s, 0, 0, 0] for s in np.linspace(1e-3, 1, 400)]),
        SAND | WIRE,
    )
    assert small.sig[-1, 2] == pytest.approx(history.sig[0, 2], rel=1e-3)


def mandel_matrix(t):
    half = np.sqrt(0.5)
    return np.array(
        [[t[0], half * t[5], half * t[4]], [half * t[5], t[1], half * t[3]], [half * t[4], half * t[3], t[2]]]
    )


def test_eigen_decomposition_on_awkward_matrices():
    rng = np.random.default_rng(1)
    sets = [rng.normal(size=(500, 6))]
    for gap in (1e-4, 1e-8, 1e-12, 0.0):
        for base in ([1.0, 1.0, -1.0], [1.0, 1.0, 2.0], [1.0, 1.0, 1.0], [0.0, 0.0, 1.0]):
            q, _ = np.linalg.qr(rng.normal(size=(60, 3, 3)))
            m = np.einsum("nij,j,nkj->nik", q, np.array(base) + gap * np.array([0, 1, 0.3]), q)
            r = np.sqrt(2)
            sets.append(
                np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2], r * m[:, 1, 2], r * m[:, 0, 2], r * m[:, 0, 1]], axis=1)
            )
    sets.append(np.ones((60, 6)) * [1, 1, 1, 0, 0, 0] + 3e-16 * rng.normal(size=(60, 6)))
    sets.append(np.diag([1.0, 1e-6, 1e-12, 0, 0, 0]))
    spherical = np.array([1.0, 1, 1, 0, 0, 0])
    sets += [spherical[None], -7.3 * spherical[None], spherical + 1e-17 * np.eye(6)[:, [3, 4, 5, 0, 1, 2]]]
    sets += [1e150 * sets[0], 1e-150 * sets[0], np.zeros((1, 6))]
    out = np.empty(12)
    for t in np.concatenate(sets):
        eigen(t, out)
        q, m = out[3:].reshape(3, 3), mandel_matrix(t)
        size = max(np.abs(m).max(), 1e-300)
        assert np.abs(q.T @ q - np.eye(3)).max() <= 1e-14
        assert np.abs((q * out[:3]) @ q.T / size - m / size).max() <= 2e-14
