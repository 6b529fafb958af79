"""Claim 16: the tangent of a step is the derivative of its stress, and Newton's method on a body converges quadratically with it.

Central differences of order eight are taken with two widths; where these disagree a kink of the step lies between, and the point
says nothing. On a body the residuals r_k of one long step are followed; of a quadratic method log r_{k+1}/log r_k tends to two
in the units of its constant, so that the order is read off the last three above rounding, log(r_3/r_2)/log(r_2/r_1), and r_3 is
compared with r_2².
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..potentials.library import ENTRIES, Entry
from .formulation_states import IDENTITY, corners, difference, magnitude, warmth

__all__ = ["tangents"]

BODIES = ("sand", "texsol")


def _law(entry: Entry, rng: np.random.Generator, n: int) -> dict[str, float]:
    """The tangent of compiled steps from different states against differences of the stress, over the largest stiffness."""
    law, dt, size = entry.law, entry.worked.dt, magnitude(entry)
    update, values = law.compile(), dict(entry.values) | warmth(law)
    strains = corners(entry, rng, n, 1)
    third = n // 3
    strains[:third] += rng.normal(size=(third, 1)) * np.abs(strains).max() * IDENTITY
    state = update(0.4 * corners(entry, rng, n, 1), None, dt, **values).state
    tangent = update(strains, state, dt, **values).tangent
    stiff = float(np.abs(tangent).max())

    def columns(width: float) -> Any:
        found = [
            difference(lambda t, d=d: update(strains + t * d, state, dt, **values).stress, width)
            for d in 1e-4 * size * np.eye(6)
        ]
        return np.stack(found, axis=-1) / (1e-4 * size)

    wide, narrow = columns(0.25), columns(0.125)
    smooth = np.abs(wide - narrow).max(axis=(1, 2)) <= 1e-7 * stiff
    transposed = np.swapaxes(tangent, 1, 2)
    return {
        "difference": float(np.abs(narrow - tangent)[smooth].max(initial=0.0) / stiff),
        "smooth": float(smooth.mean()),
        "asymmetry": float(np.abs(tangent - transposed).max() / stiff),
        "negative": float(-np.linalg.eigvalsh((tangent + transposed) / 2).min() / stiff),
    }


def _body(entry: Entry, cells: int, shortening: float) -> dict[str, Any]:
    """Residuals of Newton's method for a cylinder that is crushed between rough platens in one step."""
    from ..integrators.fe import Body, Support, cylinder_section, solve

    body = Body(
        cylinder_section(0.5, 1.0, cells, cells), entry.law.compile(), entry.values, "axisymmetric", "Q1", "selective"
    )
    supports = [
        Support("axis", x=0.0),
        Support("bottom", x=0.0, y=0.0),
        Support("top", x=0.0, y=lambda t: -shortening * t),
    ]
    state = solve(body, [0.0, 1.0], supports, tolerance=1e-12)[-1]
    above = np.array([r for r in state.residuals if r > 1e-13])
    steps = np.log(above[1:] / above[:-1])
    return {
        "order": float(steps[-1] / steps[-2]),
        "constant": float(above[-1] / above[-2] ** 2),
        "plastic": float((state.dissipation > 0.0).mean()),
        "residuals": np.array(state.residuals),
    }


def tangents(seed: int, count: int, cells: int, shortening: float) -> dict[str, Any]:
    """Claim 16 at `count` steps of every law, and on a body of `cells`² elements shortened by `shortening` in one step."""
    rng = np.random.default_rng(seed)
    laws = {name: _law(entry, rng, count) for name, entry in ENTRIES.items()}
    bodies = {name: _body(ENTRIES[name], cells, shortening) for name in BODIES}
    numbers = {key: max(f[key] for f in laws.values()) for key in ("difference", "asymmetry", "negative")}
    numbers |= {
        "smooth": min(f["smooth"] for f in laws.values()),
        "order": min(b["order"] for b in bodies.values()),
        "constant": max(b["constant"] for b in bodies.values()),
        "plastic": min(b["plastic"] for b in bodies.values()),
        "laws": len(laws),
        "steps": count,
    }
    return {"numbers": numbers, "by law": laws, "bodies": bodies}
