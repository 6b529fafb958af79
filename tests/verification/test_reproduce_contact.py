"""Claims 28 to 36: what the part computes at the small size holds, and what is broken on purpose is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenchel.dem.laws import ElasticRod
from fenchel.drawing import picture
from fenchel.errors import ConvergenceError
from fenchel.study import contact_onestep, contact_operator, wire_graphs
from fenchel.study.contact_claims import CONTACT
from fenchel.study.contact_truth import ConeStep, cone_fixed_point, lemke, natural_map
from fenchel.study.sizes import SIZES

SMALL = SIZES["small"]
FEW = replace(SMALL, samples=40, fine_grains=250)  # of the runs that are broken


def run(size: Any, folder: Path, *claims: int) -> dict[str, Any]:
    return {task.name: task() for task in CONTACT.tasks(size, folder, frozenset(claims))}


def outcome(claim: int, results: dict[str, Any], folder: Path, size: Any = FEW) -> str:
    (verdict,) = CONTACT.judge(size, folder, results, frozenset({claim}))
    return verdict.outcome


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return run(SMALL, tmp_path_factory.mktemp("contact"), *CONTACT.numbers)


def test_all_claims_of_the_part_hold(results: dict[str, Any], tmp_path: Path) -> None:
    verdicts = CONTACT.judge(SMALL, tmp_path, results, CONTACT.numbers)
    assert [v.claim for v in verdicts] == list(range(28, 37))
    for verdict in verdicts:
        assert verdict.outcome == "pass", verdict.sentence
        assert verdict.numbers and verdict.settings and np.isfinite(verdict.value)
        assert all(np.isfinite(v) for v in verdict.numbers.values())


def test_the_figures_are_drawn(results: dict[str, Any], tmp_path: Path) -> None:
    drawn = CONTACT.pictures(SMALL, tmp_path, results)
    assert len({p.key for p in drawn}) == 7
    images = [picture(p.draw()) for p in drawn]
    assert picture(drawn[0].draw()) == images[0]
    assert all(image.startswith(b"<?xml") for image in images)
    assert CONTACT.pictures(SMALL, tmp_path, {}) == []


def test_the_same_numbers_again() -> None:
    assert contact_operator.conservation(2) == contact_operator.conservation(2)
    first, second = (wire_graphs.rigid_limit(2, [1e3, 1e4]) for _ in range(2))
    assert all(np.array_equal(first[name], second[name]) for name in first)


def test_what_was_not_asked_for_is_not_run(tmp_path: Path) -> None:
    assert {t.name for t in CONTACT.tasks(SMALL, tmp_path, frozenset({35}))} == {"F: weighing"}
    assert CONTACT.judge(SMALL, tmp_path, {}, frozenset()) == []


def test_a_computation_that_failed_is_a_failed_theorem_and_an_open_question(tmp_path: Path) -> None:
    lost = ConvergenceError("the sweeps did not end")
    for claim, expected in ((29, "fail"), (34, "undecided")):
        names = [t.name for t in CONTACT.tasks(SMALL, tmp_path, frozenset({claim}))]
        assert outcome(claim, dict.fromkeys(names, lost), tmp_path) == expected


def test_a_rod_of_half_the_stiffness_is_off_its_graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Half(ElasticRod):
        def parameters(self) -> tuple[float, ...]:
            return (0.5 * self.stiffness, self.prestrain)

    monkeypatch.setattr(wire_graphs, "ElasticRod", Half)
    assert outcome(32, run(FEW, tmp_path, 32), tmp_path) == "fail"


def test_a_wire_that_is_a_rod_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wire_graphs, "ElasticWire", ElasticRod)
    assert outcome(32, run(FEW, tmp_path, 32), tmp_path) == "fail"


def test_an_operator_without_rotations_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = contact_operator.problem_of

    def without(*arguments: Any) -> Any:
        problem = whole(*arguments)
        bodies = problem.bodies
        heavy = bodies.mass.copy()
        beads = len(arguments[0].assembly.x)
        heavy[range(3 * beads, 6 * beads), range(3 * beads, 6 * beads)] = 1e3
        return type(problem).of_bodies(heavy, bodies.h, bodies.f, bodies.w, problem.mu)

    monkeypatch.setattr(contact_operator, "problem_of", without)
    assert outcome(28, run(FEW, tmp_path, 28), tmp_path) == "fail"


def test_sweeps_that_stop_early_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    swept = contact_onestep._swept
    monkeypatch.setattr(contact_onestep, "_swept", lambda s, p, h, d, _tolerance: swept(s, p, h, d, 1e-4))
    assert outcome(29, run(FEW, tmp_path, 29), tmp_path) == "fail"


def test_another_friction_is_found(results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = contact_onestep.solve
    monkeypatch.setattr(contact_onestep, "solve", lambda p, **words: whole(p.with_friction(1.01 * p.mu), **words))
    found = contact_onestep.friction(1, turns=20)
    assert outcome(30, results | {"F: friction": found}, tmp_path) == "fail"


def test_light_or_leaking_numbers_are_found(results: dict[str, Any], tmp_path: Path) -> None:
    heavy = results["F: weighing"] | {"elastic rod": {"momentum": 1e-3, "hanging": 0.0}}
    assert outcome(35, results | {"F: weighing": heavy}, tmp_path) == "fail"
    torsion = results["F: bending"] | {"rigid rod": results["F: bending"]["rigid rod"] | {"spin": 1e-6}}
    assert outcome(33, results | {"F: bending": torsion}, tmp_path) == "fail"
    swing = results["F: catenary"] | {"rod": results["F: catenary"]["rod"] | {"tension_error": 1e-3}}
    assert outcome(36, results | {"F: catenary": swing}, tmp_path) == "fail"


def test_the_pivots_and_the_cone_program_solve_what_is_known() -> None:
    rng = np.random.default_rng(0)
    for n in (1, 5, 20):
        half = rng.normal(size=(n + 2, n))
        w, q = half.T @ half, rng.normal(size=n)
        x = lemke(w, q)
        u = w @ x + q
        assert x.min() >= 0.0 and u.min() > -1e-12 * np.abs(q).max() and abs(x @ u) < 1e-12 * (1.0 + x @ np.abs(q))
    with pytest.raises(ConvergenceError, match="no solution"):
        lemke(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, -1.0]))
    # one contact: W = diag(2, 7, 7), sliding against the approach
    w, q, mu = np.diag([2.0, 7.0, 7.0]), np.array([-2.0, 30.0, -40.0]), np.array([0.4])
    r, turns = cone_fixed_point(ConeStep(w, q, mu))
    assert np.allclose(r, [1.0, -0.24, 0.32], atol=1e-8) and turns < 200
    assert natural_map(w @ r + q, r, mu, np.array([0.5]))[0] < 1e-7
    assert natural_map(q, np.zeros(3), mu, np.array([0.5]))[0] > 0.1
