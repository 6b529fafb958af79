"""Crushing of a cylinder (Figs. 4 and 5 of the study): axial shortening between platens, maps of the wire phase.

Axisymmetric linear quadrilaterals, 20 × 20 = 400 of them in the study. Rough platens hold the ends radially; between smooth ones the
fields are uniform. The strain fields of the three models differ, so that the bounds that hold at equal strain are findings here, not
theorems.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .models import equivalent_stress, wire_stress

__all__ = ["CrushingTest", "WireMap", "crush"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CrushingTest:
    """`diameter` and `height` [m], `columns` along the radius, `rows` along the height, `shortening` [-], `steps`, `rough` platens,
    `integration` "full" or "selective" (see `fenchel.integrators.fe.Body`)."""

    diameter: float = 0.1
    height: float = 0.2
    columns: int = 20
    rows: int = 20
    shortening: float = 1e-3
    steps: int = 10
    rough: bool = True
    integration: str = "selective"

    def __post_init__(self) -> None:
        if not (self.diameter > 0 and self.height > 0 and 0 < self.shortening < 0.2 and self.steps >= 1):
            raise InputError(
                "crushing test: diameter, height and shortening (below 0.2) must be positive, and at least 1 step"
            )


@dataclass(frozen=True)
class WireMap:
    """At the quadrature points: `points` (n, 2) r and z [m], `weights` [m³], wire `pressure` −tr σ_w/3 and `equivalent` √J₂ [Pa], `strain`
    (n, 6); after each step `force` [N] on the platen, `lowest` and `highest` wire pressure [Pa]; `body` and final `state`."""

    points: Array
    weights: Array
    pressure: Array
    equivalent: Array
    strain: Array
    force: Array
    lowest: Array
    highest: Array
    body: Any
    state: Any


def crush(model: str, update: Any, values: Mapping[str, float], test: CrushingTest | None = None) -> WireMap:
    """Run the test with a compiled `update` of the model ("sand", "reinforced" or "texsol") and its values; one compiled for
    "axisymmetric" does it in half the time."""
    from ..integrators.fe import Body, Support, cylinder_section, solve

    test = test or CrushingTest()
    mesh = cylinder_section(test.diameter / 2, test.height, test.columns, test.rows)
    body = Body(mesh, update, values, "axisymmetric", "Q1", test.integration)
    radial = 0.0 if test.rough else None
    supports = [
        Support("axis", x=0.0),
        Support("bottom", x=radial, y=0.0),
        Support("top", x=radial, y=lambda t: -test.shortening * test.height * t),
    ]
    states = solve(body, np.linspace(0.0, 1.0, test.steps + 1), supports)
    top = body.basis.get_dofs("top").all(["u^2"])
    stresses = [wire_stress(model, body.whole(s.strain), values) for s in states]
    pressures = [-stress[:, :3].mean(axis=1) for stress in stresses]
    return WireMap(
        body.points,
        body.weights,
        pressures[-1],
        equivalent_stress(stresses[-1]),
        body.whole(states[-1].strain),
        np.array([-s.force[top].sum() for s in states]),
        np.array([p.min() for p in pressures]),
        np.array([p.max() for p in pressures]),
        body,
        states[-1],
    )
