"""Every `fenchel ...` that a page, or the help itself, tells a reader to type is a command with these options; the cheap ones run."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from fenchel.cli import app, main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "_build" not in page.parts]
CHEAP = ("laws", "show", "doctor", "--version", "--help")


def shown(text):
    """The commands of a page: whole lines of fenced or indented code, and code within a line; (command, is it a whole line)."""
    fenced = re.findall(r"^```(?!\{code-cell)[^\n]*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    bare = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = [line for block in fenced for line in re.sub(r"\s*\\\n\s*", " ", block).splitlines()]
    lines += re.findall(r"^(?: {4}|\t)(.+)$", re.sub(r"\s*\\\n\s*", " ", bare), flags=re.MULTILINE)
    for line in lines:
        found = re.match(r"\s*(?:\$ )?(?:\.venv/bin/)?fenchel (.+)", line)
        if found:
            yield found[1], True
    for span in re.findall(r"(?<!`)`([^`]+)`(?!`)", bare):
        found = re.fullmatch(r"(?:\.venv/bin/)?fenchel (.+)", " ".join(span.split()))
        if found:
            yield found[1], False


def examples():
    """The commands of the help texts."""
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        for line in (command.help or "").splitlines():
            found = re.match(r"\s*Examples?: fenchel (.+)", line)
            if found:
                yield name, found[1]


def words(command):
    """What is typed, without the comment and without what the page leaves out."""
    typed = shlex.split(command, comments=True)
    while "..." in typed:
        at = typed.index("...")
        # `-p ...` stands for more of the same option
        del typed[at - 1 if at and typed[at - 1].startswith("-") else at : at + 1]
    return typed


CASES = {
    (page.relative_to(ROOT).as_posix(), command, whole)
    for page in PAGES
    for command, whole in shown(page.read_text(encoding="utf-8"))
}
CASES |= {(f"fenchel {name} --help", command, True) for name, command in examples()}


def known(typed):
    """The command that words mean, and the words after its name; `AssertionError` says what does not exist."""
    command = typer.main.get_command(app)
    rest = list(typed)
    while rest and not rest[0].startswith("-") and hasattr(command, "commands"):
        name = rest.pop(0)
        assert name in command.commands, f"no command {name}; there are {', '.join(command.commands)}"
        command = command.commands[name]
    options = {"--help", "-h"} | {
        word for p in command.params for word in (*p.opts, *p.secondary_opts) if word[0] == "-"
    }
    for word in rest:
        if re.match(r"--?[a-z]", word):
            assert word.partition("=")[0] in options, f"no option {word}; there are {', '.join(sorted(options))}"
    return command, rest


def parse(typed):
    """Parse words with all their values and required arguments, and run nothing; files need not be there."""
    meant, rest = known(typed)
    if "--help" in rest or hasattr(meant, "commands"):
        return
    try:
        meant.make_context(meant.name, rest)
    except Exception as problem:
        said = problem.format_message() if hasattr(problem, "format_message") else str(problem)
        assert "does not exist" in said, said


def test_commands_are_found():
    assert len(CASES) > 40
    assert {"README.md", "docs/howto/choose_accuracy.md", "docs/howto/reproduce.md"} <= {page for page, _, _ in CASES}
    assert len(list(examples())) >= 9


@pytest.mark.parametrize(("page", "command", "whole"), sorted(CASES), ids=lambda value: str(value)[:60])
def test_a_command_that_is_shown_exists(page, command, whole):
    if whole and "..." not in command:
        parse(words(command))
    else:
        known(words(command))


def test_the_cheap_ones_run(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # some write a picture
    cheap = sorted(
        {tuple(words(c)) for _, c, _ in CASES if words(c)[0] in CHEAP and not re.search(r"\b[A-Z]{3,}\b|\.py", c)}
    )
    assert len(cheap) >= 3
    for typed in [*cheap, ("--version",)]:
        assert main(list(typed)) == 0, (typed, capsys.readouterr().err)
    capsys.readouterr()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("identfy --demo", "no command identfy"),
        ("dem scene.toml -o run.h5 --picture", "no option --picture"),
        ("tradeoff sand x", "no command sand"),
        ("dem scene.toml", "Missing option"),
        ("dem scene.toml -o run.h5 --export stl", "not one of"),
    ],
)
def test_what_does_not_exist_is_found(command, said):
    with pytest.raises(AssertionError, match=said):
        parse(words(command))


def test_what_a_page_shows_is_seen():
    text = "Say `fenchel laws`.\n\n    fenchel dem a.toml \\\n      -o b.h5  # now\n\n"
    text += "```bash\n.venv/bin/fenchel doctor\n```\n```python\nx\n```\n"
    assert list(shown(text)) == [("doctor", True), ("dem a.toml -o b.h5  # now", True), ("laws", False)]
    assert words("dem a.toml -o b.h5  # now") == ["dem", "a.toml", "-o", "b.h5"]
    assert words("compare texsol path.csv -p nu=0.2 -p ...") == ["compare", "texsol", "path.csv", "-p", "nu=0.2"]
