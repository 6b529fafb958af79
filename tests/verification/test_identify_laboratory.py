"""Laboratory files of a planted law give its parameters back.

Provenance of the truth: `tests/planted_law.py` (closed-form return map in principal components, checked there against published values)
for sand, drained and undrained; the closed form of the bilinear curve for Mohr–Coulomb. None of it is code of fenchel.
"""

from __future__ import annotations

import json
from math import cos, sin

import laboratory_data
import numpy as np
import planted_law
import pytest
from laboratory_data import LAW, VALUES, effective_hardening, lab_file

from fenchel.errors import ConvergenceError, InputError
from fenchel.identify import LaboratoryTest, fit_laboratory, identify_laboratory, read_laboratory
from fenchel.identify.laboratory_replay import replay_laboratory
from fenchel.identify.laboratory_start import start_values
from fenchel.integrators import drive, read_path
from fenchel.potentials import Law, forces, indicator, isotropic, load_law, norm, parameters, scalar, sym_tensor
from fenchel.potentials.library import LAWS

PRESSURES = (5e4, 1e5, 2e5)
FELT = ("E_s", "nu_s", "theta_f", "C_0", "H_eff")
TRUTH = VALUES | {"H_eff": effective_hardening()}
CLOSE = {"E_s": 0.01, "nu_s": 0.02, "theta_f": 0.01, "C_0": 0.1, "H_eff": 0.01}  # so that a wide interval does not help


def inside(fit, names, truth=TRUTH, factor=1.0):
    """Which of the planted values lie in the intervals, these widened by `factor`."""
    out = []
    for name in names:
        e = fit.estimates[name]
        out.append(e.value - factor * (e.value - e.low) <= truth[name] <= e.value + factor * (e.high - e.value))
    return out


def files(folder, water="drained", pressures=PRESSURES, **options):
    return [lab_file(folder, f"{water}_{P / 1e3:g}.csv", LAW, P, water=water, **options) for P in pressures]


@pytest.mark.parametrize(
    "mix",
    [("drained",) * 3, ("undrained",) * 3, ("drained", "undrained", "drained")],
    ids=["drained", "undrained", "both"],
)
def test_planted_values_lie_in_their_intervals(tmp_path, mix):
    paths = [files(tmp_path, water, (P,), seed=11)[0] for water, P in zip(mix, PRESSURES, strict=True)]
    held_out = files(tmp_path, mix[0], (1.5e5,), seed=12)
    fit = identify_laboratory(paths, held_out=held_out)
    assert all(inside(fit, FELT))
    for name in FELT:
        assert fit.estimates[name].value == pytest.approx(TRUTH[name], rel=CLOSE[name])
    predicted = fit.replays[-1]
    assert predicted.held_out and [r.held_out for r in fit.replays].count(True) == 1
    assert predicted.error_q < 5e-3 and predicted.error_second < 1e-2


def test_a_monotonic_test_does_not_part_the_two_hardenings(tmp_path):
    fit = identify_laboratory(files(tmp_path, pressures=(1e5, 2e5)))
    assert "H_i" not in fit.fitted and "H_k" in fit.fitted
    assert "not told apart from H_k" in fit.estimates["H_i"].note
    assert np.isnan(fit.estimates["H_i"].low)


def test_a_reversal_parts_them(tmp_path):
    fit = identify_laboratory(files(tmp_path, pressures=(1e5, 2e5), corners=(0.0, -0.02, 0.01), seed=5))
    assert all(inside(fit, VALUES, VALUES))
    assert fit.estimates["H_k"].value == pytest.approx(LAW.H_k, rel=0.02)
    assert fit.estimates["H_i"].value == pytest.approx(LAW.H_i, rel=0.05)


def test_without_noise_the_values_are_exact(tmp_path):
    paths = files(tmp_path, pressures=(1e5,), corners=(0.0, -0.02, 0.01), noise=0.0, rounded=False)
    paths += files(tmp_path, "undrained", (5e4,), noise=0.0, rounded=False)
    fit = identify_laboratory(paths, start={"E_s": 2e7, "theta_f": 0.4, "C_0": 1e4, "H_k": 3e6, "H_i": 1e5})
    for name, value in VALUES.items():
        assert fit.values[name] == pytest.approx(value, rel=1e-5)
    assert fit.misfit < 1e-6


@pytest.mark.parametrize("water", ["drained", "undrained"])
def test_the_law_follows_a_test_as_the_independent_one_does(water):
    axial, _ = planted_law.path((0.0, -0.02, 0.004), 1e-4)
    q, second = getattr(laboratory_data, water)(LAW, 1e5, axial)
    channel = {"volume_strain" if water == "drained" else "pore_pressure": second}
    test = LaboratoryTest(name="x", pressure=1e5, axial_strain=axial, q=q, **channel)
    run = replay_laboratory(LAWS["sand"].compile("3d"), VALUES, test)
    assert np.abs(run.q - q).max() < 1e-3
    assert np.abs(run.second - second).max() < (1e-12 if water == "drained" else 1e-3)
    mean = 1e5 + q / 3 - (0.0 if water == "drained" else second)
    assert np.abs(run.pressure - mean).max() < 1e-3


def test_an_interval_holds_the_truth_as_often_as_it_says(tmp_path):
    """95 %: of 5 values in 12 repetitions with other noise at least 85 % are inside, and not by mere width."""
    hits, pulls = [], []
    for seed in range(12):
        fit = identify_laboratory(files(tmp_path, pressures=(1e5,), seed=100 + seed, step=5e-4))
        hits += inside(fit, FELT)
        pulls += [(fit.estimates[n].value - TRUTH[n]) / fit.estimates[n].deviation_residuals for n in FELT]
    assert np.mean(hits) >= 0.85
    assert 0.7 < np.std(pulls) < 1.4


def test_more_noise_means_wider_intervals(tmp_path):
    width = []
    for noise in (1.0, 4.0):
        e = identify_laboratory(files(tmp_path, pressures=(1e5, 2e5), noise=noise)).estimates["E_s"]
        width.append(e.deviation_residuals)
    assert 2.5 < width[1] / width[0] < 6.0


def test_misfits_that_follow_one_another_count_for_less():
    """The same misfits, once as a slow wave and once shuffled: a wave of 40 rows has few independent values."""
    axial, _ = planted_law.path((0.0, -0.03), 2e-4)
    q, volume = laboratory_data.drained(LAW, 1e5, axial)
    wave = 2e3 * np.sin(2.0 * np.pi * np.arange(len(q)) / 40.0)
    width = []
    for loose in (wave, np.concatenate([[0.0], np.random.default_rng(3).permutation(wave[1:])])):
        test = LaboratoryTest(name="x", pressure=1e5, axial_strain=axial, q=q + loose, volume_strain=volume)
        fit = fit_laboratory(LAWS["sand"], [test], law_name="sand", hold=["H_i"])
        width.append(fit.estimates["H_eff"].deviation_residuals)
    assert width[0] > 3.0 * width[1]


def test_three_files_give_a_jackknife_and_the_wider_interval_is_told(tmp_path):
    """Its deviation is that of the three fits to two files each, √((g−1)/g Σ(x − x̄)²); Student, two degrees of freedom."""
    paths = files(tmp_path, step=1e-3)
    fit = identify_laboratory(paths, hold=["H_i"])
    near = dict(start=fit.values, hold=["H_i"])
    pairs = [identify_laboratory([p for p in paths if p != left], **near) for left in paths]
    for name in FELT:
        e, values = fit.estimates[name], np.array([pair.estimates[name].value for pair in pairs])
        between = np.sqrt(2.0 / 3.0 * np.sum((values - values.mean()) ** 2))
        assert e.deviation_files == pytest.approx(between, rel=0.01)
        assert e.high - e.value >= 4.30265 * e.deviation_files * (1.0 - 1e-4)
        assert (e.source == "files") == (e.high - e.value <= 4.30265 * e.deviation_files * (1.0 + 1e-4))
    assert "files" in {fit.estimates[name].source for name in FELT}
    assert all(pair.estimates[n].source == "residuals" for pair in pairs for n in FELT)
    assert all(np.isnan(pair.estimates[n].deviation_files) for pair in pairs for n in FELT)


def test_signs_and_back_pressure_make_no_difference(tmp_path):
    soil = read_laboratory(files(tmp_path, "undrained", (1e5,))[0])
    other = lab_file(tmp_path, "t.csv", LAW, 1e5, water="undrained", soil=False)
    tension = read_laboratory(other, signs="tension-positive")
    back = read_laboratory(lab_file(tmp_path, "b.csv", LAW, 1e5, water="undrained", back=3e5))
    for test in (tension, back):
        assert test.pressure == pytest.approx(1e5)
        assert np.allclose(test.axial_strain, soil.axial_strain) and np.allclose(test.q, soil.q)
        assert np.abs(test.second - soil.second).max() < 101.0  # rounded to 0.1 kPa
    assert soil.axial_strain[-1] == pytest.approx(-0.03) and soil.q[-1] > 0.0
    assert soil.second[-1] < 0.0  # it dilates, so the water is under suction


def test_start_values_are_read_off_the_curves():
    """On a bilinear curve the readings are exact."""
    axial, _ = planted_law.path((0.0, -0.03), 2e-4)
    tests = []
    for P in PRESSURES:
        q, volume = laboratory_data.drained(LAW, P, axial)
        tests.append(LaboratoryTest(name="x", pressure=P, axial_strain=axial, q=q, volume_strain=volume))
    start = start_values("sand", tests)
    for name in ("E_s", "nu_s", "theta_f", "C_0"):
        assert start[name] == pytest.approx(VALUES[name], rel=1e-6)
    carried = start["H_k"] * (0.5 + np.tan(start["theta_f"]) ** 2 / 3.0) + start["H_i"]
    assert carried == pytest.approx(effective_hardening(), rel=1e-6)
    assert start_values("no_such_law", tests) == {}


def mohr_coulomb_test(P, *, E=2e7, nu=0.3, phi=0.55, c=5e3, H=8e5):
    """Closed form: q = E ε to q_y = 2(c cos φ + P sin φ)/(1 − sin φ), then ε_p = γ(1 − sin φ)/2, tr ε^p = γ sin φ."""
    s = sin(phi)
    rng = np.random.default_rng(round(P))
    q_y = 2.0 * (c * cos(phi) + P * s) / (1.0 - s)
    slope = H / (0.5 * (1.0 - s)) ** 2
    eps = np.linspace(0.0, 0.02, 81)
    q = np.where(eps < q_y / E, E * eps, q_y + (eps - q_y / E) / (1.0 / E + 1.0 / slope))
    gamma = np.maximum(q - q_y, 0.0) * 0.5 * (1.0 - s) / H
    volume = -(1.0 - 2.0 * nu) * q / E + s * gamma
    loose = rng.standard_normal((2, len(eps))) * (eps > 0.0)
    return LaboratoryTest(
        name=f"{P:g}", pressure=P, axial_strain=-eps, q=q + 300.0 * loose[0], volume_strain=volume + 2e-5 * loose[1]
    )


def test_mohr_coulomb_by_its_closed_form():
    tests = [mohr_coulomb_test(P) for P in PRESSURES]
    fit = fit_laboratory(LAWS["mohr_coulomb"], tests, law_name="mohr_coulomb")
    truth = dict(E=2e7, nu=0.3, phi=0.55, c=5e3, H_i=8e5)
    assert all(inside(fit, truth, truth))
    for name, value in truth.items():
        assert fit.values[name] == pytest.approx(value, rel=0.05)


def test_a_value_that_the_data_push_to_its_bound_ends_on_it():
    """A sand without cohesion, whose curves would ask for a negative one."""
    tests = [mohr_coulomb_test(P, c=-2e3) for P in PRESSURES[:2]]
    fit = fit_laboratory(LAWS["mohr_coulomb"], tests, law_name="mohr_coulomb")
    assert fit.values["c"] == 0.0
    assert "at its lower bound" in fit.estimates["c"].note


def test_a_held_parameter_stays_and_the_volume_may_be_left_out(tmp_path):
    paths = files(tmp_path, pressures=(1e5, 2e5))
    fit = identify_laboratory(paths, hold=["nu_s", "H_i"], start={"nu_s": 0.1, "H_i": LAW.H_i})
    assert fit.values["nu_s"] == 0.1 and fit.values["H_i"] == LAW.H_i
    assert fit.estimates["nu_s"].note == "held"
    blind = identify_laboratory(paths, volume_weight=0.0)
    assert "do not feel it" in blind.estimates["nu_s"].note  # drained, q does not depend on it
    assert blind.values["theta_f"] == pytest.approx(LAW.theta_f, rel=0.02)


def test_a_declared_law_starts_from_its_defaults_or_asks():
    E, nu, k, H = parameters("E nu k H")
    eps, eps_p, p = sym_tensor("eps"), sym_tensor("eps_p"), scalar("p")
    A, R = forces(eps_p, p)
    own = Law(
        "own",
        psi=isotropic(E, nu).energy(eps - eps_p) + H / 2 * p**2,
        phi_star=indicator(norm(A) + R - k),
        observable=eps,
        internal=(eps_p, p),
    )
    tests = [mohr_coulomb_test(1e5)]
    with pytest.raises(InputError, match=r"-p E=VALUE -p H=VALUE -p k=VALUE -p nu=VALUE"):
        fit_laboratory(own, tests)
    fit = fit_laboratory(own, tests, start=dict(E=1e7, nu=0.2, k=3e5, H=1e6))
    assert fit.misfit < 0.5


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("norton", "depends on the rate"),
        ("thermo_elasto_plastic", "has a temperature"),
        ("cam_clay", "-p H_i=VALUE -p a=VALUE"),
    ],
)
def test_a_law_that_cannot_be_fitted_says_why(name, said):
    with pytest.raises(InputError, match=said):
        fit_laboratory(LAWS[name], [mohr_coulomb_test(1e5)], law_name=name)


def test_a_law_that_carries_no_pressure_says_so():
    with pytest.raises(ConvergenceError, match="wire"):
        fit_laboratory(LAWS["wire"], [mohr_coulomb_test(1e5)], start=dict(lambda_w=1e5, mu_w=1e5))


@pytest.mark.parametrize("water", ["drained", "undrained"])
def test_the_written_law_drives_as_it_was_fitted(tmp_path, water):
    fit = identify_laboratory(files(tmp_path, water, (1e5,)), tmp_path / "out")
    law = load_law(f"{tmp_path / 'out' / 'law.py'}:law")
    assert {s.name: s.default for s in law.parameters} == pytest.approx(fit.values)
    history = drive(law, read_path(tmp_path / "out" / f"path_{water}_100.csv"), {})
    start = 5  # steps of isotropic compression
    assert history.sig[start, :3] == pytest.approx(-1e5)
    q = history.sig[:, 0] - history.sig[:, 2]
    assert q[-1] == pytest.approx(fit.replays[0].run.q[-1], rel=1e-9)
    numbers = json.loads((tmp_path / "out" / "report.json").read_text())
    assert numbers["values"] == pytest.approx(fit.values)
