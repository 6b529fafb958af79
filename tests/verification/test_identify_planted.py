"""Planted parameters: tests made by an independent law (`tests/planted_law.py`) must give its parameters back.

Provenance of the truth: closed-form return map and unilateral wire in principal components, checked here against published
regression values; Table 3 of Laniel, Alart and Pagano for the sets.
"""

from __future__ import annotations

from math import tan

import numpy as np
import planted_law
import pytest

from fenchel.identify import (
    IdentifyOptions,
    Replay,
    Specimen,
    curves,
    effective_hardening,
    elastic_moduli,
    fit_law,
    fit_yield,
    identify_law,
)

Planted = planted_law.Planted

TABLE_3 = Planted(E_s=12.167e6, E_w=0.332e6, nu=0.2, theta_f=0.079, C_0=2842.0, H_k=0.944e6, H_i=0.472e6)
GRAINS = Planted(E_s=13e6, E_w=0.9e6, nu=0.12, theta_f=0.30, C_0=4500.0, H_k=2.6e6, H_i=0.15e6)
PRESSURES = (5e4, 7e4, 9e4)
SEVEN = ("E_s", "E_w", "nu", "theta_f", "C_0", "H_k", "H_i")


def simulate(parameters, pressure, axial_strain):
    """The independent law as the route of the fit."""
    strain, sand, wire = planted_law.triaxial(Planted(**parameters.to_json()), float(np.mean(pressure)), axial_strain)
    return Replay(strain=strain, stress=sand + wire, wire=wire)


def curves_of(law, corners=(0.0, -0.01, 0.006, -0.01), **options):
    return [curves(planted_law.history(law, P, corners, **options)) for P in PRESSURES]


def test_the_truth_is_the_law():
    """Regression values: apex step and wire stress of the set E_s = 12, E_w = 6 MPa."""
    law = Planted(E_s=12e6, E_w=6e6, nu=0.2, theta_f=0.079, C_0=2842.0, H_k=0.944e6, H_i=0.472e6)
    stress, _, _, p = planted_law.sand_step([4.00e-2, 3.99e-2, 3.98e-2], [0.0] * 3, [0.0] * 3, 0.0, law)
    assert stress == pytest.approx([736349.573, 736263.316, 736177.058], abs=1e-3)
    assert p == pytest.approx(0.1169775913, rel=1e-9)
    assert planted_law.wire_stress([-2e-3, 1e-3, 1e-3], 6e6, 0.2) == pytest.approx([0.0, 5000.0, 5000.0])


@pytest.mark.parametrize("law", [TABLE_3, GRAINS], ids=["table_3", "grains"])
def test_all_seven_are_recovered(law):
    fit = fit_law(curves_of(law), IdentifyOptions(fit_frames=100), simulate)
    assert fit.hardening is not None and fit.hardening.separable
    assert fit.hardening.joint.condition < 10.0
    for stage in (fit.hardening.staged, fit.hardening.joint):
        assert stage.misfit < 1e-6
        for name in SEVEN:
            assert getattr(stage.parameters, name) == pytest.approx(getattr(law, name), rel=1e-2), name
    free = fit.hardening.free_stiffness
    assert free is not None and free.parameters.E_s == pytest.approx(law.E_s, rel=1e-3)
    assert fit.elastic.nu == pytest.approx(law.nu, rel=1e-6)
    assert fit.yielding.H_eff == pytest.approx(effective_hardening(law.H_k, law.H_i, tan(law.theta_f)), rel=1e-6)
    assert fit.elastic.E_w_bilateral < 0.5 * fit.elastic.E_w  # the bilateral reading is far off


def test_own_strain_reads_each_phase_with_its_own():
    """Wires that take 60 % of the strain: 'own' finds E_w, 'shared' finds 60 % of it."""
    histories = [planted_law.history(GRAINS, P, (0.0, -0.005)) for P in PRESSURES]
    slack = []
    for h in histories:
        values = {**vars(h), "strain_wire": 0.6 * h.strain_sand, "stress_links": 0.6 * h.stress_links}
        slack.append(curves(type(h)(**values)))
    options = IdentifyOptions()
    assert elastic_moduli(slack, options, strain="own").E_w == pytest.approx(GRAINS.E_w, rel=1e-6)
    assert elastic_moduli(slack, options, strain="shared").E_w == pytest.approx(0.6 * GRAINS.E_w, rel=1e-6)


@pytest.mark.parametrize("law", [TABLE_3, GRAINS], ids=["table_3", "grains"])
def test_consistency_line_is_exact_without_and_with_wires(law):
    """√J₂ = C_0 + t P_s + H_eff p point by point, whatever the wires carry."""
    for linked in (True, False):
        tests = [curves(planted_law.history(law, P, (0.0, -0.01), linked=linked)) for P in PRESSURES]
        found = fit_yield(tests, law.E_s, law.nu, IdentifyOptions())
        assert found.misfit < 1e-9
        assert found.t == pytest.approx(tan(law.theta_f), rel=1e-6)
        assert pytest.approx(law.C_0, rel=1e-6) == found.C_0
        assert found.H_eff == pytest.approx(effective_hardening(law.H_k, law.H_i, tan(law.theta_f)), rel=1e-6)


def test_study_reading_is_biased_upwards():
    """At vanishing offset: own mean stress gives t; the confining pressure gives t/(1 − t/√3), +21 % at t = 0.3."""
    law = Planted(E_s=13e6, E_w=0.0, nu=0.2, theta_f=0.30, C_0=3000.0, H_k=1e5, H_i=1e4)
    tests = [curves(planted_law.history(law, P, (0.0, -0.01), step=2e-5)) for P in PRESSURES]
    found = fit_yield(tests, law.E_s, law.nu, IdentifyOptions(yield_offset=1e-6))
    t = tan(law.theta_f)
    assert found.own_least_squares is not None and found.study_least_squares is not None
    assert found.own_least_squares.slope == pytest.approx(t, rel=1e-2)
    assert found.study_least_squares.slope == pytest.approx(t / (1 - t / np.sqrt(3)), rel=1e-2)
    assert pytest.approx(law.C_0, rel=0.06) == found.own_least_squares.C_0  # a chord across the kink, one frame wide


def test_without_reversal_only_the_sum_is_reported():
    law = TABLE_3
    fit = fit_law(curves_of(law, (0.0, -0.01)), IdentifyOptions(fit_frames=60), simulate)
    hard = fit.hardening
    assert hard is not None and not hard.separable and not hard.staged.separable
    t = tan(law.theta_f)
    for stage in (hard.staged, hard.joint):
        assert stage.condition > 1e6
        assert stage.column_ratio == pytest.approx(0.5 + t * t / 3.0, rel=1e-5)
        assert stage.H_eff == pytest.approx(effective_hardening(law.H_k, law.H_i, t), rel=1e-2)


def test_unloading_short_of_extension_does_not_part_them():
    """A reversal that stays elastic leaves the columns parallel."""
    fit = fit_law(curves_of(TABLE_3, (0.0, -0.01, -0.009)), IdentifyOptions(fit_frames=60), simulate)
    assert fit.hardening is not None and not fit.hardening.separable
    assert fit.hardening.joint.condition > 1e6


def test_isotropic_hardening_at_its_bound_is_said():
    law = Planted(**{**vars(GRAINS), "H_i": 0.0})
    fit = fit_law(curves_of(law), IdentifyOptions(fit_frames=100), simulate)
    assert fit.hardening is not None
    assert fit.hardening.joint.parameters.H_k == pytest.approx(law.H_k, rel=1e-2)
    assert fit.hardening.joint.parameters.H_i < 1e-3 * law.H_k
    assert "H_i" in fit.hardening.joint.at_bound


@pytest.fixture(scope="module")
def noisy():
    """Two samples whose octants scatter by 4 %, with controls and one pressure held out."""
    pressures = (5e4, 6e4, 9e4)
    specimens = [
        Specimen(
            seed=seed,
            linked={P: planted_law.record(TABLE_3, P, seed, spread=0.04) for P in pressures},
            control={P: planted_law.record(TABLE_3, P, seed, spread=0.04, linked=False) for P in pressures},
        )
        for seed in (1, 2)
    ]
    options = IdentifyOptions(held_out=(6e4,), fit_frames=24, strength_strains=(0.005,))
    return identify_law(specimens, options)


def test_intervals_are_honest_under_noise(noisy):
    """The planted values lie inside, the two samples differ, and each sample lies inside the interval."""
    for name in SEVEN:
        e = noisy.estimates[name]
        assert e.low <= getattr(TABLE_3, name) <= e.high, name
        assert e.seed_values[0] != e.seed_values[1]
        assert e.low <= min(e.seed_values) and max(e.seed_values) <= e.high, name
        assert e.source in ("seeds", "octants") and e.octant_deviation > 0.0
    assert noisy.failed_replicas == 0


def test_control_and_its_difference(noisy):
    control = noisy.control
    assert control is not None
    assert control.wire_stress_max == 0.0 and control.fit.elastic.E_w == 0.0
    found = control.difference["q@0.005@50000"]
    truth = []
    for linked in (True, False):
        _, sand, wire = planted_law.triaxial(TABLE_3, 5e4, np.array([0.0, -0.005]), linked=linked)
        whole = sand + wire
        truth.append(whole[-1, 0] - whole[-1, 2])
    # the same octants carry the same noise with and without links: the difference is far sharper than its terms
    assert found.value == pytest.approx(truth[0] - truth[1], abs=0.05 * truth[0])
    assert found.octant_deviation < 0.5 * noisy.estimates["q@0.005@50000"].octant_deviation


def test_sand_alone_has_no_mismatch_and_no_wires():
    """Without beads there is no second strain: zeros must not be read as one."""
    values = {}
    for P in (5e4, 9e4):
        h = planted_law.history(TABLE_3, P, linked=False)
        values[P] = type(h)(**{**vars(h), "strain_wire": 0.0 * h.strain_sand, "linked": True})
    found = identify_law([Specimen(seed=1, linked=values)], IdentifyOptions(fit_frames=30))
    assert all(np.isnan(m.end_of_first_leg) for m in found.mismatches)
    text = " ".join(found.findings)
    assert "Strains of the phases" not in text and "sand alone" in text and "control" not in text


def test_what_links_change_is_said_at_the_largest_strain_reached():
    """The sphere strains less than the box: the last of the stated strains may not be there."""
    specimen = Specimen(
        seed=1,
        linked={P: planted_law.history(TABLE_3, P) for P in (5e4, 9e4)},
        control={P: planted_law.history(TABLE_3, P, linked=False) for P in (5e4, 9e4)},
    )
    found = identify_law([specimen], IdentifyOptions(fit_frames=30, strength_strains=(0.0025, 0.005, 0.02)))
    assert any("Links change q at 0.50%" in text for text in found.findings)


def test_held_out_pressure_is_predicted_and_not_fitted(noisy):
    held = [p for p in noisy.predictions if p.held_out and p.linked]
    assert {p.pressure for p in held} == {6e4} and noisy.fitted == (5e4, 9e4)
    assert all(p.error_q < 0.05 for p in held)
    assert "tau_y@60000" not in noisy.estimates


def test_one_sample_has_octant_intervals_and_bare_histories_none():
    options = IdentifyOptions(fit_frames=30)
    pressures = (5e4, 9e4)
    one = identify_law([Specimen(seed=3, linked={P: planted_law.record(TABLE_3, P, 3) for P in pressures})], options)
    assert one.estimates["E_s"].source == "octants" and one.control is None
    bare = identify_law([Specimen(seed=3, linked={P: planted_law.history(TABLE_3, P) for P in pressures})], options)
    assert bare.estimates["E_s"].source == "none" and np.isnan(bare.estimates["E_s"].low)
    assert any("without intervals" in text for text in bare.findings)
