"""`fenchel dem`: run a scene of grains."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import typer

__all__ = ["register"]


class _Export(StrEnum):
    vtk = "vtk"
    xyz = "xyz"
    picture = "picture"


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("dem")(_dem)


def _dem(
    scene: Path = typer.Argument(..., metavar="SCENE.toml", help="The scene: grains, wires, sample, test, solver."),
    output: Path = typer.Option(..., "-o", "--output", metavar="RUN.h5", help="The run file to write."),
    resume: bool = typer.Option(False, "--resume", help="Go on with RUN.h5 from its last checkpoint, bit for bit."),
    export: list[_Export] = typer.Option(
        [],
        "--export",
        help="Also write the last state beside RUN.h5: vtk (ParaView), xyz (OVITO), picture; may be repeated.",
    ),
    quiet: bool = typer.Option(False, "--quiet", help="Show no progress."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the quality of the run as JSON."),
) -> None:
    """Make a sample of grains and wires, test it, and write its run file; the last table says how well it was solved.

    With --resume a finished run is read again and not run again: a way to export it later.

    Example: fenchel dem scene.toml -o run.h5 --export vtk
    """
    from fenchel.dem import run_scene
    from fenchel.dem.export import export_run
    from fenchel.dem.triaxial import QUALITY

    from .progress import progress_bar
    from .tables import print_json, print_table

    with progress_bar(not quiet) as progress:
        record = run_scene(scene, output, resume=resume, progress=progress)
    exported = [file for kind in dict.fromkeys(export) for file in export_run(output, kind.value)]
    if json_wanted:
        print_json(
            {
                "run": output,
                "pressure": record.pressure,
                "seed": record.seed,
                "linked": record.linked,
                "frames": len(record.leg),
                "quality": record.quality,
                "exports": exported,
            }
        )
    else:
        rows = [(name, value, *QUALITY[name]) for name, value in record.quality.items()]
        print_table(("quality", "value", "unit", "meaning"), rows, title=f"{output}: {len(record.leg)} frames")
        for file in exported:
            typer.echo(f"exported {file}")
