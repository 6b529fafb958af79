"""Directive `command-line`: every command of fenchel with its options, taken from the program itself at build."""

from __future__ import annotations

from typing import Any

import typer.testing
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from fenchel.cli import app


class CommandLine(SphinxDirective):
    """A section per command with what `--help` prints."""

    def run(self) -> list[nodes.Node]:
        sections: list[nodes.Node] = []
        for name in _commands():
            shown = typer.testing.CliRunner().invoke(
                app, [*name.split(), "--help"], prog_name="fenchel", env={"COLUMNS": "100", "TERMINAL_WIDTH": "100"}
            )
            if shown.exit_code != 0 or "Usage:" not in shown.output:
                raise self.error(f"fenchel {name} --help failed: {shown.output}")
            title = nodes.title(text=f"fenchel {name}")
            text = nodes.literal_block(shown.output, shown.output, language="text")
            sections.append(
                nodes.section("", title, text, ids=[f"fenchel-{name.replace(' ', '-')}"], names=[f"fenchel {name}"])
            )
        return sections


def _commands() -> list[str]:
    """Names of the commands, those of a group with its name before them."""
    found = [command.name for command in app.registered_commands if command.name]
    for group in app.registered_groups:
        inside = group.typer_instance
        found += [f"{group.name} {command.name}" for command in (inside.registered_commands if inside else ())]
    return found


def setup(sphinx: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    sphinx.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "version": "1"}
