"""The three headline results under other settings: Δφ, the ratio of active lengths, and E_w, each with one setting changed at a time.

Changes are paired by seed against the run "as it is" of the same size; intervals are Student's over seeds. The scatter of the seeds
themselves stands beside them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..campaign import Task
from ..errors import FenchelError
from ..identify.curves import curves
from ..identify.elastic import elastic_moduli
from ..identify.options import IdentifyOptions
from .active_segments import network_of
from .claim import taken
from .deposit import heap
from .deposit_claims import content_of
from .grain_runs import PRESSURE, VARIED, varied
from .length_claims import triaxial_network
from .sizes import Size
from .statistics import Mean, mean_of

__all__ = ["HEADLINES", "Headline", "headline_tasks", "headlines", "wire_modulus"]

HEADLINES = {
    "gain of the slope angle, linked less unlinked": "°",
    "active length of the slope over that of the triaxial test": "1",
    "wire modulus E_w": "Pa",
}


@dataclass(frozen=True)
class Headline:
    """A headline result: its unit, its mean and what each setting changes; `failed`: settings whose runs did not converge."""

    name: str
    unit: str
    value: Mean
    change: Mapping[str, Mean]
    failed: tuple[str, ...] = ()


def headline_tasks(size: Size, folder: Path) -> list[Task]:
    """The runs."""
    return varied(size, folder)


def wire_modulus(record: Any) -> float:
    """E_w [Pa] of the unilateral law from the first half per cent of one test, with ν from the sand."""
    return elastic_moduli([curves(record.history())], IdentifyOptions()).E_w


def _of_seed(size: Size, folder: Path, results: Mapping[str, Any], name: str, seed: int) -> dict[str, float]:
    from ..dem.measures import active_length

    label, setting = f"vary {name}", VARIED[name]
    record = taken(results, f"{label}, seed {seed}: {PRESSURE / 1e3:g} kPa, links on")
    linked, unlinked = (content_of(results, label, seed, kind) for kind in ("linked", "unlinked"))
    tops = [heap(content) for content in (linked, unlinked)]
    slope = active_length(network_of(linked, setting.friction)).radii
    box = active_length(
        triaxial_network(size, folder, seed, label=label, count=size.fine_grains, setting=setting)
    ).radii
    angle = float("nan") if None in tops else tops[0].angle - tops[1].angle  # type: ignore[union-attr]
    return dict(zip(HEADLINES, (angle, slope / box if box else float("nan"), wire_modulus(record)), strict=True))


def headlines(size: Size, folder: Path, results: Mapping[str, Any]) -> list[Headline]:
    """The table; a setting one of whose runs failed is left out and named."""
    seeds = range(1, size.fine_seeds + 1)
    rows: dict[str, list[dict[str, float]]] = {}
    failed = []
    for name in VARIED:
        try:
            rows[name] = [_of_seed(size, folder, results, name, seed) for seed in seeds]
        except FenchelError:
            failed.append(name)
    base = rows.get("as it is")
    if base is None:
        return []
    out = []
    for headline, unit in HEADLINES.items():
        change = {
            name: mean_of([b[headline] - a[headline] for a, b in zip(base, rows[name], strict=True)])
            for name in rows
            if name != "as it is"
        }
        out.append(Headline(headline, unit, mean_of([row[headline] for row in base]), change, tuple(failed)))
    return out


def headline_numbers(found: list[Headline]) -> dict[str, Any]:
    """For the file of the claims."""
    return {
        h.name: {"unit": h.unit, "value": h.value.numbers(), "failed": list(h.failed)}
        | {f"change with {name}": mean.numbers() for name, mean in h.change.items()}
        for h in found
    }
