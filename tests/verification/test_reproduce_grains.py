"""The discrete part of the reproduction at a toy size: it runs, says something of every claim, goes on bit for bit, and its T claims hold.

The figures of a toy size mean nothing; those of the sizes a user runs are on the page "Findings". Broken on purpose: the stress split, the
definition of the active length.
"""

from __future__ import annotations

import json
import signal
from dataclasses import replace

import numpy as np
import pytest

from fenchel.campaign import run_campaign
from fenchel.cli import main
from fenchel.errors import ConvergenceError, InputError
from fenchel.study import active_segments, field_claims, sizes
from fenchel.study.active_segments import definition_holds, knee, network_of
from fenchel.study.deposit_claims import DEPOSIT, content_of
from fenchel.study.field_claims import FIELDS
from fenchel.study.field_measures import branches, sphere_stress
from fenchel.study.grain_runs import BASE, VARIED, Setting, deposits
from fenchel.study.headline import headlines
from fenchel.study.length_claims import LENGTH
from fenchel.study.reproduce import reproduce, wanted_claims
from fenchel.study.statistics import mean_of, seeds_for_width, seeds_to_exclude
from fenchel.study.stiffness_claims import saturation

TOY = replace(
    sizes.SIZES["small"], name="toy", grains=200, seeds=2, fine_grains=120, fine_seeds=1, wire_stiffness=(1.0, 100.0),
    bead_ratios=(0.5, 0.1), permutations=99,
)  # fmt: skip
DISCRETE = ("A", "G", "H", "I", "J", "K")


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """The discrete parts and the headlines at the toy size."""
    folder = tmp_path_factory.mktemp("toy")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sizes.SIZES, "toy", TOY)
        for name in ("tolerance", "step", "bead radius"):  # one change is enough to see the table
            patch.delitem(VARIED, name)
        found = reproduce([*DISCRETE, "headlines"], "toy", folder, jobs=1, show=False)
    return folder, found


def test_every_claim_gets_a_verdict_with_a_figure_and_its_settings(toy):
    folder, found = toy
    assert sorted(found.verdicts) == [1, 2, 3, *range(37, 64)]
    told = json.loads((folder / "claims.json").read_text())
    assert [c["claim"] for c in told["claims"]] == sorted(found.verdicts)
    for claim in told["claims"]:
        assert claim["outcome"] in ("pass", "fail", "undecided")
        assert claim["sentence"] and claim["settings"] and claim["numbers"], claim["claim"]
        assert claim["outcome"] != "undecided" or claim["needed"], claim["claim"]
        assert "nan" not in claim["sentence"], claim
    page = (folder / "report.html").read_text()
    assert all(f'id="claim-{n}"' in page for n in found.verdicts)
    assert (
        page.count("<figure") >= 8 and "In the study:" in page and "http" not in page.replace("http://www.w3.org", "")
    )


def test_the_theorems_among_them_hold(toy):
    _, found = toy
    assert found.theorems_hold
    for n in (41, 59, 61):
        assert found.verdicts[n].outcome == "pass"


def test_headline_results_stand_beside_what_moves_them(toy):
    _, found = toy
    assert [h.unit for h in found.headlines] == ["°", "1", "Pa"]
    for h in found.headlines:
        assert set(h.change) == {"friction"} and not h.failed
        assert all(np.isfinite(m.value) for m in h.change.values())


def test_the_same_again_gives_the_same_bytes_without_a_run(toy, monkeypatch):
    folder, _ = toy
    before = (folder / "claims.json").read_bytes()
    monkeypatch.setitem(sizes.SIZES, "toy", TOY)
    for name in ("tolerance", "step", "bead radius"):
        monkeypatch.delitem(VARIED, name)
    monkeypatch.setattr(
        "fenchel.dem.slope.SlopeDeposit.advance", lambda self: pytest.fail("a finished run was run again")
    )
    monkeypatch.setattr(
        "fenchel.dem.triaxial.TriaxialTest.advance", lambda self: pytest.fail("a finished run was run again")
    )
    reproduce([*DISCRETE, "headlines"], "toy", folder, jobs=1, show=False)
    assert (folder / "claims.json").read_bytes() == before


@pytest.mark.parametrize("when", [8, 30])
def test_a_deposit_that_was_interrupted_goes_on_bit_for_bit(toy, tmp_path, monkeypatch, when):
    """Ctrl-C in mid-run, then again: the same file as without."""
    folder, _ = toy
    calls = []

    def interrupt(_place, _progress):
        calls.append(1)
        if len(calls) == when:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("fenchel.study.deposit.report_progress", interrupt)
    monkeypatch.setattr("fenchel.dem.run.time.monotonic", iter(np.arange(0.0, 1e6, 0.3)).__next__)
    task = deposits(TOY.grains, 1, tmp_path, ("linked",))[0]
    with pytest.raises(KeyboardInterrupt):
        task()
    half = task.run_file.read_bytes()
    task()
    whole = (folder / "runs" / task.run_file.name).read_bytes()
    assert half != whole and task.run_file.read_bytes() == whole


def test_a_broken_split_is_seen(toy, monkeypatch):
    folder, found = toy
    monkeypatch.setattr(
        field_claims, "branches", lambda network, links=None: branches(network, links=None if links else links)
    )
    verdicts = FIELDS.judge(TOY, folder / "runs", found.results, frozenset({59}))
    assert [v.outcome for v in verdicts] == ["fail"]


def test_a_broken_definition_is_seen(toy, monkeypatch):
    folder, found = toy
    right = active_segments.active_length

    def wrong(network, *, m=3.0):
        """The mean of the taut links in place of that of all: not the definition, longest wire at m = 0 all the same."""
        shorter = right(network, m=m + 0.5)
        return shorter

    monkeypatch.setattr(active_segments, "active_length", wrong)
    verdicts = LENGTH.judge(TOY, folder / "runs", found.results, frozenset({41}))
    assert [v.outcome for v in verdicts] == ["fail"]


def test_a_run_that_failed_leaves_its_claims_undecided_and_says_why(toy, monkeypatch):
    folder, found = toy
    results = dict(found.results) | {
        f"{BASE} deposit, seed 1: linked": ConvergenceError("the heap does not come to rest")
    }
    for verdict in DEPOSIT.judge(TOY, folder / "runs", results, frozenset({37, 40})):
        assert verdict.outcome == "undecided" and "does not come to rest" in verdict.sentence
    theorem = LENGTH.judge(TOY, folder / "runs", results, frozenset({41}))[0]
    assert theorem.outcome == "fail"
    for name in ("tolerance", "step", "bead radius"):
        monkeypatch.delitem(VARIED, name)
    lost = headlines(
        TOY, folder / "runs", dict(found.results) | {"vary friction deposit, seed 1: linked": ConvergenceError("no")}
    )
    assert lost[0].failed == ("friction",) and "friction" not in lost[0].change


def test_stress_in_a_sphere_against_the_record_and_a_sum_by_hand(toy):
    """Partial branches: a sphere that holds the whole box gives the whole sum; one contact cut in half gives half of it."""
    _, found = toy
    network = network_of(content_of(found.results, BASE, 1, "linked"), 0.4)
    parts = (np.array([[0.0, 0.0, 0.0]]), np.array([[2.0, 0.0, 0.0]]), np.array([[-3.0, 0.0, 0.0]]))
    unit = sphere_stress(parts, np.zeros(3), 1.0) * 4.0 / 3.0 * np.pi
    assert unit == pytest.approx(np.diag([-3.0, 0.0, 0.0]))  # half of f ⊗ l = −6
    for centre, share in ((np.array([1.0, 0.0, 0.0]), 1.0), (np.array([5.0, 0.0, 0.0]), 0.0)):
        assert sphere_stress(parts, centre, 1.0)[0, 0] * 4.0 / 3.0 * np.pi == pytest.approx(-6.0 * share)
    assert all(definition_holds(network).values())


def test_statistics_against_closed_forms():
    found = mean_of([1.0, 2.0, 3.0])
    assert (found.value, found.half) == pytest.approx((2.0, 4.302652729911275 / np.sqrt(3.0)))
    assert mean_of([5.0, np.nan]).count == 1 and np.isnan(mean_of([5.0]).low)
    # t(0.975, n − 1)/√n < 2 from n = 4 on (t = 3.182, 1.591; n = 3: 2.484)
    assert seeds_to_exclude(found, 0.0) == 4
    assert seeds_for_width(found, 1.0) == 7  # t(0.975, 6)/√7 = 0.9248, t(0.975, 5)/√6 = 1.0494
    k = np.geomspace(1.0, 1e3, 6)
    assert saturation(k, 1.0 / (1.0 / 50.0 + 1.0 / (3.0 * k))) == pytest.approx((50.0, 3.0), rel=1e-6)
    hockey = np.interp(active_segments.MULTIPLES, [0.0, 3.0, 8.0], [10.0, 1.0, 0.5])
    assert knee(hockey) == 3.0


def test_what_can_be_asked_for():
    assert wanted_claims(["37", "40-42", "b", "choice"]) == (
        frozenset({37, 40, 41, 42, *range(4, 11)}),
        frozenset({"choice"}),
    )
    everything, extras = wanted_claims([])
    assert everything == frozenset(range(1, 72)) and extras == {"headlines", "choice"}
    for word, text in (("99", "claims 1 to 71"), ("zz", "ranges like 4-16")):
        with pytest.raises(InputError, match=text):
            wanted_claims([word])


def test_a_folder_of_something_else_is_left_alone(toy, tmp_path, capsys):
    (tmp_path / "report.html").write_text("mine")
    assert main(["reproduce", "66", "-o", str(tmp_path), "--quiet"]) == 2
    assert "not from a reproduction" in capsys.readouterr().err and (tmp_path / "report.html").read_text() == "mine"
    assert main(["reproduce", "66", "-o", str(toy[0]), "--quiet"]) == 2
    assert "choose another folder" in capsys.readouterr().err
    assert main(["reproduce", "66", "--size", "huge", "-o", str(tmp_path / "new"), "--quiet"]) == 2
    assert "small, medium, paper" in capsys.readouterr().err


def test_the_command_on_the_arithmetic_of_the_study(tmp_path, capsys):
    assert main(["reproduce", "66", "-o", str(tmp_path), "--quiet", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (claim,) = told["claims"]
    assert claim["outcome"] == "pass" and claim["value"] == pytest.approx(0.0797, abs=1e-4)
    assert claim["numbers"]["C_0_least_absolute"] == pytest.approx(2839.5, abs=0.1)
    assert main(["reproduce", "66", "-o", str(tmp_path), "--quiet"]) == 0
    assert "1 pass, 0 fail, 0 undecided" in capsys.readouterr().out


def test_a_setting_tells_runs_apart():
    """Two settings that differ in what a deposit depends on never share a file."""
    from pathlib import Path

    a, b = (
        deposits(100, 1, Path("."), ("linked",), label=label, setting=s)[0]
        for label, s in (("a", Setting()), ("b", Setting(friction=0.5)))
    )
    assert a.run_file != b.run_file and a.settings() != b.settings()
    assert run_campaign([], Path("."), jobs=1, show=False) == {}
