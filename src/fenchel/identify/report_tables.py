"""Tables of the report, as rows of text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from .hardening import Stage
from .identification import LAW_NAMES, Identification
from .interval import Estimate
from .laboratory_interval import LaboratoryEstimate
from .runs_info import RunsInfo

__all__ = ["Table", "tables"]


@dataclass(frozen=True, kw_only=True)
class Table:
    """A caption, a head and rows of text; `folded` tables are shown on demand."""

    key: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    folded: bool = False


#: What the quality keys mean, in the order shown; the worst is the largest.
QUALITY = {
    "inertial_number": "inertial number I, largest (below 1e-3)",
    "unbalanced_median": "unbalanced force / mean contact force, median (below 1e-2)",
    "unbalanced_max": "the same, largest",
    "natural_map_median": "natural-map residual, relative, median",
    "natural_map_max": "the same, largest",
    "change_max": "relative impulse change of the last sweep, largest",
    "violation_over_radius": "gap less elastic deflection / mean radius, largest (below 1e-3)",
    "overlap_mean_over_radius": "elastic overlap / mean radius, mean",
    "overlap_max_over_radius": "the same, largest",
    "kappa": "stiffness number κ = k_n/(P d)",
    "energy_error": "energy not accounted for / external work",
    "wall_box_difference": "wall stress against homogenised stress of the box (below 0.05)",
    "wall_sphere_difference": "wall stress against homogenised stress of the sphere",
    "sweeps_mean": "sweeps per step, mean",
    "inertial_time_over_step": "inertial time / step",
    "solid_fraction": "solid fraction with beads",
    "bead_fraction": "bead volume fraction",
    "wire_density": "wire length per volume [1/m²]",
}
_SYMBOLS = {
    "E_s": "E_s, sand",
    "E_w": "E_w, wires (unilateral)",
    "E_w_bilateral": "E_w read with the bilateral law",
    "nu": "ν, common",
    "theta_f": "θ_f",
    "C_0": "C_0",
    "H_eff": "H_eff = H_k(½ + t²/3) + H_i",
    "H_k": "H_k, kinematic",
    "H_i": "H_i, isotropic",
    "theta_f_staged": "θ_f, yield line of the first leg",
    "C_0_staged": "C_0, the same",
    "H_eff_staged": "H_eff, the same",
    "H_k_staged": "H_k with staged yield",
    "H_i_staged": "H_i with staged yield",
    "theta_f_own": "θ_f, offset yield stress against P_s (least squares)",
    "C_0_own": "C_0, the same",
    "theta_f_study": "θ_f, study's reading: against the confining pressure (least absolute deviations)",
    "C_0_study": "C_0, the same",
}


def number(value: Any, digits: int = 4) -> str:
    """A number for people: four figures, a dash for what is not there."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        return "—" if value is None else str(value)
    if not isfinite(value):
        return "—" if value != value else "∞"
    if value == 0:
        return "0"
    return f"{value:.{digits}g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.{digits - 1}e}"


def _scaled(unit: str, size: float) -> tuple[float, str]:
    if unit != "Pa":
        return 1.0, "" if unit == "1" else unit
    return (1e-6, "MPa") if size >= 1e6 else (1e-3, "kPa") if size >= 1e3 else (1.0, "Pa")


def estimate_row(name: str, e: Estimate | LaboratoryEstimate) -> tuple[str, ...]:
    """Name, value, interval, unit, source, remark."""
    sizes = [abs(v) for v in (e.value, e.low, e.high) if isfinite(v)]
    factor, unit = _scaled(e.unit, max(sizes, default=0.0) if not isfinite(e.value) or e.value == 0 else abs(e.value))
    interval = f"{number(e.low * factor, 3)} … {number(e.high * factor, 3)}" if isfinite(e.low) else "—"
    return (name, number(e.value * factor), interval, unit, e.source, e.note)


_HEAD = ("", "value", "interval", "unit", "from", "remark")


def _values(found: Identification) -> list[Table]:
    def rows(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        return tuple(estimate_row(_SYMBOLS[n], found.estimates[n]) for n in names if n in found.estimates)

    level = f"{found.options.confidence:.0%}"
    by_pressure = [n for n in found.estimates if "@" in n]
    return [
        Table(
            key="values",
            caption=f"The law. {level} intervals are for another sample: from the scatter between seeds, or "
            "from leaving out each octant of the measuring sphere where that is larger.",
            head=_HEAD,
            rows=rows(LAW_NAMES),
        ),
        Table(
            key="readings",
            caption="Other readings of the same tests",
            head=_HEAD,
            rows=rows([n for n in _SYMBOLS if n not in LAW_NAMES]),
        ),
        Table(
            key="by_pressure",
            caption="By confining pressure (tau_y: √J₂ of the sand at the offset; q@strain: at that shortening)",
            head=_HEAD,
            rows=tuple(estimate_row(_at(n), found.estimates[n]) for n in by_pressure),
            folded=True,
        ),
    ]


def _at(name: str) -> str:
    parts = name.split("@")
    middle = f" at {float(parts[1]):.2%}" if len(parts) == 3 else ""
    return f"{parts[0]}{middle}, {float(parts[-1]) / 1e3:g} kPa"


def _stages(found: Identification) -> Table:
    hard = found.pooled.hardening
    assert hard is not None

    def column(stage: Stage) -> list[str]:
        p = stage.parameters
        apart = stage.separable
        return [
            number(p.E_s / 1e6),
            number(p.theta_f),
            number(p.C_0 / 1e3) if p.C_0 >= 1.0 else "0",
            number(stage.H_eff / 1e6),
            number(p.H_k / 1e6) if apart else "not separable",
            number(p.H_i / 1e6) if apart else "not separable",
            f"{stage.misfit:.2%}",
            number(stage.condition, 3),
            number(stage.column_ratio),
            ", ".join((*(found.pooled.yielding.at_bound if stage is hard.staged else ()), *stage.at_bound)) or "none",
        ]

    labels = [
        "E_s [MPa]",
        "θ_f [rad]",
        "C_0 [kPa]",
        "H_eff [MPa]",
        "H_k [MPa]",
        "H_i [MPa]",
        "misfit of q / max|q|, rms",
    ]
    labels += ["condition number of (∂q/∂H_k, ∂q/∂H_i)", "column ratio (½ + t²/3 when parallel)", "at the lower bound"]
    stages = [hard.staged, hard.joint, *([hard.free_stiffness] if hard.free_stiffness else [])]
    rows = list(zip(labels, *(column(stage) for stage in stages), strict=True))
    rows.append(("singular values of (t, C_0, H_k, H_i)", "", ", ".join(number(v, 3) for v in hard.singular_values)))
    return Table(
        key="stages",
        caption="Staged (yield line of the first leg, then H_k and H_i) and joint (all four together, E_s and ν kept)",
        head=("", "staged", "joint (the law)", "joint, E_s free")[: 1 + len(stages)],
        rows=tuple(rows),
    )


def _elastic(found: Identification) -> Table:
    pair = (found.pooled.elastic, found.pooled.elastic_other)
    rows = [
        ("E_s [MPa]", *(number(e.E_s / 1e6) for e in pair)),
        ("E_w unilateral [kPa]", *(number(e.E_w / 1e3) for e in pair)),
        ("E_w bilateral [kPa]", *(number(e.E_w_bilateral / 1e3) for e in pair)),
        ("ν common", *(number(e.nu) for e in pair)),
        ("ν of the sand alone", *(number(e.nu_sand_alone) for e in pair)),
        (
            "misfit sand, wires, wires bilateral",
            *(f"{e.misfit_sand:.1%}, {e.misfit_wire:.1%}, {e.misfit_wire_bilateral:.1%}" for e in pair),
        ),
    ]
    names = {"shared": "strain of the sand for both", "own": "each phase its own strain"}
    return Table(
        key="elastic",
        caption=f"Elastic moduli, sand up to {found.options.window_sand:.2%} and wires up to "
        f"{found.options.window_wire:.2%} of axial strain (first column: used in the law)",
        head=("", *(names[e.strain] for e in pair)),
        rows=tuple(rows),
    )


def _predictions(found: Identification) -> Table:
    rows = tuple(
        (
            f"{p.pressure / 1e3:g}{' (held out)' if p.held_out else ''}",
            str(p.seed),
            f"{p.error_q:.1%}",
            f"{p.error_lateral:.1%}",
            f"{p.error_wire:.0%}" if isfinite(p.error_wire) else "—",
            f"{100 * p.volume_end:+.3f}",
            f"{100 * p.volume_end_law:+.3f}",
        )
        for p in found.predictions
        if p.linked
    )
    return Table(
        key="predictions",
        caption="Replay of the tests: rms error / largest measured magnitude; volume strain [%] at the end of the "
        "first leg, dilation +",
        head=("P [kPa]", "seed", "q", "lateral strain", "wire stress", "volume, grains", "volume, law"),
        rows=rows,
    )


def _control(found: Identification) -> list[Table]:
    if found.control is None:
        return []
    first = ("E_s", "nu", "theta_f_staged", "C_0_staged", "H_eff_staged", "H_eff", "H_k", "H_i")
    difference = found.control.difference
    names = [n for n in first if n in difference] + [n for n in difference if n.startswith("q@")]
    labels = {**_SYMBOLS}
    return [
        Table(
            key="control",
            caption="What the wires do: linked less unlinked, paired by sample and octant",
            head=_HEAD,
            rows=tuple(estimate_row(labels.get(n) or _at(n), difference[n]) for n in names),
        ),
        Table(
            key="control_values",
            caption="The control by itself",
            head=_HEAD,
            rows=tuple(estimate_row(labels[n], e) for n, e in found.control.estimates.items() if n in labels),
            folded=True,
        ),
    ]


def plain(key: str, caption: str, rows: Sequence[Mapping[str, Any]], *, folded: bool = False) -> Table:
    """A table of rows given as mappings; the columns are those that occur, in order."""
    head: dict[str, None] = {}
    for row in rows:
        head |= dict.fromkeys(row)
    return Table(
        key=key,
        caption=caption,
        head=tuple(head),
        rows=tuple(tuple(number(row.get(name)) for name in head) for row in rows),
        folded=folded,
    )


def _quality(info: RunsInfo) -> list[Table]:
    if not info.quality:
        return []
    rows = []
    for key, label in QUALITY.items():
        data = [
            float(row[key]) for row in info.quality if isinstance(row.get(key), (int, float)) and isfinite(row[key])
        ]
        if data:
            rows.append((label, number(float(np.median(data)), 3), number(min(data), 3), number(max(data), 3)))
    count = len(info.quality)
    summary = Table(
        key="quality",
        caption=f"Quality of the {count} runs",
        head=("", "median run", "least", "most"),
        rows=tuple(rows),
    )
    return [summary, plain("quality_runs", "Quality run by run", info.quality, folded=True)]


def tables(found: Identification, info: RunsInfo) -> dict[str, Table]:
    """All tables by key; those without content are left out."""
    every = [*_values(found), _stages(found), _elastic(found), _predictions(found), *_control(found), *_quality(info)]
    if info.stiffness:
        every.append(
            plain("stiffness", "Stiffness of the sample against tolerance and step of the solver", info.stiffness)
        )
    settings = {**info.settings}
    if settings:
        pairs = [{"key": key, "value": _text(value)} for key, value in settings.items()]
        every.append(plain("settings", "Settings of the study", pairs, folded=True))
    if info.seconds:
        every.append(plain("seconds", "Time by stage", [{"stage": k, "seconds": v} for k, v in info.seconds.items()]))
    if info.versions:
        every.append(
            plain("versions", "Versions", [{"package": k, "version": v} for k, v in info.versions.items()], folded=True)
        )
    return {table.key: table for table in every if table.rows}


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
