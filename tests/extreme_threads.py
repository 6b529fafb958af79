"""Order of summation: threads over points, threads over contact sweeps, contacts in another order under the sums of homogenisation.

Bounds, stated before any run:

* points know nothing of each other: no bit changes with the number of threads, with any method of the step;
* sweeps in as many parts as threads: no bit changes from run to run with the same number; between numbers velocities agree to what the
  solver was asked for. NLGS stops at a relative change of 1e-10 of the impulses and converges by at least a hundredth a sweep here, so that
  its error is at most a hundred times as large: 1e-8 of the largest impulse, over a mass. Grains are compliant, so that the answer is one;
* a sum of n terms in any order is right to n ε Σ|terms|; the truth is the sum in extended precision.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from awkward_states import increments
from extreme_rows import Cell, Measured, near, nothing_but

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.homogenise import moments
from fenchel.dem.laws import CompliantSignoriniCoulomb
from fenchel.potentials.library import ENTRIES

EPS = float(np.finfo(float).eps)
DOWN = Drive(gravity=np.array([0.0, 0.0, -9.81]))


def points(law: str, threads: int) -> Measured:
    """3001 awkward increments (600 through the general engine), shared by `threads`, against one thread."""
    entry, values = ENTRIES[law], dict(ENTRIES[law].values)
    general = law == "kelvin_voigt"
    count = 600 if general else 3001
    eps = increments("linear_elastic" if general else law, values, np.random.default_rng(4), count)
    one, many = (entry.law.compile(threads=k)(eps, None, **values) for k in (1, threads))
    pairs = [("stress", one.stress, many.stress), ("tangent", one.tangent, many.tangent)]
    pairs += [("dissipation", one.dissipation, many.dissipation)]
    pairs += [(name, one.state[name], many.state[name]) for name in one.state]
    return {f"bits of {name}": (float((a != b).sum()), 0.0) for name, a, b in pairs}


LAW = CompliantSignoriniCoulomb(friction=0.5, k_n=5e4, k_t=4e4)


def pile(threads: int) -> Simulation:
    """200 compliant spheres in a corner after six steps."""
    rng = np.random.default_rng(2)
    grid = np.array([(i, j, k) for k in range(8) for j in range(5) for i in range(5)], dtype=float)
    x = 0.0199 * grid + 0.0099 + 1e-4 * rng.uniform(-1, 1, (200, 3))
    a = Assembly.of_spheres(x, np.full(200, 0.01), np.full(200, 0.01))
    planes = [
        Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5),
        *(Plane(normal=n, point=p) for n, p in (((1, 0, 0), (0, 0, 0)), ((-1, 0, 0), (0.1, 0, 0)))),
        *(Plane(normal=n, point=p) for n, p in (((0, 1, 0), (0, 0, 0)), ((0, -1, 0), (0, 0.1, 0)))),
    ]
    solver = Solver(tolerance=1e-10, sweep_limit=20_000)
    simulation = Simulation(a, Laws(contact=LAW), solver, planes=planes, threads=threads)
    for _ in range(6):
        simulation.advance(2e-4, DOWN)
    return simulation


@cache
def answer(threads: int) -> tuple[Any, Any, Any]:
    a = pile(threads).assembly
    return a.x.copy(), a.velocity.copy(), a.pair_impulse.copy()


def again(threads: int) -> Measured:
    """The same scene twice with the same number of threads."""
    one, two = answer(threads), pile(threads).assembly
    arrays = zip(("places", "velocities", "impulses"), one, (two.x, two.velocity, two.pair_impulse), strict=True)
    return {f"bits of {name}": (float((a != b).sum()), 0.0) for name, a, b in arrays}


def other_number(threads: int) -> Measured:
    """The same scene with one thread."""
    one, many = answer(1), answer(threads)
    allowed = 6 * 1e-8 * float(np.abs(one[2]).max()) / 0.01
    return {
        "velocity [m/s]": near(many[1], one[1], abs=allowed),
        "place [m]": near(many[0], one[0], abs=6 * 2e-4 * allowed),
    }


def contacts_in_order(order: str) -> Measured:
    """Internal moments Σ f ⊗ ℓ of the box with the contacts of the pile in another order, against extended precision."""
    simulation = pile(1)
    rows, a = simulation.contacts, simulation.assembly
    assert rows is not None
    count = len(rows.pair)
    strength = np.linalg.norm(rows.impulse, axis=1)
    places = {
        "reversed": np.arange(count)[::-1],
        "shuffled": np.random.default_rng(8).permutation(count),
        "weakest first": np.argsort(strength),
        "strongest first": np.argsort(-strength),
    }[order]
    turned = replace(rows, pair=rows.pair[places], row=rows.row[places], cold=rows.cold[places])
    none = {k: getattr(rows, k)[:0] for k in ("touching", "touching_row", "touching_cold", "touching_candidate")}
    turned = replace(turned, candidate=rows.candidate[places], **none)
    found = moments(a, turned, 0.05)[0, 8]
    wide = np.longdouble
    branch = rows.x[rows.pair[:, 0]].astype(wide) - rows.x[rows.pair[:, 1]].astype(wide)
    terms = -np.einsum("ni,nj->nij", rows.impulse.astype(wide) / wide(rows.step), branch)
    truth, size = terms.sum(axis=0), np.abs(terms).sum(axis=0)
    # 2 n terms of two bodies each; the contact point is the middle of the gap, so that the branches add up to the distance of centres
    return {
        "moment [J]": near(found, truth, abs=2 * count * EPS * size.astype(float)),
        "more than a hundred contacts": nothing_but(int((strength > 0).sum()) > 100),
    }


METHODS = (
    ("texsol", "closed"), ("cam_clay", "reduced"), ("mohr_coulomb", "principal"), ("kelvin_voigt", "general engine"),
)  # fmt: skip
CELLS: list[Cell] = [
    *(
        Cell("threads over points", f"{k}, {method}", lambda law=law, k=k: points(law, k))
        for law, method in METHODS
        for k in (2, 3, 8)
    ),
    *(Cell("threads over contacts", f"{k}, run again", lambda k=k: again(k)) for k in (1, 2, 3)),
    *(Cell("threads over contacts", f"{k} against 1", lambda k=k: other_number(k)) for k in (2, 3)),
    *(
        Cell("order of the contacts", order, lambda order=order: contacts_in_order(order))
        for order in ("reversed", "shuffled", "weakest first", "strongest first")
    ),
]
