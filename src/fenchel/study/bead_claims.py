r"""Part I: ever thinner beads at the same spacing, until the wires no longer go with the sand.

Best-fit strains of grains and beads in the sphere of 0.8 half widths, from the start of the test to 3 % shortening; mismatch
‖ε_s − ε_w‖/‖ε_s‖ with a bootstrap over grains and whole wires. Slip is the displacement of a bead against its four nearest grains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..campaign import Task
from ..dem.measures import bead_slip, phase_mismatch, sliding_fraction
from ..dem.storage import load_run
from ..errors import FenchelError
from ..identify.tasks import Prepare, Test
from .active_segments import network_of
from .claim import FAIL, PASS, UNDECIDED, Claim, Part, Picture, Verdict, decided, judged, taken, unjudged
from .grain_runs import BEADS, PRESSURE, bead_label, beads_study
from .sizes import Size
from .statistics import Mean, mean_of

__all__ = ["BEAD", "Phases", "moved", "phases"]

Array = NDArray[np.float64]

CLAIMS = (
    Claim(
        48, "Q", "The mean strains of the phases part when beads are too small.",
        "The mismatch rises as beads get thinner, and more than by noise.",
    ),
    Claim(
        49, "Q", "The cause is a sudden large sliding of the wire.",
        "Slip and share of sliding bead contacts rise with the mismatch; motion comes in bursts.",
    ),
    Claim(
        50, "Q", "The slip has a direction: the two horizontal wire strains differ.",
        "|ε_xx − ε_yy|/|ε_zz| of thin wires above that of thick ones, interval excludes 0.",
    ),
    Claim(51, "Q", "Thinner wires slip more.", "Rank correlation of slip with bead radius below −0.7."),
    Claim(
        52, "Q", "There is a limit below which equal strains no longer hold.",
        "A bead radius at which the mismatch passes its noise by 10 %.",
    ),
)  # fmt: skip


def moved(prepare: Prepare, test: Test) -> tuple[Array, Array, Array, NDArray[np.int64], Array]:
    """Start positions, displacements, radii, wires of the bodies, and half widths at the start."""
    start, _ = load_run(prepare.state_file(test.pressure))
    end, _ = load_run(test.run_file)
    a, b = start["assembly"], end["assembly"]
    return a["x"], b["x"] - a["x"], a["radius"], a["wire"], a["half"]


@dataclass(frozen=True, kw_only=True)
class Phases:
    """Strains of the phases and how the wires slide, at the end of one test."""

    mismatch: float
    low: float
    high: float
    noise: float
    slip: float  # root mean square, mean grain radii
    sliding: float  # share of bead–grain contacts at the Coulomb limit
    directed: float  # |ε_xx − ε_yy|/|ε_zz| of the wires
    directed_sand: float
    burst: float  # kinetic energy: 99th percentile over the median of the frames


def phases(prepare: Prepare, test: Test, kinetic: Array, samples: int) -> Phases:
    """The measures of one test."""
    x, u, radius, wire, half = moved(prepare, test)
    inside = np.linalg.norm(x, axis=1) < 0.8 * half.min()
    found = phase_mismatch(x[inside], u[inside], wire[inside], np.random.default_rng([48, test.seed]), samples=samples)
    slip = bead_slip(x, u, wire)[inside[wire >= 0]]
    content, _ = load_run(test.run_file)
    network = network_of(content, test.study.grains.friction)
    grains = wire < 0

    def directed(strain: Array) -> float:
        return float(abs(strain[0, 0] - strain[1, 1]) / abs(strain[2, 2]))

    return Phases(
        mismatch=found.mismatch,
        low=found.low,
        high=found.high,
        noise=found.noise,
        slip=float(np.sqrt(np.mean(np.sum(slip**2, axis=1))) / radius[grains].mean()),
        sliding=sliding_fraction(network, kind="grain_bead", tolerance=1e-3),
        directed=directed(found.wires),
        directed_sand=directed(found.grains),
        burst=float(np.quantile(kinetic, 0.99) / np.median(kinetic)),
    )


class _State:
    def __init__(self, size: Size, folder: Path, results: Mapping[str, Any]) -> None:
        self.ratios = np.array(sorted(size.bead_ratios, reverse=True))
        tasks = {task.name: task for task in beads_study(size, folder)}
        self.found: dict[float, list[Phases]] = {}
        for ratio in self.ratios:
            self.found[ratio] = []
            for seed in range(1, size.fine_seeds + 1):
                name = f"{bead_label(ratio)}, seed {seed}"
                record = taken(results, f"{name}: {PRESSURE / 1e3:g} kPa, links on")
                test, prepare = tasks[f"{name}: {PRESSURE / 1e3:g} kPa, links on"], tasks[f"{name}: preparation"]
                assert isinstance(test, Test) and isinstance(prepare, Prepare)
                self.found[ratio].append(phases(prepare, test, record.series["kinetic"], min(size.permutations, 400)))
        self.settings = {
            "grains": size.fine_grains, "seeds": size.fine_seeds, "beads per grain": BEADS.per_grain, "beads of a wire": BEADS.beads,
            "spacing / mean radius": 1.0, "k [N]": BEADS.stiffness, "axial strain": BEADS.path[-1], "pressure [Pa]": PRESSURE,
            "friction": BEADS.friction, "wires": "prestressed by the preparation",
        }  # fmt: skip

    def means(self, name: str) -> list[Mean]:
        return [mean_of([getattr(p, name) for p in self.found[r]]) for r in self.ratios]

    def rank(self, name: str) -> float:
        """Rank correlation with the bead radius over all tests."""
        from scipy.stats import spearmanr

        pairs = [(r, getattr(p, name)) for r in self.ratios for p in self.found[r]]
        answer: Any = spearmanr(*zip(*pairs, strict=True))
        return float(answer.statistic)

    def told(self, name: str) -> str:
        return ", ".join(f"{m.value:.2g} at {r:g}" for r, m in zip(self.ratios, self.means(name), strict=True))


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    return beads_study(size, folder) if wanted & BEAD.numbers else []


def _judge(size: Size, folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {48: _parting, 49: _sliding, 50: _directed, 51: _thin, 52: _threshold}
    if not wanted & BEAD.numbers:
        return []
    try:
        state = _State(size, folder, results)
    except FenchelError as problem:
        return unjudged(CLAIMS, wanted, problem)
    return judged(CLAIMS, wanted, lambda n: makers[n](state))


def _parting(s: _State) -> Verdict:
    rank = s.rank("mismatch")
    thick, thin = s.found[s.ratios[0]], s.found[s.ratios[-1]]
    apart = min(p.low for p in thin) > max(p.high for p in thick)
    noise = float(np.mean([p.noise for p in thick]))
    thinnest = s.means("mismatch")[-1]
    return Verdict(
        claim=48,
        outcome=decided(rank < -0.7 and apart),
        sentence=f"Mismatch of the strains by bead radius over mean grain radius: {s.told('mismatch')}; two halves of the grains differ by "
        f"{noise:.2g}.",
        value=thinnest.value, low=thinnest.low, high=thinnest.high,
        numbers={
            "rank": rank, "noise": noise, **{f"mismatch_{r:g}": m.numbers() for r, m in zip(s.ratios, s.means("mismatch"), strict=True)},
            **{f"bootstrap_{r:g}": [[p.low, p.high] for p in s.found[r]] for r in s.ratios},
        },
        settings=s.settings,
    )  # fmt: skip


def _sliding(s: _State) -> Verdict:
    slip, sliding, burst = s.rank("slip"), s.rank("sliding"), s.means("burst")
    sudden = burst[-1].value > 10.0 and burst[-1].value > 2.0 * burst[0].value
    grows = slip < -0.7 and sliding < -0.7
    return Verdict(
        claim=49,
        outcome=decided(grows and sudden),
        sentence=f"Slip in mean grain radii: {s.told('slip')}; sliding share of the bead contacts: {s.told('sliding')}. Kinetic energy, "
        f"99th percentile over median: {burst[0].value:.2g} with thick and {burst[-1].value:.2g} with thin beads"
        + (", it comes in bursts." if sudden else ": the wires slide steadily, not suddenly." if grows else "."),
        value=slip,
        numbers={
            "rank_slip": slip, "rank_sliding": sliding,
            **{f"slip_{r:g}": m.numbers() for r, m in zip(s.ratios, s.means("slip"), strict=True)},
            **{f"sliding_{r:g}": m.numbers() for r, m in zip(s.ratios, s.means("sliding"), strict=True)},
            **{f"burst_{r:g}": m.numbers() for r, m in zip(s.ratios, burst, strict=True)},
        },
        settings=s.settings,
    )  # fmt: skip


def _directed(s: _State) -> Verdict:
    thick, thin = s.found[s.ratios[0]], s.found[s.ratios[-1]]
    more = mean_of([b.directed - a.directed for a, b in zip(thick, thin, strict=True)])
    clear = bool(more.low > 0.0)
    n = 5 if more.count < 3 else None
    return Verdict(
        claim=50,
        outcome=PASS if clear else FAIL if more.high < 0.0 else UNDECIDED,
        sentence=f"|ε_xx − ε_yy|/|ε_zz| of the wires: {s.told('directed')}; of the sand: {s.told('directed_sand')}. Thin less "
        f"thick on the same "
        f"seed: {more.text('.2g')}.",
        value=more.value, low=more.low, high=more.high,
        numbers={f"directed_{r:g}": m.numbers() for r, m in zip(s.ratios, s.means("directed"), strict=True)}, settings=s.settings,
        needed="" if clear or more.high < 0.0 else f"about {n or _enough(more)} seeds",
    )  # fmt: skip


def _enough(found: Mean) -> int:
    from .statistics import seeds_to_exclude

    return seeds_to_exclude(found, 0.0)


def _thin(s: _State) -> Verdict:
    rank = s.rank("slip")
    return Verdict(
        claim=51,
        outcome=decided(rank < -0.7),
        sentence=f"Rank correlation of slip with bead radius: {rank:.2f} over {sum(map(len, s.found.values()))} tests.",
        value=rank, numbers={"rank": rank}, settings=s.settings,
    )  # fmt: skip


def _threshold(s: _State) -> Verdict:
    """The largest bead radius at which the mismatch exceeds that of the thickest beads by a tenth of the strain."""
    crossing = []
    for k in range(len(s.found[s.ratios[0]])):
        excess = np.array([s.found[r][k].mismatch for r in s.ratios]) - s.found[s.ratios[0]][k].mismatch - 0.1
        above = np.flatnonzero(excess > 0.0)
        if above.size and above[0] > 0:
            i = int(above[0])
            w = excess[i - 1] / (excess[i - 1] - excess[i])
            crossing.append(float(s.ratios[i - 1] + w * (s.ratios[i] - s.ratios[i - 1])))
    found = mean_of(crossing)
    every = len(crossing) == len(s.found[s.ratios[0]])
    return Verdict(
        claim=52,
        outcome=PASS if every else FAIL if not crossing else UNDECIDED,
        sentence=f"The mismatch exceeds that of the thickest beads by 0.1 below a bead radius of {found.text('.2f')} mean grain "
        f"radii; a bead "
        "passes the throat between three touching grains at 0.155."
        if crossing
        else "No bead radius of the sweep parts the phases by 0.1 more than the thickest beads do.",
        value=found.value, low=found.low, high=found.high, numbers={"by_seed": crossing, "throat": 2.0 / np.sqrt(3.0) - 1.0},
        settings=s.settings, needed="" if every or not crossing else "about 5 seeds",
    )  # fmt: skip


def _pictures(size: Size, folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    from .grain_figures import bead_figure

    try:
        s = _State(size, folder, results)
    except (FenchelError, KeyError):
        return []
    return [
        Picture("beads", "Mismatch of the strains, slip and sliding share against bead radius; bars: bootstrap, points: seeds.",
                lambda: bead_figure(s.found), "The study reports in words that the mean strains diverge when beads are too small."),
    ]  # fmt: skip


BEAD = Part("I", "Bead diameter", CLAIMS, _tasks, _judge, _pictures)
