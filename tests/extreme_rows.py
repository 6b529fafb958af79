"""Rows of the stability maps: a cell measures errors against bounds that were stated before; a row says how it came out.

A cell is a function without arguments that returns its measured errors with their bounds, by name of the quantity. Its row shows the one
nearest to its bound (or farthest beyond): *right* if error ≤ bound for all, *refused* if one of `fenchel.errors` was raised where the cell
foresees it, in one line with the words that it foresees, else *wrong*. What is neither a number nor such an error is an error of the test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenchel.errors import ConvergenceError, InputError

Measured = Mapping[str, tuple[float, float]]  # quantity with its unit: (error, bound)


@dataclass(frozen=True)
class Row:
    """One cell of a map: quantity nearest to its bound, its error and bound in its own unit, or the message of a refusal."""

    suite: str
    group: str
    setting: str
    bound: float = np.nan
    error: float = np.nan
    what: str = ""
    message: str = ""
    foreseen: bool = False
    note: str = ""

    @property
    def ratio(self) -> float:
        """Error as a multiple of its bound."""
        return over(self.error, self.bound)

    @property
    def verdict(self) -> str:
        """right, refused (with a reason, where that may be) or wrong."""
        if self.message:
            return "refused" if self.foreseen else "wrong"
        return "right" if self.ratio <= 1.0 else "wrong"


@dataclass(frozen=True)
class Cell:
    """Place in the map and what is done. `says`: words that a refusal has to contain; empty where none may be. `long`: by `make validate`.

    `run` returns the measured errors, or these and a note for the table.
    """

    group: str
    setting: str
    run: Callable[[], Measured | tuple[Measured, str]]
    says: str = ""
    long: bool = False

    @property
    def name(self) -> str:
        return f"{self.group}, {self.setting}"


def over(error: float, bound: float) -> float:
    """error/bound; 0/0 is 0, and what is not a number is infinitely wrong."""
    if not np.isfinite(error) or np.isnan(bound):
        return np.inf
    return 0.0 if error == 0.0 else np.inf if bound <= 0.0 else float(error / bound)


def near(value: Any, truth: Any, *, rel: float = 0.0, abs: Any = 0.0) -> tuple[float, float]:
    """(|value − truth|, max(rel |truth|, abs)) of the component that is worst off."""
    value, truth = np.broadcast_arrays(np.asarray(value, dtype=float), np.asarray(truth, dtype=float))
    if not value.size:
        return 0.0, 0.0
    error, bound = np.abs(value - truth), np.broadcast_to(np.maximum(rel * np.abs(truth), abs), value.shape)
    pairs = zip(error.ravel().tolist(), bound.ravel().tolist(), strict=True)
    return max(pairs, key=lambda pair: over(*pair))


def nothing_but(condition: bool) -> tuple[float, float]:
    """A statement that holds or does not: (0, 0) or (1, 0)."""
    return (0.0, 0.0) if condition else (1.0, 0.0)


def evaluate(suite: str, cell: Cell) -> Row:
    """The row of a cell. numpy's own warnings are silenced: what is not finite is found by looking."""
    try:
        with np.errstate(all="ignore"):
            found = cell.run()
    except (ConvergenceError, InputError) as refusal:
        message = str(refusal)
        foreseen = bool(cell.says) and cell.says in message and "\n" not in message
        return Row(suite, cell.group, cell.setting, message=message, foreseen=foreseen)
    measured, note = found if isinstance(found, tuple) else (found, "")
    what = max(measured, key=lambda name: over(*measured[name]))
    error, bound = measured[what]
    return Row(suite, cell.group, cell.setting, float(bound), float(error), what, note=note)


def rows_of(suite: str, cells: Iterable[Cell], *, long: bool = False) -> list[Row]:
    """Rows of the cells; the long ones only if asked."""
    return [evaluate(suite, cell) for cell in cells if long or not cell.long]
