"""Options of the commands that run many tasks."""

from __future__ import annotations

import typer

__all__ = ["JOBS", "SCHEDULER"]

JOBS = typer.Option(None, "--jobs", min=1, help="How many runs go on at the same time; default: all cores.")
SCHEDULER = typer.Option(
    None, "--scheduler", metavar="ADDRESS", help="Run on the workers of this dask scheduler, e.g. tcp://10.0.0.1:8786."
)
