"""Strategies of hypothesis on the pieces of the search for failures: laws, values, states, scenes, contact problems.

A law is drawn by its seed, since its pieces depend on one another; what can be chosen apart (size and shape of strains, friction, scale,
solver) is, so that a failing example shrinks to the plainest of these.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from fuzz.contacts import NAMES, random_problem
from fuzz.scenes import random_scene
from hypothesis import strategies as st
from random_laws import RandomLaw, random_law

__all__ = ["contact_problems", "law_values", "laws", "scenes", "states"]

SEEDS = st.integers(0, 10_000)


def laws(*, extreme: bool = False) -> st.SearchStrategy[RandomLaw]:
    """Random admissible laws with values."""
    return SEEDS.map(lambda seed: random_law(np.random.default_rng(seed), extreme=extreme))


def law_values(drawn: RandomLaw, decades: float = 1.0) -> st.SearchStrategy[dict[str, float]]:
    """Values of the same law, each within `decades` of its own, within its bounds; zero stays zero."""
    table: dict[str, Any] = {}
    for symbol in drawn.law.parameters:
        value = drawn.values[symbol.name]
        fixed = value <= 0.0 or np.isfinite(symbol.upper) or symbol.name in ("T_0", "n", "n_h")
        scale = st.just(1.0) if fixed else st.floats(-decades, decades, width=16).map(lambda x: 10.0**x)
        table[symbol.name] = scale.map(lambda s, value=value: s * value)
    return st.fixed_dictionaries(table)


@st.composite
def states(draw: Any, drawn: RandomLaw, points: int = 4) -> np.ndarray:
    """Strains (points, 6): small whole numbers of yield strains times a power of ten, so that axes and equal values turn up often."""
    whole = st.lists(st.integers(-3, 3), min_size=6, max_size=6)
    rows = draw(st.lists(whole, min_size=points, max_size=points))
    size = 10.0 ** draw(st.integers(-3, 3))
    return np.array(rows, dtype=float) * size * drawn.strain


def scenes() -> st.SearchStrategy[dict[str, Any]]:
    """Valid scenes of a few bodies, as nested dictionaries."""
    return SEEDS.map(lambda seed: random_scene(np.random.default_rng(seed)))


@st.composite
def contact_problems(draw: Any) -> dict[str, Any]:
    """A problem as `fuzz.contacts` draws them, with solver, tolerance and scales chosen apart."""
    kind, W, q, mu = random_problem(np.random.default_rng(draw(SEEDS)))
    friction = draw(st.sampled_from([None, 0.0, 0.3, 1.0, 100.0]))
    return {
        "kind": kind, "W": W * 10.0 ** draw(st.integers(-6, 6)), "q": q * 10.0 ** draw(st.integers(-6, 6)),
        "mu": mu if friction is None else np.full(len(mu), friction), "solver": draw(st.sampled_from(NAMES)), "start": None,
        "tolerance": 10.0 ** draw(st.integers(-12, -3)), "keep": draw(st.booleans()),
    }  # fmt: skip
