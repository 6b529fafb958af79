"""The command line: `fenchel COMMAND`, one file per command group.

Exit code 0: done; 1: it failed; 2: misuse, or an input that breaks a rule. Foreseen failures are one line on standard error.
Everything heavy is imported inside the commands, so that `fenchel --help` answers at once.
"""

from __future__ import annotations

import sys

import typer

from . import compare, contact, dem, doctor, drive, identify, laws, reproduce, tradeoff
from .faults import one_line

__all__ = ["app", "main"]

app = typer.Typer(
    name="fenchel",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


STOPPED = 130
_KEPT = {
    "dem": "if the run file is there it holds the last checkpoint, and the same command with --resume goes on from it",
    "identify": "runs and checkpoints of a study are kept, and the same command goes on from them",
    "reproduce": "runs and checkpoints are kept, and the same command goes on from them",
}


def _version(wanted: bool) -> None:
    if wanted:
        from fenchel import __version__

        typer.echo(f"fenchel {__version__}")
        raise typer.Exit()


@app.callback()
def _face(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version and leave."
    ),
) -> None:
    """Constitutive laws from declared potentials, and from grains.

    Units are SI. Stress and strain are positive in tension, unless --signs says otherwise.
    """


for _group in (laws, drive, compare, dem, contact, identify, reproduce, tradeoff, doctor):
    _group.register(app)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line on `arguments` (default: those of the process) and return its exit code."""
    given = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    told = False
    try:
        code = app(args=given, prog_name="fenchel", standalone_mode=False)
    except Exception as problem:
        line, code = one_line(problem)
        print(line, file=sys.stderr)
        told = True
    except KeyboardInterrupt:
        code = STOPPED
    if code == STOPPED and not told:  # typer turns Ctrl-C into this code and says nothing
        print(f"fenchel: stopped; {_KEPT.get(given[0], 'nothing was written in part')}", file=sys.stderr)
    return code if isinstance(code, int) else 0
