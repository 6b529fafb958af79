"""Path and history files: comma-separated, plain tensor components (shear not doubled), tension positive, SI units.

`PATH.csv` has a column `t` [s] and, per component, at most one of `eps_xx` (prescribed strain [-]) and `sig_xx` (prescribed stress
[Pa]); a component without column has zero stress. A column `eps_v` (volume strain [-]) or `p` (mean pressure [Pa]) takes the place of the
normal components without column, which then share one stress. An optional column `T` [K] is the temperature, for a law that has one; the
time steps of a viscous law are the differences of `t`. The first row is the virgin state and zero, except for `t` and `T`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..drawing import Signs
from ..errors import InputError, StorageError
from ..notebook import Summary
from ..potentials import Law
from .history import History

__all__ = ["COMPONENTS", "StrainStressPath", "read_history", "read_path", "write_history"]

COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
MANDEL = np.array([1.0, 1.0, 1.0, math.sqrt(2.0), math.sqrt(2.0), math.sqrt(2.0)])
_KNOWN = ("t", *(f"eps_{c}" for c in COMPONENTS), *(f"sig_{c}" for c in COMPONENTS), "eps_v", "p", "T")


@dataclass(frozen=True, repr=False)
class StrainStressPath(Summary):
    """Prescribed path: `time` (n,); `control` (6,) True where stress is prescribed; `targets` (n, 6) Mandel; trace condition;
    `temperature` (n,) [K] or None."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "time": "s",
        "temperature": "K",
    }

    time: np.ndarray
    control: np.ndarray
    targets: np.ndarray
    trace: str | None = None
    trace_targets: np.ndarray | None = None
    temperature: np.ndarray | None = None

    def _title(self) -> str:
        return f"a path of {len(self.time)} rows"


def read_path(file: str | Path, *, signs: str = "tension-positive", virgin: bool = True) -> StrainStressPath:
    """Read `PATH.csv`, whose strains and stresses are written under `signs`; what is returned is tension positive.

    With "compression-positive" every tensor component and `eps_v` turn; the mean pressure `p` is positive in compression under either.
    The first row is the virgin state, all zero; with `virgin` False it is the end of another path, whose stresses stand in it, and
    only strains are zero there (see `drive`). `InputError` names the file, the row (header is row 1) and the column.
    """
    factor = Signs(signs).factor
    path = Path(file)
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InputError(f"path file '{path}' cannot be read: {reason}") from None
    rows = [(i, row) for i, row in enumerate(rows, start=1) if any(cell.strip() for cell in row)]
    if not rows:
        raise InputError(
            f"path file '{path}' is empty; it needs a header such as 't,eps_zz,sig_xx,sig_yy' and rows of numbers"
        )
    header = [cell.strip() for cell in rows[0][1]]
    _check_header(path, header)
    if len(rows) < 2:
        raise InputError(f"path file '{path}' has a header but no row")
    table = np.array([_numbers(path, number, header, row) for number, row in rows[1:]])
    first = rows[1][0]
    for name, value in zip(header, table[0], strict=True):
        if name not in ("t", "T") and value != 0.0 and (virgin or name.startswith("eps_")):
            state = (
                "the virgin state and must be zero"
                if virgin
                else "where the path begins; strains count from there and must be zero"
            )
            raise InputError(
                f"path file '{path}', row {first}, column '{name}': the first row is {state}, not {value:g}"
            )
    time = table[:, header.index("t")]
    if "T" in header and not (table[:, header.index("T")] > 0.0).all():
        cold = int(np.argmax(~(table[:, header.index("T")] > 0.0)))
        raise InputError(
            f"path file '{path}', row {rows[1 + cold][0]}, column 'T': a temperature is positive, in kelvin"
        )
    late = np.flatnonzero(np.diff(time) <= 0)
    if late.size:
        raise InputError(
            f"path file '{path}', row {rows[2 + late[0]][0]}, column 't': the time must increase, it is {time[late[0] + 1]:g}"
        )
    return _path(header, table, time, factor)


def _check_header(path: Path, header: list[str]) -> None:
    where = f"path file '{path}', row 1"
    for name in header:
        if name not in _KNOWN:
            if ";" in name or "\t" in name:
                raise InputError(f"{where}: the cells must be separated by commas, with points in the numbers")
            raise InputError(f"{where}: unknown column '{name}'; a path has: {', '.join(_KNOWN)}")
        if header.count(name) > 1:
            raise InputError(f"{where}: the column '{name}' stands twice")
    if "t" not in header:
        raise InputError(f"{where}: the column 't' is missing")
    for c in COMPONENTS:
        if f"eps_{c}" in header and f"sig_{c}" in header:
            raise InputError(
                f"{where}: both 'eps_{c}' and 'sig_{c}' are given; prescribe one of them, the same for the whole path "
                "(a second path goes on from its end under another control: drive --after)"
            )
    if "eps_v" in header and "p" in header:
        raise InputError(f"{where}: both 'eps_v' and 'p' are given; one of them may replace one component")
    for name in ("eps_v", "p"):
        if name in header and all(f"eps_{c}" in header or f"sig_{c}" in header for c in COMPONENTS[:3]):
            raise InputError(
                f"{where}: '{name}' replaces a normal component; leave out the column of one of xx, yy, zz"
            )


def _numbers(path: Path, number: int, header: list[str], row: list[str]) -> list[float]:
    if len(row) != len(header):
        commas = "; numbers have points, not commas" if len(row) > len(header) else ""
        raise InputError(f"path file '{path}', row {number}: {len(row)} cells under {len(header)} columns{commas}")
    found = []
    for name, cell in zip(header, row, strict=True):
        try:
            value = float(cell)
        except ValueError:
            raise InputError(
                f"path file '{path}', row {number}, column '{name}': {cell.strip()!r} is not a number"
            ) from None
        if not math.isfinite(value):
            raise InputError(f"path file '{path}', row {number}, column '{name}': {cell.strip()} is not finite")
        found.append(value)
    return found


def _path(header: list[str], table: np.ndarray, time: np.ndarray, factor: float) -> StrainStressPath:
    control, targets = np.ones(6, dtype=bool), np.zeros((len(time), 6))
    trace = next((name for name in ("eps_v", "p") if name in header), None)
    for i, c in enumerate(COMPONENTS):
        for kind in ("eps", "sig"):
            if f"{kind}_{c}" in header:
                control[i] = kind == "sig"
                targets[:, i] = factor * MANDEL[i] * table[:, header.index(f"{kind}_{c}")] + 0.0
        if trace is not None and i < 3 and f"eps_{c}" not in header and f"sig_{c}" not in header:
            targets[:, i] = np.nan
    condition = None if trace is None else table[:, header.index(trace)] * (factor if trace == "eps_v" else 1.0) + 0.0
    heat = table[:, header.index("T")].copy() if "T" in header else None
    return StrainStressPath(time, control, targets, trace, condition, heat)


def write_history(file: str | Path, history: History, time: Any = None, *, signs: str = "tension-positive") -> None:
    """Write `OUT.csv`: t, (T,) eps_*, sig_*, eps_v, p, q, internal variables, (entropy,) psi, dissipation, status.

    `p` is the mean pressure −tr σ/3 and `q` = √(3 J₂), under either of the `signs`: "compression-positive" turns tensor components and
    `eps_v`. A scalar internal variable whose name is taken is written as `internal_<name>`.
    """
    columns = history_columns(history, time, signs)
    lines = [",".join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(",".join(repr(float(v)) if not isinstance(v, (int, np.integer)) else str(int(v)) for v in row))
    try:
        Path(file).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise StorageError(f"cannot write '{file}': {error.strerror}") from None


def read_history(file: str | Path, law: Law, *, signs: str = "tension-positive") -> History:
    """Read an `OUT.csv` that `write_history` or `fenchel drive -o` wrote for a law, tension positive again; to go on from it, see `drive`.

    `InputError` for a file that cannot be read, that is no history of this law, or that holds a step that has not converged.
    """
    factor = Signs(signs).factor
    path = Path(file)
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if row]
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InputError(f"history '{path}' cannot be read: {reason}") from None
    try:
        table = np.array([[float(cell) for cell in row] for row in rows[1:]])
        columns = dict(zip(rows[0], table.T, strict=True))

        def tensor(name: str) -> np.ndarray:
            return (
                factor * np.stack([columns[f"{name}_{c}"] * MANDEL[i] for i, c in enumerate(COMPONENTS)], axis=1) + 0.0
            )

        state = {}
        for variable in law.internal:
            name = variable.name
            if f"{name}_xx" in columns:
                state[name] = tensor(name)
            else:
                state[name] = columns[f"internal_{name}"] if f"internal_{name}" in columns else columns[name]
        found = History(
            tensor("eps"), tensor("sig"), state, columns["psi"], columns["dissipation"], columns["status"].astype(np.int64),
            columns.get("T"), columns.get("entropy"),
        )  # fmt: skip
    except (ValueError, IndexError, KeyError) as problem:
        raise InputError(
            f"'{path}' is no history of law '{law.name}' ({problem}): give what fenchel drive -o wrote for it"
        ) from None
    if not all(np.isfinite(array).all() for array in (found.eps, found.sig, *state.values())) or found.status.any():
        raise InputError(f"history '{path}' holds a step that has not converged: nothing can go on from it")
    return found


def history_columns(history: History, time: Any = None, signs: str = "tension-positive") -> dict[str, np.ndarray]:
    """Columns of `OUT.csv` by name, under `signs`."""
    factor = Signs(signs).factor
    n = len(history.psi)
    columns: dict[str, np.ndarray] = {"t": np.arange(n, dtype=float) if time is None else np.asarray(time, dtype=float)}
    if history.temperature is not None:
        columns["T"] = history.temperature
    for kind, values in (("eps", history.eps), ("sig", history.sig)):
        columns |= {f"{kind}_{c}": values[:, i] / MANDEL[i] for i, c in enumerate(COMPONENTS)}
    mean = history.sig[:, :3].sum(axis=1) / 3.0
    deviator = history.sig - mean[:, None] * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    size = np.abs(deviator).max(axis=1, initial=0.0)  # scaled, so that the squares stay in range
    columns |= {
        "eps_v": history.eps[:, :3].sum(axis=1),
        "p": -mean,
        "q": np.sqrt(1.5) * size * np.linalg.norm(deviator / np.where(size > 0.0, size, 1.0)[:, None], axis=1),
    }
    ends = {"psi": history.psi, "dissipation": history.dissipation, "status": history.status}
    if history.entropy is not None:
        ends = {"entropy": history.entropy, **ends}
    for name, values in history.state.items():
        if values.ndim == 2:
            columns |= {f"{name}_{c}": values[:, i] / MANDEL[i] for i, c in enumerate(COMPONENTS)}
        else:
            columns[f"internal_{name}" if name in columns or name in ends else name] = values
    found = columns | ends
    if factor > 0.0:
        return found
    tensors = ("eps", "sig", *(name for name, values in history.state.items() if values.ndim == 2))
    turning = {"eps_v", *(f"{name}_{c}" for name in tensors for c in COMPONENTS)}
    return {name: 0.0 - v if name in turning else v for name, v in found.items()}
