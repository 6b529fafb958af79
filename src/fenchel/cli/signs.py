"""`--signs`: tension positive inside, always; here is the only place where a sign is turned for those who count compression."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from fenchel.integrators import StrainStressPath

__all__ = ["SIGNS", "Signs", "turn_columns", "turn_path"]


class Signs(StrEnum):
    """Which sense of stress and strain is positive in files and tables."""

    tension = "tension-positive"
    compression = "compression-positive"


SIGNS = typer.Option(Signs.tension, "--signs", help="Signs of stress and strain in what is read and written.")


def turn_path(path: StrainStressPath, signs: Signs) -> StrainStressPath:
    """A path read under `signs`, tension positive; the mean pressure `p` is positive in compression under either."""
    if signs is Signs.tension:
        return path
    from dataclasses import replace

    trace = path.trace_targets
    return replace(
        path,
        targets=0.0 - path.targets,
        trace_targets=0.0 - trace if path.trace == "eps_v" and trace is not None else trace,
    )


def turn_columns(columns: dict[str, Any], signs: Signs) -> dict[str, Any]:
    """Columns of a history under `signs`: every tensor component and `eps_v` turn, scalars and energies do not."""
    if signs is Signs.tension:
        return columns
    turning = ("_xx", "_yy", "_zz", "_yz", "_xz", "_xy")
    return {
        name: 0.0 - values if name.endswith(turning) or name == "eps_v" else values for name, values in columns.items()
    }
