"""Material-point test of a law along a path file: the steps as given, under mixed control.

A law without closed form is driven by the general engine, some milliseconds per step.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..potentials import Law
from .accuracy import AccurateUpdate
from .explicit import ExplicitUpdate
from .general_update import GeneralUpdate
from .history import History, drive_arrays
from .path_file import StrainStressPath, read_path
from .stress_update import StressUpdate
from .update import Update, build_update

__all__ = ["drive"]


def drive(
    law: Law | Update | GeneralUpdate | StressUpdate | ExplicitUpdate | AccurateUpdate,
    path: StrainStressPath | str | Path,
    values: Mapping[str, Any],
    initial_state: Mapping[str, Any] | None = None,
    *,
    solver: str = "auto",
    formulation: str = "strain",
) -> History:
    """Follow `path` (a file or what `read_path` returns) with the parameter values by name; `solver` and `formulation` are for a law
    that is not compiled yet.

    Raises `InputError` for bad input, `ConvergenceError` with the row where the path cannot be followed.
    """
    plan = path if isinstance(path, StrainStressPath) else read_path(path)
    compiled = isinstance(law, (Update, GeneralUpdate, StressUpdate, ExplicitUpdate, AccurateUpdate))
    update = law if compiled else build_update(law, solver=solver, formulation=formulation)
    return drive_arrays(
        update,
        plan.control,
        plan.targets,
        values,
        trace=plan.trace,
        trace_targets=plan.trace_targets,
        initial_state=initial_state,
        times=plan.time,
        temperatures=plan.temperature,
    )
