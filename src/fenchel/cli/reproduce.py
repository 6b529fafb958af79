"""`fenchel reproduce`: the reference study, claim by claim."""

from __future__ import annotations

from pathlib import Path

import typer

from .campaign import JOBS, SCHEDULER

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("reproduce")(_reproduce)


def _reproduce(
    claims: list[str] = typer.Argument(
        None, metavar="[CLAIM ...]", help="Numbers, ranges (4-16), parts (A to L), headlines, choice; default: all."
    ),
    size: str = typer.Option("small", "--size", metavar="small|medium|paper", help="Minutes, hours, or a day."),
    output: Path = typer.Option(..., "-o", "--output", metavar="DIR", help="The folder of report, claims and runs."),
    jobs: int | None = JOBS,
    scheduler: str | None = SCHEDULER,
    quiet: bool = typer.Option(False, "--quiet", help="Show no progress."),
    json_wanted: bool = typer.Option(False, "--json", help="Print claims.json."),
) -> None:
    """Run the reference study, claim by claim.

    The study is that of wire-reinforced sand; each of its claims passes, fails or stays undecided, with the figures.

    Writes DIR/report.html, DIR/claims.json and DIR/runs/*.h5. Finished runs stay: the same command takes them up after an interruption.

    Exit code 0 if every wanted claim that is a theorem passes, else 1.

    Example: fenchel reproduce 17-27 --size small -o continuum
    """
    from fenchel.study.reproduce import reproduce

    from .tables import print_table

    found = reproduce(claims or (), size, output, jobs=jobs, scheduler=scheduler, show=not quiet)
    if json_wanted:
        typer.echo((output / "claims.json").read_text(encoding="utf-8"), nl=False)
    else:
        rows = [(str(n), found.claims[n].kind, v.outcome, v.sentence) for n, v in found.verdicts.items()]
        if rows:
            print_table(("claim", "kind", "verdict", "figures"), rows)
        counts = ", ".join(f"{found.count(outcome)} {outcome}" for outcome in ("pass", "fail", "undecided"))
        typer.echo(f"{counts}. The report is {output / 'report.html'}")
    if not found.theorems_hold:
        raise typer.Exit(1)
