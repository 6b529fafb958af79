r"""Part G: the slope deposit, with and without wires on the same seeds.

Per seed three deposits: wires linked, the same beads unlinked, and the same grains without beads. Angles come from straight lines through
the free surface in six azimuths; what counts is the difference on the same seed. The interval is Student's over seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..dem.bodies import Assembly
from ..errors import FenchelError
from .active_segments import Segments, network_of, segments
from .claim import FAIL, PASS, UNDECIDED, Claim, Outcome, Part, Picture, Verdict, decided, judged, taken
from .deposit import heap
from .grain_runs import BASE, KINDS, deposits
from .sizes import Size
from .statistics import Mean, combined_p, few, mean_of

__all__ = ["DEPOSIT", "angles", "deposit_segments", "gain"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(37, "Q", "The kinetic energy of the deposit dies out.", "Mean net force of bodies below 1 % of the mean contact force."),
    Claim(
        38, "Q", "The network settles with the sand and lies down into horizontal barriers.",
        "The vertical share of the wire fabric ends below 1/3 and below its start, its interval excludes 1/3.",
    ),
    Claim(
        39, "Q", "The network becomes orthotropic.",
        "Wires turned at random are closer to isotropy (p < 0.05), and the axis with the fewest wires is vertical within 15°.",
    ),
    Claim(
        40, "N", "Wires steepen the slope by 0° to 10°.",
        "Difference to sand alone on the same seeds between 0° and 10°, interval excludes 0.",
    ),
)  # fmt: skip


def content_of(results: Mapping[str, Any], label: str, seed: int, kind: str) -> dict[str, Any]:
    """What a deposit left; its error, where it failed, is raised."""
    return taken(results, f"{label} deposit, seed {seed}: {kind}")


def angles(results: Mapping[str, Any], label: str, seeds: int, kind: str) -> Array:
    """Angle of repose [°] by seed, nan where the heap has no measurable surface."""
    out = np.full(seeds, np.nan)
    for k in range(seeds):
        found = heap(content_of(results, label, k + 1, kind))
        out[k] = np.nan if found is None else found.angle
    return out


def gain(results: Mapping[str, Any], label: str, seeds: int, other: str) -> Mean:
    """Angle with wires less that of another kind, paired by seed [°]."""
    return mean_of(angles(results, label, seeds, "linked") - angles(results, label, seeds, other))


def deposit_segments(size: Size, results: Mapping[str, Any]) -> list[Segments]:
    """Wires of the linked deposits by seed."""
    return [
        segments(network_of(content_of(results, BASE, seed, "linked"), 0.4), seed, size.permutations)
        for seed in range(1, size.seeds + 1)
    ]


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    return [*deposits(size.grains, size.seeds, folder, KINDS)] if wanted & DEPOSIT.numbers else []


def settings_of(size: Size) -> dict[str, Any]:
    """What the figures of the deposits depend on."""
    return {
        "grains": size.grains, "seeds": size.seeds, "beads per grain": 1.0, "beads of a wire": 60, "bead radius / mean radius": 0.4,
        "k [N]": 100.0, "friction": 0.4, "tolerance": 1e-3, "step / sqrt(d/g)": 1.0 / 80.0,
    }  # fmt: skip


def _judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {37: _rest, 38: _barriers, 39: _orthotropy, 40: _steeper}
    cache: dict[str, Any] = {}
    return judged(CLAIMS, wanted, lambda n: makers[n](size, results, cache))


def _segments(size: Size, results: Mapping[str, Any], cache: dict[str, Any]) -> list[Segments]:
    if "segments" not in cache:
        cache["segments"] = deposit_segments(size, results)
    return cache["segments"]


def _rest(size: Size, results: Mapping[str, Any], _cache: dict[str, Any]) -> Verdict:
    qualities = [content_of(results, BASE, s, kind)["quality"] for s in range(1, size.seeds + 1) for kind in KINDS]
    unbalanced = max(q["unbalanced"] for q in qualities)
    kinetic = max(q["kinetic"] for q in qualities)
    return Verdict(
        claim=37,
        outcome=decided(unbalanced < 1e-2),
        sentence=f"All {len(qualities)} deposits end with a net force below {unbalanced:.1e} of the contact force; the fall itself is "
        f"followed down to {kinetic:.1e} of the energy set free, then every step starts from rest.",
        value=unbalanced,
        numbers={"unbalanced": unbalanced, "kinetic": kinetic, "steps": max(q["steps"] for q in qualities)},
        settings=settings_of(size),
    )


def _barriers(size: Size, results: Mapping[str, Any], cache: dict[str, Any]) -> Verdict:
    found = _segments(size, results, cache)
    histories = [content_of(results, BASE, s, "linked")["history"]["fabric_zz"] for s in range(1, size.seeds + 1)]
    begin, end = mean_of([h[0] for h in histories]), mean_of([f.fabric[2, 2] for f in found])
    # over wires of each seed where there are too few seeds for an interval over seeds
    within = float(np.mean([0.5 * (f.fabric_high[2, 2] - f.fabric_low[2, 2]) for f in found])) / np.sqrt(len(found))
    half = end.half if end.count >= 3 else within
    low, high = end.value - half, end.value + half
    lower = high < 1 / 3 and end.value < begin.value
    return Verdict(
        claim=38,
        outcome=PASS if lower else UNDECIDED if low < 1 / 3 else FAIL,
        sentence=f"The vertical share of the wire fabric falls from {begin.value:.3f} to {end.value:.3f} [{low:.3f}, {high:.3f}]; "
        "without preferred direction it is 1/3.",
        value=end.value, low=low, high=high,
        numbers={
            "start": begin.value, "end": end.value, "wires_low": end.value - within, "wires_high": end.value + within,
            "by_seed": [float(f.fabric[2, 2]) for f in found],
        },
        settings=settings_of(size),
        needed="" if lower else few(end, 1 / 3),
    )  # fmt: skip


def _orthotropy(size: Size, results: Mapping[str, Any], cache: dict[str, Any]) -> Verdict:
    found = _segments(size, results, cache)
    p = combined_p([f.isotropy_p for f in found])
    tilt = []
    for f in found:
        _, vectors = np.linalg.eigh(f.fabric)
        tilt.append(float(np.degrees(np.arccos(min(1.0, abs(vectors[2, 0]))))))
    local = np.mean([f.local for f in found], axis=0)
    leaning = mean_of(tilt)
    return Verdict(
        claim=39,
        outcome=decided(leaning.value < 15.0) if p < 0.05 else UNDECIDED,
        sentence=f"Wires turned at random come as far from isotropy with p = {p:.2g}; the axis with the fewest wires leans by "
        f"{leaning.text('.2g')}° from the vertical. Shares along the radius, around the axis and upwards: {local[0]:.3f}, "
        f"{local[1]:.3f}, {local[2]:.3f}.",
        value=p,
        numbers={
            "p": p, "tilt_by_seed": tilt, "radial": float(local[0]), "around": float(local[1]), "vertical": float(local[2]),
            "eigenvalues": np.linalg.eigvalsh(np.mean([f.fabric for f in found], axis=0)).tolist(),
        },
        settings=settings_of(size),
        needed="" if p < 0.05 else "more wires or seeds",
    )  # fmt: skip


def slope_outcome(found: Mean) -> tuple[Outcome, str]:
    """Is a gain of angle between 0° and 10°, and clear of 0? And what would decide."""
    if np.isnan(found.low):
        return UNDECIDED, "at least 2 seeds for an interval"
    if found.low > 0.0:
        return decided(found.value <= 10.0), ""
    if found.high < 0.0:
        return FAIL, ""
    return UNDECIDED, few(found, 0.0)


def _steeper(size: Size, results: Mapping[str, Any], _cache: dict[str, Any]) -> Verdict:
    sand, unlinked = (gain(results, BASE, size.seeds, other) for other in ("sand", "unlinked"))
    table = {kind: angles(results, BASE, size.seeds, kind) for kind in KINDS}
    outcome, needed = slope_outcome(sand)
    means = ", ".join(f"{np.nanmean(values):.1f}° {kind}" for kind, values in table.items())
    return Verdict(
        claim=40,
        outcome=outcome,
        sentence=f"Wires change the slope by {sand.text('.2f')}° against sand alone and by {unlinked.text('.2f')}° against the same beads "
        f"unlinked (means: {means}). A sudden release makes low heaps: the differences count.",
        value=sand.value, unit="°", low=sand.low, high=sand.high,
        numbers={
            "against_sand": sand.numbers(), "against_unlinked": unlinked.numbers(),
            **{f"angle_{kind}": values.tolist() for kind, values in table.items()},
            "largest_lost_share": max(
                content_of(results, BASE, s, kind)["quality"]["lost"] for s in range(1, size.seeds + 1) for kind in KINDS
            ),
        },
        settings=settings_of(size),
        needed=needed,
    )  # fmt: skip


def _pictures(size: Size, _folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .deposit_figures import fabric_history, heap_view, profile_figure

    try:
        linked = content_of(results, BASE, 1, "linked")
        kinds = {kind: content_of(results, BASE, 1, kind) for kind in KINDS}
        histories = [content_of(results, BASE, s, "linked")["history"] for s in range(1, size.seeds + 1)]
        heaps = {kind: [heap(content_of(results, BASE, s, kind)) for s in range(1, size.seeds + 1)] for kind in KINDS}
    except (FenchelError, KeyError):
        return []
    assembly = Assembly.from_arrays(linked["assembly"])
    return [
        Picture(
            "slope_active", "The deposit with its wires: links above three times the mean tension are thick and coloured by tension.",
            lambda: heap_view(assembly, network_of(linked, 0.4)),
            "The study shows the same beside the triaxial test: many long active pieces in the slope.", "png",
        ),
        Picture(
            "slope_profile", "Free surface of the heaps (mean over azimuths and seeds; thin lines: seeds).",
            lambda: profile_figure(heaps),
        ),
        Picture(
            "slope_history", "Kinetic energy and vertical share of the wire fabric during the fall.",
            lambda: fabric_history(histories, {kind: found["history"] for kind, found in kinds.items()}),
        ),
    ]  # fmt: skip


DEPOSIT = Part("G", "Slope deposit", CLAIMS, _tasks, _judge, _pictures)
