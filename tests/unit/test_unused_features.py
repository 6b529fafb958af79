"""What is not used costs nothing: the code without a feature is that of a build that never had it, and as large in memory."""

from __future__ import annotations

import pytest
import unused_features
from unused_features import FEATURES, Row, found_in, scene_code

from fenchel.dem.kernels import scene_kernels

TITLES = [f"{feature.name}, {feature.room}" for feature in FEATURES]
ABSENT = [k for k, feature in enumerate(FEATURES) if not feature.flag]


def row(k: int) -> Row:
    return unused_features.rows()[k]


@pytest.mark.parametrize("k", ABSENT, ids=[TITLES[k] for k in ABSENT])
def test_code_without_a_feature_is_that_of_a_build_that_never_had_it(k: int) -> None:
    assert row(k).same is True
    assert row(k).refused, "the build without the feature writes what has it"


@pytest.mark.parametrize("k", ABSENT, ids=[TITLES[k] for k in ABSENT])
def test_no_name_of_the_feature_stands_in_the_code(k: int) -> None:
    assert row(k).found == row(k).stay
    assert row(k).alive, "none of the names stands in the code that has the feature: they say nothing"


@pytest.mark.parametrize("k", range(len(FEATURES)), ids=TITLES)
def test_bytes_are_those_of_a_build_that_never_had_it(k: int) -> None:
    assert row(k).counted == row(k).declared == row(k).never


def test_what_is_decided_at_run_time_is_told() -> None:
    flags = {(r.feature, r.room): r for r in unused_features.rows() if r.flag}
    assert set(flags) == {("friction (pressure)", "laws"), ("tangent", "laws")}
    assert all(r.remark and r.same is not True for r in flags.values())
    tangent, pressure = flags["tangent", "laws"], flags["friction (pressure)", "laws"]
    assert tangent.more["point"] - tangent.counted["point"] == 8 * 36
    assert pressure.more == pressure.counted


def test_a_name_of_wires_in_every_contact_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    wires = FEATURES[0]
    planted = scene_kernels.PAIRS.replace("    change = 0.0\n", "    change = 0.0\n    tension = 0.0\n")
    monkeypatch.setattr(scene_kernels, "PAIRS", planted)
    kernels = unused_features.scene(unused_features.FRICTION)
    assert found_in(scene_code(kernels), wires) == {"tension", *wires.stay}
