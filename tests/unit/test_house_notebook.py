"""Laws and results as a few lines in a terminal, as mathematics and tables in a notebook."""

from __future__ import annotations

from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from fenchel.errors import Status
from fenchel.front import Front, Measured
from fenchel.integrators import StepResult
from fenchel.integrators.comparison import Comparison, Run
from fenchel.integrators.history import History
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
        block = table._repr_latex_()
        assert block.count("{") == block.count("}") and block.count("&") >= len(table.rows)
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
