"""Derivatives along a path under mixed control.

Row by row σ = σ(ε, X_n; θ), X = X(ε, X_n; θ) with ε = base + Z y and V σ = goal, base and goal not depending on θ:

    s = ∂σ/∂θ + ∂σ/∂X_n dX_n,   dy = −(V ℂ Z)⁻¹ V s,   dε = Z dy,   dσ = s + ℂ dε,   dX = ∂X/∂θ + ∂X/∂X_n dX_n + ∂X/∂ε dε.

The partial derivatives of all rows are taken at once, at the states that the path has passed; what is left to the recursion is small.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from ..notebook import Summary
from .dimension import require_space
from .general_update import GeneralUpdate
from .history import History, drive_arrays, path_plan, time_steps
from .sensitivity import chosen_names, derivatives
from .thermal import thermal_input

__all__ = ["PathSensitivities", "path_sensitivities"]

Array = NDArray[np.float64]
LIMIT = 1e-10


@dataclass(frozen=True, repr=False)
class PathSensitivities(Summary):
    """Derivatives by the k parameters `names` at the n rows of `history`, per unit of each: `eps` [1/unit], `sig` [Pa/unit] (n, 6, k),
    Mandel; `state` by name, tensors (n, 6, k), scalars (n, k); `dissipation`, accumulated [J/m³ per unit] (n, k)."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "eps": "1/unit",
        "sig": "Pa/unit",
        "dissipation": "J/m³/unit",
    }

    names: tuple[str, ...]
    eps: Array
    sig: Array
    state: dict[str, Array]
    dissipation: Array
    history: History

    def _title(self) -> str:
        return f"derivatives by {', '.join(self.names)} along a path"


def path_sensitivities(
    update: Any,
    control: Any,
    targets: Any,
    values: Mapping[str, Any],
    *,
    wrt: Sequence[str] | str | None = None,
    history: History | None = None,
    trace: str | None = None,
    initial_state: Mapping[str, Any] | None = None,
    times: Any = None,
    temperatures: Any = None,
    **more: Any,
) -> PathSensitivities:
    """Follow a path as `drive_arrays` does, and differentiate it by the parameters `wrt` (all if None; the temperature may be named).

    The arguments are those of `drive_arrays`; what is prescribed does not depend on the parameters. `history` is what that function has
    returned for the same arguments, if it is there already. Raises `InputError`, and `ConvergenceError` where the path fails, or where its
    control leaves a rate of strain undetermined, as at a limit load.
    """
    require_space(update, "path_sensitivities")
    names = chosen_names(update.law, wrt)
    path: dict[str, Any] = {
        "trace": trace,
        "initial_state": initial_state,
        "times": times,
        "temperatures": temperatures,
    }
    found = drive_arrays(update, control, targets, values, **path, **more) if history is None else history
    n, k, size = len(found.eps), len(names), update.state_size
    if np.atleast_2d(np.asarray(targets)).shape[0] != n:
        raise InputError(
            f"path_sensitivities: the history has {n} rows, the targets have {len(np.atleast_2d(targets))}"
        )
    old = np.empty((n, size))
    old[:1] = update.packing.pack(initial_state, 1)
    old[1:] = update.packing.pack(found.state, n)[:-1]
    width = k + size + 6
    d_old, d_eps = np.zeros((n, size, width)), np.zeros((n, 6, width))
    d_old[:, :, k : k + size], d_eps[:, :, k + size :] = np.eye(size), np.eye(6)
    given = dict(values)
    if temperatures is not None:
        given[update.law.temperature.name] = temperatures
    thermal_input(update.law, given, n)
    viscous = isinstance(update, GeneralUpdate) or update.module.VISCOUS
    steps = time_steps(times, n) if viscous and times is not None else 1.0
    parts = derivatives(update, found.eps, old, steps, given, names, d_old, d_eps)
    # where the path goes does not depend on the values of its condition
    plan = path_plan(control, targets, trace, None if trace is None else np.zeros(n), False)
    return _followed(names, found, update.packing, parts, plan.z, plan.v)


def _followed(
    names: tuple[str, ...],
    history: History,
    packing: Any,
    parts: tuple[Array, Array, Array],
    directions: Array,
    rows: Array,
) -> PathSensitivities:
    d_stress, d_new, d_lost = parts
    n, k, size = len(d_stress), len(names), d_new.shape[1]
    eps, sig = np.zeros((n, 6, k)), np.zeros((n, 6, k))
    states, lost = np.zeros((n, size, k)), np.zeros((n, k))
    d_state, total = np.zeros((size, k)), np.zeros(k)
    seed, strain = slice(k, k + size), slice(k + size, k + size + 6)
    largest = float(np.abs(d_stress[:, :, strain]).max(initial=0.0))
    for i in range(n):
        fixed = d_stress[i, :, :k] + d_stress[i, :, seed] @ d_state
        stiffness = d_stress[i, :, strain]
        if len(rows):
            matrix = rows @ stiffness @ directions
            if not np.linalg.svd(matrix, compute_uv=False)[-1] > LIMIT * largest:
                raise ConvergenceError(
                    f"path_sensitivities: at row {i} the control leaves a rate of strain undetermined; the stress is at a limit there"
                )
            eps[i] = -directions @ np.linalg.solve(matrix, rows @ fixed)
        sig[i] = fixed + stiffness @ eps[i]
        total = total + d_lost[i, :k] + d_lost[i, seed] @ d_state + d_lost[i, strain] @ eps[i]
        d_state = d_new[i, :, :k] + d_new[i, :, seed] @ d_state + d_new[i, :, strain] @ eps[i]
        states[i], lost[i] = d_state, total
    named = {
        name: states[:, start] if length == 1 else states[:, start : start + length]
        for name, (start, length) in packing.layout.items()
    }
    return PathSensitivities(names, eps, sig, named, lost, history)
