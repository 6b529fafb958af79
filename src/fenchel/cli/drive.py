"""`fenchel drive`: one material point along a prescribed path."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .laws import LAW, Formulation
from .signs import SIGNS, Signs, turn_columns, turn_path
from .values import PARAMETERS, VALUES, parameter_values

if TYPE_CHECKING:
    from fenchel.integrators import History, StressUpdate, Update

__all__ = ["register"]


class Solver(StrEnum):
    """How the step is solved."""

    auto = "auto"
    closed = "closed"
    reduced = "reduced"
    principal = "principal"
    general = "general"
    conic = "conic"


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
    signs: Signs = SIGNS,
    certify: bool = typer.Option(False, "--certify", help="Add the duality gap of every step [J/m3]."),
    json_wanted: bool = typer.Option(False, "--json", help="Print the history as JSON."),
) -> None:
    """A material point along a path of prescribed strains and stresses; a component without column has zero stress.

    Example: fenchel drive von_mises path.csv -p E=2e11 -p nu=0.3 -p sigma_y=3e8 -p H_k=0 -p H_i=1e9 -o out.csv
    """
    from fenchel.errors import InputError
    from fenchel.integrators import StressUpdate, Update, drive, read_path
    from fenchel.integrators.path_file import history_columns
    from fenchel.potentials import load_law

    from .tables import csv_text, print_json, print_table

    values = parameter_values(pairs, parameters)
    plan = turn_path(read_path(path), signs)
    declared = load_law(law)
    update = declared.compile("3d", formulation=formulation.value, solver=solver.value)
    if certify and not isinstance(update, (Update, StressUpdate)):
        raise InputError(
            "--certify needs a generated step; the general method is its own certificate: leave --certify out"
        )
    history = drive(update, plan, values)
    columns: dict[str, Any] = dict(history_columns(history, plan.time))
    if certify:
        columns["gap"] = _gaps(update, history, values, plan.time)
    columns = turn_columns(columns, signs)
    if output is not None:
        _write(output, csv_text(columns))
    if json_wanted:
        print_json(columns)
    elif output is not None:
        typer.echo(f"{len(plan.time)} steps in {output}")
    else:
        shown = {name: column for name, column in columns.items() if _worth_showing(name, column, columns)}
        print_table(tuple(shown), zip(*(column.tolist() for column in shown.values()), strict=True))


def _worth_showing(name: str, column: Any, columns: dict[str, Any]) -> bool:
    """Whether a column goes into the table for people: the file has all of them."""
    if name in ("t", "p", "q", "dissipation", "status", "gap"):
        return True
    if not name.startswith(("eps_", "sig_")) or name.count("_") > 1:
        return False
    largest = max(abs(other).max() for key, other in columns.items() if key[:4] == name[:4] and key.count("_") == 1)
    return bool(abs(column).max() > 1e-9 * largest)


def _write(output: Path, text: str) -> None:
    """Write in one piece, so that a full disk leaves an older file as it was; a pipe or a device is written to directly."""
    if output.exists() and not output.is_file():
        output.write_text(text, encoding="utf-8")
        return
    from fenchel.dem.storage import replace_file

    replace_file(output.resolve(), text.encode())


def _gaps(update: Update | StressUpdate, history: History, values: dict[str, float], times: Any) -> Any:
    """Duality gap of every step: each row once more, from the state of the row before."""
    import numpy as np

    from fenchel.integrators import StressUpdate

    driven = history.sig if isinstance(update, StressUpdate) else history.eps
    before = {name: np.concatenate([np.zeros_like(state[:1]), state[:-1]]) for name, state in history.state.items()}
    given: dict[str, Any] = dict(values)
    if history.temperature is not None and update.law.temperature is not None:
        given[update.law.temperature.name] = history.temperature
    if not update.module.VISCOUS or len(times) < 2:
        return update(driven, before, certify=True, **given).gap
    found = []
    for row, dt in enumerate(np.diff(times, prepend=2.0 * times[0] - times[1])):
        state = {name: value[row : row + 1] for name, value in before.items()}
        own = {k: v[row] if np.ndim(v) else v for k, v in given.items()}
        gap = update(driven[row], state, float(dt), certify=True, **own).gap
        assert gap is not None  # certify=True asks for it
        found.append(gap[0])
    return np.array(found)
