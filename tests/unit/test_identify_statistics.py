"""Lines, jackknife, intervals, and refusals of the identification."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fenchel.dem.record import PhaseHistory
from fenchel.errors import InputError
from fenchel.identify import (
    IdentifyOptions,
    Specimen,
    curves,
    effective_hardening,
    estimate,
    identify_law,
    jackknife_deviation,
    least_absolute_line,
    least_squares_line,
    quality_notes,
)
from fenchel.identify.elastic import unit_hooke, unit_wire
from fenchel.identify.jsonable import jsonable

CONFINING = np.array([0.5, 0.6, 0.7, 0.8, 0.9]) * 1e5
STUDY = np.array([6832.0, 6947.0, 8429.0, 9679.0, 5810.0])  # Table 3 of Laniel, Alart and Pagano, yield stress [Pa]


def test_least_absolute_deviations_on_the_column_of_the_study():
    """0.0797 rad and 2839.5 Pa against the published 0.079 rad and 2842 Pa; the last row lies far below the line."""
    line = least_absolute_line(CONFINING, STUDY)
    assert line.slope == pytest.approx(0.07985, abs=1e-12)
    assert pytest.approx(2839.5, abs=1e-8) == line.C_0
    assert line.angle == pytest.approx(0.0797, abs=5e-5)
    assert STUDY[-1] - (2842.0 + 0.9e5 * np.tan(0.079)) == pytest.approx(-4157.0, abs=1.0)


def test_the_least_absolute_line_of_the_study_is_not_unique():
    """The line through 0.5 and 0.6 bar has the same sum of deviations, 5351 Pa."""
    assert not least_absolute_line(CONFINING, STUDY).unique
    other = 6257.0 + 0.0115 * CONFINING
    assert np.abs(STUDY - other).sum() == pytest.approx(5351.0)
    assert np.abs(STUDY - (2839.5 + 0.07985 * CONFINING)).sum() == pytest.approx(5351.0)
    assert least_absolute_line(CONFINING, np.array([0.0, 1.0, 2.0, 3.0, 10.0])).unique


def test_least_squares_does_not_give_the_study():
    line = least_squares_line(CONFINING, STUDY)
    assert line.slope == pytest.approx(0.0069, abs=5e-5) and pytest.approx(7058.0, abs=0.5) == line.C_0
    four = least_squares_line(CONFINING[:4], STUDY[:4])
    assert four.slope == pytest.approx(0.1002, abs=5e-5) and pytest.approx(1457.0, abs=1.0) == four.C_0


def test_least_absolute_line_is_optimal():
    """Against the linear program on random points."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(0)
    for _ in range(20):
        x, y = rng.standard_normal(6), rng.standard_normal(6)
        line = least_absolute_line(x, y)
        a = np.hstack([np.stack([np.ones(6), x], axis=1), np.eye(6), -np.eye(6)])
        program = linprog(np.r_[0, 0, np.ones(12)], A_eq=a, b_eq=y, bounds=[(None, None)] * 2 + [(0, None)] * 12)
        assert np.abs(y - line.C_0 - line.slope * x).sum() == pytest.approx(program.fun, rel=1e-9)


def test_jackknife_of_a_mean_is_the_textbook_formula():
    rng = np.random.default_rng(1)
    sample = rng.normal(3.0, 2.0, 8)
    leave_one_out = [np.delete(sample, k).mean() for k in range(8)]
    assert jackknife_deviation(leave_one_out) == pytest.approx(sample.std(ddof=1) / np.sqrt(8.0), rel=1e-12)


def test_seed_interval_covers_another_sample_at_its_nominal_rate():
    rng = np.random.default_rng(2)
    draws = rng.standard_normal((3000, 4))
    inside = 0
    for row in draws:
        e = estimate("x", "1", float(row[:3].mean()), row[:3], [], lower=None)
        inside += e.low <= row[3] <= e.high
    assert inside / len(draws) == pytest.approx(0.95, abs=0.013)


def test_octant_interval_of_one_sample_covers_another_at_its_nominal_rate():
    """The value is a mean over eight octants; the interval of one sample must hold the mean of another."""
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(2000):
        octants, other = rng.standard_normal(8), rng.standard_normal(8).mean()
        replicas = [[float(np.delete(octants, k).mean()) for k in range(8)]]
        e = estimate("x", "1", float(octants.mean()), [float(octants.mean())], replicas, lower=None)
        assert e.source == "octants"
        inside += e.low <= other <= e.high
    assert inside / 2000 == pytest.approx(0.95, abs=0.016)


def test_octants_are_a_floor_of_the_spread():
    """Two seeds that agree by chance do not give a narrow interval."""
    replicas = [[1.0, 1.1, 0.9, 1.05, 0.95, 1.0, 1.02, 0.98]] * 2
    e = estimate("x", "1", 1.0, [1.0, 1.000001], replicas)
    assert e.source == "octants" and e.high - e.low > 0.3
    wide = estimate("x", "1", 1.0, [0.5, 1.5], replicas)
    assert wide.source == "seeds" and wide.low == 0.0  # clipped at the physical bound


def test_failed_replicas_do_not_narrow_the_interval():
    """Five of eight octants left: the spread is the same on average, not √(4/7) of it."""
    rng = np.random.default_rng(5)
    whole, part = [], []
    for _ in range(2000):
        octants = rng.standard_normal(8)
        replicas = np.array([np.delete(octants, k).mean() for k in range(8)])
        whole.append(estimate("x", "1", 0.0, [0.0], [replicas], lower=None).octant_deviation ** 2)
        replicas[:3] = np.nan
        part.append(estimate("x", "1", 0.0, [0.0], [replicas], lower=None).octant_deviation ** 2)
    assert np.mean(whole) == pytest.approx(1.0 / 8.0, rel=0.05)
    assert np.mean(part) == pytest.approx(1.0 / 8.0, rel=0.05)
    few = np.array([1.0, 1.1, 0.9] + [np.nan] * 5)
    assert estimate("x", "1", 1.0, [1.0], [few]).source == "none"


def test_a_value_at_its_bound_everywhere_has_no_interval_of_no_width():
    e = estimate("H_i", "Pa", 0.0, [0.0, 0.0], [[0.0] * 8] * 2, note="at its lower bound")
    assert e.source == "none" and np.isnan(e.low) and np.isnan(e.high)
    some = estimate("H_i", "Pa", 0.0, [0.0, 0.0], [[0.0] * 7 + [1.0]] * 2)
    assert some.source == "octants" and some.low == 0.0 and some.high > 0.0


def test_quality_notes_say_what_is_not_met():
    good = {"inertial_number": 5e-4, "unbalanced_max": 1e-3, "violation_over_radius": 1e-5, "wall_box_difference": 1e-3}
    assert quality_notes([good]) == []
    (note,) = quality_notes([good, good | {"unbalanced_max": 0.03}])
    assert "NOT MET in 1 of 2" in note and "0.03" in note
    assert "NOT MET" in quality_notes([good | {"inertial_number": float("nan")}])[0]
    assert "17%" in quality_notes([good | {"wall_sphere_difference": 0.17}])[0]


def test_effective_hardening():
    assert effective_hardening(2.0, 0.5, 0.3) == pytest.approx(2.0 * (0.5 + 0.03) + 0.5)


def test_unit_responses():
    """Hooke at unit modulus in uniaxial stress; the wire is Hooke in all-round extension, zero in compression."""
    strain = np.array([-0.25, -0.25, 1.0, 0.0, 0.0, 0.0])
    assert unit_hooke(strain, 0.25) == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(4)
    near = np.array([1.0, 1.2, 0.9, 0.0, 0.0, 0.0]) + 0.1 * rng.standard_normal(6)
    assert unit_wire(near, 0.2) == pytest.approx(unit_hooke(near, 0.2), rel=1e-12)
    assert unit_wire(-near, 0.2) == pytest.approx(np.zeros(6), abs=1e-15)
    # published state: ε = diag(2, 1, −15)·10⁻⁴ with ε_12 = 3·10⁻⁴, E_w = 6 MPa, ν = 0.2
    state = np.array([2e-4, 1e-4, -15e-4, 0.0, 0.0, np.sqrt(2.0) * 3e-4])
    expected = [1321.99494, 948.69570, 0.0, 0.0, 0.0, np.sqrt(2.0) * 1119.89772]
    assert 6e6 * unit_wire(state, 0.2) == pytest.approx(expected, abs=1e-4)


def _history(pressure=5e4, frames=21, **changes):
    zero = np.zeros((frames, 6))
    axial = np.linspace(0.0, -1e-3, frames)
    values = {
        "pressure": pressure,
        "linked": True,
        "leg": np.zeros(frames, dtype=np.int64),
        "axial_strain": axial,
        "wall_strain": zero,
        "wall_stress": zero,
        "strain_sand": zero.copy(),
        "strain_wire": zero,
        "stress_grains": zero.copy(),
        "stress_beads": zero,
        "stress_links": zero,
    }
    values["strain_sand"][:, 2] = axial
    return PhaseHistory(**{**values, **changes})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: identify_law([]), "at least one specimen"),
        (lambda: identify_law([Specimen(seed=1, linked={5e4: _history()})]), "two or more"),
        (lambda: identify_law([Specimen(seed=1, linked={5e4: _history(), 7e4: _history(7e4)})]), "no stiffness"),
        (
            lambda: identify_law(
                [
                    Specimen(seed=1, linked={5e4: _history(), 7e4: _history(7e4)}),
                    Specimen(seed=2, linked={5e4: _history()}),
                ]
            ),
            "no linked test at 70000",
        ),
        (lambda: curves(_history(stress_grains=np.full((21, 6), np.nan))), "not finite at frame 0"),
        (lambda: curves(_history(stress_grains=np.zeros((9, 6)), stress_beads=np.zeros((9, 6)))), "shape"),
        (lambda: curves(_history(pressure=0.0)), "must be positive"),
        (lambda: curves(_history(), split="half"), 'use "links"'),
        (lambda: IdentifyOptions(window_sand=-1.0), "window_sand"),
        (lambda: IdentifyOptions(poisson_bounds=(0.1, 0.5)), "poisson_bounds"),
        (lambda: IdentifyOptions(strain="both"), "shared"),
        (lambda: least_absolute_line(np.ones(3), np.ones(3)), "different pressures"),
    ],
)
def test_bad_input_is_refused_in_one_line(call, words):
    with pytest.raises(InputError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_jsonable_has_no_nan_and_no_arrays():
    options = IdentifyOptions(held_out=(6e4,))
    text = json.dumps(jsonable({5e4: options, "x": float("nan"), "a": np.zeros(3), "n": np.int64(3)}), allow_nan=False)
    back = json.loads(text)
    assert back["x"] is None and "a" not in back and back["n"] == 3 and back["50000"]["held_out"] == [60000.0]
