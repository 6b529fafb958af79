"""`fenchel identify`: the main job, from a study of grains and wires, or from tests of a laboratory, to a checked law."""

from __future__ import annotations

from pathlib import Path

import typer

from .campaign import JOBS, SCHEDULER
from .signs import Signs
from .values import parameter_values

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("identify")(_identify)


def _identify(
    inputs: list[Path] | None = typer.Argument(
        None,
        metavar="[STUDY.toml | LAB.csv ...]",
        help="A study, or triaxial tests of a laboratory; neither with --demo.",
    ),
    output: Path = typer.Option(
        ..., "-o", "--output", metavar="DIR", help="The folder of the report, law and run files."
    ),
    demo: bool = typer.Option(False, "--demo", help="Take the study that fenchel carries."),
    law: str | None = typer.Option(
        None, "--law", metavar="LAW", help="Laboratory: the law, a library name (default: sand) or file.py:name."
    ),
    pairs: list[str] = typer.Option([], "-p", metavar="NAME=VALUE", help="Laboratory: where a parameter starts (SI)."),
    hold: list[str] = typer.Option(
        [], "--hold", metavar="NAME", help="Laboratory: keep this parameter at its start value; may be repeated."
    ),
    held_out: list[Path] = typer.Option(
        [], "--held-out", metavar="LAB.csv", help="Laboratory: predict this test, do not fit it; may be repeated."
    ),
    confining: list[str] = typer.Option(
        [],
        "--confining-pressure",
        metavar="VALUE UNIT",
        help='Laboratory: for files without such a line, e.g. "100 kPa"; one per file, held-out files last.',
    ),
    volume_weight: float | None = typer.Option(
        None, "--volume-weight", min=0.0, help="Laboratory: weight of volume strain or pore pressure against q (1)."
    ),
    jobs: int | None = JOBS,
    scheduler: str | None = SCHEDULER,
    signs: Signs | None = typer.Option(
        None,
        "--signs",
        help="Signs of stress and strain: tension-positive with a study, compression-positive with laboratory files "
        "unless given.",
    ),
    quiet: bool = typer.Option(False, "--quiet", help="Show no progress."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the numbers of the report as JSON."),
) -> None:
    """From tests to a continuum law, and how well it holds.

    With a study: make a sample of grains and wires, test it, identify the law. Writes DIR/report.html, DIR/report.json, DIR/law.py (for
    `fenchel drive`) and DIR/runs/*.h5. Finished runs stay: the same command takes them up after an interruption.

    With laboratory files: fit a law to triaxial tests. A LAB.csv has columns such as eps_a [%], q [kPa] and eps_v [%] (drained) or u [kPa]
    (undrained), and a line # confining_pressure = 100 kPa. Writes DIR/report.html, DIR/report.json, DIR/law.py and a path per test.

    Example: fenchel identify study.toml -o result

    Example: fenchel identify cd50.csv cd100.csv cd200.csv --held-out cd150.csv -o result
    """
    from ..errors import InputError

    given = inputs or []
    laboratory = [path for path in given if path.suffix.lower() != ".toml"]
    if demo == bool(given) or (len(given) > 1 and len(laboratory) < len(given)):
        raise InputError(
            "identify takes one study file, or laboratory files, or --demo: fenchel identify STUDY.toml|LAB.csv -o DIR"
        )
    only_laboratory = {
        "--law": law, "-p": pairs, "--hold": hold, "--held-out": held_out, "--confining-pressure": confining,
        "--volume-weight": volume_weight,
    }  # fmt: skip
    only_study = {"--jobs": jobs, "--scheduler": scheduler}
    for name, value in (only_study if laboratory else only_laboratory).items():
        if value is not None and value != []:
            raise InputError(f"{name} is for {'a study' if laboratory else 'laboratory files'}: leave it out here")
    if laboratory:
        from fenchel.identify.laboratory import identify_laboratory
        from fenchel.identify.laboratory_file import pressure_value

        identify_laboratory(
            laboratory,
            output,
            law=law or "sand",
            held_out=held_out,
            start=parameter_values(pairs),
            hold=hold,
            signs=(signs or Signs.compression).value,
            confining_pressures=[pressure_value("--confining-pressure", text) for text in confining],
            volume_weight=1.0 if volume_weight is None else volume_weight,
            show=not quiet,
        )
    else:
        from fenchel.identify.job import run_study

        study = given[0] if given else None
        run_study(study, output, jobs=jobs, scheduler=scheduler, show=not quiet, signs=(signs or Signs.tension).value)
    if json_wanted:
        typer.echo((output / "report.json").read_text(encoding="utf-8"))
    else:
        typer.echo(f"The report is {output / 'report.html'}")
