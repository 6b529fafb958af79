"""Random one-step contact problems of several kinds, each a function of its seed: lattices of spheres, towers of boxes, grooves, dense W.

`solvable` tells whether a solution is known to exist: q = w + Hᵀ(free velocities) with w ≥ 0 gaps, or no gap driven shut (then r with
W r + q in K* exists).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from contact_families import boxes, spheres, wedge

KINDS = ("spheres", "boxes", "wedge", "dense")


def friction(rng: np.random.Generator) -> float:
    """From none to μ = 1.5, most of it between 0.1 and 1."""
    return float(
        rng.choice([0.0, rng.uniform(0.05, 0.6), rng.uniform(0.3, 1.0), rng.uniform(1.0, 1.5)], p=[0.1, 0.5, 0.3, 0.1])
    )


def random_contacts(seed: int) -> tuple[str, dict[str, Any]]:
    """(what it is, keywords of `OneStepProblem.of_bodies` or of `OneStepProblem.local`)."""
    rng = np.random.default_rng([seed, 7])
    kind = KINDS[int(rng.choice(4, p=[0.55, 0.25, 0.05, 0.15]))]
    mu = friction(rng)
    if kind == "spheres":
        side, ratio = int(rng.integers(2, 7)), float(10.0 ** (4 * rng.random() if rng.random() < 0.3 else 0.0))
        found = spheres(seed, side, mu=mu, mass_ratio=ratio, gravity=float(10.0 ** rng.uniform(-3, -1)))
        return f"spheres {side}³, mu {mu:.2f}, mass ratio {ratio:.0f}", found
    if kind == "boxes":
        levels, ratio = int(rng.integers(1, 21)), float(10.0 ** (2 * rng.random() if rng.random() < 0.3 else 0.0))
        push = float(rng.uniform(0.0, 1.0))
        return f"boxes {levels}, mu {mu:.2f}, push {push:.2f}", boxes(levels, mu=mu, push=push, mass_ratio=ratio)
    if kind == "wedge":
        return f"wedge, mu {mu:.2f}", wedge(mu)
    n = int(rng.integers(1, 41))
    rank = int(rng.integers(max(1, n), 3 * n + 1))
    a = rng.normal(size=(3 * n, rank)) / np.sqrt(rank)
    free = rng.normal(size=rank)
    # q in the range of W: driven by free velocities, as in mechanics
    return f"dense {n}, rank {rank}, mu {mu:.2f}", {"delassus": a @ a.T, "q": a @ free, "mu": np.full(n, mu)}


def problem(seed: int) -> tuple[str, Any]:
    """(what it is, the problem)."""
    from fenchel.dem.one_step import OneStepProblem

    what, given = random_contacts(seed)
    make = OneStepProblem.local if "delassus" in given else OneStepProblem.of_bodies
    return what, make(**given)
