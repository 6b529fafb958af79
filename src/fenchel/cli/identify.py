"""`fenchel identify`: the main job, from a study of grains and wires to a checked law."""

from __future__ import annotations

from pathlib import Path

import typer

from .campaign import JOBS, SCHEDULER
from .signs import SIGNS, Signs

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("identify")(_identify)


def _identify(
    study: Path | None = typer.Argument(None, metavar="[STUDY.toml]", help="The study; not with --demo."),
    output: Path = typer.Option(
        ..., "-o", "--output", metavar="DIR", help="The folder of the report, law and run files."
    ),
    demo: bool = typer.Option(False, "--demo", help="Take the study that fenchel carries."),
    jobs: int | None = JOBS,
    scheduler: str | None = SCHEDULER,
    signs: Signs = SIGNS,
    quiet: bool = typer.Option(False, "--quiet", help="Show no progress."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the numbers of the report as JSON."),
) -> None:
    """Make a sample of grains and wires, test it, identify a continuum law and say how well it holds.

    Writes DIR/report.html, DIR/report.json, DIR/law.py (for `fenchel drive`) and DIR/runs/*.h5.

    Finished runs stay: the same command takes them up after an interruption.

    Example: fenchel identify study.toml -o result
    """
    from ..errors import InputError

    if demo == (study is not None):
        raise InputError("identify takes either a study file or --demo: fenchel identify STUDY.toml -o DIR")
    from fenchel.identify.job import run_study

    run_study(study, output, jobs=jobs, scheduler=scheduler, show=not quiet, signs=signs.value)
    if json_wanted:
        typer.echo((output / "report.json").read_text(encoding="utf-8"))
    else:
        typer.echo(f"The report is {output / 'report.html'}")
