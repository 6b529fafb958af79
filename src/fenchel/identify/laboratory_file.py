"""A triaxial test as a laboratory hands it out: `LAB.csv`.

Columns with their unit in the header (`eps_a [%]`, `q [kPa]`, and `eps_v [%]` of a drained or `u [kPa]` of an undrained test), the
confining pressure in a comment line (`# confining_pressure = 100 kPa`). Soil-mechanics signs unless asked otherwise: strains and
q = σ_a − σ_r positive in compression. Pressures (confining, back, pore) are positive in compression under either. Inside everything
is in SI units, strains positive in tension; q = σ_r − σ_a stays positive in triaxial compression, as everywhere in this room.

The test begins at an isotropic effective stress: strains and pore pressure count from the first row, q must be near zero there. The
effective pressure of the start is the confining pressure less the back pressure; undrained, the pore pressure of the first row is that.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..notebook import Summary

__all__ = ["LaboratoryTest", "pressure_value", "read_laboratory"]

Array = NDArray[np.float64]
ROWS = 8  # fewer say nothing about a curve
Q_START = 0.05  # part of max|q| that q may have in the first row

#: Column: what it is, and the names that people give it (lower case, words apart by one blank).
COLUMNS = {
    "eps_a": (
        "axial strain",
        ("eps a", "eps 1", "epsilon a", "epsilon 1", "ε a", "ε 1", "axial strain", "strain axial"),
    ),
    "q": ("deviator stress", ("q", "deviator", "deviator stress", "deviatoric stress", "sigma 1 sigma 3", "σ 1 σ 3")),
    "eps_v": (
        "volumetric strain, drained",
        ("eps v", "eps vol", "epsilon v", "ε v", "volumetric strain", "volume strain", "strain volumetric"),
    ),
    "u": (
        "pore pressure, undrained",
        ("u", "delta u", "pore pressure", "pore water pressure", "excess pore pressure", "pwp"),
    ),
}
STRAIN_UNITS = {"%": 1e-2, "-": 1.0, "–": 1.0, "1": 1.0, "m/m": 1.0, "mm/mm": 1.0}
STRESS_UNITS = {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "gpa": 1e9, "n/m2": 1.0, "kn/m2": 1e3, "mn/m2": 1e6, "n/mm2": 1e6}
UNITS = {"eps_a": STRAIN_UNITS, "q": STRESS_UNITS, "eps_v": STRAIN_UNITS, "u": STRESS_UNITS}
WORDS = {id(STRAIN_UNITS): "%, - or 1", id(STRESS_UNITS): "Pa, kPa, MPa or kN/m2"}
PRESSURES = {
    "confining_pressure": ("confining pressure", "cell pressure", "confining stress", "sigma 3", "σ 3"),
    "back_pressure": ("back pressure",),
}
_HEAD = re.compile(r"^(?P<name>[^\[\]()]+?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]$")


@dataclass(frozen=True, kw_only=True, repr=False)
class LaboratoryTest(Summary):
    """One test. Arrays of shape (row_count,); strains [-] positive in tension and zero in the first row.

    `pressure` is the effective isotropic pressure [Pa] of the start, positive; `q` = σ_r − σ_a [Pa], positive in triaxial compression;
    `volume_strain` tr ε of a drained test, else None; `pore_pressure` [Pa] of an undrained test, as its change from the first row, else
    None. `notes` are the comment lines that say nothing fenchel reads.
    """

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "axial_strain": "-",
        "q": "Pa",
        "volume_strain": "-",
        "pore_pressure": "Pa",
    }

    name: str
    pressure: float
    axial_strain: Array
    q: Array
    volume_strain: Array | None = None
    pore_pressure: Array | None = None
    notes: tuple[str, ...] = field(default=())

    def _title(self) -> str:
        return f"{self.name}: {len(self.q)} rows, {'drained' if self.drained else 'undrained'}"

    @property
    def drained(self) -> bool:
        """Whether water could leave: the lateral stress is held; else the volume is."""
        return self.volume_strain is not None

    @property
    def second(self) -> Array:
        """What is measured beside q: tr ε [-] drained, the change of the pore pressure [Pa] undrained."""
        found = self.volume_strain if self.volume_strain is not None else self.pore_pressure
        assert found is not None
        return found


def read_laboratory(
    file: Path | str, *, signs: str = "compression-positive", confining_pressure: float | None = None
) -> LaboratoryTest:
    """Read one `LAB.csv`; `signs` "compression-positive" or "tension-positive", for eps_a, q and eps_v.

    `confining_pressure` [Pa] takes the place of the comment line. Cells are apart by commas, semicolons or tabs; where it is not the comma,
    a decimal comma is read as well. `InputError` names the file, the row (the first line is row 1), the rule and the remedy.
    """
    path = Path(file)
    if signs not in ("compression-positive", "tension-positive"):
        raise InputError(f'signs = "{signs}" is unknown: use "compression-positive" or "tension-positive"')
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"laboratory file '{path}' cannot be read: {reason}") from None
    where = f"laboratory file '{path}'"
    keys, notes = _comments(where, lines)
    rows = [(k, text) for k, text in enumerate(lines, start=1) if text.strip() and not text.lstrip().startswith("#")]
    if not rows:
        raise InputError(f"{where} has no header: begin with a line such as eps_a [%], q [kPa], eps_v [%]")
    separator = next((mark for mark in (";", "\t") if mark in rows[0][1]), ",")
    header = [_column(f"{where}, row {rows[0][0]}", cell) for cell in rows[0][1].split(separator)]
    second = _complete(f"{where}, row {rows[0][0]}", [name for name, _ in header])
    if len(rows) - 1 < ROWS:
        raise InputError(f"{where} has {len(rows) - 1} rows of numbers: a curve needs {ROWS} or more")
    table = np.array([_numbers(f"{where}, row {k}", text.split(separator), header, separator) for k, text in rows[1:]])
    columns = {name: table[:, k] * factor for k, (name, factor) in enumerate(header)}
    turn = -1.0 if signs == "compression-positive" else 1.0
    axial, q = turn * columns["eps_a"], -turn * columns["q"]
    _check_curves(where, axial - axial[0], q, signs)
    first = columns["u"][0] if second == "u" else keys.get("back_pressure", 0.0)
    if second == "u" and "back_pressure" in keys:
        raise InputError(
            f"{where}: back_pressure and a column u say the same thing twice; leave back_pressure out: the first row of u is it"
        )
    cell = keys.get("confining_pressure") if confining_pressure is None else confining_pressure
    if cell is None:
        raise InputError(
            f"{where} does not say its confining pressure: add a line '# confining_pressure = 100 kPa', or give --confining-pressure"
        )
    if not (math.isfinite(cell) and cell - first > 0.0):
        what = "pore pressure of the first row" if second == "u" else "back pressure"
        raise InputError(
            f"{where}: the test starts at confining pressure {cell:g} Pa less {what} {first:g} Pa = {cell - first:g} Pa; "
            "the effective pressure must be positive"
        )
    other = columns[second] - columns[second][0]
    return LaboratoryTest(
        name=keys.get("sample") or path.stem,
        pressure=float(cell - first),
        axial_strain=axial - axial[0] + 0.0,
        q=q + 0.0,
        volume_strain=turn * other + 0.0 if second == "eps_v" else None,
        pore_pressure=other if second == "u" else None,
        notes=tuple(notes),
    )


def pressure_value(where: str, text: str) -> float:
    """A pressure with its unit, "100 kPa", in Pa.

    >>> pressure_value("here", "100 kPa")
    100000.0
    """
    found = re.fullmatch(r"\s*(?P<number>[-+0-9.eE]+)\s*\[?(?P<unit>[^\]\[]*)\]?\s*", text)
    try:
        value = float(found["number"]) if found else math.nan
    except ValueError:
        value = math.nan
    if not found or not math.isfinite(value):
        raise InputError(f"{where}: {text.strip()!r} is no pressure: write a number and its unit, such as 100 kPa")
    unit = found["unit"].strip()
    if not unit:
        raise InputError(
            f"{where}: the pressure {text.strip()} has no unit: write it as {text.strip()} kPa, or Pa or MPa"
        )
    return value * _factor(where, unit, STRESS_UNITS)


def _plain(text: str) -> str:
    """A name without its typography: lower case, words apart by one blank."""
    return " ".join(re.sub(r"([εσ])(?=\w)", r"\1 ", re.sub(r"[\s_\-–−'′]+", " ", text.lower())).split())


def _factor(where: str, unit: str, units: Mapping[str, float]) -> float:
    key = unit.strip().lower().replace("²", "2").replace("^2", "2")
    if key not in units:
        raise InputError(f"{where}: the unit [{unit}] is not known here: use {WORDS[id(units)]}")
    return units[key]


def _comments(where: str, lines: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """What the comment lines say: pressures [Pa] and the name of the sample by key; the other lines as they are."""
    keys: dict[str, Any] = {}
    notes: list[str] = []
    for number, text in enumerate(lines, start=1):
        if not text.lstrip().startswith("#"):
            continue
        said = text.strip().lstrip("#").strip().rstrip(",;\t ")
        name, mark, value = (
            (part.strip() for part in re.split(r"([=:])", said, maxsplit=1))
            if re.search(r"[=:]", said)
            else (said, "", "")
        )
        unit = _HEAD.match(name)
        word = _plain(unit["name"] if unit else name)
        key = next((key for key, names in PRESSURES.items() if word in names), None)
        if mark and key is not None:
            if key in keys:
                raise InputError(f"{where}, row {number}: {key} is given twice; give it once")
            keys[key] = pressure_value(f"{where}, row {number}", f"{value} {unit['unit']}" if unit else value)
        elif mark and word in ("sample", "specimen", "name") and value:
            keys["sample"] = value
        elif said:
            notes.append(said)
    return keys, notes


def _column(where: str, cell: str) -> tuple[str, float]:
    """Name of a column and the factor to SI units."""
    text = cell.strip().strip('"').strip()
    found = _HEAD.match(text)
    word = _plain(found["name"] if found else text)
    name = next((key for key, (_, names) in COLUMNS.items() if word in names), None)
    if name is None:
        known = ", ".join(f"{key} ({what})" for key, (what, _) in COLUMNS.items())
        raise InputError(f"{where}: unknown column '{text}'; known are {known}: name it so, or take it out")
    unit = found["unit"].strip() if found else ""
    if not unit:
        example = "%" if UNITS[name] is STRAIN_UNITS else "kPa"
        raise InputError(
            f"{where}: the column '{text}' has no unit: write {text} [{example}], or {WORDS[id(UNITS[name])]}"
        )
    return name, _factor(f"{where}, column '{text}'", unit, UNITS[name])


def _complete(where: str, names: Sequence[str]) -> str:
    """Which of eps_v and u the file has, after the check that it has what it needs, once each."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{where}: the column {name} stands twice; keep one")
    for name in ("eps_a", "q"):
        if name not in names:
            raise InputError(
                f"{where}: the column {name} ({COLUMNS[name][0]}) is missing: a test needs eps_a, q and one of eps_v, u"
            )
    second = [name for name in ("eps_v", "u") if name in names]
    if len(second) != 1:
        said = "both eps_v and u are there" if second else "neither eps_v nor u is there"
        raise InputError(
            f"{where}: {said}; a drained test has eps_v (volumetric strain), an undrained one u (pore pressure)"
        )
    return second[0]


def _numbers(where: str, cells: Sequence[str], header: Sequence[tuple[str, float]], separator: str) -> list[float]:
    if len(cells) != len(header):
        raise InputError(
            f"{where}: {len(cells)} cells under {len(header)} columns; every row needs one number per column"
        )
    out = []
    for (name, _), cell in zip(header, cells, strict=True):
        text = cell.strip().strip('"')
        try:
            value = float(text if separator == "," else text.replace(",", "."))
        except ValueError:
            raise InputError(
                f"{where}, column {name}: {text!r} is not a number; mend the cell or take the row out"
            ) from None
        if not math.isfinite(value):
            raise InputError(f"{where}, column {name}: {text} is not finite; mend the cell or take the row out")
        out.append(value)
    return out


def _check_curves(where: str, axial: Array, q: Array, signs: str) -> None:
    """The rules that a test keeps as a whole."""
    span, largest = float(np.max(np.abs(axial))), float(np.max(np.abs(q)))
    if span == 0.0 or largest == 0.0:
        raise InputError(f"{where}: the column {'eps_a' if span == 0.0 else 'q'} never changes; a test needs a curve")
    if span > 1.0:
        raise InputError(f"{where}: eps_a reaches {span:g} (1 is 100 %): is the unit in the header the right one?")
    if abs(q[0]) > Q_START * largest:
        raise InputError(
            f"{where}: q begins at {q[0]:g} Pa, more than {Q_START:.0%} of its largest value {largest:g} Pa; the test must begin at the "
            "isotropic stress: keep the rows from the start of shearing on"
        )
    if float(0.5 * (q[1:] + q[:-1]) @ np.diff(axial)) > 0.0:  # − ∫ q dε_a: the work that is done on the sample
        raise InputError(
            f"{where}: eps_a and q have opposite signs, so that the sample would give work: turn one of the two columns "
            f"(both are read as {signs}; see --signs)"
        )
