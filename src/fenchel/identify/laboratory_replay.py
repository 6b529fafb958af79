"""A law along a laboratory test: isotropic compression to the start, then the axial strain of the file.

From the virgin state the law is compressed isotropically to the effective pressure P of the start, in `COMPRESSION` steps of stress.
Then the axial strain follows the file, from there on:

* drained, σ_xx = σ_yy = −P; the answer is q and the volume strain;
* undrained, tr ε keeps its value and σ_xx = σ_yy; with the cell pressure held, the pore pressure changes by Δu = P + σ_xx.

Rows that lie far apart are driven in smaller steps, many rows thinned to some hundred, turning points kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .curves import axial, deviator, lateral, pressure
from .laboratory_file import LaboratoryTest

__all__ = [
    "LaboratoryRun",
    "driven_strains",
    "isotropic_compression",
    "replay_laboratory",
    "thin_laboratory",
    "turning_rows",
]

Array = NDArray[np.float64]
COMPRESSION = 5  # steps of the isotropic compression
STEPS = 150  # a step is at most this part of the range of the axial strain
ROWS = 300  # rows of a test that enter a fit
TURN = 0.02  # a reversal smaller than this part of the range of the axial strain is noise


@dataclass(frozen=True, kw_only=True)
class LaboratoryRun:
    """The law along a test, shape (row_count,), as in `LaboratoryTest`; `pressure` is the effective mean pressure [Pa]."""

    q: Array
    second: Array
    pressure: Array


def replay_laboratory(update: Any, values: Mapping[str, float], test: LaboratoryTest) -> LaboratoryRun:
    """Drive a compiled law along a test. Raises `ConvergenceError` where the law cannot follow, `InputError` for impossible values."""
    from fenchel.integrators import drive_arrays

    before = isotropic_compression(update, values, test.pressure)
    strain = before.eps[-1]
    grid, rows = driven_strains(test.axial_strain)
    targets = np.zeros((len(grid), 6))
    targets[:, 2] = axial(strain) + grid
    control = np.array([True, True, False, True, True, True])
    more: dict[str, Any] = {}
    if test.drained:
        targets[:, :2] = -test.pressure
    else:
        targets[:, :2] = np.nan
        more = {"trace": "eps_v", "trace_targets": np.full(len(grid), strain[:3].sum())}
    after = drive_arrays(
        update,
        control,
        targets,
        values,
        initial_strain=strain,
        initial_state={name: value[-1:] for name, value in before.state.items()},
        **more,
    )
    sig = after.sig[rows]
    volume = after.eps[rows, :3].sum(axis=1) - strain[:3].sum()
    second = volume if test.drained else test.pressure + lateral(sig)
    return LaboratoryRun(q=deviator(sig), second=second, pressure=pressure(sig))


def isotropic_compression(update: Any, values: Mapping[str, float], level: float) -> Any:
    """History of the isotropic compression from the virgin state to the pressure `level` [Pa]. Errors as of `drive_arrays`."""
    from fenchel.integrators import drive_arrays

    ramp = np.zeros((COMPRESSION, 6))
    ramp[:, :3] = -level * np.linspace(1.0 / COMPRESSION, 1.0, COMPRESSION)[:, None]
    return drive_arrays(update, np.ones(6, dtype=bool), ramp, values)


def driven_strains(strain: Array) -> tuple[Array, NDArray[np.int64]]:
    """Axial strains to drive through, and which of them are the rows of the file."""
    step = (strain.max() - strain.min()) / STEPS
    counts = np.maximum(np.ceil(np.abs(np.diff(strain)) / step - 1e-9).astype(np.int64), 1)
    rows = np.concatenate([[0], np.cumsum(counts)])
    return np.interp(np.arange(rows[-1] + 1), rows, strain), rows


def turning_rows(strain: Array) -> NDArray[np.int64]:
    """Rows in which the axial strain turns round; reversals below `TURN` of its range do not count.

    >>> turning_rows(np.array([0.0, 1.0, 2.0, 1.99, 3.0, 1.0, 2.0])).tolist()
    [4, 5]
    """
    least = TURN * (strain.max() - strain.min())
    found: list[int] = []
    extreme, sense = 0, 0.0
    for k, value in enumerate(strain):
        ahead = value - strain[extreme]
        if sense == 0.0:
            if abs(ahead) > least:
                extreme, sense = k, np.sign(ahead)
        elif sense * ahead >= 0.0:
            extreme = k
        elif -sense * ahead > least:
            found.append(extreme)
            extreme, sense = k, -sense
    return np.array(found, dtype=np.int64)


def thin_laboratory(test: LaboratoryTest) -> LaboratoryTest:
    """About `ROWS` rows of a test, evenly spaced in row number; first, last and turning rows are kept."""
    count = len(test.axial_strain)
    if count <= ROWS:
        return test
    even = np.linspace(0, count - 1, ROWS).round().astype(np.int64)
    keep = np.unique(np.concatenate([even, turning_rows(test.axial_strain)]))
    return replace(
        test,
        axial_strain=test.axial_strain[keep],
        q=test.q[keep],
        volume_strain=None if test.volume_strain is None else test.volume_strain[keep],
        pore_pressure=None if test.pore_pressure is None else test.pore_pressure[keep],
    )
