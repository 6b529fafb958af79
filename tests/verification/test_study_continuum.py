"""Continuum part of the reference study: cyclic compression (claims 17–22) and crushing of a cylinder (claims 23–27).

The residual strains are those of the theory page (its section 7.1, computed there by another code); slopes are closed forms (section 4).
What is a theorem is asserted as one; what depends on parameters is asserted where the theory page found it.
"""

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.study.crushing import CrushingTest, crush
from fenchel.study.cyclic import CyclicTest, cyclic_compression
from fenchel.study.models import MODELS, equivalent_stress, model_values, wire_stress

STIFF = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3, E_w=6e6, nu_w=0.2)
TABLE_3 = STIFF | dict(E_s=12.167e6, E_w=332e3)


@pytest.fixture(scope="module")
def updates():
    return {name: law.compile("3d") for name, law in MODELS.items()}


def loops(updates, values, test=None):
    return {name: cyclic_compression(updates[name], model_values(law, values), test) for name, law in MODELS.items()}


@pytest.mark.parametrize(
    ("change", "residuals", "stabilised"),
    [
        ({}, (-8.30, -4.67, -6.34), (14, 13, 14)),
        ({"theta_f": 0.3}, (-6.55, -3.17, -4.37), (12, 8, 10)),
        ({"theta_f": 0.3, "H_k": 2e6, "H_i": 5e4}, (-2.20, -1.00, -1.39), (None, 17, 18)),
        ({"E_s": 12.167e6, "E_w": 332e3}, (-8.31, -7.98, -8.16), (14, 14, 14)),
    ],
)
def test_claims_17_to_19_cyclic_compression(updates, change, residuals, stabilised):
    found = loops(updates, STIFF | change)
    for name, residual, loop in zip(MODELS, residuals, stabilised, strict=True):
        assert found[name].residual[-1] * 1e4 == pytest.approx(residual, abs=0.012)
        # the page's own count of loops, to one loop: its normalisation of "change" is not written down
        assert (found[name].stabilised is None) == (loop is None)
        assert loop is None or abs(found[name].stabilised - loop) <= 1
        if change.get("H_i") is None:
            ends = np.stack([found[name].low, found[name].high])
            assert (np.abs(ends[:, -1] - ends[:, -2]) < 0.01 * np.abs(ends[:, -1]).max()).all()
    # closer to the axis of zero displacement than sand, by more than 5 % where the wires are stiff
    share = 0.95 if "E_w" not in change else 1.0
    for name in ("reinforced", "texsol"):
        assert abs(found[name].residual[-1]) < share * abs(found["sand"].residual[-1])


@pytest.mark.parametrize(("values", "ratio"), [(STIFF, 1.4219), (TABLE_3, 1.0236)])
def test_claim_20_the_slope_of_texsol_switches(updates, values, ratio):
    test = CyclicTest(stroke=1e-6, loops=2, steps=2)
    for name, law in MODELS.items():
        slopes = []
        for sign in (1.0, -1.0):
            from fenchel.integrators import drive_arrays

            targets = np.zeros((2, 6))
            targets[1, 2] = sign * test.stroke
            history = drive_arrays(
                updates[name], [True, True, False, True, True, True], targets, model_values(law, values)
            )
            slopes.append(history.sig[1, 2] / targets[1, 2])
        assert slopes[0] / slopes[1] == pytest.approx(ratio if name == "texsol" else 1.0, rel=2e-4)


def test_claim_21_texsol_lies_between_the_other_two(updates):
    found = loops(updates, STIFF)
    for lower, upper in (("sand", "texsol"), ("texsol", "reinforced")):
        assert (np.abs(found[lower].low) <= np.abs(found[upper].low) * (1 + 1e-9)).all()


def test_equal_strain_bounds_are_theorems():
    strain = np.random.default_rng(11).normal(size=(20000, 6)) * 1e-3
    two, one = wire_stress("reinforced", strain, STIFF), wire_stress("texsol", strain, STIFF)
    assert (equivalent_stress(one) <= equivalent_stress(two) * (1 + 1e-12) + 1e-9).all()
    pressure_one, pressure_two = -one[:, :3].mean(axis=1), -two[:, :3].mean(axis=1)
    assert (pressure_one <= np.minimum(0.0, pressure_two) + 1e-9).all()


@pytest.fixture(scope="module")
def maps(updates):
    return {name: crush(name, updates[name], model_values(law, TABLE_3)) for name, law in MODELS.items()}


def test_claims_23_to_26_crushing(maps):
    assert all(m.body.mesh.t.shape[1] == 400 for m in maps.values())
    texsol, reinforced = maps["texsol"], maps["reinforced"]
    assert texsol.state.dissipation.max() > 0.0
    scale = texsol.equivalent.max()
    assert texsol.pressure.max() <= 1e-12 * scale
    assert not maps["sand"].equivalent.any()
    for measure in (np.max, np.mean, lambda x: np.quantile(x, 0.95)):
        assert 0.0 < measure(texsol.equivalent) <= measure(reinforced.equivalent)
    assert np.average(texsol.equivalent <= reinforced.equivalent, weights=texsol.weights) > 0.99
    assert np.corrcoef(texsol.equivalent, reinforced.equivalent)[0, 1] > 0.8
    # the study's wires of both signs do not show at this shape of cylinder: all of the bilateral network is compressed
    assert reinforced.pressure.min() > 0.0
    # the mean of the reaction is that of first yield and beyond: sand alone yields at 5.16 kPa
    area = np.pi * 0.05**2
    assert (
        5.16e3 < maps["sand"].force[-1] / area < maps["texsol"].force[-1] / area < maps["reinforced"].force[-1] / area
    )


def test_claim_23_refinement(updates):
    values = model_values(MODELS["texsol"], TABLE_3)
    coarse, fine = (
        crush("texsol", updates["texsol"], values, CrushingTest(columns=n, rows=n)).force[-1] for n in (10, 20)
    )
    assert abs(coarse / fine - 1) < 0.02


def test_claim_27_smooth_platens_give_uniform_maps(updates):
    values = model_values(MODELS["texsol"], TABLE_3)
    found = crush("texsol", updates["texsol"], values, CrushingTest(rough=False, columns=5, rows=5))
    assert np.ptp(found.equivalent) < 1e-9 * found.equivalent.mean()


def test_wrong_tests_are_refused():
    for wrong in (lambda: CyclicTest(stroke=0.0), lambda: CyclicTest(loops=1), lambda: CrushingTest(shortening=0.5)):
        with pytest.raises(InputError):
            wrong()
