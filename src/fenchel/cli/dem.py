"""`fenchel dem`: run a scene of grains."""

from __future__ import annotations

from pathlib import Path

import typer

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("dem")(_dem)


def _dem(
    scene: Path = typer.Argument(..., metavar="SCENE.toml", help="The scene: grains, wires, walls, loading."),
    output: Path = typer.Option(..., "-o", "--output", metavar="RUN.h5", help="The run file to write."),
    resume: bool = typer.Option(False, "--resume", help="Go on from the checkpoint beside RUN.h5."),
) -> None:
    """Run a scene of grains and wires, and write its run file.

    Example: fenchel dem scene.toml -o run.h5
    """
    from fenchel.dem import run_scene

    run_scene(scene, output, resume=resume)
    typer.echo(f"The run is in {output}")
