"""Laws and results as a few lines in a terminal, as mathematics and tables in a notebook."""

from __future__ import annotations

import dataclasses
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from figure_words import assert_words_apart

from fenchel.dem import PhaseHistory
from fenchel.drawing import shown
from fenchel.errors import Status
from fenchel.front import Front, Measured
from fenchel.identify import Estimate
from fenchel.identify.estimate_view import estimate_figure, estimate_rows
from fenchel.integrators import StepResult
from fenchel.integrators.comparison import Comparison, Run
from fenchel.integrators.history import History
from fenchel.notebook import Summary, field_cells
from fenchel.potentials import total_conjugate
from fenchel.potentials.library import LAWS


class Cells(HTMLParser):
    """Texts of the cells of a table, row by row."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.open = [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def step(count=4):
    rng = np.random.default_rng(2)
    status = np.zeros(count, dtype=np.int64)
    status[-1] = Status.ITERATION_LIMIT
    stress = rng.normal(size=(count, 6))
    stress[0, 0], stress[1, 1], stress[2, 2] = -7e6, 3e6, np.nan
    state = {"eps_p": np.zeros((count, 6)), "p": np.linspace(0.0, 0.5, count)}
    return StepResult(stress, None, state, np.ones(count), status, gap=np.full(count, 1e-9))


def path(count=5000):
    arrays = [np.random.default_rng(1).normal(size=(count, 6)) for _ in range(2)]
    return History(*arrays, {"p": np.zeros(count)}, np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.int64))


@pytest.mark.parametrize("result", [step(), step(100_000), path()], ids=["step", "many", "path"])
def test_a_result_is_shown_by_shape_unit_and_range(result):
    text, page = repr(result), result._repr_html_()
    assert len(text) < 1500 and len(page) < 6000 and len(text.splitlines()) < 15
    rows = Cells(page).rows
    assert rows[0] == ["", "unit", "shape", "range"]
    for row in rows[1:]:
        assert all(cell in text for cell in row)
    assert "tangent" not in text


def test_the_numbers_of_a_summary_are_those_of_the_arrays():
    text = repr(step())
    assert text.splitlines()[0] == "step of 4 points: 3 converged, 1 iteration limit"
    stress = next(line for line in text.splitlines() if "stress" in line)
    assert "Pa" in stress and "4 × 6" in stress and "-7e+06 … 3e+06, 1 not finite" in stress
    assert next(line for line in text.splitlines() if "state['p']" in line).endswith("0 … 0.5")
    assert repr(path(1)).startswith("path of 1 rows: 1 converged")


@pytest.mark.parametrize(
    "name", ["linear_elastic", "kelvin_voigt", "drucker_prager_cap", "sand", "thermo_elasto_plastic"]
)
def test_a_law_is_mathematics_in_a_notebook(name):
    law = LAWS[name]
    text = law._repr_latex_()
    assert text.startswith("$$") and text.endswith("$$")
    assert text.count("{") == text.count("}") and text.count(r"\left") == text.count(r"\right")
    assert r"\psi" in text and (r"\varphi^{*}" in text) == (law.phi_star is not None)
    assert name.replace("_", r"\_") in text
    for table in (
        law.table("strain"),
        law.table("stress", split="reversible") if law.internal else law.table("stress"),
    ):
        block = table._repr_markdown_()
        assert block.count("{") == block.count("}")
        # a table of two columns: no formula holds a bar that would end its cell
        assert [line.count("|") for line in block.splitlines()] == [3] * (len(table.rows) + 2)
        assert str(table) == table.text()


def test_a_conjugate_and_an_indicator_are_mathematics():
    law = LAWS["tresca"]
    for thing in (law.phi_star, total_conjugate(LAWS["drucker_prager"])):
        assert thing._repr_latex_() == f"$\\displaystyle {thing.latex()}$"


def test_a_report_is_one_line_and_says_where_the_rest_is():
    report = LAWS["tresca"].check()
    assert (
        repr(report)
        == f"<AdmissibilityReport of law 'tresca': proved under {len(report.conditions)} conditions; print(report) says why>"
    )
    assert report.text() in report._repr_markdown_()


def test_a_comparison_shows_its_runs_and_its_verdict():
    runs = (
        Run("strain", "closed", "", "", 20, 0.0, 0.0, {}, 1e-15, 2e-6, 1.0, 1e-8, True),
        Run("stress", "closed", "", "strains <are> not determined " * 9),
        Run("strain", "general", "", "", 20, 3e-6, 0.0, {}, 1e-15, 2e-4, 1.0, 1e-8, False),
    )
    verdict = SimpleNamespace(headline="strain suits best")
    found = Comparison("sand", 20, runs, 0, "", 1e-8, 1e5, None, verdict)  # type: ignore[arg-type]
    text = repr(found)
    assert "DISAGREE" in text.splitlines()[0] and "strain suits best" in text.splitlines()[0]
    assert "* strain closed" in text and "3.0e-06" in text and "NO" in text
    rows = Cells(found._repr_html_()).rows
    assert len(rows) == 4 and rows[1][0] == "* strain closed" and "<are>" in rows[2][-1]


def test_a_front_marks_what_is_not_dominated():
    points = tuple(
        Measured(setting={"tolerance": 10.0**-k}, cost=float(k), error=e) for k, e in ((1, 1e-2), (2, 1e-1), (3, None))
    )
    front = Front(kind="law", subject="sand & wires", measure="stress", cost="s", points=points)
    text = repr(front)
    assert "1 of 3 settings" in text and text.splitlines()[2].split()[0] == "*"
    rows = Cells(front._repr_html_()).rows
    assert [r[0] for r in rows[1:]] == ["*", "", ""] and rows[3][-1] == "failed"
    assert "sand &amp; wires" in front._repr_html_()


def summaries():
    """Every class that is shown by its fields."""
    import fenchel.dem.export.runs
    import fenchel.identify
    import fenchel.integrators.sensitivity_path  # noqa: F401

    def below(kind):
        return [kind, *(c for sub in kind.__subclasses__() for c in below(sub))]

    return sorted((c for c in below(Summary)[1:]), key=lambda c: c.__name__)


def test_every_unit_belongs_to_a_field():
    found = summaries()
    assert len(found) > 12
    for kind in found:
        names = {f.name for f in dataclasses.fields(kind)}
        assert set(kind.UNITS) <= names, kind
        assert kind.__repr__ is Summary.__repr__, f"{kind.__name__}: declare it with repr=False"


def test_a_record_is_shown_by_its_fields():
    count = 7
    grown = np.arange(float(count))
    tensors = {
        name: np.outer(grown, np.ones(6)) * 1e4
        for name in ("wall_stress", "stress_grains", "stress_beads", "stress_links")
    }
    strains = {name: np.zeros((count, 6)) for name in ("wall_strain", "strain_sand", "strain_wire")}
    found = PhaseHistory(
        pressure=2e4, linked=True, leg=np.zeros(count, dtype=int), axial_strain=-grown, **tensors, **strains
    )
    text = repr(found)
    assert text.splitlines()[0] == "a test at 20 kPa by phase, 7 frames"
    row = next(line for line in text.splitlines() if "wall_stress" in line)
    assert row.split() == ["wall_stress", "Pa", "7", "×", "6", "0", "…", "60000"]
    rows = Cells(found._repr_html_()).rows
    assert (
        rows[0] == ["", "unit", "shape", "value"]
        and ["pressure", "Pa", "", "20000"] in rows
        and ["linked", "", "", "true"] in rows
    )


def test_a_tensor_is_listed_and_what_is_missing_is_left_out():
    @dataclasses.dataclass(repr=False)
    class Thing(Summary):
        stress: np.ndarray
        words: tuple[str, ...] = ("one", "two")
        none: float | None = None
        parts: dict[str, float] = dataclasses.field(default_factory=lambda: {"a<b": 1.0})
        inner: object = None

        UNITS: ClassVar = {"stress": "Pa"}

    found = Thing(np.array([1.0, -2.5, 0.0, 0.0, 0.0, 3e6]), inner=Thing(np.zeros(2)))
    rows = Cells(found._repr_html_()).rows
    assert ["stress", "Pa", "6", "1, -2.5, 0, 0, 0, 3e+06"] in rows
    assert ["words", "", "2 entries", "one, two"] in rows and ["parts", "", "1 entry", "a<b"] in rows
    assert ["inner", "", "", "Thing"] in rows and all(row[0] != "none" for row in rows)


@pytest.mark.parametrize(
    ("value", "cells"),
    [
        ("", ("", "")),
        (np.array(["a", "b"]), ("2", "<U1")),
        (np.array([1 + 2j]), ("1", "complex128")),
        (np.array([object()]), ("1", "object")),
        (np.True_, ("", "true")),
        (np.float64(2.5), ("", "2.5")),
        (np.array(3), ("", "3")),
        (np.zeros((0, 6)), ("0 × 6", "")),
        ((), ("0", "")),
        (Front(kind="law", subject="s", measure="m", cost="s", points=()), ("", "Front")),
    ],
)
def test_anything_that_a_result_may_hold_has_cells(value, cells):
    assert field_cells("x", "Pa", value)[2:] == cells


def test_a_step_says_what_it_is():
    for solver, text in (("auto", "solver 'closed' ("), ("general", "solver 'general' (asked for by name)")):
        step_of = LAWS["von_mises"].compile("3d", solver=solver)
        assert repr(step_of).startswith("step of 'von_mises', 3d, driven by the strain, ") and text in repr(step_of)
        assert len(repr(step_of)) < 300


def test_estimates_are_a_table_and_a_figure():
    told = {
        "E_s": Estimate(name="E_s", unit="Pa", value=1.2e7, low=1.0e7, high=1.4e7, source="seeds", seed_values=(1.1e7, 1.3e7),
                        seed_deviation=1e6, octant_deviation=1e6),
        "C_0": Estimate(name="C_0", unit="Pa", value=0.0, low=-1.0, high=1.0, source="seeds", seed_values=(0.0,),
                        seed_deviation=1.0, octant_deviation=1.0),
        "H_k": Estimate(name="H_k", unit="Pa", value=-1e5, low=-9e5, high=7e5, source="octants", seed_values=(-1e5,),
                        seed_deviation=np.nan, octant_deviation=1e5),
        "E_w": Estimate(name="E_w", unit="Pa", value=1.0, low=5.0, high=6.0, source="seeds", seed_values=(50.0,),
                        seed_deviation=1.0, octant_deviation=1.0),
        "H_i": Estimate(name="H_i", unit="Pa", value=1.0, low=0.5, high=np.inf, source="seeds", seed_values=(1.0,),
                        seed_deviation=1.0, octant_deviation=1.0),
        "nu": Estimate(name="nu", unit="1", value=0.2, low=np.nan, high=np.nan, source="none", seed_values=(0.2,),
                       seed_deviation=np.nan, octant_deviation=np.nan),
    }  # fmt: skip
    assert estimate_rows(told) == [
        ("E_s", "Pa", "1.2e+07", "1e+07 … 1.4e+07"),
        ("C_0", "Pa", "0", "-1 … 1"),
        ("H_k", "Pa", "-100000", "-9e+05 … 7e+05"),
        ("E_w", "Pa", "1", "5 … 6"),
        ("H_i", "Pa", "1", "none"),
        ("nu", "1", "0.2", "none"),
    ]
    figure = estimate_figure(told)
    axis = figure.axes[0]
    bars = {line.get_ydata()[0]: line.get_xdata() for line in axis.get_lines() if line.get_linewidth() == 2.0}
    np.testing.assert_allclose(bars[0], [1.0 / 1.2, 1.4 / 1.2], rtol=1e-12)
    low, high = axis.get_xlim()
    np.testing.assert_allclose(bars[2], [low, high], rtol=1e-12)  # −7 to 9 times the value: cut, with arrows
    np.testing.assert_allclose(
        bars[3], [high, high], rtol=1e-12
    )  # wholly beyond the axis: both of its ends are at the edge
    assert sorted(bars) == [0, 2, 3]
    assert all(
        low - 1e-12 <= x <= high + 1e-12
        for line in axis.get_lines()
        for x in line.get_xdata()
        if len(line.get_xdata()) < 3
    )
    assert {line.get_marker() for line in axis.get_lines() if line.get_ydata()[0] == 2} >= {"<", ">"}
    shown(figure)
    said = assert_words_apart(figure, 8)
    assert sum("no interval" in word for word in said) == 2 and any("-1e+05 Pa" in word for word in said)
