"""Exponential and power cones with one constant and one costed entry, written as scalar terms: fewer unknowns, and no flat cone.

    x ≥ kᵃ⁻¹… : c·x over {xᵃ k¹⁻ᵃ ≥ |z|}   = C |z|^(1/a)          c·z over {k exp(x/k) ≤ z}      = c k exp(x/k)
    −c·x over {k exp(x/k) ≤ z}             = −c k ln(z/k)         c·y over the dual exponential   = c (r ln(r/k) − r), r = −x

The costed entry is an unknown of its own that meets nothing else; it goes, with two of the three rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .canonical import Cone
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, POWER, POWER_DUAL
from .scalar_terms import ENTROPY_TERM, EXPONENTIAL_TERM, LOGARITHM_TERM, POWER_TERM
from .step_program import StepProgram

__all__ = ["Compact", "compact"]


@dataclass(frozen=True)
class Compact:
    """`program` with scalar terms, and which unknowns and rows of the conic program it keeps."""

    program: StepProgram
    unknowns: NDArray[np.int64]
    rows: NDArray[np.int64]


def compact(program: StepProgram) -> Compact:
    """Replace every cone that can be a scalar term."""
    keep_unknown = np.ones(program.p.size, dtype=bool)
    rows: list[int] = []
    cones: list[Cone] = []
    start = 0
    for cone in program.cones:
        place = list(range(start, start + cone.size))
        start += cone.size
        found = _term(program, cone, place) if cone.kind in (EXPONENTIAL, EXPONENTIAL_DUAL, POWER, POWER_DUAL) else None
        if found is None:
            rows += place
            cones.append(cone)
        else:
            term, unknown, row = found
            keep_unknown[unknown] = False
            rows.append(row)
            cones.append(term)
    kept, chosen = np.flatnonzero(keep_unknown), np.array(rows, dtype=np.int64)
    small = replace(
        program,
        p=program.p[kept],
        G=np.ascontiguousarray(program.G[np.ix_(chosen, kept)]),
        q0=program.q0[kept],
        q1=np.ascontiguousarray(program.q1[kept]),
        h0=program.h0[chosen],
        h1=np.ascontiguousarray(program.h1[chosen]),
        cones=tuple(cones),
        increment_y=program.increment_y[:, kept],
    )
    return Compact(small, kept, chosen)


def _term(program: StepProgram, cone: Cone, place: list[int]) -> tuple[Cone, int, int] | None:
    """(term, unknown that goes, row that stays)."""
    G = program.G
    exponential = cone.kind in (EXPONENTIAL, EXPONENTIAL_DUAL)
    fixed = [r for r in place if not G[r].any() and not program.h1[r].any() and program.h0[r] > 0.0]
    if len(fixed) != 1 or fixed[0] == place[0 if exponential else 2]:
        return None
    for moved in place:
        entries = np.flatnonzero(G[moved])
        if moved == fixed[0] or entries.size != 1 or (not exponential and moved == place[2]):
            continue
        j = int(entries[0])
        alone = np.count_nonzero(G[:, j]) == 1 and not program.q1[j].any() and not program.increment_y[:, j].any()
        if not alone or program.p[j] != 0.0 or program.h0[moved] != 0.0 or program.h1[moved].any():
            continue
        # the entry is −G y, so its cost per unit is −q/G
        cost, k = -float(program.q0[j]) / float(G[moved, j]), float(program.h0[fixed[0]])
        row = next(r for r in place if r not in (moved, fixed[0]))
        return _scalar(cone, place, moved, fixed[0], row, cost, k, j)
    return None


def _scalar(
    cone: Cone, place: list[int], moved: int, fixed: int, row: int, cost: float, k: float, unknown: int
) -> tuple[Cone, int, int] | None:
    if cone.kind in (POWER, POWER_DUAL):
        if cost <= 0.0:
            return None
        weight = cone.alpha if moved == place[0] else 1.0 - cone.alpha
        if cone.kind == POWER_DUAL:
            cost, k = cost * weight, k / (1.0 - weight)
        factor = math.log(cost) - (1.0 - weight) / weight * math.log(k)
        if abs(factor) > 600.0:
            return None
        return Cone(POWER_TERM, 1, math.exp(factor), 1.0 / weight), unknown, row
    if cone.kind == EXPONENTIAL and fixed == place[1]:
        if moved == place[2] and cost > 0.0:
            return Cone(EXPONENTIAL_TERM, 1, cost * k, k), unknown, row
        if moved == place[0] and cost < 0.0:
            return Cone(LOGARITHM_TERM, 1, -cost * k, 0.0), unknown, row
    if cone.kind == EXPONENTIAL_DUAL and fixed == place[2] and moved == place[1] and cost > 0.0:
        return Cone(ENTROPY_TERM, 1, cost, k), unknown, row
    return None
