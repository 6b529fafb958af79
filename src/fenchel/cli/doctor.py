"""`fenchel doctor`: what is installed, where things are kept, what is missing."""

from __future__ import annotations

import typer

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the commands of this group to the command line."""
    app.command("doctor")(_doctor)


def _doctor(json_wanted: bool = typer.Option(False, "--json", help="Print JSON.")) -> None:
    """Is everything there and working?

    Versions, cache, threads, free disk, and whether compiler and cone solver work; exit code 1 if something needed does not. The cache
    holds compiled code only: its folder may be deleted at any time.

    Example: fenchel doctor
    """
    from ..doctor import examine
    from .tables import print_json, print_table

    findings = examine()
    healthy = all(finding.fine or not finding.needed for finding in findings)
    if json_wanted:
        items = [
            {"name": item.name, "value": item.value, "needed": item.needed, "fine": item.fine, "remedy": item.remedy}
            for item in findings
        ]
        print_json({"healthy": healthy, "findings": items})
    else:
        rows = [
            (item.name, item.value, "" if item.fine else ("MISSING" if item.needed else "optional"), item.remedy)
            for item in findings
        ]
        print_table(("what", "found", "state", "remedy"), rows)
    if not healthy:
        raise typer.Exit(1)
