"""Random laws, states, scenes and contact problems by the strategies of `tests/strategies.py`, judged as the search for failures does."""

import msgspec
import numpy as np
from fuzz import contacts
from fuzz.case import Failure
from fuzz.laws import Judge, stepped
from fuzz.scenes import toml_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import contact_problems, law_values, laws, scenes, states

from fenchel.dem.motion_scene import MotionScene, bodies_of, check_motion_scene
from fenchel.dem.scene import Scene, check_scene, parse_toml
from fenchel.dem.slope_scene import SlopeScene, check_slope_scene


def few(count):
    """Fewer examples than usual: a law that is new is compiled first. `make fuzz` asks for its own number."""
    return settings(max_examples=count if settings().max_examples <= 100 else settings().max_examples)


@few(8)
@given(st.data())
def test_a_step_of_a_random_law_satisfies_its_own_declaration(data):
    drawn = data.draw(laws())
    new = data.draw(states(drawn))
    update = drawn.law.compile(solver="general")
    old = {name: np.zeros_like(value) for name, value in update.initial_state(len(new)).items()}
    answer, kept = stepped(update, new, old, drawn, certify=True)
    assume(kept.size)
    judge = Judge(drawn, np.zeros_like(new), old, new)
    judge.take(kept)
    judge.all(answer, update.solver)


@few(12)
@given(st.data())
def test_other_values_of_a_random_law_are_not_refuted(data):
    drawn = data.draw(laws())
    values = data.draw(law_values(drawn))
    assume("egg" not in drawn.tags and "coupled" not in drawn.tags)  # their parameters hang together
    assert drawn.law.check(**values).admissible is not False


@few(40)
@given(scenes())
def test_a_random_scene_is_read(scene):
    kind, check = {
        "motion": (MotionScene, check_motion_scene), "slope": (SlopeScene, check_slope_scene), "triaxial": (Scene, check_scene),
    }[next(k for k in ("motion", "slope", "triaxial") if k in scene)]  # fmt: skip
    found = check(msgspec.convert(scene, kind))
    assert parse_toml(toml_of(scene).encode(), kind, "scene") == found
    if kind is MotionScene:
        assert np.isfinite(bodies_of(found).x).all()


@few(10)
@given(contact_problems())
def test_a_claim_about_a_random_contact_problem_is_true(case):
    contacts.judge(case)


def test_the_judge_sees_a_wrong_answer():
    """Of a law and a problem that are answered, everything that is claimed is spoilt in turn."""
    from dataclasses import replace

    from random_laws import random_law

    drawn = random_law(np.random.default_rng(2))
    update = drawn.law.compile()
    new = drawn.strain * np.array([[3.0, -1.0, 0.5, 0.2, 0.0, 1.0], [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]])
    old = {name: np.zeros_like(value) for name, value in update.initial_state(2).items()}
    good = update(new, old, drawn.dt, certify=True, **drawn.given)
    judge = Judge(drawn, np.zeros_like(new), old, new)
    judge.all(good, "good")
    more = {name: value * (1.0 + 1e-3) for name, value in good.state.items()}
    wrong = {
        "stress": replace(good, stress=good.stress * (1 + 1e-4)),
        "state": replace(good, state=more),
        "elastic": replace(good, state=old, stress=judge.stress(new, old)),
        "dissipation": replace(good, dissipation=-np.abs(good.dissipation)),
        "tangent": replace(good, tangent=-good.tangent),
        "nan": replace(good, dissipation=good.dissipation * np.nan),
        "gap": replace(good, gap=good.gap + np.abs(good.dissipation)),
    }
    for name, answer in wrong.items():
        try:
            judge.all(answer, name)
        except Failure:
            continue
        raise AssertionError(f"a spoilt {name} passes")


def test_the_judge_of_contacts_sees_a_false_claim():
    case = {"W": np.eye(3), "q": np.array([-1.0, 2.0, 0.0]), "mu": np.array([0.5]), "tolerance": 1e-8, "solver": "nlgs"}
    contacts.judged(case, np.array([1.0, -0.5, 0.0]), case["q"])
    for wrong in ([1.0, -0.5001, 0.0], [1.0, 0.5, 0.0], [0.9999, -0.5, 0.0], [0.0, 0.0, 0.0]):
        try:
            contacts.judged(case, np.array(wrong), case["q"])
        except Failure:
            continue
        raise AssertionError(f"reactions {wrong} pass for a solution")
    with np.testing.assert_raises(Failure):
        contacts.refuted(case)
