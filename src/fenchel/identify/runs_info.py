"""What the report wants to know about the runs behind the records: filled by whoever ran them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..dem.record import TriaxialRecord
from ..notebook import Summary

__all__ = ["RunsInfo", "SampleView", "Series", "quality_notes", "quality_rows", "series_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SampleView:
    """A sample to be drawn: centres [m] (body_count, 3), radii [m] (body_count,), number of the wire of each body (grain: −1).

    The beads of one wire follow each other in the arrays.
    """

    positions: Array
    radii: Array
    wire: NDArray[np.int64]
    title: str = ""


@dataclass(frozen=True, kw_only=True, repr=False)
class Series(Summary):
    """Measures along one test, by name, shape (frame_count,); names as in `fenchel.dem.residual.MEASURES`.

    Drawn where present: natural_map, change, unbalanced (residuals); external, friction, algorithmic, shock, elastic, kinetic,
    balance (energies [J]; summed from the start, except elastic and kinetic).
    """

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "axial_strain": "-",
    }

    seed: int
    pressure: float
    linked: bool
    axial_strain: Array
    values: Mapping[str, Array]

    def _title(self) -> str:
        return f"measures of the test at {self.pressure / 1e3:g} kPa, seed {self.seed}"


@dataclass(frozen=True, kw_only=True)
class RunsInfo:
    """Everything optional. Tables are lists of rows (column name: value, units in the name as in "E_s [MPa]")."""

    title: str = "From grains and wires to a law"
    settings: Mapping[str, Any] = field(default_factory=dict)  # "table.key": value, of the study
    seconds: Mapping[str, float] = field(default_factory=dict)  # wall-clock time by stage
    versions: Mapping[str, str] = field(default_factory=dict)
    sample: SampleView | None = None
    series: Sequence[Series] = ()
    quality: Sequence[Mapping[str, Any]] = ()  # one row per run
    stiffness: Sequence[Mapping[str, Any]] = ()  # E_s against tolerance and step: compliant and rigid grains
    stiffness_note: str = ""  # what that table shows, in a sentence
    notes: Sequence[str] = ()  # sentences printed below the findings
    files: Sequence[str] = ()  # run files, relative to the report


def quality_rows(records: Sequence[TriaxialRecord]) -> list[dict[str, Any]]:
    """Rows of the quality table: what identifies a run, then its `quality` as it stands."""
    return [
        {"seed": r.seed, "pressure [kPa]": r.pressure / 1e3, "links": "on" if r.linked else "off", **r.quality}
        for r in records
    ]


_LIMITS = {
    "inertial_number": (1e-3, "inertial number"),
    "unbalanced_max": (1e-2, "mean unbalanced force over the mean contact force"),
    "violation_over_radius": (1e-3, "gap less elastic deflection over the mean radius"),
    "wall_box_difference": (5e-2, "difference of wall stress and homogenised stress of the box"),
    "energy_error": (5e-2, "energy not accounted for over the external work"),
}


def quality_notes(quality: Sequence[Mapping[str, Any]]) -> list[str]:
    """Sentences on the limits that some run does not keep, and on how far the measuring sphere is from the walls."""
    out = []
    for key, (limit, words) in _LIMITS.items():
        values = [float(row[key]) for row in quality if key in row]
        over = sum(not value < limit for value in values)
        if over:
            out.append(f"NOT MET in {over} of {len(values)} runs: {words} below {limit:g} (worst {max(values):.2g}).")
    apart = [float(row["wall_sphere_difference"]) for row in quality if "wall_sphere_difference" in row]
    if apart and max(apart) > 0.05:
        out.append(
            f"The stress inside the measuring sphere, from which the law is read, differs from that on the walls by up to {max(apart):.0%} "
            "(next to a wall a layer carries less): pressures named here are those of the walls, "
            "also in the study's reading of the yield stress."
        )
    return out


def series_of(records: Sequence[TriaxialRecord]) -> list[Series]:
    """The time series of some records, for the figures of residuals and energies."""
    return [
        Series(seed=r.seed, pressure=r.pressure, linked=r.linked, axial_strain=r.axial_strain, values=r.series)
        for r in records
        if r.series
    ]
