"""Material-point test of a law along a path file: the steps as given, under mixed control."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..potentials import Law
from .history import History, drive_arrays
from .path_file import StrainStressPath, read_path
from .update import Update, build_update

__all__ = ["drive"]


def drive(
    law: Law | Update,
    path: StrainStressPath | str | Path,
    values: Mapping[str, Any],
    initial_state: Mapping[str, Any] | None = None,
    *,
    solver: str = "auto",
) -> History:
    """Follow `path` (a file or what `read_path` returns) with the parameter values by name.

    Raises `InputError` for bad input, `ConvergenceError` with the row where the path cannot be followed.
    """
    plan = path if isinstance(path, StrainStressPath) else read_path(path)
    update = law if isinstance(law, Update) else build_update(law, solver=solver)
    if not isinstance(update, Update):
        raise InputError(
            f"law '{update.law.name}' has no closed form; paths need one (its step is solved by '{update.solver}')"
        )
    return drive_arrays(
        update,
        plan.control,
        plan.targets,
        values,
        trace=plan.trace,
        trace_targets=plan.trace_targets,
        initial_state=initial_state,
        times=plan.time,
    )
