"""`fenchel compare`: one path through every formulation and solver that a law takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .laws import LAW
from .progress import notice
from .signs import SIGNS, Signs
from .values import PARAMETERS, VALUES, parameter_values

if TYPE_CHECKING:
    from fenchel.integrators import Comparison, Run

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("compare")(_compare)


def _compare(
    law: str = LAW,
    path: Path = typer.Argument(
        ..., metavar="PATH.csv", help="t, and per component eps_xx (strain) or sig_xx (stress, Pa)."
    ),
    pairs: list[str] = VALUES,
    parameters: Path | None = PARAMETERS,
    tolerance: float = typer.Option(1e-8, "--tolerance", help="Difference of stress, relative to the largest."),
    sampled: int = typer.Option(10, "--sampled-rows", help="Single steps by cvxpy and by the explicit scheme."),
    signs: Signs = SIGNS,
    output: Path | None = typer.Option(None, "-o", "--output", metavar="OUT.csv", help="Write the table of the runs."),
    json_wanted: bool = typer.Option(False, "--json", help="Print everything as JSON."),
) -> None:
    """One path by every formulation and solver.

    Told are differences, duality gaps, the order in the step size, times, and which formulation suits best.

    Exit code 0 if all runs that can follow the path agree, 1 if they do not or none can.

    Example: fenchel compare von_mises path.csv -p E=2e11 -p nu=0.3 -p sigma_y=3e8 -p H_k=0 -p H_i=1e9
    """
    from fenchel.integrators import compare, read_path
    from fenchel.potentials import load_law

    from .drive import write_text
    from .tables import csv_text, print_json

    values = parameter_values(pairs, parameters)
    plan = read_path(path, signs=signs.value)
    declared = load_law(law)
    with notice() as told:
        found = compare(declared, plan, values, tolerance=tolerance, sampled_rows=sampled, progress=told)
    if output is not None:
        write_text(output, csv_text(_columns(found)))
    if json_wanted:
        print_json(_content(found))
    else:
        _print(found)
    if not found.agree:
        raise typer.Exit(1)


def _content(found: Comparison) -> dict[str, Any]:
    from dataclasses import asdict

    content = asdict(found)
    return content | {
        "agree": found.agree,
        "order": asdict(found.order) | {"exact": found.order.exact},
        "verdict": asdict(found.verdict) | {"text": found.verdict.text},
    }


def _columns(found: Comparison) -> dict[str, list[Any]]:
    """One row per run; an empty cell where there is no figure."""
    names = (
        "formulation",
        "solver",
        "rows",
        "stress",
        "strain",
        "gap",
        "time_per_step",
        "iterations",
        "allowed",
        "agrees",
    )
    table: dict[str, list[Any]] = {
        name: ["" if getattr(run, name) is None else getattr(run, name) for run in found.runs] for name in names
    }
    variables = next((tuple(run.internal) for run in found.runs if run.internal), ())
    for variable in variables:
        table[f"internal_{variable}"] = [run.internal.get(variable, "") for run in found.runs]
    # reasons hold commas, and the reader of a cell should not have to know about quotes
    table["failure"] = [run.failure.replace(",", ";").replace('"', "'") for run in found.runs]
    return table


def _print(found: Comparison) -> None:
    from .tables import print_table

    followed = [(k, run) for k, run in enumerate(found.runs) if not run.failure and run.stress is not None]
    conditions = {one.formulation: one.condition for one in found.verdict.figures}
    title = f"{found.law}, {found.rows} rows; differences relative to the reference (*), largest stress {found.scale:.6g} Pa"
    heads = (
        "run", "rows", "stress", "strain", "internal", "gap / energy", "µs per step", "systems per step", "agrees",
    )  # fmt: skip
    rows = [
        (
            f"{'* ' if k == found.reference else ''}{run.formulation} {run.solver}",
            run.rows,
            _short(run.stress),
            _short(run.strain),
            _short(max(run.internal.values(), default=0.0)),
            _short(run.gap),
            "" if run.time_per_step is None else f"{run.time_per_step * 1e6:.3g}",
            "" if run.iterations is None else f"{run.iterations:.2f}",
            _agreement(run, conditions[run.formulation]),
        )
        for k, run in followed
    ]
    print_table(heads, rows, title=title)
    failed = [(f"{run.formulation} {run.solver}", run.failure) for run in found.runs if run.failure]
    if failed:
        print_table(("run", "why it did not follow"), failed)
    if found.order.differences:
        pairs = zip(found.order.parts, found.order.parts[1:], found.order.differences, strict=False)
        print_table(
            ("parts per step", "difference"), [(f"{a} and {b}", f"{size:.1e}") for a, b, size in pairs],
            title="steps cut into equal parts",
        )  # fmt: skip
    if found.reference is not None:
        reference = found.runs[found.reference]
        typer.echo(f"reference: {reference.formulation} {reference.solver}: {found.trusted}")
    typer.echo(f"step size: {found.order.meaning}")
    for one in found.verdict.figures:
        typer.echo(one.text)
    wrong = [f"{run.formulation} {run.solver}" for _, run in followed if run.agrees is False]
    if found.reference is None:
        start = "no run follows the path"
    elif wrong:
        start = f"{len(wrong)} of {len(followed)} runs disagree ({', '.join(wrong)})"
    else:
        start = f"all {len(followed)} runs that follow the path agree"
    typer.echo(f"verdict: {start}; {found.verdict.headline}")


def _agreement(run: Run, condition: float | None) -> str:
    if not run.agrees:
        return f"NO, above {run.allowed or 0.0:.1e}"
    apart = max(run.strain or 0.0, *run.internal.values(), 0.0)
    loose = condition is not None and condition > 1e15 and apart > (run.allowed or 0.0)
    return "yes, but its strain is not determined" if loose else "yes"


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"
