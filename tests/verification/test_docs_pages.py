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
REFERENCE = ("reference/messages.md", "reference/command_line.md")  # what the program itself is asked for

# Seconds for their cells, on one core and with code compiled before: `make test` runs these, `make validate` all others.
QUICK = (
    "tutorials/corners.md",
    "tutorials/finite_elements.md",
    "tutorials/first_law.md",
    "tutorials/own_contact_law.md",
    "tutorials/thermal_law.md",
    "tutorials/viscous_law.md",
    "howto/drained_undrained.md",
    "howto/read_the_residuals.md",
)
# Pages that run nothing, each with its reason.
SHOWN_ONLY = {
    "howto/cluster.md": "needs machines; every command stands in a test, and the page names it",
    "howto/fuzz.md": "what it shows is a search for failures, minutes long; tests/regression/test_fuzz_cases.py runs what was found",
}

# Pages that read files of the project run in their own folder, as the notebook does; all others in an empty one.
AT_HOME = ("howto/choose_accuracy.md",)


def pages() -> list[str]:
    """Every tutorial and guide, by its name below `docs`."""
    return sorted(str(p.relative_to(DOCS)) for folder in FOLDERS for p in (DOCS / folder).glob("*.md"))


def cells(page: str) -> list[tuple[int, str]]:
    """Line of the page and text of every code cell, without its options: lines that begin with a colon, or a block between dashes."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = []
    for match in CELL.finditer(text):
        lines = match.group(1).split("\n")
        options = lines.index("---", 1) + 1 if lines[0] == "---" else 0
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
    "page",
    [
        p if p in (*QUICK, *REFERENCE) else pytest.param(p, marks=pytest.mark.validate)
        for p in (*REFERENCE, *pages())
        if p not in SHOWN_ONLY
    ],
)
def test_the_cells_of_a_page_hold(page: str, tmp_path: Path) -> None:
    """In a process of its own: pages register atoms and laws, and a reader starts with none of them."""
    assert any("assert " in text for _, text in cells(page)[-2:]), "a page ends in a claim, at most a figure after it"
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, __file__, page],
        cwd=DOCS / "howto" if page in AT_HOME else tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
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


def test_the_commands_for_a_cluster_hand_the_address_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every `fenchel` command of the page, with its files here: the engine is asked for that address, before anything runs."""
    from fenchel import cli
    from fenchel.campaign import engines
    from fenchel.errors import InputError

    asked = []

    def refuse(address: str) -> None:
        asked.append(address)
        raise InputError("no dask scheduler answers there")

    monkeypatch.setattr(engines, "_ClusterEngine", refuse)
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text("[grains]\ncount = 200\nnormal_stiffness = 4.3e4\n")
    Path("scene.toml").write_text("[grains]\ncount = 60\nnormal_stiffness = 4.3e4\n")
    commands = re.findall(
        r"^    fenchel (.*--scheduler.*)$", (DOCS / "howto/cluster.md").read_text(), flags=re.MULTILINE
    )
    assert {command.split()[0] for command in commands} == {"identify", "reproduce", "tradeoff"}
    for command in commands:
        assert cli.main(command.replace("/shared", str(tmp_path)).split()) == 2, command
    assert asked == ["tcp://10.0.0.1:8786"] * len(commands)


def test_every_test_that_the_page_on_clusters_names_is_there() -> None:
    for file, name in re.findall(r"`(tests/\S+\.py)::(\w+)`", (DOCS / "howto/cluster.md").read_text()):
        assert f"def {name}(" in (ROOT / file).read_text(), name


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    run_cells(sys.argv[1])
