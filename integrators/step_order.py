"""Order of accuracy in the step size, measured: one path with every step cut into more and more equal parts.

With σ_m the stresses (and strains) at the rows of the path when every step is cut into m parts, and an error C m^{−q}, the differences
|σ_{2m} − σ_m| = C (1 − 2^{−q}) m^{−q} fall with the same slope q, which needs no exact solution; q by least squares over log m. Implicit
Euler is of first order on viscous laws and on plastic paths that turn; on a radial path of a rate-independent law the projection of one
long step is the exact solution, and cutting it changes nothing but rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FenchelError
from .history import History
from .path_file import StrainStressPath

__all__ = ["StepOrder", "cut_path", "measure_order"]

Array = NDArray[np.float64]
EXACT = 1e-9


@dataclass(frozen=True)
class StepOrder:
    """`parts` per step; `differences` between one number of parts and the next, largest over the rows, relative to the largest stress and
    strain; `order` (None: exact, or not to be had), `error` of the path as given, relative too, and the `meaning` in words."""

    parts: tuple[int, ...]
    differences: tuple[float, ...]
    order: float | None
    error: float | None
    meaning: str

    @property
    def exact(self) -> bool:
        """True if cutting the steps changed nothing but rounding."""
        return bool(self.differences) and max(self.differences) <= EXACT


def cut_path(path: StrainStressPath, parts: int) -> StrainStressPath:
    """Every step in `parts` equal ones: targets, times and temperatures on straight lines. The first row is reached from zero, at its own
    temperature, in the time that the second one takes."""
    time = np.asarray(path.time, dtype=float)
    span = float(time[1] - time[0]) if len(time) > 1 else 1.0
    heat = path.temperature
    return replace(
        path,
        time=_cut(time, time[0] - span, parts),
        targets=_cut(path.targets, 0.0 * path.targets[0], parts),
        trace_targets=None if path.trace_targets is None else _cut(np.asarray(path.trace_targets), 0.0, parts),
        temperature=None if heat is None else _cut(np.asarray(heat), heat[0], parts),
    )


def _cut(rows: Array, first: Any, parts: int) -> Array:
    before = np.concatenate([np.asarray(first, dtype=float)[None], rows[:-1]])
    shape = (1, parts) + (1,) * (rows.ndim - 1)
    share = (np.arange(1, parts + 1) / parts).reshape(shape)
    found = before[:, None] + share * (rows - before)[:, None]
    found[:, -1] = rows  # the rows of the path themselves, to the last digit
    return np.ascontiguousarray(found.reshape(-1, *rows.shape[1:]))


def measure_order(
    run: Callable[[StrainStressPath], History], path: StrainStressPath, parts: tuple[int, ...], strains: bool = True
) -> StepOrder:
    """`run` follows a path; `parts` are powers of two from 1; `strains` false leaves the strains out, where the stresses do not determine
    them. A failure ends the study with what was found until then."""
    found: list[tuple[Array, ...]] = []
    failure = ""
    for count in parts:
        try:
            history = run(cut_path(path, count))
        except FenchelError as problem:
            failure = f"; in {count} parts: {' '.join(str(problem).split())}"
            break
        both = (history.sig[count - 1 :: count], history.eps[count - 1 :: count])
        found.append(both if strains else both[:1])
    done = parts[: len(found)]
    differences = []
    for one, two in pairwise(found):
        apart = [np.abs(a - b).max() / max(float(np.abs(b).max()), 1e-300) for a, b in zip(one, two, strict=True)]
        differences.append(float(max(apart)))
    order, error, meaning = _read(done, differences)
    return StepOrder(done, tuple(differences), order, error, meaning + failure)


def _read(parts: tuple[int, ...], differences: list[float]) -> tuple[float | None, float | None, str]:
    if not differences:
        return None, None, "no order: the steps could not be cut"
    largest = max(differences)
    if largest <= EXACT:
        return None, largest, f"exact: cutting the steps changes nothing but rounding ({largest:.1e})"
    if len(differences) < 2 or min(differences) <= 0.0:
        return (
            None,
            differences[0],
            f"no order from {len(differences)} difference(s); the first is {differences[0]:.1e}",
        )
    order = -float(np.polyfit(np.log(parts[: len(differences)]), np.log(differences), 1)[0])
    if order <= 0.3:
        return order, None, f"order {order:.2f}: the differences do not fall, the steps are too long to tell"
    error = differences[0] / (1.0 - 2.0**-order)
    near = round(order)
    if abs(order - near) <= 0.2 and near >= 1:
        words = {
            1: "first order: half the step, half the error",
            2: "second order: half the step, a quarter of the error",
        }
        word = words.get(near, f"order {near}")
    else:
        word = "between orders: some steps pass a kink, or are too long"
    return order, error, f"order {order:.2f}, {word}; the steps as given err by about {error:.1e}"
