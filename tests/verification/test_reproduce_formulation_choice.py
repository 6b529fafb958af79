"""Which formulation to identify with: the costs against independent truths, fits to planted data, a verdict that follows the numbers.

The duality gap of a step is computed again as two cone programs (theory page, section 6.1), the axial cost by the replay of the
identification, the Jacobian by exact sensitivities.
"""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from fenchel.errors import ConvergenceError, InputError
from fenchel.identify.curves import thin
from fenchel.identify.hardening import misfit_of
from fenchel.identify.replay import replay
from fenchel.integrators import path_sensitivities
from fenchel.potentials.library import texsol
from fenchel.study import cost_functions, formulation_choice, formulation_fits
from fenchel.study.cost_functions import (
    COSTS,
    FREE,
    NAMES,
    Problem,
    fit,
    gap,
    guess,
    measured,
    plastic_path,
    values_by_name,
)
from fenchel.study.formulation_choice import discrete_choice, pictures, summary, table, tasks, verdict_sentence
from fenchel.study.formulation_fits import NOISES, SETS, choice_of, planted_choice
from fenchel.study.identification_runs import GRAINS, TABLE_3, planted_tests
from fenchel.study.sizes import size_named

SEEDS = 2


@pytest.fixture(scope="module")
def noisy():
    tests = [thin(test, 60) for test in planted_tests(GRAINS, (5e4, 9e4), step=2e-4)]
    return formulation_fits._noisy(tests, (0.01, 0.01), 3)


@pytest.fixture(scope="module")
def planted():
    return {f"choice: table_3, {cost}": planted_choice("table_3", cost, SEEDS, frames=60) for cost in COSTS}


@pytest.fixture(scope="module")
def grains():
    tests = planted_tests(GRAINS, (5e4, 9e4))
    draws = [test for seed in (1, 2) for test in formulation_fits._noisy(tests, (0.002, 0.002), seed)]
    return choice_of(draws, [1, 1, 2, 2], seed=1, frames=60, realisations=1)


# -- the costs --------------------------------------------------------------------------------------------------------------------


def programs(law, strain, stress, plastic, alpha, p):
    """W_n(ε) + W_n*(σ) − σ:ε of one axisymmetric step as two cone programs in principal values, in units of 1e-3 and kPa."""
    shear = law.E_s / (2 * (1 + law.nu)) / 1e6
    lame = law.bulk / 1e6 - 2 * shear / 3
    lw, mw, hk, hi, c0 = law.lambda_w / 1e6, law.mu_w / 1e6, law.H_k / 1e6, law.H_i / 1e6, law.C_0 / 1e3
    d, flow = cp.Variable(3), cp.Variable()
    mean = cp.sum(d) / 3 * np.ones(3)
    rules = [cp.sum(d) == law.t * flow, np.sqrt(2) * cp.norm(d - mean) <= flow]

    def energy(e):
        elastic = e - plastic - d
        sand = lame / 2 * cp.square(cp.sum(elastic)) + shear * cp.sum_squares(elastic)
        hard = hk / 2 * cp.sum_squares(alpha + d) + hi / 2 * cp.square(p + flow) + c0 * flow
        return sand + hard + lw / 2 * cp.square(cp.pos(cp.sum(e))) + mw * cp.sum_squares(cp.pos(e))

    primal = cp.Problem(cp.Minimize(energy(strain)), rules)
    e = cp.Variable(3)
    dual = cp.Problem(cp.Maximize(stress @ e - energy(e)), rules)
    kwargs = dict(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-9, tol_feas=1e-9)
    return primal.solve(**kwargs) + dual.solve(**kwargs) - stress @ strain


def test_gap_is_that_of_two_cone_programs(noisy):
    law, test = replace(GRAINS, H_k=1.4 * GRAINS.H_k, theta_f=0.25), measured(noisy[0])
    error, apart = gap(law, test)
    path = cost_functions._drive(law, test, "strain", cost_functions.STRAINS, test.strain)
    for k in (5, 17, 24, 31, 45, 58):
        before = [1e3 * path.state[name][k - 1] for name in ("eps_p", "alpha", "p")]
        known = programs(
            law, 1e3 * test.strain[k, :3], test.stress[k, :3] / 1e3, before[0][:3], before[1][:3], float(before[2])
        )
        assert error[k] == pytest.approx(known, rel=1e-4, abs=1e-6)
        assert known > 1e-4
    assert np.abs(apart).max() > 1e-5


def test_gap_vanishes_where_the_law_is_right_and_only_there(noisy):
    exact = measured(thin(planted_tests(GRAINS, (5e4,))[0], 60))
    scale = exact.largest_q * exact.largest_strain
    assert gap(GRAINS, exact)[0].max() < 1e-11 * scale
    assert gap(replace(GRAINS, C_0=1.1 * GRAINS.C_0), exact)[0].max() > 1e-6 * scale
    assert (gap(GRAINS, measured(noisy[0]))[0] >= 0.0).all()


def test_axial_cost_is_the_replay_of_the_identification(noisy):
    law = replace(GRAINS, H_i=0.3e6)
    problem = Problem("axial", [measured(test) for test in noisy], law, NAMES)
    assert problem.misfit(law) == pytest.approx(misfit_of(noisy, law, replay), rel=1e-9)


def test_jacobian_is_that_of_the_exact_sensitivities(noisy):
    test = measured(noisy[0])
    problem = Problem("strain", [test], GRAINS, FREE)
    values = cost_functions._values(GRAINS)
    start = cost_functions._start(GRAINS, test.pressure)
    exact = path_sensitivities(
        texsol.compile(), cost_functions.STRAINS, test.strain, values, initial_state=start,
        wrt=["theta_f", "C_0", "H_k", "H_i"],
    ).sig  # fmt: skip
    chain = values_by_name(GRAINS, NAMES) / np.array([1 + GRAINS.t**2, 1, 1, 1])
    columns = np.stack([np.sqrt(2) * exact[:, 0], exact[:, 2]], axis=1).reshape(-1, 4) * chain
    columns /= test.largest_q * np.sqrt(len(test.strain))
    found = problem.jacobian(GRAINS)
    assert np.abs(found[:, :4] - columns).max() < 2e-4 * np.abs(columns).max()


# -- the fits ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("cost", COSTS)
def test_every_cost_finds_what_was_planted(name, cost):
    tests = [measured(thin(test, 60)) for test in planted_tests(SETS[name], (5e4, 9e4))]
    for names in (NAMES, FREE):
        found = fit(cost, tests, SETS[name], names=names)
        assert values_by_name(found.law, names) == pytest.approx(values_by_name(SETS[name], names), rel=1e-4)
        assert not found.failure and found.condition < 100 and found.evaluations < 150


def test_noise_belongs_into_the_residual_not_into_what_drives(planted):
    p = summary(planted)["planted"]
    assert p["best by noise"]["strain 1 %"] == "stress"
    assert p["best by noise"]["stress 1 %"] != "stress"
    assert p["stress"]["rms by noise"]["strain 1 %"] < 0.3 * p["stress"]["rms by noise"]["stress 1 %"]
    assert p["stress"]["without hardening"] > 3 * p["strain"]["without hardening"]  # strain = stress / hardening


def test_noise_of_a_driving_stress_is_flow_that_stays():
    """The largest stress of a leg decides the flow: the more frames, the larger the largest. A driving strain has no such memory."""
    drift = {}
    for count in (100, 800):
        clean = [thin(test, count) for test in planted_tests(GRAINS, (5e4, 9e4))]
        for cost in ("strain", "stress"):
            straight = [plastic_path(GRAINS, measured(test), cost) for test in clean]
            drift[count, cost] = np.mean(
                [
                    plastic_path(GRAINS, measured(test), cost) / p - 1.0
                    for seed in range(10)
                    for test, p in zip(formulation_fits._noisy(clean, (0.02, 0.02), seed), straight, strict=True)
                ]
            )
    assert drift[800, "stress"] > drift[100, "stress"] > 0.01
    assert abs(drift[100, "strain"]) < 0.1 * drift[100, "stress"]


def test_intervals_hold_what_they_say_where_the_residuals_are_independent():
    tests = [thin(test, 60) for test in planted_tests(TABLE_3, (5e4, 9e4))]
    held = []
    for seed in range(12):
        draws = [measured(test) for test in formulation_fits._noisy(tests, (0.01, 0.0), seed)]
        found = fit("strain", draws, TABLE_3, start=TABLE_3)
        apart = values_by_name(found.law, NAMES) - values_by_name(TABLE_3, NAMES)
        held.append(np.abs(apart) <= found.half)
    assert 0.8 <= np.mean(held) <= 1.0


def test_a_law_that_cannot_follow_is_a_failed_fit(noisy, monkeypatch):
    def refuse(law, test):
        if law.H_k != pytest.approx(0.05 * GRAINS.E_s):
            raise ConvergenceError("no")
        return np.ones(2 * len(test.strain)), 1

    monkeypatch.setitem(cost_functions.RESIDUALS, "stress", refuse)
    tests = [measured(test) for test in noisy]
    found = fit("stress", tests, GRAINS)
    assert found.failure and found.law == guess(GRAINS, tests) and np.isnan(found.half).all()


def test_grains_are_left_out_and_predicted(grains):
    for cost in COSTS:
        found = grains["fits"][cost]
        assert found["left sample"]["measured"].shape == found["left pressure"]["measured"].shape == (2, 4)
        assert found["values"][0] == pytest.approx(GRAINS.t, rel=0.15)
        assert found["q"] == pytest.approx(found["measured"][0], rel=0.1)  # all frames, thinned
        assert found["measured"][0] < 0.03
    own = [grains["fits"][cost]["measured"][k] for k, cost in enumerate(COSTS)]
    least = np.min([grains["fits"][cost]["measured"] for cost in COSTS], axis=0)
    assert np.allclose(own, least, rtol=1e-3)  # what a cost was fitted by, no other fit does better


def test_tests_without_links_are_refused(tmp_path):
    with pytest.raises(InputError, match="with links"):
        discrete_choice([], tmp_path, 1)


# -- the verdict ------------------------------------------------------------------------------------------------------------------


def test_verdict_table_and_pictures(planted, grains):
    found = summary(planted | {"any": grains})
    p, d = found["planted"], found["discrete"]
    least = min(COSTS, key=lambda c: p[c]["rms"])
    assert p[p["best"]]["rms"] <= 1.25 * p[least]["rms"] and p["best"] in p["equal"]
    assert found["best"] == d["best"] and d["left out"] == "pressure"
    said = verdict_sentence(found)
    assert f"{p['stress']['rms']:.1%}" in said and f"{d['gap']['q left out']:.1%}" in said
    head, rows = table(found)
    assert len(rows) == len(COSTS) and all(len(row) == len(head) for row in rows)
    assert [picture.key for picture in pictures(planted | {"any": grains})] == [
        "formulation_choice", "formulation_grains",
    ]  # fmt: skip
    assert all(picture.draw() is not None for picture in pictures(planted | {"any": grains}))


def test_verdict_without_results():
    failed = {"choice: table_3, gap": ConvergenceError("no")}
    assert summary(failed)["failed tasks"] == 1
    assert "not there" in verdict_sentence(summary(failed))
    assert pictures(failed) == []


def test_verdict_turns_with_the_numbers(planted):
    """What was first is given the errors of the last, and the other way round."""
    p = summary(planted)["planted"]
    first, last = p["best"], p["order"].split(", ")[-1]
    turned = dict(planted)
    turned[f"choice: table_3, {first}"] = planted[f"choice: table_3, {last}"] | {"cost": first}
    turned[f"choice: table_3, {last}"] = planted[f"choice: table_3, {first}"] | {"cost": last}
    again = summary(turned)["planted"]
    assert again["best"] != first and again["order"].split(", ")[-1] == first
    assert verdict_sentence(summary(turned)) != verdict_sentence(summary(planted))


def test_a_formulation_with_a_wrong_law_loses(planted, monkeypatch):
    """The best cost is run with a law that hardens twice as much: its fits end at half of it, and the verdict turns."""
    best = summary(planted)["best"]
    right = cost_functions._values
    monkeypatch.setattr(cost_functions, "_values", lambda law: right(law) | {"H_k": 2.0 * law.H_k})
    spoilt = planted_choice("table_3", best, SEEDS, frames=60)
    monkeypatch.undo()
    assert spoilt["clean"]["error"][NAMES.index("H_k")] == pytest.approx(-0.5, abs=1e-3)
    found = summary(planted | {f"choice: table_3, {best}": spoilt})
    assert found["best"] != best and found["planted"]["order"].split(", ")[-1] == best
    assert found["planted"][best]["coverage"] < summary(planted)["planted"][best]["coverage"]


def test_a_wrong_conjugate_is_found_out(monkeypatch):
    """A gap that is not zero where strain and stress belong together does not find what was planted."""
    tests = [measured(thin(test, 60)) for test in planted_tests(TABLE_3, (5e4, 9e4))]

    def wrong(law, test):
        error, apart = gap(law, test)
        return error + 1e-3 * np.abs(test.stress * test.strain).sum(axis=1) * law.C_0 / TABLE_3.C_0, apart

    monkeypatch.setattr(cost_functions, "gap", wrong)
    found = fit("gap", tests, TABLE_3)
    assert np.abs(values_by_name(found.law, NAMES) / values_by_name(TABLE_3, NAMES) - 1.0).max() > 1e-3


def test_tasks_are_kept_in_files_and_the_same_again(tmp_path, planted):
    found = tasks(size_named("small"), tmp_path)
    assert [t.name for t in found] == [f"choice: {name}, {cost}" for name in SETS for cost in COSTS]
    assert all(t.arguments["seeds"] == 8 for t in found)
    task = replace(found[1], arguments={"name": "table_3", "cost": "strain", "seeds": SEEDS, "frames": 60})
    first, again, known = task(), task(), planted["choice: table_3, strain"]
    assert task.run_file.exists()
    for label in NOISES:
        assert np.array_equal(first["noise"][label]["error"], again["noise"][label]["error"])
        assert np.array_equal(first["noise"][label]["error"], known["noise"][label]["error"])
    assert formulation_choice.planted_choice is planted_choice
