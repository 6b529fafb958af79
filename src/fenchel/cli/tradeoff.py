"""`fenchel tradeoff`: what accuracy costs, measured on the user's own law, contact problem or scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..errors import InputError
from .campaign import JOBS, SCHEDULER
from .laws import LAW
from .signs import SIGNS, Signs
from .values import PARAMETERS, VALUES, parameter_values

if TYPE_CHECKING:
    from fenchel.front import Front

__all__ = ["register"]

ACCURACY = typer.Option(
    [], "--accuracy", metavar="A", help="A wanted accuracy; may be repeated. Default: some decades."
)
OUTPUT = typer.Option(..., "-o", "--output", metavar="DIR", help="The folder of front.json and front.svg.")
JSON = typer.Option(False, "--json", help="Print front.json.")
QUIET = typer.Option(False, "--quiet", help="Show no progress.")
KEEP = typer.Option(True, "--keep/--no-keep", help="Keep the front in the cache, where accuracy= finds it.")

_app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="Measure speed against accuracy.\n\n"
    "Written are a table, front.json and front.svg, and told is the cheapest setting for a wanted accuracy.\n\n"
    "Example: fenchel tradeoff law cam_clay -o front --accuracy 1e-6",
)


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.add_typer(_app, name="tradeoff")


@_app.command("law")
def _law(
    law: str = LAW,
    path: Path | None = typer.Argument(
        None, metavar="[PATH.csv]", help="A path to measure the step size on; default: random paths of three legs."
    ),
    pairs: list[str] = VALUES,
    parameters: Path | None = PARAMETERS,
    accuracies: list[float] = ACCURACY,
    output: Path = OUTPUT,
    points: int = typer.Option(2000, "--points", min=10, help="Random points of the front of the step."),
    threads: list[int] = typer.Option([1, 2], "--threads", min=1, help="Numbers of threads to time; may be repeated."),
    time_step: float = typer.Option(1.0, "--dt", help="Time step of the random points [s]; matters to viscous laws."),
    temperature: float = typer.Option(300.0, "--temperature", help="Of laws that have one [K]."),
    signs: Signs = SIGNS,
    keep: bool = KEEP,
    quiet: bool = QUIET,
    json_wanted: bool = JSON,
) -> None:
    """The step of a law by every method, tolerance and precision, and a path in more and more steps.

    Errors are those of stress, energy, dissipation and tangent against a trusted answer, whose own error is bounded by its duality gap.
    Values that are not given are those of the library.

    Example: fenchel tradeoff law drucker_prager -p H_i=0 -o front --accuracy 1e-3
    """
    from fenchel.integrators import read_path
    from fenchel.potentials import load_law
    from fenchel.potentials.library import ENTRIES
    from fenchel.tradeoff.law import measure_law

    declared = load_law(law)
    values = dict(ENTRIES[law].values) if law in ENTRIES else {}
    values |= parameter_values(pairs, parameters)
    plan = None if path is None else read_path(path, signs=signs.value)
    wanted = _accuracies(accuracies, (1e-3, 1e-6, 1e-9))
    with _told(quiet) as tell:
        found = measure_law(
            declared,
            values,
            path=plan,
            points=points,
            threads=tuple(threads),
            dt=time_step,
            temperature=temperature,
            progress=tell,
        )
    if keep:
        found.keep(declared)
    _finish([found.step, found.path], output, wanted, json_wanted, {"threads": found.threads})
    if not json_wanted:
        for count, seconds in found.threads.items():
            typer.echo(
                f"{count} thread{'s' if count > 1 else ''}: {seconds * 1e6:.3g} µs per point, the same answer to the last bit"
            )


@_app.command("contact")
def _contact(
    problem: Path = typer.Argument(
        ..., metavar="PROBLEM.hdf5", help="An FCLIB file, local or global, three-dimensional."
    ),
    accuracies: list[float] = ACCURACY,
    output: Path = OUTPUT,
    solvers: list[str] = typer.Option(
        [], "--solver", metavar="S", help="Solvers to try; may be repeated. Default: all."
    ),
    tolerances: list[float] = typer.Option([], "--tolerance", metavar="T", help="Tolerances to try; may be repeated."),
    measure: str = typer.Option(
        "residual", "--measure", help="residual, or velocity: against the best solution found."
    ),
    time_limit: float = typer.Option(20.0, "--time-limit", metavar="SECONDS", help="Processor time of one setting."),
    quiet: bool = QUIET,
    json_wanted: bool = JSON,
) -> None:
    """A contact problem by every solver, tolerance and start.

    Errors are recomputed from the reactions by code that the solvers do not share.

    Example: fenchel tradeoff contact PROBLEM.hdf5 -o front --accuracy 1e-6
    """
    from fenchel.dem.one_step import read_fclib
    from fenchel.tradeoff.contact import TOLERANCES, measure_contact

    given = read_fclib(problem)
    wanted = _accuracies(accuracies, (1e-3, 1e-6, 1e-9))
    if not time_limit > 0.0:
        raise InputError(f"--time-limit {time_limit:g}: seconds, more than zero")
    tried = _accuracies(tolerances, TOLERANCES, "--tolerance")
    with _told(quiet) as tell:
        front = measure_contact(
            given, solvers=solvers or None, tolerances=tried, time_limit=time_limit, measure=measure, progress=tell
        )
    _finish([front], output, wanted, json_wanted, {})


@_app.command("dem")
def _dem(
    scene: Path = typer.Argument(..., metavar="SCENE.toml", help="A scene: triaxial test, free bodies, or deposit."),
    accuracies: list[float] = ACCURACY,
    output: Path = OUTPUT,
    measure: str | None = typer.Option(
        None,
        "--measure",
        help="triaxial: stress, strain, porosity, length; motion: centre, energy; slope: angle, height.",
    ),
    steps: list[float] = typer.Option([], "--step", help="Steps to try, in the unit of the scene; may be repeated."),
    tolerances: list[float] = typer.Option([], "--tolerance", metavar="T", help="Tolerances to try; may be repeated."),
    keep: bool = KEEP,
    jobs: int | None = JOBS,
    scheduler: str | None = SCHEDULER,
    quiet: bool = QUIET,
    json_wanted: bool = JSON,
) -> None:
    """A scene under every time step, tolerance and contact law, judged by what the scene is made for.

    A triaxial sample is prepared once and tested under every setting. Finished runs stay in DIR/runs: the same command takes them up.
    Run with --jobs 1 for times that do not disturb each other.

    Example: fenchel tradeoff dem scene.toml -o front --accuracy 1e-2 --jobs 1
    """
    from fenchel.dem.accuracy import measures_of, scene_key
    from fenchel.front import keep_front
    from fenchel.tradeoff.scene import measure_scene, read_any_scene

    given = read_any_scene(scene)
    wanted = _accuracies(accuracies, (1e-1, 3e-2, 1e-2))
    front = measure_scene(
        given,
        output / "runs",
        measure=measure,
        steps=_accuracies(steps, (), "--step", most=100.0) or None,
        tolerances=_accuracies(tolerances, (), "--tolerance") or None,
        name=scene.name,
        jobs=jobs,
        scheduler=scheduler,
        show=not quiet,
    )
    if keep and (measure is None or measure == next(iter(measures_of(given)))):
        keep_front(front, scene_key(given))
    _finish([front], output, wanted, json_wanted, {})


def _accuracies(
    given: Sequence[float], usual: Sequence[float], what: str = "--accuracy", most: float = 1.0
) -> tuple[float, ...]:
    for value in given:
        if not 0.0 < value < most:
            raise InputError(f"{what} {value:g}: a number between 0 and {most:g}")
    return tuple(given) or tuple(usual)


def _told(quiet: bool) -> Any:
    from contextlib import nullcontext

    from .progress import notice

    return nullcontext(None) if quiet else notice()


def _finish(
    fronts: list[Front], output: Path, wanted: Sequence[float], json_wanted: bool, more: dict[str, Any]
) -> None:
    """Write the files of a front, print the table or the JSON."""
    from fenchel.cache import replace_file
    from fenchel.front import write_json
    from fenchel.tradeoff.figure import front_picture
    from fenchel.tradeoff.report import content_of, sentences

    from .tables import print_json, print_table

    content = content_of(fronts, wanted) | more
    write_json(output / "front.json", content)
    replace_file(output / "front.svg", front_picture(fronts))
    if json_wanted:
        print_json(content)
        return
    for front in fronts:
        inside = set(front.efficient)
        names = list(dict.fromkeys(name for p in front.points for name in p.figures))
        rows = [
            (
                f"{'* ' if k in inside else ''}{p.name}",
                f"{p.cost:.3g}" if p.error is not None else "",
                "" if p.error is None else f"{p.error:.1e}",
                *("" if p.figures.get(n) is None else f"{p.figures[n]:.2g}" for n in names),
            )
            for k, p in enumerate(front.points)
            if not p.failure
        ]
        print_table(
            ("setting", f"cost [{front.cost}]", "error", *names), rows, title=f"{front.subject}; error: {front.measure}"
        )
        failed = [(p.name, p.failure) for p in front.points if p.failure]
        if failed:
            print_table(("setting", "why it has no figure"), failed)
        typer.echo(f"* not dominated; {front.note}")
        for sentence in sentences(front, wanted):
            typer.echo(sentence)
    typer.echo(f"written: {output / 'front.json'}, {output / 'front.svg'}")
