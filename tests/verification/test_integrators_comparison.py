"""`compare`: agreement, reasons, order and verdict against what is known of the laws and paths."""

import dataclasses

import numpy as np
import pytest

from fenchel.errors import InputError
from fenchel.integrators import StrainStressPath, compare, drive_arrays
from fenchel.integrators.comparison_runs import spread
from fenchel.integrators.comparison_verdict import FormulationFigures, judge
from fenchel.integrators.history import path_plan
from fenchel.integrators.path_certificate import PathData, path_gaps, worst_condition
from fenchel.integrators.step_order import cut_path, measure_order
from fenchel.integrators.update import Update
from fenchel.potentials.library import (
    ENTRIES,
    drucker_prager,
    kelvin_voigt,
    mohr_coulomb,
    norton,
    perzyna,
    sand,
    texsol,
    thermo_elasto_plastic,
    von_mises,
)

STRAINS, STRESSES = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)
AXIAL = np.array([True, True, False, True, True, True])


def size_of(law):
    return float(np.linalg.norm(ENTRIES[law.name].worked.eps))


def strain_path(law, rows=7, seed=1, amplitude=2.0):
    """A turning strain path from zero."""
    corner = amplitude * size_of(law) * np.random.default_rng(seed).normal(size=(2, 6)) / np.sqrt(6)
    s = np.linspace(0.0, 1.0, rows)[:, None]
    return StrainStressPath(0.1 * np.arange(rows), STRAINS, s * corner[0] + s**2 * corner[1])


def axial_path(law, rows=6, amplitude=2.0):
    targets = np.zeros((rows, 6))
    targets[:, 2] = -amplitude * size_of(law) * np.linspace(0.0, 1.0, rows)
    return StrainStressPath(0.1 * np.arange(rows), AXIAL, targets)


def values(law):
    return dict(ENTRIES[law.name].values)


def quick(law, path, **more):
    return compare(law, path, values(law), **{"sampled_rows": 1, "parts": (1, 2, 4)} | more)


def run_of(found, formulation, solver):
    return next(run for run in found.runs if (run.formulation, run.solver) == (formulation, solver))


LONG = [pytest.param(law, marks=pytest.mark.validate) for law in (texsol, mohr_coulomb, perzyna)]


@pytest.mark.parametrize("law", [sand, kelvin_voigt, *LONG], ids=lambda law: law.name)
def test_every_run_that_follows_agrees_and_every_other_says_why(law):
    found = quick(law, axial_path(law))
    assert found.agree
    followed = [run for run in found.runs if not run.failure]
    assert {run.formulation for run in followed} == {"strain", "stress"}
    assert {"general", "conic", "cvxpy"} <= {run.solver for run in followed}
    for run in found.runs:
        assert bool(run.failure) != bool(run.agrees)
        assert "\n" not in run.failure
    reference = found.runs[found.reference]
    assert reference.stress == 0.0 and reference.gap < 1e-10
    exact = [run for run in followed if run.solver not in ("cvxpy", "explicit")]
    assert max(run.stress for run in exact) <= 1e-8
    assert all(set(run.internal) == {v.name for v in law.internal} for run in followed)


def test_a_law_with_temperature_is_compared():
    path = dataclasses.replace(axial_path(thermo_elasto_plastic), temperature=np.linspace(293.0, 350.0, 6))
    found = quick(thermo_elasto_plastic, path)
    assert found.agree and run_of(found, "stress", "general").agrees
    assert "isothermal" in run_of(found, "strain", "explicit").failure


def test_perfect_plasticity_is_not_followed_by_stresses_and_the_row_is_named():
    perfect = values(drucker_prager) | {"H_i": 0.0}
    found = compare(drucker_prager, strain_path(drucker_prager), perfect, sampled_rows=1, parts=(1, 2))
    stress = [run for run in found.runs if run.formulation == "stress" and run.solver in ("closed", "general")]
    assert stress and all("fails at row" in run.failure for run in stress)
    assert found.agree and found.verdict.best == "strain"
    assert "no use" in found.verdict.reason and "fails at row" in found.verdict.text


def test_a_planted_error_of_1e_minus_6_is_seen_and_does_not_become_the_reference(monkeypatch):
    from fenchel.integrators import comparison_runs

    honest = comparison_runs.follow_path

    def planted(update, path, given):
        history = honest(update, path, given)
        if isinstance(update, Update) and update.solver == "closed":
            return dataclasses.replace(history, sig=history.sig * (1.0 + 1e-6))
        return history

    monkeypatch.setattr(comparison_runs, "follow_path", planted)
    found = quick(sand, strain_path(sand))
    wrong = run_of(found, "strain", "closed")
    assert not found.agree and wrong.agrees is False
    assert wrong.stress == pytest.approx(1e-6, rel=1e-3)
    assert wrong.gap > 1e-8
    assert found.runs[found.reference] != wrong
    assert all(run.agrees for run in found.runs if run is not wrong and not run.failure)


@pytest.mark.parametrize("part", ["sig", "eps_p", "p"])
def test_the_certificate_is_linear_in_an_error_of_any_part(part):
    path, given = axial_path(von_mises), values(von_mises)
    update = von_mises.compile()
    history = drive_arrays(update, path.control, path.targets, given)
    data = PathData(von_mises, given, np.ones(6), None)
    assert path_gaps(data, history).max() < 1e-12 * history.psi.max()
    found = []
    for error in (1e-4, 1e-6):
        if part == "sig":
            wrong = dataclasses.replace(history, sig=history.sig * (1 + error))
        else:
            wrong = dataclasses.replace(history, state=history.state | {part: history.state[part] * (1 + error)})
        found.append(path_gaps(data, wrong).max())
    assert found[1] > 1e-10 * history.psi.max()
    assert 50.0 < found[0] / found[1] < 200.0  # the two bounds take turns, each is linear


def test_a_radial_path_of_a_rate_independent_law_is_exact_in_the_step_size():
    found = quick(von_mises, dataclasses.replace(axial_path(von_mises), control=STRAINS))
    assert found.order.exact and found.order.order is None
    assert found.order.meaning.startswith("exact")


def test_relaxation_by_creep_is_of_first_order_and_the_error_is_that_of_the_closed_form():
    # uniaxial strain held; ε̇_p = rate_0 (q/σ_0)^n: q̇ = −3 μ rate_0 (q/σ_0)^n under a fixed deviator of strain
    given = values(norton)
    mu = given["E"] / (2 * (1 + given["nu"]))
    start = 2.0e8
    targets = np.zeros((9, 6))
    targets[:, 5] = np.sqrt(2) * start / np.sqrt(3) / (2 * mu)
    targets[0] = 0.0
    pace = 3 * mu * given["rate_0"] * (start / given["sigma_0"]) ** given["n"] / start
    # put on suddenly: cut in parts, a slow rise would hide the order behind that of a power of time
    rise = 1e-6 / pace
    path = StrainStressPath(np.concatenate([[-rise], np.arange(8) * 0.05 / pace]), STRAINS, targets)
    update = norton.compile()
    order = measure_order(
        lambda cut: drive_arrays(update, cut.control, cut.targets, given, times=cut.time),
        path,
        (1, 2, 4, 8, 16),
    )
    assert 0.9 <= order.order <= 1.1
    assert "first order" in order.meaning
    # the closed form of relaxation itself, from a sudden strain, for the scheme that the order was measured on
    times = np.linspace(0.0, 0.4 / pace, 2001)
    sudden = np.broadcast_to(targets[1], (2001, 6))
    history = drive_arrays(update, STRAINS, sudden, given, times=times)
    q = np.sqrt(3.0) * history.sig[:, 5] / np.sqrt(2.0)
    n = given["n"]
    exact = start * (1.0 + (n - 1.0) * pace * (times[-1] + times[1])) ** (-1.0 / (n - 1.0))
    assert q[-1] == pytest.approx(exact, rel=1e-3)


def test_a_turning_plastic_path_is_of_first_order():
    found = quick(von_mises, strain_path(von_mises, rows=9, amplitude=3.0), parts=(1, 2, 4, 8, 16))
    assert 0.85 <= found.order.order <= 1.15
    assert found.order.error > 1e-4


def test_the_order_of_a_scheme_of_known_order_is_found():
    # heights of a parabola and a line with planted errors of order 1 and 2 in the step
    path = StrainStressPath(np.arange(4.0), STRAINS, np.arange(4.0)[:, None] * np.ones(6))
    for order in (1, 2):

        def run(cut, order=order):
            parts = (len(cut.time)) // 4
            history = drive_arrays(von_mises.compile(), STRAINS, 1e-6 * cut.targets, values(von_mises))
            return dataclasses.replace(history, sig=history.sig * (1.0 + 0.01 * parts**-order))

        found = measure_order(run, path, (1, 2, 4, 8))
        assert found.order == pytest.approx(order, abs=0.02)
        assert found.error == pytest.approx(0.01, rel=0.05)


def test_cut_steps_pass_the_rows_of_the_path_exactly():
    path = StrainStressPath(
        np.array([1.0, 1.5, 3.0]),
        AXIAL,
        np.array([[0.1] * 6, [0.3] * 6, [-0.7] * 6]),
        None,
        None,
        np.array([300.0, 310.0, 305.0]),
    )
    cut = cut_path(path, 4)
    assert cut.time.shape == (12,) and cut.time[3::4].tolist() == path.time.tolist()
    assert (cut.targets[3::4] == path.targets).all()
    assert cut.time[0] == pytest.approx(0.5 + 0.125) and cut.targets[0, 0] == pytest.approx(0.025)
    assert cut.temperature[:4] == pytest.approx(300.0) and cut.temperature[5] == pytest.approx(305.0)
    assert np.diff(cut.time) == pytest.approx(np.repeat([0.125, 0.125, 0.375], 4)[1:])


def test_the_verdict_follows_what_is_prescribed():
    driven = quick(sand, strain_path(sand))
    given = values(sand)
    stresses = drive_arrays(sand.compile(), STRAINS, strain_path(sand).targets, given).sig
    carried = quick(sand, StrainStressPath(np.arange(7.0), STRESSES, stresses))
    assert driven.agree and carried.agree
    assert (driven.verdict.best, carried.verdict.best) == ("strain", "stress")
    strain, stress = driven.verdict.figures
    assert (strain.unknowns, stress.unknowns, strain.condition) == (0, 6, 1.0)
    assert stress.condition > 1.0 and run_of(driven, "strain", "closed").iterations == 0.0
    strain, stress = carried.verdict.figures
    assert (strain.unknowns, stress.unknowns, stress.condition) == (6, 0, 1.0)
    assert run_of(carried, "strain", "closed").iterations > 0.0


def test_the_rule_of_the_verdict():
    strain = FormulationFigures("strain", 5, 4.0, "closed", 1e-5)
    stress = FormulationFigures("stress", 1, 2.0, "closed", 2e-5)
    assert judge(strain, stress).best == "stress"
    assert judge(strain, dataclasses.replace(stress, time_per_step=9e-5)).best == "strain"
    assert judge(strain, dataclasses.replace(stress, failure="fails")).best == "strain"
    assert judge(dataclasses.replace(strain, failure="x"), dataclasses.replace(stress, failure="y")).best is None
    three, ill = dataclasses.replace(strain, unknowns=3), dataclasses.replace(stress, unknowns=3, condition=1e4)
    assert judge(three, ill).best == "strain"
    assert judge(three, dataclasses.replace(ill, condition=4.0, time_per_step=1e-6)).best == "stress"


def test_the_condition_is_that_of_the_matrix_that_is_solved():
    plan = path_plan(AXIAL, np.zeros((1, 6)), None, None, False)
    tangent = np.diag([1.0, 2.0, 50.0, 4.0, 5.0, 10.0])
    assert worst_condition(plan, tangent[None], False) == pytest.approx(10.0)
    whole = path_plan(STRAINS, np.zeros((1, 6)), None, None, True)
    assert worst_condition(whole, tangent[None], True) == pytest.approx(50.0)
    # two strains prescribed, coupled to the rest: the compliance of the two, which is not the inverse of their stiffness
    two = path_plan(np.array([False, False, True, True, True, True]), np.zeros((1, 6)), None, None, True)
    coupled = np.eye(6)
    coupled[0, 2] = coupled[2, 0] = 0.9  # compliance of the first: 1/(1 − 0.81); stiffness of the two: the identity
    assert worst_condition(two, coupled[None], True) == pytest.approx(1.0 / (1.0 - 0.81))
    assert worst_condition(whole, np.diag([0.0, 1, 1, 1, 1, 1])[None], True) == np.inf
    assert worst_condition(path_plan(STRAINS, np.zeros((1, 6)), None, None, False), tangent[None], False) == 1.0


def test_sampled_rows_are_spread_and_hold_the_last():
    for rows, count in ((1, 3), (5, 5), (100, 7), (11, 10)):
        found = spread(rows, count)
        assert found[-1] == rows - 1 and len(found) == min(rows, count) and found[0] >= 0
        assert np.diff(found).max(initial=1) <= np.ceil(rows / count)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(given={"E": 1e9}), "no value; give"),
        (dict(tolerance=0.0), "tolerance"),
        (dict(parts=(1, 3)), "parts"),
        (dict(sampled_rows=0), "rows"),
    ],
)
def test_bad_input_is_refused_before_anything_runs(change, words):
    given = change.pop("given", values(von_mises))
    with pytest.raises(InputError, match=words):
        compare(von_mises, axial_path(von_mises), given, **change)


def test_what_is_prescribed_throughout_is_followed_without_a_tangent_and_nothing_else():
    path, given = strain_path(von_mises, rows=4), values(von_mises)
    exact = drive_arrays(von_mises.compile(), STRAINS, path.targets, given)
    for solver, close in (("cvxpy", 1e-4), ("explicit", 0.1)):
        update = von_mises.compile(solver=solver)
        found = drive_arrays(update, STRAINS, path.targets, given)
        assert np.abs(found.sig - exact.sig).max() <= close * np.abs(exact.sig).max()
        assert found.psi == pytest.approx(exact.psi, rel=2 * close, abs=1.0)
        assert found.dissipation == pytest.approx(exact.dissipation, rel=2 * close, abs=close * exact.dissipation[-1])
        with pytest.raises(InputError, match="no tangent"):
            drive_arrays(update, AXIAL, path.targets, given)


@pytest.mark.parametrize("formulation", ["strain", "stress"])
def test_a_virgin_row_of_zeros_is_followed_by_the_cone_program(formulation):
    path, given = axial_path(sand), values(sand)
    for solver in ("general", "conic"):
        update = sand.compile(solver=solver, formulation=formulation)
        history = drive_arrays(update, path.control, path.targets, given)
        assert np.abs(history.sig[0]).max() <= 1e-9 * np.abs(history.sig).max()
