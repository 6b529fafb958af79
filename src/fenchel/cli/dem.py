"""`fenchel dem`: run a scene of grains."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Any

import typer

from .signs import Signs

__all__ = ["register"]


class _Export(StrEnum):
    vtk = "vtk"
    xyz = "xyz"
    picture = "picture"
    plot = "plot"


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
        help="Also write beside RUN.h5 the last state: vtk (ParaView), xyz (OVITO), picture (forces); plot: the sample and what was "
        "measured. May be repeated.",
    ),
    signs: Signs = typer.Option(
        Signs.tension, "--signs", help="Signs of the strains in the plot; files stay tension positive."
    ),
    quiet: bool = typer.Option(False, "--quiet", help="Show no progress."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the quality of the run as JSON."),
) -> None:
    """Run a scene of grains and wires.

    A sample is made, tested, and written to its run file; told are stress and strain at the
    end, how well it was solved, and the last state.

    A scene with a table [motion] instead of [triaxial] lets bodies move freely: grains, planes, floors, chains. One with a table [slope]
    releases a block of grains and wires on a rough floor and measures its slope.

    With --resume a finished run is read again and not run again: a way to export it later.

    Example: fenchel dem scene.toml -o run.h5 --export vtk
    """
    from fenchel.dem import run_scene
    from fenchel.dem.export import export_run, network_of_run
    from fenchel.dem.measures import summary
    from fenchel.dem.motion_scene import is_motion
    from fenchel.dem.slope_scene import is_slope
    from fenchel.dem.storage import load_run
    from fenchel.dem.triaxial import QUALITY

    from .progress import progress_bar
    from .tables import print_json, print_table

    if is_motion(scene):
        _motion(scene, output, resume, quiet, json_wanted, export, signs)
        return
    if is_slope(scene):
        _slope(scene, output, resume, quiet, json_wanted, export, signs)
        return
    with progress_bar(not quiet) as progress:
        record = run_scene(scene, output, resume=resume, progress=progress)
    exported = [file for kind in dict.fromkeys(export) for file in export_run(output, kind.value, signs=signs.value)]
    measures = summary(network_of_run(output))
    if json_wanted:
        print_json(
            {
                "run": output,
                "pressure": record.pressure,
                "seed": record.seed,
                "linked": record.linked,
                "frames": len(record.leg),
                "quality": record.quality,
                "accuracy": _accuracy(output, record.quality["natural_map_max"]),
                "measures": measures,
                "exports": exported,
                "kernels": load_run(output)[0].get("kernels", {}),
            }
        )
    else:
        typer.echo(f"{output}: {len(record.leg)} frames, confining pressure {record.pressure / 1e3:g} kPa")
        typer.echo(_final(record, signs))
        rows = [(name, value, *QUALITY[name]) for name, value in record.quality.items()]
        print_table(
            ("quality", "value", "unit", "meaning"), rows, title="how well it was solved (page Read the residuals)"
        )
        _print_kernels(load_run(output)[0].get("kernels", {}))
        _print_state(measures, exported)
        _print_accuracy(output, record.quality["natural_map_max"])


def _motion(
    scene: Path, output: Path, resume: bool, quiet: bool, json_wanted: bool, export: list[_Export], signs: Signs
) -> None:
    """Run a scene of free bodies."""
    from fenchel.dem.export import export_run, network_of_run
    from fenchel.dem.measures import summary
    from fenchel.dem.motion import QUALITY, run_motion

    from .progress import progress_bar
    from .tables import print_json, print_table

    with progress_bar(not quiet) as progress:
        content = run_motion(scene, output, resume=resume, progress=progress)
    exported = [file for kind in dict.fromkeys(export) for file in export_run(output, kind.value, signs=signs.value)]
    measures = summary(network_of_run(output))
    frames, quality = content["frames"], content["quality"]
    if json_wanted:
        print_json(
            {
                "run": output,
                "frames": len(frames["time"]),
                "quality": quality,
                "accuracy": _accuracy(output, quality["natural_map_max"]),
                "measures": measures,
                "exports": exported,
                "kernels": content["kernels"],
            }
        )
        return
    rows = [(name, value, *QUALITY[name]) for name, value in quality.items()]
    print_table(("quality", "value", "unit", "meaning"), rows, title=f"{output}: {len(frames['time'])} frames")
    _print_kernels(content["kernels"])
    _print_state(measures, exported)
    _print_accuracy(output, quality["natural_map_max"])


def _slope(
    scene: Path, output: Path, resume: bool, quiet: bool, json_wanted: bool, export: list[_Export], signs: Signs
) -> None:
    """Run the scene of a deposit."""
    from fenchel.dem.export import export_run, network_of_run
    from fenchel.dem.measures import summary
    from fenchel.dem.slope_scene import QUALITY, run_slope

    from .progress import progress_bar
    from .tables import print_json, print_table

    with progress_bar(not quiet) as progress:
        content = run_slope(scene, output, resume=resume, progress=progress)
    exported = [file for kind in dict.fromkeys(export) for file in export_run(output, kind.value, signs=signs.value)]
    measures = summary(network_of_run(output))
    quality, profile = content["quality"], content["profile"]
    if json_wanted:
        print_json(
            {
                "run": output,
                "quality": quality,
                "accuracy": _accuracy(output, quality["natural_map_max"]),
                "profile": profile,
                "measures": measures,
                "exports": exported,
                "kernels": content["kernels"],
            }
        )
        return
    rows = [(name, value, *QUALITY[name]) for name, value in quality.items()]
    print_table(("deposit", "value", "unit", "meaning"), rows, title=f"{output}")
    _print_kernels(content["kernels"])
    _print_state(measures, exported)
    _print_accuracy(output, quality["natural_map_max"])


def _accuracy(run: Path, residual: float) -> dict[str, Any] | None:
    """What was chosen for the accuracy of the scene, and whether the residual of the run is of the kind that it was chosen from."""
    from fenchel.dem.storage import load_run

    said = load_run(run)[1].get("accuracy")
    if said is None:
        return None
    largest = said["residual"]
    return said | {"confirmed": None if largest is None else residual <= largest, "residual_of_run": residual}


def _print_accuracy(run: Path, residual: float) -> None:
    said = _accuracy(run, residual)
    if said is None:
        return
    words = {
        True: f"confirmed: its residual {residual:.1e} is one of those that the choice was made from (up to {said['residual'] or 0.0:.1e})",
        False: f"NOT CONFIRMED: its residual {residual:.1e} is above all that the choice was made from ({said['residual'] or 0.0:.1e})",
        None: "nothing to hold its residual against",
    }
    typer.echo(f"accuracy: {said['why']}; {words[said['confirmed']]}")


def _print_state(measures: dict[str, float], exported: list[Path]) -> None:
    """What the sample looks like at the end, as far as there is something to measure, and where it was exported to."""
    from fenchel.dem.measures import SUMMARY

    from .tables import print_table

    rows = [(name, value, *SUMMARY[name]) for name, value in measures.items() if value == value]
    print_table(("measure", "value", "unit", "meaning"), rows, title="the last state")
    for file in exported:
        typer.echo(f"exported {file}")


def _print_kernels(report: dict[str, Any]) -> None:
    """What the code that was generated for the scene does, and what a row of it costs in memory."""
    size = report.get("bytes", {})
    kinds = [name.split("_")[2] for name in str(report.get("names", "")).split()]
    if kinds:
        told = ", ".join(f"{kind} ({size[kind]} bytes a row)" if size.get(kind) else kind for kind in kinds)
        typer.echo(f"code generated for this scene: {told}")


def _final(record: Any, signs: Signs) -> str:
    """What the test ended at, in a line: stresses of the walls, strains of the box under `signs`."""
    import numpy as np

    sign = 1.0 if signs is Signs.tension else -1.0
    stress, strain = record.wall_stress[-1], record.wall_strain[-1]
    q = 0.5 * (stress[0] + stress[1]) - stress[2]
    word = "extension" if sign > 0.0 else "compression"
    return (
        f"at the end: p = {-float(np.mean(stress[:3])) / 1e3:.5g} kPa, q = {q / 1e3:.5g} kPa (positive when pressed along z), "
        f"axial strain {sign * float(record.axial_strain[-1]):.4%}, volume strain {sign * float(np.sum(strain[:3])):.4%} ({word} positive)"
    )
