r"""Part H: the characteristic length λ̄^m_max of a deposit and of a triaxial test of the same grains and wires.

Lengths in mean grain radii. The wires of the deposit are released without tension, those of the triaxial test pull from the preparation
on, as in the study; beside it stands the test of wires that are free of tension at its start. A maximum over many
links is never small, so every length stands beside that of tensions shuffled along the wires. Ratios are paired by seed and averaged as
logarithms.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..dem.measures import Network
from ..dem.storage import load_run
from ..errors import FenchelError
from .active_segments import MULTIPLES, Segments, definition_holds, knee, network_of, segments
from .claim import FAIL, PASS, UNDECIDED, Claim, Part, Picture, Verdict, decided, judged, taken, unjudged
from .deposit_claims import content_of, deposit_segments, settings_of
from .field_measures import over_seeds, scatter
from .grain_runs import BASE, FREE, TAUT, Setting, deposits, taut_tests, triaxial
from .sizes import Size
from .statistics import Mean, combined_p, few, mean_of, seeds_to_exclude

__all__ = ["LENGTH", "length_ratio", "triaxial_network", "triaxial_segments"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(41, "T", "λ̄^m_max falls with m, is the longest wire at m = 0, ignores the scale of tension.", "Exact on every network."),
    Claim(42, "Q", "m = 3 parts weak from strong pieces.", "The curve over m bends most between m = 2 and 4, in both tests."),
    Claim(43, "N", "54 mean radii in the slope, 4 in the triaxial test.", "Each within a factor 2, in radii."),
    Claim(
        44, "Q", "Large strain makes far longer active pieces than small strain.",
        "Ratio above 3 on the same blocks, interval excludes 1.",
    ),
    Claim(
        45, "Q", "Only in the slope are active pieces longer than chance.",
        "Shuffled tensions: p < 0.05 in the slope, not in the triaxial test.",
    ),
    Claim(
        46, "Q", "The triaxial test is local; a representative volume exceeds the characteristic length.",
        "The scatter of the stress falls with the size of the domain and is below 10 % beyond λ̄³_max.",
    ),
    Claim(
        47, "Q", "Active pieces straighten at large strain.",
        "End-to-end over arc length: active above inactive, and above active ones of the triaxial test; intervals exclude 0.",
    ),
)  # fmt: skip


def triaxial_network(
    size: Size, folder: Path, seed: int, *, label: str = BASE, count: int | None = None, setting: Setting = FREE
) -> Network:
    """The network at the end of a triaxial test."""
    test = triaxial(count or size.grains, seed, folder, label=label, setting=setting)[-1]
    content, _ = load_run(test.run_file)
    return network_of(content, setting.friction)


def triaxial_segments(size: Size, folder: Path, label: str = BASE) -> list[Segments]:
    """Wires at the end of the triaxial tests by seed."""
    return [
        segments(triaxial_network(size, folder, seed, label=label), seed, size.permutations)
        for seed in range(1, size.seeds + 1)
    ]


def length_ratio(slope: list[float], test: list[float]) -> Mean:
    """Geometric mean of the ratio, with the interval of its logarithm."""
    logs = mean_of(np.log(np.array(slope) / np.array(test)))
    return Mean(
        float(np.exp(logs.value)), float(np.exp(logs.low)), float(np.exp(logs.high)), logs.deviation, logs.count
    )


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    if not wanted & LENGTH.numbers:
        return []
    return [
        *deposits(size.grains, size.seeds, folder, ("linked",)),
        *triaxial(size.grains, size.seeds, folder),
        *taut_tests(size, folder),
    ]


def _judge(size: Size, folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {41: _definition, 42: _three, 43: _lengths, 44: _ratio, 45: _chance, 46: _domain, 47: _straight}
    try:
        for name in results:
            if name.startswith((f"{BASE}, ", f"{TAUT}, ")):
                taken(results, name)
        state = _State(size, folder, results)
    except FenchelError as problem:
        return unjudged(CLAIMS, wanted, problem)
    return judged(CLAIMS, wanted, lambda n: makers[n](state))


class _State:
    """Networks and measures of both tests, by seed."""

    def __init__(self, size: Size, folder: Path, results: Mapping[str, Any]) -> None:
        self.size = size
        seeds = range(1, size.seeds + 1)
        self.slopes = [network_of(content_of(results, BASE, seed, "linked"), 0.4) for seed in seeds]
        self.boxes = [triaxial_network(size, folder, seed, label=TAUT) for seed in seeds]
        self.free_boxes = [triaxial_network(size, folder, seed) for seed in seeds]
        self.slope = deposit_segments(size, results)
        self.test = triaxial_segments(size, folder, TAUT)
        self.free = triaxial_segments(size, folder)
        self.settings = settings_of(size) | {
            "axial strain": -0.01,
            "pressure [Pa]": 5e4,
            "permutations": size.permutations,
        }


def _definition(state: _State) -> Verdict:
    held = [definition_holds(network) for network in (*state.slopes, *state.boxes, *state.free_boxes)]
    broken = sorted({name for found in held for name, ok in found.items() if not ok})
    return Verdict(
        claim=41,
        outcome=decided(not broken),
        sentence=f"All four properties hold exactly on {len(held)} networks, over {len(MULTIPLES)} values of m."
        if not broken
        else f"Broken: {', '.join(broken)}.",
        value=float(len(broken)),
        numbers={"networks": len(held), "broken": len(broken)},
        settings=state.settings,
    )


def _three(state: _State) -> Verdict:
    bends = {
        name: mean_of([knee(s.radii) for s in found])
        for name, found in (("slope", state.slope), ("triaxial", state.test))
    }
    shares = {
        name: mean_of([s.share[12] for s in found])
        for name, found in (("slope", state.slope), ("triaxial", state.test))
    }
    inside = all(2.0 <= bend.value <= 4.0 for bend in bends.values())
    return Verdict(
        claim=42,
        outcome=decided(inside),
        sentence=f"The curve of λ̄^m_max over m bends most at m = {bends['slope'].text('.2f')} in the slope and "
        f"{bends['triaxial'].text('.2f')} "
        f"in the triaxial test; at m = 3, {100 * shares['slope'].value:.0f} and {100 * shares['triaxial'].value:.0f} % of the wire "
        f"length is "
        "active." + ("" if inside else " So m = 3 is no mark of the curve but a choice beyond its bend."),
        value=bends["slope"].value, low=bends["slope"].low, high=bends["slope"].high,
        numbers={
            "knee_slope": bends["slope"].numbers(), "knee_triaxial": bends["triaxial"].numbers(),
            "active_share_slope": shares["slope"].numbers(), "active_share_triaxial": shares["triaxial"].numbers(),
            "m": MULTIPLES.tolist(),
            "radii_slope": np.mean([s.radii for s in state.slope], axis=0).tolist(),
            "radii_triaxial": np.mean([s.radii for s in state.test], axis=0).tolist(),
        },
        settings=state.settings,
    )  # fmt: skip


def _lengths(state: _State) -> Verdict:
    slope, test = mean_of([s.at_three for s in state.slope]), mean_of([s.at_three for s in state.test])
    free = mean_of([s.at_three for s in state.free])
    good = 27.0 <= slope.value <= 108.0 and 2.0 <= test.value <= 8.0
    longest = float(np.max([s.radii[0] for s in state.slope]))
    return Verdict(
        claim=43,
        outcome=decided(good),
        sentence=f"λ̄³_max is {slope.text('.3g')} mean radii in the slope (study: 54) and {test.text('.3g')} in the triaxial test "
        f"(study: 4); "
        f"one link is {state.slope[0].spacing:.2f} radii, the longest wire {longest:.0f}.",
        value=slope.value, unit="mean radii", low=slope.low, high=slope.high,
        numbers={
            "slope": slope.numbers(), "triaxial": test.numbers(), "triaxial_free": free.numbers(),
            "slope_by_seed": [s.at_three for s in state.slope],
            "triaxial_by_seed": [s.at_three for s in state.test], "longest_wire": longest, "link": state.slope[0].spacing,
        },
        settings=state.settings,
    )  # fmt: skip


def _ratio(state: _State) -> Verdict:
    found = length_ratio([s.at_three for s in state.slope], [s.at_three for s in state.test])
    logs = Mean(float(np.log(found.value)), np.nan, np.nan, found.deviation, found.count)
    free = length_ratio([s.at_three for s in state.slope], [s.at_three for s in state.free])
    clear = bool(found.low > 1.0)
    return Verdict(
        claim=44,
        outcome=PASS if clear and found.value > 3.0 else FAIL if not np.isnan(found.low) and found.high < 3.0 else UNDECIDED,
        sentence=f"On the same blocks the slope has {found.text('.3g')} times the active length of the triaxial test (study: 13), "
        f"{free.text('.3g')} times that of wires free of tension at its start.",
        value=found.value, low=found.low, high=found.high, numbers=found.numbers() | {"free": free.numbers()}, settings=state.settings,
        needed="" if clear else f"about {max(seeds_to_exclude(logs, 0.0), 3)} seeds",
    )  # fmt: skip


def _chance(state: _State) -> Verdict:
    slope, test = combined_p([s.p_value for s in state.slope]), combined_p([s.p_value for s in state.test])
    null = {
        name: float(np.mean([s.null_mean for s in found]))
        for name, found in (("slope", state.slope), ("triaxial", state.test))
    }
    return Verdict(
        claim=45,
        outcome=decided(slope < 0.05 <= test),
        sentence=f"Shuffled tensions give as long a piece with p = {slope:.2g} in the slope (mean {null['slope']:.1f} radii) and p "
        f"= {test:.2g} "
        f"in the triaxial test (mean {null['triaxial']:.1f})."
        + ("" if test >= 0.05 else " The triaxial value, too, is more than chance: neighbours on a wire pull alike."),
        value=slope,
        numbers={
            "p_slope": slope, "p_triaxial": test, "null_slope": null["slope"], "null_triaxial": null["triaxial"],
            "p_slope_by_seed": [s.p_value for s in state.slope], "p_triaxial_by_seed": [s.p_value for s in state.test],
        },
        settings=state.settings,
    )  # fmt: skip


def _domain(state: _State) -> Verdict:
    radius = state.boxes[0].grain_radius
    most = 0.55 * float(min(network.half.min() for network in state.boxes)) / radius
    sizes = np.linspace(2.5, most, 6)
    rows = [
        scatter(network, sizes * radius, np.random.default_rng([46, seed]))
        for seed, network in enumerate(state.boxes, 1)
    ]
    pressure, wires = over_seeds([r["pressure"] for r in rows]), over_seeds([r["wires"] for r in rows])
    length = float(np.mean([s.at_three for s in state.test]))
    beyond = 2.0 * sizes >= length
    falls = pressure[-1].value < pressure[0].value
    small = bool(beyond.any()) and all(m.value < 0.1 for m, b in zip(pressure, beyond, strict=True) if b)
    exponent = float(np.polyfit(np.log(sizes), np.log([m.value for m in pressure]), 1)[0])
    return Verdict(
        claim=46,
        outcome=decided(falls and small) if beyond.any() else UNDECIDED,
        sentence=f"The pressure in spheres of {sizes[0]:.1f} to {sizes[-1]:.1f} mean radii scatters by {100 * pressure[0].value:.1f} to "
        f"{100 * pressure[-1].value:.1f} % (exponent {exponent:.2f} in the size); that of the wires by {100 * wires[0].value:.0f} to "
        f"{100 * wires[-1].value:.0f} %. λ̄³_max is {length:.1f} radii. There is no plateau, only a fall: a representative volume is one "
        "whose scatter is small enough, not one beyond a length.",
        value=pressure[-1].value, low=pressure[-1].low, high=pressure[-1].high,
        numbers={
            "sphere_radii": sizes.tolist(), "pressure_scatter": [m.value for m in pressure], "wire_scatter": [m.value for m in wires],
            "exponent": exponent, "active_length": length,
        },
        settings=state.settings | {"places": 40},
        needed="" if beyond.any() else f"a box whose inner spheres are wider than {length:.0f} radii: more grains",
    )  # fmt: skip


def _straight(state: _State) -> Verdict:
    within = mean_of([s.straight_active - s.straight_inactive for s in state.slope])
    across = mean_of([s.straight_active - t.straight_active for s, t in zip(state.slope, state.test, strict=True)])
    values = {
        name: float(np.nanmean(v))
        for name, v in (
            ("slope active", [s.straight_active for s in state.slope]),
            ("slope inactive", [s.straight_inactive for s in state.slope]),
            ("triaxial active", [s.straight_active for s in state.test]),
        )
    }
    clear = within.low > 0.0 and across.low > 0.0
    refuted = within.high < 0.0 or across.high < 0.0
    worse = min((within, across), key=lambda m: m.low if np.isfinite(m.low) else m.value)
    return Verdict(
        claim=47,
        outcome=PASS if clear else FAIL if refuted else UNDECIDED,
        sentence=f"Pieces of three links: end-to-end over arc length {values['slope active']:.4f} active and "
        f"{values['slope inactive']:.4f} "
        f"inactive in the slope, {values['triaxial active']:.4f} active in the triaxial test; differences {within.text('.2g')} and "
        f"{across.text('.2g')}.",
        value=within.value, low=within.low, high=within.high,
        numbers={**values, "within": within.numbers(), "across": across.numbers()}, settings=state.settings | {"links of a piece": 3},
        needed="" if clear or refuted else few(worse, 0.0),
    )  # fmt: skip


def _pictures(size: Size, folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .deposit_figures import box_view, length_figure

    try:
        state = _State(size, folder, results)
    except (FenchelError, KeyError):
        return []
    study = "The study sets active wire pieces of the two tests side by side: few and short ones in the box, long ones in the slope."
    return [
        Picture("triaxial_active", "The triaxial sample at 1 % shortening: active links thick, coloured by tension.",
                lambda: box_view(state.boxes[0]), study, "png"),
        Picture("length", "Longest active piece against m, in mean radii; dashed: mean of shuffled tensions at m = 3.",
                lambda: length_figure(state.slope, state.test),
                "The study gives one number per test, at m = 3: 54 and 4 mean radii."),
    ]  # fmt: skip


LENGTH = Part("H", "Characteristic length", CLAIMS, _tasks, _judge, _pictures)
