"""The pages of the documentation keep their word: their cells run one after another, as plain Python, until the last assertion.

The truths are those that each page states: closed forms, theorems, published values. `make docs` runs the same cells in a notebook.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(.*?)^```\s*$", flags=re.DOTALL | re.MULTILINE)
FOLDERS = ("tutorials", "howto")

# Seconds for their cells, on one core and with code compiled before: `make test` runs these, `make validate` all others.
QUICK = (
    "tutorials/corners.md",
    "tutorials/first_law.md",
    "tutorials/own_contact_law.md",
    "tutorials/thermal_law.md",
    "tutorials/viscous_law.md",
    "howto/drained_undrained.md",
    "howto/read_the_residuals.md",
    "howto/resume_a_run.md",
)
# Pages that run nothing, each with its reason.
SHOWN_ONLY = {
    "howto/cluster.md": "needs machines; every command stands in a test, and the page names it",
    "howto/fuzz.md": "what it shows is a search for failures, minutes long; tests/regression/test_fuzz_cases.py runs what was found",
}


def pages() -> list[str]:
    """Every tutorial and guide, by its name below `docs`."""
    return sorted(str(p.relative_to(DOCS)) for folder in FOLDERS for p in (DOCS / folder).glob("*.md"))


def cells(page: str) -> list[tuple[int, str]]:
    """Line of the page and text of every code cell; options of a cell (lines that begin with a colon) are left out."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = []
    for match in CELL.finditer(text):
        lines = match.group(1).split("\n")
        options = 0
        while lines[options].startswith(":"):
            options += 1
        found.append((text.count("\n", 0, match.start(1)) + 1 + options, "\n".join(lines[options:])))
    return found


def run_cells(page: str) -> None:
    """Run the cells of a page in one namespace; a line of a traceback is the line of the page."""
    space: dict[str, object] = {"__name__": "__main__"}
    for line, text in cells(page):
        exec(compile("\n" * (line - 1) + text, str(DOCS / page), "exec"), space)


@pytest.mark.parametrize(
    "page", [p if p in QUICK else pytest.param(p, marks=pytest.mark.validate) for p in pages() if p not in SHOWN_ONLY]
)
def test_the_cells_of_a_page_hold(page: str, tmp_path: Path) -> None:
    """In a process of its own: pages register atoms and laws, and a reader starts with none of them."""
    assert "assert " in cells(page)[-1][1] or any("assert " in text for _, text in cells(page)[-2:]), "ends in a claim"
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, __file__, page], cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr[-4000:]
    print(f"{page}: {time.perf_counter() - started:.1f} s")


def test_every_page_runs_something_or_says_why_not() -> None:
    known = pages()
    assert set(QUICK) <= set(known)
    assert set(SHOWN_ONLY) <= set(known)
    for page in known:
        assert bool(cells(page)) != (page in SHOWN_ONLY), page


def test_every_page_is_in_the_table_of_contents() -> None:
    listed = set(re.findall(r"^((?:tutorials|howto)/\w+)$", (DOCS / "index.md").read_text(), flags=re.MULTILINE))
    assert listed == {page.removesuffix(".md") for page in pages()}


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    run_cells(sys.argv[1])
