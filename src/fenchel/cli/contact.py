"""`fenchel contact`: solve one FCLIB problem and say how well."""

from __future__ import annotations

from pathlib import Path

import typer

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("contact")(_contact)


def _contact(
    problem: Path = typer.Argument(
        ..., metavar="PROBLEM.hdf5", help="An FCLIB file, local or global, three-dimensional."
    ),
    solver: str = typer.Option(
        "auto",
        "--solver",
        metavar="S",
        help="auto, nlgs, anderson, admm, interior, interior_selective, newton, homotopy or cone_program.",
    ),
    tolerance: float = typer.Option(
        1e-8, "--tolerance", metavar="T", help="What natural_map_q and natural_map_scaled shall both reach."
    ),
    time_limit: float = typer.Option(
        120.0, "--time-limit", metavar="SECONDS", help="Processor time after which to stop."
    ),
    certify: bool = typer.Option(
        False, "--certify", help="Compare with the optimum of the cone program at the slip velocities found."
    ),
    json_wanted: bool = typer.Option(False, "--json", help="Print the result as JSON."),
) -> None:
    """Solve a contact problem with Coulomb friction.

    The problem is u = W r + q as given; every error measure is reported.

    The errors are recomputed from the reactions by code that the solvers do not share. Exit code 1: the tolerance was not reached.

    Example: fenchel contact PROBLEM.hdf5 --solver auto --tolerance 1e-8 --certify
    """
    from fenchel.dem.one_step import read_fclib, solve
    from fenchel.dem.one_step.solve import describe

    from .progress import waiting
    from .tables import print_json, print_table

    given = read_fclib(problem)
    with waiting(f"solving {problem} ({given.contact_count} contacts)"):
        solution = solve(given, solver=solver, tolerance=tolerance, time_limit=time_limit, keep_unconverged=True)
    notes = []
    if not given.symmetric:
        notes.append(f"W is not symmetric (relative part {given.asymmetry:.1e}): the problem was solved as given")
    certified, how = None, ""
    if certify:
        with waiting("certifying by a cone program"):
            certified, how = _certified(given, solution.r)
    if how:
        notes.append(how)
    if not solution.converged:
        notes.append(describe(given, solution))
    errors = solution.errors.as_dict()
    if json_wanted:
        print_json(
            {
                "problem": problem,
                "solver": solution.solver,
                "converged": solution.converged,
                "status": solution.status.name.lower(),
                "contacts": given.contact_count,
                "tolerance": tolerance,
                "sweeps": solution.sweeps,
                "factorisations": solution.factorisations,
                "seconds": solution.seconds,
                "errors": errors,
                "symmetric": given.symmetric,
                "certified": certified,
                "notes": notes,
            }
        )
    else:
        rows = [(name, value) for name, value in errors.items()]
        print_table(
            ("error measure", "value"), rows, title=f"{problem}: {given.contact_count} contacts, {solution.solver}"
        )
        typer.echo(
            f"{'converged' if solution.converged else 'NOT CONVERGED'} to {tolerance:.0e} after {solution.sweeps} sweeps, "
            f"{solution.factorisations} factorisations, {solution.seconds:.3g} s"
        )
        if certify:
            typer.echo(f"certified: {'undecided' if certified is None else 'yes' if certified else 'no'}")
        for note in notes:
            typer.echo(note)
    if not solution.converged:
        raise typer.Exit(1)


def _certified(problem, reactions) -> tuple[bool | None, str]:  # type: ignore[no-untyped-def]
    """Whether a cone program confirms the reactions; None where there is none that could."""
    from fenchel.dem.one_step import certify
    from fenchel.errors import ConvergenceError, InputError

    try:
        certificate = certify(problem, reactions)
    except (InputError, ConvergenceError) as reason:
        return None, f"no certificate: {reason}"
    return certificate.certified, (
        f"certificate: relative gap to the optimum of the cone program {certificate.gap:.1e}, "
        f"difference in energy norm {certificate.velocity_difference:.1e}"
    )
