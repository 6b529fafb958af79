"""`fenchel drive`: one material point along a prescribed path."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .figures import figure_kind, write_figure
from .laws import LAW, Formulation
from .progress import waiting
from .signs import SIGNS, Signs
from .values import PARAMETERS, VALUES, parameter_values

if TYPE_CHECKING:
    from fenchel.integrators import History
    from fenchel.potentials import Law

__all__ = ["register", "write_text"]


LARGE = 0.5  # a strain beyond this is taken for one in per cent


class Solver(StrEnum):
    """How the step is solved."""

    auto = "auto"
    closed = "closed"
    reduced = "reduced"
    principal = "principal"
    general = "general"
    conic = "conic"
    cvxpy = "cvxpy"
    explicit = "explicit"


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("drive")(_drive)


def _drive(
    law: str = LAW,
    path: Path = typer.Argument(
        ..., metavar="PATH.csv", help="t, and per component eps_xx (strain) or sig_xx (stress, Pa)."
    ),
    pairs: list[str] = VALUES,
    parameters: Path | None = PARAMETERS,
    formulation: Formulation = typer.Option(Formulation.strain, "--formulation", help="What drives the law."),
    solver: Solver = typer.Option(Solver.auto, "--solver", help="How the step is solved."),
    output: Path | None = typer.Option(
        None, "-o", "--output", metavar="OUT.csv", help="Write the history; else a table."
    ),
    plot: Path | None = typer.Option(
        None,
        "--plot",
        metavar="FILE.png|svg",
        help="Draw stress and strain, the path of the stress, volume and energies.",
    ),
    after: Path | None = typer.Option(
        None,
        "--after",
        metavar="OUT.csv",
        help="Go on from the end of a history that -o wrote: its stresses stand in the first row of PATH.csv, strains count from there.",
    ),
    signs: Signs = SIGNS,
    certify: bool = typer.Option(False, "--certify", help="Add the duality gap of every step [J/m3]."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the history as JSON."),
) -> None:
    """Drive a material point along a path.

    PATH.csv has a column t [s] and per component xx, yy, zz, yz, xz, xy either a strain (eps_zz, a fraction; shear not doubled) or a stress
    (sig_zz, Pa); eps_v or p replaces one normal component; a component without column has zero stress. The first row is the virgin state:
    zeros. Uniaxial stress up to one per cent and back:

    \b
        t,eps_zz
        0,0
        1,0.01
        2,0

    Example: fenchel drive von_mises path.csv -p E=2e11 -p nu=0.3 -p sigma_y=3e8 -p H_k=0 -p H_i=1e9 -o out.csv

    Consolidated, then sheared: the shearing goes on, under another control, from where the consolidation ended.

    Example: fenchel drive sand shear.csv --parameters sand.toml --after consolidation.out.csv -o shear.out.csv

    Example: fenchel drive sand path.csv --parameters sand.toml --signs compression-positive --plot path.png
    """
    from fenchel.errors import InputError
    from fenchel.integrators import drive, read_history, read_path
    from fenchel.integrators.path_file import history_columns
    from fenchel.potentials import load_law

    from .tables import csv_text, print_json, print_table

    if plot is not None:
        figure_kind(plot)
        if output is not None and output.resolve() == plot.resolve():
            raise InputError(f"-o and --plot both name {plot}: give the figure another name")
    values = parameter_values(pairs, parameters)
    declared = load_law(law)
    plan = read_path(path, signs=signs.value, virgin=after is None)
    before = None if after is None else read_history(after, declared, signs=signs.value)
    if certify and after is not None:
        raise InputError("--certify bounds a path from the virgin state: leave --certify or --after out")
    if certify and solver is Solver.explicit:
        raise InputError(
            "--certify: an explicit step is not the minimum of a program and has no gap: leave --certify out"
        )
    for file in (output, plot):
        for given in (path, after):
            if file is not None and given is not None and file.exists() and file.samefile(given):
                raise InputError(
                    f"{file} is the {'path' if given is path else 'history before'} itself: give the history another name"
                )
    declared.values(values)  # refused before anything is compiled
    with waiting(f"driving law '{declared.name}'"):
        update = declared.compile("3d", formulation=formulation.value, solver=solver.value)
        history = drive(update, plan, values, after=before)
        columns: dict[str, Any] = dict(history_columns(history, plan.time, signs.value))
        if certify:
            columns["gap"] = _gaps(declared, history, values, plan.time, plan.temperature)
    _warn_of_size(path, history)
    if output is not None:
        write_text(output, csv_text(columns))
    if plot is not None:
        write_figure(history.plot(signs=signs.value, title=declared.name), plot)
        typer.echo(f"figure in {plot}", err=True)
    if json_wanted:
        print_json(columns)
    elif output is not None:
        typer.echo(f"{len(plan.time)} steps in {output}")
    else:
        shown = {
            name: _without_noise(name, column, columns)
            for name, column in columns.items()
            if _worth_showing(name, column, columns)
        }
        print_table(tuple(shown), zip(*(column.tolist() for column in shown.values()), strict=True))


def _warn_of_size(path: Path, history: History) -> None:
    """A line on standard error where strains are so large that they were probably meant in per cent."""
    from fenchel.integrators.path_file import MANDEL

    largest = float(abs(history.eps / MANDEL).max())
    if largest > LARGE:
        typer.echo(
            f"fenchel: {path}: the strain reaches {largest:.3g}, that is {largest:.0%}: strains are fractions, not per cent, and laws are "
            "for small strains",
            err=True,
        )


def _worth_showing(name: str, column: Any, columns: dict[str, Any]) -> bool:
    """Whether a column goes into the table for people: the file has all of them."""
    if name in ("t", "p", "q", "dissipation", "status", "gap"):
        return True
    if not name.startswith(("eps_", "sig_")) or name.count("_") > 1:
        return False
    largest = max(abs(other).max() for key, other in columns.items() if key[:4] == name[:4] and key.count("_") == 1)
    return bool(abs(column).max() > 1e-9 * largest)


def _without_noise(name: str, column: Any, columns: dict[str, Any]) -> Any:
    """The column with what is rounding beside the largest of its kind as zero: the file has every digit."""
    import numpy as np

    kind = "eps_" if name.startswith("eps_") else "sig_" if name.startswith("sig_") or name in ("p", "q") else ""
    if not kind:
        return column
    largest = max((abs(other).max() for key, other in columns.items() if key.startswith(kind)), default=0.0)
    return np.where(abs(column) > 1e-12 * largest, column, 0.0)


def write_text(output: Path, text: str) -> None:
    """Write in one piece, so that a full disk leaves an older file as it was; a pipe or a device is written to directly."""
    if output.exists() and not output.is_file():
        output.write_text(text, encoding="utf-8")
        return
    from fenchel.dem.storage import replace_file

    replace_file(output.resolve(), text.encode())


def _gaps(law: Law, history: History, values: dict[str, float], times: Any, temperatures: Any) -> Any:
    """Duality gap of every step: each row once more by the general engine, from the state of the row before."""
    from fenchel.integrators.history import time_steps
    from fenchel.integrators.path_certificate import PathData, path_gaps

    return path_gaps(PathData(law, values, time_steps(times, len(times)), temperatures), history)
