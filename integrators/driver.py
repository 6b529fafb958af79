"""Material-point test of a law along a path file: the steps as given, under mixed control.

A law without closed form is driven by the general engine, some milliseconds per step.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..potentials import Law
from .accuracy import AccurateUpdate
from .explicit import ExplicitUpdate
from .general_update import GeneralUpdate
from .history import History, drive_arrays
from .path_file import COMPONENTS, MANDEL, StrainStressPath, read_path
from .stress_update import StressUpdate
from .update import Update, build_update

__all__ = ["drive"]

SAME = 1e-6  # of the largest stress: how well a path must begin where a history ends


def drive(
    law: Law | Update | GeneralUpdate | StressUpdate | ExplicitUpdate | AccurateUpdate,
    path: StrainStressPath | str | Path,
    values: Mapping[str, Any],
    initial_state: Mapping[str, Any] | None = None,
    *,
    solver: str = "auto",
    formulation: str = "strain",
    after: History | None = None,
) -> History:
    """Follow `path` (a file or what `read_path` returns) with the parameter values by name; `solver` and `formulation` are for a law
    that is not compiled yet.

    `after` is a history of the same law whose end the path goes on from, under another control if need be: consolidation, then shear. The
    first row of the path is that end. Its stresses are those there, its strains zero: strains (and `eps_v`) of the path count from there,
    while those of the returned history are whole, and its dissipation goes on.

    Raises `InputError` for bad input, `ConvergenceError` with the row where the path cannot be followed.
    """
    plan = path if isinstance(path, StrainStressPath) else read_path(path, virgin=after is None)
    if after is not None and initial_state is not None:
        raise InputError("drive: give initial_state, or a history to go on from, not both")
    compiled = isinstance(law, (Update, GeneralUpdate, StressUpdate, ExplicitUpdate, AccurateUpdate))
    update = law if compiled else build_update(law, solver=solver, formulation=formulation)
    if after is not None:
        return _go_on(update, plan, values, after)
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


def _go_on(update: Any, plan: StrainStressPath, values: Mapping[str, Any], after: History) -> History:
    """The path from the end of a history."""
    eps, sig = after.eps[-1], after.sig[-1]
    names = {v.name for v in update.law.internal}
    if set(after.state) != names:
        raise InputError(
            f"drive: the history to go on from holds the state {sorted(after.state)}; law '{update.law.name}' has {sorted(names)}"
        )
    if len(plan.time) < 2:
        raise InputError("drive: a path that goes on needs two rows: where it begins, and where it goes")
    targets = np.where(plan.control, plan.targets, plan.targets + eps)
    goals = plan.trace_targets
    if goals is not None and plan.trace == "eps_v":
        goals = goals + eps[:3].sum()
    _check_start(plan, targets[0], sig)
    more: dict[str, Any] = {} if plan.temperature is None else {"temperatures": plan.temperature[1:]}
    rest = drive_arrays(
        update,
        plan.control,
        targets[1:],
        values,
        trace=plan.trace,
        trace_targets=None if goals is None else goals[1:],
        initial_strain=eps,
        initial_state={name: array[-1:] for name, array in after.state.items()},
        times=plan.time,
        **more,
    )
    return after._joined(rest)


def _check_start(plan: StrainStressPath, first: Any, sig: Any) -> None:
    """The first row says the stresses that are there; a component without column has no stress."""
    size = SAME * float(np.abs(sig).max()) + np.finfo(float).tiny
    for k, c in enumerate(COMPONENTS):
        if plan.control[k] and np.isfinite(first[k]) and abs(first[k] - sig[k]) > size:
            raise InputError(
                f"drive: the path begins at sig_{c} = {first[k] / MANDEL[k]:g} Pa, but the history that it goes on from ends at "
                f"{sig[k] / MANDEL[k]:g} Pa (tension positive): begin with that stress, in a column of its own"
            )
    if plan.trace == "p" and plan.trace_targets is not None:
        p = -float(sig[:3].mean())
        if abs(plan.trace_targets[0] - p) > size:
            raise InputError(
                f"drive: the path begins at p = {plan.trace_targets[0]:g} Pa, but the history ends at {p:g} Pa: begin there"
            )
