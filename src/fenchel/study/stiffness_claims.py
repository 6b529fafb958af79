r"""Part J: the stress of the wires against the strain of the triaxial test, for elastic wires of several k and for the rigid wire.

σ_w^eq = √J₂ of the wire stress. The links alone are the wire here: with the bead contacts added, the skeleton of the beads hides what k
does (unlinked beads have a stress, too); both are given. Wires pull from the preparation on, and what the preparation left need not be
isotropic: the growth is √J₂ of the stress less that at the start, the shift √J₂ at the start. The macro-stiffness is the slope of the
growth over the shortening from 0.05 to 0.5 %; its limit follows from 1/E(k) = 1/E_∞ + 1/(ηk). Where k exceeds
k_c = l₀ m_b/(2h²), steps see a rigid wire whatever k.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..dem.record import TriaxialRecord
from ..errors import FenchelError
from .claim import FAIL, PASS, UNDECIDED, Claim, Part, Picture, Verdict, decided, judged, taken, unjudged
from .grain_runs import PRESSURE, RADIUS, STIFF, stiffness_label, stiffness_runs
from .models import equivalent_stress
from .sizes import Size
from .statistics import Mean, few, mean_of, monotone

__all__ = ["STIFFNESS", "WireCurve", "wire_curve"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(53, "Q", "The wire stress grows linearly with the strain for elastic wires.", "R² > 0.95 from 0.05 to 0.5 %, every k."),
    Claim(54, "Q", "It does for rigid wires, too.", "R² > 0.95; half the tolerance and half the step change the slope by less than 10 %."),
    Claim(55, "Q", "Preparation leaves a stress shift at zero strain.", "Positive for every k, interval excludes 0."),
    Claim(
        56, "Q", "Shift and onset strain grow with k, largest for the rigid wire.",
        "Both rise with k and are largest for the rigid wire.",
    ),
    Claim(
        57, "Q", "The test begins with a contracting rearrangement, stronger for stiff wires.",
        "A first event in volume that grows with k.",
    ),
    Claim(
        58, "Q", "The macro-stiffness rises with k, less than linearly, to a limit: the rigid wire.",
        "Rises; below k; limit in the interval of the rigid wire.",
    ),
)  # fmt: skip

WINDOW = (5e-4, 5e-3)  # axial strain of the fit


@dataclass(frozen=True, kw_only=True)
class WireCurve:
    """One test: axial shortening, √J₂ of the links and of links with bead contacts [Pa], its growth, events of the start."""

    strain: Array
    links: Array
    total: Array
    growth: Array  # √J₂ of the link stress less its start [Pa]
    slope: float  # Pa
    slope_total: float
    r_squared: float
    shift: float  # Pa, at zero strain
    onset: float  # strain at which the wire stress has grown by a twentieth of its final growth
    contraction: float  # −tr ε at the first 0.02 %, less what the slope of the next 0.05 % would give
    burst: float  # kinetic energy: largest of the first 0.02 % over the median


def wire_curve(record: TriaxialRecord) -> WireCurve:
    """The curve of a test."""
    h = record.history()
    strain = -h.axial_strain
    links = equivalent_stress(h.stress_links)
    total = equivalent_stress(h.stress_links + h.stress_beads)
    inside = (strain >= WINDOW[0]) & (strain <= WINDOW[1] * (1 + 1e-9))
    growth = equivalent_stress(h.stress_links - h.stress_links[0])
    whole = h.stress_links + h.stress_beads
    slope, foot = np.polyfit(strain[inside], growth[inside], 1)
    left = growth[inside] - slope * strain[inside] - foot
    spread = float(np.sum((growth[inside] - growth[inside].mean()) ** 2))
    grown = np.flatnonzero(growth >= 0.05 * growth[-1]) if growth[-1] > 0 else np.zeros(0, dtype=int)
    volume = -h.strain_sand[:, :3].sum(axis=1)
    early, next_ = strain <= 2e-4, (strain > 2e-4) & (strain <= 7e-4)
    trend = np.polyfit(strain[next_], volume[next_], 1)[0] if next_.sum() > 1 else 0.0
    kinetic = record.series["kinetic"]
    return WireCurve(
        strain=strain,
        links=links,
        total=total,
        growth=growth,
        slope=float(slope),
        slope_total=float(np.polyfit(strain[inside], equivalent_stress(whole - whole[0])[inside], 1)[0]),
        r_squared=1.0 - float(left @ left) / spread if spread > 0.0 else 0.0,
        shift=float(links[0]),
        onset=float(strain[grown[0]]) if grown.size else float("nan"),
        contraction=float(volume[early][-1] - trend * strain[early][-1]),
        burst=float(kinetic[early].max() / np.median(kinetic)),
    )


Table = dict[str, list[WireCurve]]


def _curves(size: Size, results: Mapping[str, Any]) -> Table:
    table: Table = {}
    labels = [stiffness_label(k) for k in (*size.wire_stiffness, None)]
    labels += [stiffness_label(k, strict=True) for k in (max(size.wire_stiffness), None)]
    for label in labels:
        table[label] = []
        for seed in range(1, size.fine_seeds + 1):
            table[label].append(wire_curve(taken(results, f"{label}, seed {seed}: {PRESSURE / 1e3:g} kPa, links on")))
    return table


def _of(curves: list[WireCurve], name: str) -> Mean:
    return mean_of([getattr(c, name) for c in curves])


class _State:
    def __init__(self, size: Size, results: Mapping[str, Any]) -> None:
        self.size = size
        self.curves = _curves(size, results)
        self.elastic = {k: self.curves[stiffness_label(k)] for k in size.wire_stiffness}
        self.rigid = self.curves[stiffness_label(None)]
        t = 2.0 * RADIUS * np.sqrt(2600.0 / PRESSURE)
        mass = 2600.0 * 4.0 / 3.0 * np.pi * RADIUS**3  # of a bead: that of a mean grain
        self.critical = RADIUS * mass / (2.0 * (STIFF.step * t) ** 2)
        self.settings = {
            "grains": size.fine_grains, "seeds": size.fine_seeds, "beads per grain": STIFF.per_grain, "beads of a wire": STIFF.beads,
            "pressure [Pa]": PRESSURE, "window": list(WINDOW), "tolerance": STIFF.tolerance, "step / inertial time": STIFF.step,
            "k_c [N]": self.critical, "wires": "prestressed by the preparation",
        }  # fmt: skip


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    return stiffness_runs(size, folder) if wanted & STIFFNESS.numbers else []


def _judge(size: Size, _folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {53: _linear, 54: _rigid_linear, 55: _shift, 56: _shift_grows, 57: _event, 58: _limit}
    if not wanted & STIFFNESS.numbers:
        return []
    try:
        state = _State(size, results)
    except FenchelError as problem:
        return unjudged(CLAIMS, wanted, problem)
    return judged(CLAIMS, wanted, lambda n: makers[n](state))


def _linear(s: _State) -> Verdict:
    worst = {k: min(c.r_squared for c in curves) for k, curves in s.elastic.items()}
    k = min(worst, key=lambda k: worst[k])
    return Verdict(
        claim=53,
        outcome=decided(worst[k] > 0.95),
        sentence=f"σ_w^eq (links) against strain from 0.05 to 0.5 %: R² is at least {worst[k]:.3f} (k = {k:g} N). Beyond 1 % the "
        f"curve bends: "
        "slip limits the tension.",
        value=worst[k], numbers={f"r_squared_k_{k:g}": v for k, v in worst.items()}, settings=s.settings,
    )  # fmt: skip


def _rigid_linear(s: _State) -> Verdict:
    r = min(c.r_squared for c in s.rigid)
    change = [
        abs(b.slope / a.slope - 1.0) for a, b in zip(s.rigid, s.curves[stiffness_label(None, strict=True)], strict=True)
    ]
    worst = max(change)
    mean = mean_of(
        [b.slope / a.slope - 1.0 for a, b in zip(s.rigid, s.curves[stiffness_label(None, strict=True)], strict=True)]
    )
    good = r > 0.95 and abs(mean.value) < 0.1
    unsure = r > 0.95 and not good and (mean.count < 3 or (mean.low < 0.1 and mean.high > -0.1))
    return Verdict(
        claim=54,
        outcome=PASS if good else UNDECIDED if unsure else FAIL,
        sentence=f"Rigid wires: R² at least {r:.3f}; half the tolerance and half the step change the slope by "
        f"{100 * mean.value:.1f} % in the "
        f"mean, {100 * worst:.0f} % at most. Another step is another sample: the preparation takes another way.",
        value=r,
        numbers={"r_squared": r, "change_mean": mean.value, "change_low": mean.low, "change_high": mean.high, "change_worst": worst},
        settings=s.settings, needed="about 5 seeds" if unsure else "",
    )  # fmt: skip


def _shift(s: _State) -> Verdict:
    shifts = {k: _of(curves, "shift") for k, curves in s.elastic.items()}
    least = min(shifts.values(), key=lambda m: m.low if np.isfinite(m.low) else m.value)
    clear = all(m.low > 0.0 for m in shifts.values())
    return Verdict(
        claim=55,
        outcome=PASS if clear else UNDECIDED,
        sentence="Wire stress at zero strain: " + ", ".join(f"{m.value:.0f} Pa at k = {k:g} N" for k, m in shifts.items()) + ".",
        value=least.value, unit="Pa", low=least.low, high=least.high,
        numbers={f"shift_k_{k:g}": m.numbers() for k, m in shifts.items()}, settings=s.settings,
        needed="" if clear else few(least, 0.0),
    )  # fmt: skip


def _rises(s: _State, name: str) -> tuple[bool, dict[str, Mean]]:
    values = {f"{k:g}": _of(curves, name) for k, curves in s.elastic.items()} | {"rigid": _of(s.rigid, name)}
    return monotone([m.value for m in values.values()]), values


def _spearman(s: _State, name: str) -> float:
    """Rank correlation of a measure with k over all seeds, the rigid wire last."""
    from scipy.stats import spearmanr

    rank, value = [], []
    for place, curves in enumerate((*s.elastic.values(), s.rigid)):
        for c in curves:
            rank.append(place)
            value.append(getattr(c, name))
    answer: Any = spearmanr(rank, value, nan_policy="omit")
    return float(answer.statistic)


def _shift_grows(s: _State) -> Verdict:
    rising, shifts = _rises(s, "shift")
    later, onsets = _rises(s, "onset")
    ranks = {name: _spearman(s, name) for name in ("shift", "onset")}
    top = max(shifts, key=lambda k: shifts[k].value)
    good = ranks["shift"] > 0.5 and ranks["onset"] > 0.5 and top == "rigid"
    return Verdict(
        claim=56,
        outcome=decided(good),
        sentence=f"Rank correlation with k: {ranks['shift']:.2f} for the stress shift, {ranks['onset']:.2f} for the onset strain; "
        f"the largest shift "
        f"is at k = {top}. Shift {shifts[next(iter(shifts))].value:.0f} to {shifts['rigid'].value:.0f} Pa, onset "
        f"{1e2 * onsets[next(iter(onsets))].value:.3f} to {1e2 * onsets['rigid'].value:.3f} %.",
        value=ranks["shift"],
        numbers={
            "shift_monotone": rising, "onset_monotone": later, **{f"rank_{k}": v for k, v in ranks.items()},
            **{f"shift_{k}": m.numbers() for k, m in shifts.items()}, **{f"onset_{k}": m.numbers() for k, m in onsets.items()},
        },
        settings=s.settings,
    )  # fmt: skip


def _event(s: _State) -> Verdict:
    _, contraction = _rises(s, "contraction")
    _, burst = _rises(s, "burst")
    rank = _spearman(s, "contraction")
    first = contraction["rigid"]
    good = first.value > 0.0 and rank > 0.5
    return Verdict(
        claim=57,
        outcome=decided(good),
        sentence=f"Contraction of the first 0.02 % beyond the trend: {1e6 * contraction[next(iter(contraction))].value:.1f} (softest) to "
        f"{1e6 * first.value:.1f}·10⁻⁶ (rigid), rank correlation with k {rank:.2f}; kinetic energy there "
        f"{burst['rigid'].value:.1f} times its "
        "median. A test that starts from rest with a ramped rate shows no brutal event.",
        value=first.value, low=first.low, high=first.high,
        numbers={
            "rank": rank, **{f"contraction_{k}": m.numbers() for k, m in contraction.items()},
            **{f"burst_{k}": m.numbers() for k, m in burst.items()},
        },
        settings=s.settings,
    )  # fmt: skip


def saturation(k: Array, slope: Array) -> tuple[float, float]:
    """E_∞ and η of 1/E = 1/E_∞ + 1/(ηk), by least squares of the logarithm of E; nan where a slope is not positive."""
    from scipy.optimize import least_squares

    if not np.all(slope > 0.0):
        return float("nan"), float("nan")
    start = np.array([np.log(slope.max()), np.log(slope[0] / k[0])])

    def residual(p: Array) -> Array:
        return -np.log(np.exp(-p[0]) + np.exp(-p[1]) / k) - np.log(slope)

    found: Any = least_squares(residual, start)
    return float(np.exp(found.x[0])), float(np.exp(found.x[1]))


def _limit(s: _State) -> Verdict:
    k = np.array(list(s.elastic))
    means = [_of(curves, "slope") for curves in s.elastic.values()]
    slope = np.array([m.value for m in means])
    rigid = _of(s.rigid, "slope")
    limit, eta = saturation(k, slope)
    exponent = float(np.polyfit(np.log(k), np.log(np.maximum(slope, 1e-9)), 1)[0])
    rank = _spearman(s, "slope")
    spread = rigid.half if np.isfinite(rigid.low) else 0.25 * rigid.value
    near = abs(limit - rigid.value) <= spread
    rises = rank > 0.7 and 0.0 < exponent < 1.0
    unsure = rises and not near
    return Verdict(
        claim=58,
        outcome=PASS if rises and near else UNDECIDED if unsure else FAIL,
        sentence=f"The slope of σ_w^eq (links) rises as k^{exponent:.2f} from {slope[0] / 1e3:.0f} kPa at {k[0]:g} N to "
        f"{slope[-1] / 1e3:.0f} kPa at "
        f"{k[-1]:g} N; the fit tends to {limit / 1e3:.0f} kPa, the rigid wire has {rigid.text('.3g')} Pa. k/k_c runs from "
        f"{k[0] / s.critical:.2g} "
        f"to {k[-1] / s.critical:.2g}.",
        value=rigid.value, unit="Pa", low=rigid.low, high=rigid.high,
        numbers={
            "limit": limit, "eta": eta, "exponent": exponent, "rank": rank, "k_c": s.critical, "rigid": rigid.numbers(),
            **{f"slope_k_{a:g}": m.numbers() for a, m in zip(k, means, strict=True)},
            **{f"total_slope_k_{a:g}": _of(c, "slope_total").numbers() for a, c in s.elastic.items()},
            "strict_slope": _of(s.curves[stiffness_label(max(s.size.wire_stiffness), strict=True)], "slope").numbers(),
        },
        settings=s.settings, needed="more seeds or larger k: the limit lies outside the interval of the rigid wire" if unsure else "",
    )  # fmt: skip


def _pictures(size: Size, _folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .grain_figures import macro_figure, wire_stress_figure

    try:
        s = _State(size, results)
    except (FenchelError, KeyError):
        return []
    k = np.array(list(s.elastic))
    means = [_of(curves, "slope") for curves in s.elastic.values()]
    limit = saturation(k, np.array([m.value for m in means]))
    return [
        Picture("wire_stress", "Wire stress √J₂ (links alone) against axial shortening, seed 1.",
                lambda: wire_stress_figure({k: c[0] for k, c in s.elastic.items()}, s.rigid[0]),
                "The study shows straight lines, shifted by the preparation, steeper for stiffer wires and steepest for rigid ones."),
        Picture("macro_stiffness", "Slope of the wire stress against k; the band is the rigid wire, the line the fit, the mark k_c.",
                lambda: macro_figure(k, means, _of(s.rigid, "slope"), limit, s.critical),
                "The study says that the macro-stiffness rises with k towards that of the rigid wire."),
    ]  # fmt: skip


STIFFNESS = Part("J", "Wire stress and macro-stiffness", CLAIMS, _tasks, _judge, _pictures)
