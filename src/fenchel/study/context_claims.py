r"""Part A: the material. What the wire density means as yarn, what volume the wires take, and what they add to the friction angle.

A yarn of linear density ρ_lin in a soil of dry density ρ_d, content c by weight, has the length per volume ρ_L = c ρ_d/ρ_lin.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..campaign import Task
from ..identify.tasks import Prepare
from .claim import Claim, Part, Verdict, decided, judged, taken
from .deposit_claims import gain, settings_of, slope_outcome
from .grain_runs import BASE, deposits, triaxial
from .sizes import Size

__all__ = ["CONTEXT"]

CLAIMS = (
    Claim(
        1, "N", "10⁵ to 3·10⁵ m of wire per m³ fit 0.1 to 0.2 % of yarn by weight.",
        "The yarns that follow are of 53 to 320 dtex, and the samples hold that density at the study's grain size.",
    ),
    Claim(2, "Q", "The volume of the wires is negligible.", "A yarn of 167 dtex takes below 1 %; the volume of beads is told apart."),
    Claim(3, "N", "Wires raise the friction angle by 0° to 10°.", "As claim 40."),
)  # fmt: skip

DRY, POLYESTER, DTEX = 1600.0, 1380.0, 1e-7  # kg/m³ of the soil, kg/m³ of the fibre, kg/m


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    tasks: list[Task] = []
    if 3 in wanted:
        tasks += deposits(size.grains, size.seeds, folder, ("linked", "sand", "unlinked"))
    if wanted & {1, 2}:
        tasks += triaxial(size.grains, size.seeds, folder)
    return tasks


def _judge(size: Size, folder: Path, results: Mapping[str, Any], wanted: frozenset[int]) -> list[Verdict]:
    makers = {1: _density, 2: _volume, 3: _angle}
    return judged(CLAIMS, wanted, lambda n: makers[n](size, folder, results))


def _records(size: Size, folder: Path, results: Mapping[str, Any]) -> list[Any]:
    tasks = triaxial(size.grains, size.seeds, folder)
    return [taken(results, task.name) for task in tasks if not isinstance(task, Prepare)]


def _density(size: Size, folder: Path, results: Mapping[str, Any]) -> Verdict:
    yarns = sorted(content * DRY / length / DTEX for content in (1e-3, 2e-3) for length in (1e5, 3e5))
    low, high = yarns[0], yarns[-1]
    found = [r.quality["wire_density"] for r in _records(size, folder, results)]
    inside = min(found) >= 0.9e5 and max(found) <= 3e5
    good = abs(low - 160.0 / 3.0) < 1.0 and abs(high - 320.0) < 1.0 and inside
    return Verdict(
        claim=1,
        outcome=decided(good),
        sentence=f"0.1 to 0.2 % by weight at {DRY:.0f} kg/m³ means yarns of {low:.0f} to {high:.0f} dtex; the samples hold "
        f"{min(found):.3g} to {max(found):.3g} m⁻² at the mean radius of the study's triaxial sample (within 10 % of its lower end).",
        value=float(np.mean(found)), unit="m⁻²", low=min(found), high=max(found),
        numbers={"dtex_low": low, "dtex_high": high, "wire_density": found}, settings=settings_of(size) | {"dry density [kg/m³]": DRY},
    )  # fmt: skip


def _volume(size: Size, folder: Path, results: Mapping[str, Any]) -> Verdict:
    section = 167.0 * DTEX / POLYESTER
    share = 3e5 * section
    beads = [r.quality["bead_fraction"] for r in _records(size, folder, results)]
    return Verdict(
        claim=2,
        outcome=decided(share < 0.01),
        sentence=f"A polyester yarn of 167 dtex takes {100 * share:.2f} % of the volume at 3·10⁵ m⁻²; the beads that stand for it "
        f"here take "
        f"{100 * max(beads):.1f} %, so every test has the control of the same beads unlinked.",
        value=share, numbers={"yarn": share, "beads": max(beads)}, settings=settings_of(size),
    )  # fmt: skip


def _angle(size: Size, _folder: Path, results: Mapping[str, Any]) -> Verdict:
    found = gain(results, BASE, size.seeds, "sand")
    outcome, needed = slope_outcome(found)
    return Verdict(
        claim=3, outcome=outcome, sentence=f"The angle of the deposits changes by {found.text('.2f')}° (claim 40).",
        value=found.value, unit="°", low=found.low, high=found.high, numbers=found.numbers(), settings=settings_of(size), needed=needed,
    )  # fmt: skip


CONTEXT = Part("A", "Material and context", CLAIMS, _tasks, _judge)
