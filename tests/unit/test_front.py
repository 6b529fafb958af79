"""Fronts: what dominates what, the cheapest setting for an accuracy, and where fronts are kept."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenchel import front as fronts
from fenchel.errors import InputError
from fenchel.front import Front, Measured, checked_accuracy, keep_front, kept_front, shipped_front

LEVELS = st.sampled_from([1e-9, 1e-6, 1e-3, 1e-1])
POINTS = st.lists(st.tuples(st.sampled_from([1.0, 2.0, 4.0, 8.0]), st.none() | LEVELS), min_size=1, max_size=12)


def made(pairs, kind="test"):
    points = tuple(Measured(setting={"solver": f"s{k}"}, cost=c, error=e) for k, (c, e) in enumerate(pairs))
    return Front(kind=kind, subject="it", measure="m", cost="s", points=points)


@given(POINTS)
def test_the_front_is_what_no_other_beats(pairs):
    front = made(pairs)
    inside = set(front.efficient)
    for k, (cost, error) in enumerate(pairs):
        beaten = error is None or any(
            e is not None and e <= error and c <= cost and ((e, c) != (error, cost) or j < k)
            for j, (c, e) in enumerate(pairs)
            if j != k
        )
        assert (k in inside) == (not beaten)


@given(POINTS, LEVELS)
def test_the_cheapest_setting_is_accurate_enough_and_none_is_cheaper(pairs, accuracy):
    found = made(pairs).cheapest(accuracy)
    able = [c for c, e in pairs if e is not None and e <= accuracy]
    if not able:
        assert found is None
        return
    assert found is not None and found.error is not None
    assert found.error <= accuracy and found.cost == min(able)


def test_of_two_that_cost_the_same_the_more_accurate_is_taken():
    found = made([(1.0, 1e-3), (1.04, 1e-9), (1.2, 1e-12)]).cheapest(1e-2)
    assert found is not None and found.error == 1e-9


def test_errors_below_rounding_are_equal():
    front = made([(1.0, 3e-14), (5.0, 0.0)])
    assert front.efficient == (0,)
    assert front.finest == fronts.ROUNDING and front.cheapest(1e-13) is None


def test_a_front_comes_back_from_its_dictionary():
    front = made([(1.0, 1e-3), (2.0, None)])
    content = json.loads(json.dumps(front.as_dict()))
    assert [p["dominated"] for p in content["points"]] == [False, True]
    assert Front.from_dict(content) == front


def test_a_kept_front_belongs_to_its_machine(monkeypatch, tmp_path):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    assert kept_front("law", "key") is None
    front = made([(1.0, 1e-3)], "law")
    file = keep_front(front, "key")
    assert kept_front("law", "key") == front
    monkeypatch.setattr(fronts, "fingerprint", lambda: "another")
    assert kept_front("law", "key") is None
    monkeypatch.undo()
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    file.write_text("{ half a fi")
    assert kept_front("law", "key") is None


@pytest.mark.parametrize("value", [0.0, 1.0, -1e-3, float("nan"), "1e-3", True, None])
def test_an_accuracy_is_a_number_between_zero_and_one(value):
    with pytest.raises(InputError, match="between 0 and 1"):
        checked_accuracy(value)


def test_what_is_shipped_is_whole():
    law, contact, scene = shipped_front("law"), shipped_front("contact"), shipped_front("scene")
    assert set(law["methods"]) == {"closed", "reduced", "principal", "general"}
    for content in law["methods"].values():
        front = Front.from_dict(content)
        assert front.points and front.environment["processor"]
        assert front.finest <= 1e-8
    assert len(contact["rows"]) >= 100 and {len(s) for r in contact["rows"] for s in r["seconds"].values()} == {9}
    assert len(scene["scenes"]) >= 40
    assert {len(row[name]) for row in scene["scenes"] for name in ("errors", "seconds", "residuals")} == {
        len(scene["settings"])
    }


def test_equal_errors_never_dominate_one_another_in_a_circle():
    """Costs 1, 0.97, 0.94 of one error: each is equal to its neighbour, the last is cheaper than the first; one of them has to stay."""
    for costs in ((1.0, 0.97, 0.94), (0.94, 0.97, 1.0), (1.0, 0.94, 0.97), (1.08, 1.04, 1.0, 1.02)):
        points = tuple(Measured(setting={"k": k}, cost=c, error=1e-14) for k, c in enumerate(costs))
        front = Front(kind="law", subject="s", measure="m", cost="s", points=points)
        assert len(front.efficient) == 1
        assert points[front.efficient[0]].cost <= 1.05 * min(costs)
        assert front.cheapest(1e-6) is points[front.efficient[0]]
