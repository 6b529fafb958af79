r"""Part F: the discrete method itself, before any sample: one step as a contact problem, the links of wires, motions in closed form.

`contact_operator` (28), `contact_onestep` (29, 30), `contact_sweeps` (31), `wire_graphs` (32), `wire_chains` (33 to 35),
`contact_motion` (36) compute; `contact_judges` says what follows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..campaign import Computation, Task
from ..errors import FenchelError
from .claim import FAIL, UNDECIDED, Claim, Part, Picture, Verdict
from .contact_judges import JUDGES
from .contact_motion import G, catenary, flight_and_bounce, pendulum, sliding, stack
from .contact_onestep import SWEEPS, complementarity, friction, residuals
from .contact_operator import GAP, GRAINS, conservation, operator
from .contact_pictures import (
    buckling_figure,
    convergence_figure,
    laws_figure,
    limit_figure,
    motion_figure,
    residual_figure,
    sweeps_figure,
)
from .contact_scenes import PRESSURE, STIFF
from .contact_sweeps import convergence, over_bodies, over_stiffness
from .sizes import Size
from .wire_chains import bending, buckling, folding, weighing
from .wire_graphs import SPACING, SPREAD, four_graphs, rigid_limit

__all__ = ["CONTACT"]

Results = Mapping[str, Any]

CLAIMS = (
    Claim(
        28, "T", "The contacts of a step see each other through W = Hᵀ M⁻¹ H.",
        "W symmetric, no negative eigenvalue, equal to its matrix-free product; momentum and angular momentum kept to round-off.",
    ),
    Claim(
        29, "T", "Without friction a step is a linear complementarity problem.",
        "Sweeps that end, pivots and quadratic programs give the same velocities to 1e-8, complementarity checked.",
    ),
    Claim(
        30, "T", "With friction the impulses obey the non-smooth law of sliding.",
        "Natural map below 1e-8 on small problems; solutions solve the cone program of their own slip.",
    ),
    Claim(
        31, "Q", "Gauss–Seidel sweeps over the contacts come to an end.",
        "Every step, over numbers of bodies and stiffnesses of wires, reaches its tolerance.",
    ),
    Claim(
        32, "T", "The four wire laws have their graphs of force against strain.",
        "Links lie on the graphs; the rigid ones are reached as 1/k; wires never push.",
    ),
    Claim(
        33, "T", "Links bend freely and carry nothing across.",
        "No impulse across a link, no moment, and folding costs no energy.",
    ),
    Claim(
        34, "Q", "Even rods make a chain that only pulls: it buckles.",
        "Push at the end of a disturbed chain of three points or more below 1 % of the pull.",
    ),
    Claim(35, "T", "A wire weighs what its beads weigh.", "What moves and what hangs is the sum of the beads, which share equally."),
    Claim(
        36, "Q", "The method moves bodies as mechanics says.",
        "Flight, bounce, onset of sliding, stack, pendulum and hung chain agree with closed forms.",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class _Step:
    """A computation of the part: which claim it is for, and its arguments at a size."""

    claim: int
    function: Callable[..., dict[str, Any]]
    arguments: Callable[[Size], dict[str, Any]]

    def task(self, name: str, size: Size, folder: Path) -> Computation:
        return Computation(name, self.function, folder, self.arguments(size))


RATIOS = [1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5]
STEPS: dict[str, _Step] = {
    "F: operator": _Step(28, operator, lambda s: {"problems": max(2, s.samples // 50), "impulses": s.samples // 4}),
    "F: conservation": _Step(28, conservation, lambda s: {"problems": max(4, s.samples // 50)}),
    "F: complementarity": _Step(29, complementarity, lambda s: {"problems": max(2, s.samples // 66)}),
    "F: friction": _Step(30, friction, lambda s: {"problems": max(2, s.samples // 100)}),
    "F: residuals": _Step(30, residuals, lambda s: {"grains": s.fine_grains, "tolerances": [1e-2, 1e-3, 1e-4, 1e-5]}),
    "F: sweeps over bodies": _Step(
        31, over_bodies,
        lambda s: {"rows": [5, 10, 20, 40, 80], "grains": [s.fine_grains // n for n in (16, 8, 4, 2, 1)], "seeds": 1 + s.fine_seeds},
    ),
    "F: sweeps over stiffness": _Step(
        31, over_stiffness, lambda s: {"ratios": RATIOS, "count": 80, "grains": s.fine_grains // 4, "seeds": 1 + s.fine_seeds}
    ),
    "F: convergence": _Step(31, convergence, lambda s: {"grains": 60, "sweeps": 1000}),
    "F: four graphs": _Step(32, four_graphs, lambda s: {"pairs": min(s.samples, 1000), "chains": max(5, s.samples // 10)}),
    "F: rigid limit": _Step(32, rigid_limit, lambda s: {"chains": max(5, s.samples // 40), "ratios": [1e3, 1e4, 1e5, 1e6]}),
    "F: bending": _Step(33, bending, lambda s: {"chains": max(5, s.samples // 40), "beads": 12}),
    "F: folding": _Step(33, folding, lambda s: {"steps": [50, 100, 200, 400]}),
    "F: buckling": _Step(34, buckling, lambda s: {"counts": [2, 3, 5, 9, 17], "amplitude": 1e-2, "seeds": 1 + s.seeds}),
    "F: weighing": _Step(35, weighing, lambda s: {"chains": max(3, s.samples // 50), "beads": 10}),
    "F: flight and bounce": _Step(36, flight_and_bounce, lambda s: {"restitutions": [0.0, 0.3, 0.8, 1.0]}),
    "F: sliding": _Step(36, sliding, lambda s: {"coefficients": [0.1, 0.4, 1.0]}),
    "F: stack": _Step(36, stack, lambda s: {"count": 6, "ratios": [1.0, 10.0, 100.0, 1000.0]}),
    "F: pendulum": _Step(36, pendulum, lambda s: {"steps": [100, 200, 400, 800, 1600]}),
    "F: catenary": _Step(36, catenary, lambda s: {}),
}  # fmt: skip


_PACKED = {"pressure [Pa]": PRESSURE, "grain radius [mm]": "0.75 to 1.39", "friction": 0.4}
_SOFT = {"k_n and k_t of compliant grains [N/m]": "{normal_stiffness:g} and {tangential_stiffness:g}".format(**STIFF)}
HELD: dict[int, dict[str, Any]] = {  # what is the same at all sizes
    28: _PACKED | {"grains": GRAINS, "gaps [m]": GAP},
    29: _PACKED | _SOFT | {"friction": 0.0, "grains": "30, rigid wires 12", "most sweeps": SWEEPS},
    30: _PACKED | _SOFT | {"friction": "0.2, 0.4, 0.8; packing 0.4", "grains": 6, "beads": 4, "most sweeps": SWEEPS},
    31: _PACKED | _SOFT | {"step of rows [s]": 1e-3, "k of wires in packings over bodies [N]": 10.0},
    32: {"step [s]": 1e-3, "bead mass [kg]": "0.005 to 0.02", "spacing [m]": SPACING},
    33: {"step [s]": 1e-3, "bead mass [kg]": "0.005 to 0.02", "spacing [m]": SPACING},
    34: {
        "step [s]": 1e-3,
        "bead mass [kg]": 1e-3,
        "spacing [m]": SPACING,
        "damping": "inner velocities halved every step",
    },
    35: {"step [s]": 1e-3, "bead mass [kg]": "0.005 to 0.02", "spacing [m]": SPACING},
    36: {"g [m/s²]": G},
}


def _tasks(size: Size, folder: Path, wanted: frozenset[int]) -> list[Task]:
    return [step.task(name, size, folder) for name, step in STEPS.items() if step.claim in wanted]


def _settings(claim: int, size: Size, **more: Any) -> dict[str, Any]:
    """The arguments of all computations of a claim, by computation and name."""
    found = {
        f"{name[3:]}, {key}": value
        for name, step in STEPS.items()
        if step.claim == claim
        for key, value in step.arguments(size).items()
    }
    return HELD[claim] | found | more


def _judge(size: Size, folder: Path, results: Results, wanted: frozenset[int]) -> list[Verdict]:
    verdicts = []
    for claim in CLAIMS:
        if claim.number not in wanted:
            continue
        settings = _settings(claim.number, size, seeds="0, 1, 2, …")
        failed = [
            results[n] for n, s in STEPS.items() if s.claim == claim.number and isinstance(results[n], FenchelError)
        ]
        if failed:
            outcome = FAIL if claim.kind == "T" else UNDECIDED
            needed = "" if outcome == FAIL else "a run that ends"
            verdicts.append(
                Verdict(claim=claim.number, outcome=outcome, sentence=str(failed[0]), settings=settings, needed=needed)
            )
        else:
            verdicts.append(JUDGES[claim.number](results, settings))
    return verdicts


def _pictures(size: Size, folder: Path, results: Results) -> list[Picture]:
    def there(*names: str) -> bool:
        return all(n in results and not isinstance(results[n], FenchelError) for n in names)

    out = []
    if there("F: four graphs"):
        out.append(
            Picture(
                "wire_laws", "Force against strain of single links after one step, with the graphs of the four laws.",
                partial(laws_figure, results["F: four graphs"], 100.0, SPREAD),
                "Fig. 7: schematic graphs of the four laws, rods and wires, rigid and elastic.",
            )
        )  # fmt: skip
    if there("F: convergence"):
        caption = "What is left of the natural map after each Gauss–Seidel sweep, started without impulses."
        out.append(Picture("sweeps_convergence", caption, partial(convergence_figure, results["F: convergence"])))
    if there("F: sweeps over bodies", "F: sweeps over stiffness"):
        caption = (
            "Sweeps of one step (to a relative change of 1e-8 in rows, 1e-4 in packings) against bodies and wire stiffness; "
            "bands: least and largest of the seeds."
        )
        draw = partial(sweeps_figure, results["F: sweeps over bodies"], results["F: sweeps over stiffness"])
        out.append(Picture("sweeps_bodies_stiffness", caption, draw))
    if there("F: residuals"):
        caption = "Natural map of the contacts of a packing against the tolerance at which the sweeps stop."
        out.append(Picture("sweeps_residuals", caption, partial(residual_figure, results["F: residuals"])))
    if there("F: rigid limit") or there("F: folding"):
        caption = (
            "Elastic links against rigid ones as they stiffen; and the energy that a fold costs as steps get shorter."
        )
        parts = [results[n] if there(n) else None for n in ("F: rigid limit", "F: folding")]
        out.append(Picture("wire_limits", caption, partial(limit_figure, *parts)))
    if there("F: buckling"):
        caption = "Chains of elastic rods, pulled and pushed at their ends: more than two points buckle."
        out.append(Picture("wire_buckling", caption, partial(buckling_figure, results["F: buckling"])))
    if there("F: flight and bounce", "F: pendulum", "F: catenary"):
        caption = "Motions in closed form: bounces, a pendulum, a hung chain."
        parts = [results[n] for n in ("F: flight and bounce", "F: pendulum", "F: catenary")]
        out.append(Picture("contact_motions", caption, partial(motion_figure, *parts)))
    return out


CONTACT = Part("F", "Discrete method", CLAIMS, _tasks, _judge, _pictures)
