"""Parts B and C of the reproduction (claims 4 to 16): at the small size every theorem holds, what is made wrong is found."""

from dataclasses import replace

import numpy as np
import pytest

from fenchel.drawing import picture
from fenchel.errors import ConvergenceError
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.study import formulation_energies, formulation_splits, model_sand, model_step, model_wires
from fenchel.study.formulations import FORMULATIONS
from fenchel.study.model_claims import MODEL
from fenchel.study.sizes import SIZES

SMALL = SIZES["small"]
PARTS = {"B": FORMULATIONS, "C": MODEL}


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """Results of all computations of both parts, and their verdicts."""
    found = {}
    for letter, part in PARTS.items():
        folder = tmp_path_factory.mktemp(letter)
        results = {task.name: task() for task in part.tasks(SMALL, folder, part.numbers)}
        found[letter] = results, part.judge(SMALL, folder, results, part.numbers)
    return found


def test_every_theorem_holds(reproduced):
    verdicts = [v for _, found in reproduced.values() for v in found]
    assert [v.claim for v in verdicts] == list(range(4, 17))
    for v in verdicts:
        assert v.outcome == "pass", v.sentence
        assert np.isfinite(v.value) and v.numbers and v.settings["seed"] == v.claim
        assert "{" not in v.sentence and len(v.sentence) < 500
    assert {claim.kind for part in PARTS.values() for claim in part.claims} == {"T"}


def test_pictures_are_drawn(reproduced, tmp_path):
    assert not FORMULATIONS.pictures(SMALL, tmp_path, reproduced["B"][0])
    pictures = MODEL.pictures(SMALL, tmp_path, reproduced["C"][0])
    assert [p.key for p in pictures] == ["cone", "gap"]
    for p in pictures:
        assert picture(p.draw()) == picture(p.draw())


def test_a_claim_can_be_asked_alone(reproduced, tmp_path):
    (task,) = MODEL.tasks(SMALL, tmp_path, frozenset({12}))
    first = task()
    (verdict,) = MODEL.judge(SMALL, tmp_path, {task.name: first}, frozenset({12}))
    assert verdict.claim == 12 and verdict.outcome == "pass"
    assert first["numbers"] == reproduced["C"][0][task.name]["numbers"]  # the same bits again


def test_a_computation_that_stopped_is_a_failure(tmp_path):
    (verdict,) = MODEL.judge(SMALL, tmp_path, {"C: closed cycles": ConvergenceError("no answer")}, frozenset({12}))
    assert verdict.outcome == "fail" and "no answer" in verdict.sentence


def verdict_of(part, number, folder, **fewer):
    """The verdict of one claim, with other arguments where they are given."""
    (task,) = part.tasks(SMALL, folder, frozenset({number}))
    result = replace(task, arguments={**task.arguments, **fewer})()
    (verdict,) = part.judge(SMALL, folder, {task.name: result}, frozenset({number}))
    return verdict


class Spoiled:
    """A law whose compiled step is changed by `change(result)`."""

    def __init__(self, law, change):
        self.law, self.change = law, change

    def __getattr__(self, name):
        return getattr(self.law, name)

    def compile(self, *arguments, **options):
        update = self.law.compile(*arguments, **options)
        change = self.change

        class Update:
            def __getattr__(self, name):
                return getattr(update, name)

            def __call__(self, *given, **values):
                return change(update(*given, **values))

        return Update()


def spoil(monkeypatch, name, change):
    monkeypatch.setitem(ENTRIES, name, replace(ENTRIES[name], law=Spoiled(ENTRIES[name].law, change)))


def test_a_conjugate_with_a_wrong_sign_is_found(monkeypatch, tmp_path):
    right = formulation_energies.supremum
    monkeypatch.setattr(formulation_energies, "supremum", lambda *a: (-right(*a)[0], right(*a)[1]))
    assert verdict_of(FORMULATIONS, 4, tmp_path, count=20).outcome == "fail"


def test_a_wire_modulus_that_is_wrong_in_one_part_is_found(monkeypatch, tmp_path):
    entry = ENTRIES["texsol"]
    lambda_w = next(p for p in entry.law.parameters if p.name == "lambda_w")
    monkeypatch.setitem(ENTRIES, "texsol", replace(entry, law=entry.law.with_parameters(lambda_w=1.001 * lambda_w)))
    verdict = verdict_of(FORMULATIONS, 10, tmp_path, count=20, programs=1)
    assert verdict.outcome == "fail" and "sums" in verdict.sentence


def test_wires_forgotten_in_the_reversible_split_are_found(monkeypatch, tmp_path):
    """Without the pull of the wires on the plastic strain the two splits are different models."""
    right = formulation_splits.reversible_law
    monkeypatch.setattr(formulation_splits, "reversible_law", lambda law: right(LAWS["sand"]))
    monkeypatch.setattr(formulation_splits, "LAWS", ("texsol",))
    verdict = verdict_of(FORMULATIONS, 9, tmp_path, paths=2, steps=2)
    assert verdict.outcome == "fail" and "stress" in verdict.sentence


def test_a_wrong_conjugate_of_the_wires_is_found(monkeypatch, tmp_path):
    right = model_wires.unilateral_conjugate
    monkeypatch.setattr(model_wires, "unilateral_conjugate", lambda s, lam, mu: right(s, 0.5 * lam, mu))
    verdict = verdict_of(MODEL, 11, tmp_path, count=80, programs=6)
    assert verdict.outcome == "fail" and "conjugate" in verdict.sentence


def test_a_dissipation_off_by_a_millionth_is_found(monkeypatch, tmp_path):
    spoil(monkeypatch, "texsol", lambda out: replace(out, dissipation=out.dissipation * (1 + 1e-6)))
    verdict = verdict_of(MODEL, 13, tmp_path, paths=2)
    assert verdict.outcome == "fail" and "C_0" in verdict.sentence


def test_a_cone_through_the_wrong_edges_is_found(monkeypatch, tmp_path):
    right = model_sand.cone
    turned = {"compression": "extension", "extension": "compression"}
    monkeypatch.setattr(
        model_sand, "cone", lambda t, c, reading="shear_limit": right(t, c, turned.get(reading, reading))
    )
    verdict = verdict_of(MODEL, 14, tmp_path)
    assert verdict.outcome == "fail" and "theorems" in verdict.sentence


def test_a_return_map_that_stops_short_is_found(monkeypatch, tmp_path):
    """Plastic strain and its measure short by a thousandth: admissible, but not the minimum."""

    def short(out):
        return replace(out, state={k: 0.999 * v for k, v in out.state.items()})

    spoil(monkeypatch, "sand", short)
    spoil(monkeypatch, "texsol", short)
    monkeypatch.setattr(model_step, "_reference", lambda *_: {"gap": 0.0, "stress": 0.0, "state": 0.0})
    verdict = verdict_of(MODEL, 15, tmp_path, programs=1)
    assert verdict.outcome == "fail" and "gap" in verdict.sentence
