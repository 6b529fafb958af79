"""A smaller program with the same solution: scalar terms for cones, fewer rows, fewer unknowns.

Exponential and power cones with one constant and one costed entry are scalar terms: fewer unknowns, and no flat cone.

    x ≥ kᵃ⁻¹… : c·x over {xᵃ k¹⁻ᵃ ≥ |z|}   = C |z|^(1/a)          c·z over {k exp(x/k) ≤ z}      = c k exp(x/k)
    −c·x over {k exp(x/k) ≤ z}             = −c k ln(z/k)         c·y over the dual exponential   = c (r ln(r/k) − r), r = −x

The costed entry is an unknown of its own that meets nothing else; it goes, with two of the three rows. Then rows go that say t ≥ 0 of
a second-order cone |w| ≤ t once more, since their multipliers would not be unique; w is written in a basis of the values that it can
have; and unknowns without cost go that could only lengthen such a w.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .canonical import Cone
from .cone_projection import EXPONENTIAL, EXPONENTIAL_DUAL, ORTHANT, POWER, POWER_DUAL, SECOND_ORDER
from .scalar_terms import ENTROPY_TERM, EXPONENTIAL_TERM, LOGARITHM_TERM, POWER_TERM
from .step_program import StepProgram

__all__ = ["Compact", "compact"]

NOISE = 1e-12


@dataclass(frozen=True)
class Compact:
    """`program` with scalar terms, and the maps `unknowns` (n′, n), `rows` (m′, m) of the conic program's unknowns and multipliers to
    its own."""

    program: StepProgram
    unknowns: NDArray[np.float64]
    rows: NDArray[np.float64]

    @classmethod
    def whole(cls, program: StepProgram) -> Compact:
        """The form that leaves everything as it is."""
        return cls(program, np.eye(program.p.size), np.eye(program.h0.size))

    def start(self, y: NDArray[np.float64], multipliers: NDArray[np.float64]) -> tuple[Any, Any]:
        """Unknowns and multipliers (N, ·) of the conic program as those of the compact one."""
        return y @ self.unknowns.T, multipliers @ self.rows.T


def compact(program: StepProgram) -> Compact:
    """Replace every cone that can be a scalar term, then drop what repeats."""
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
    select = np.zeros((chosen.size, program.h0.size))
    select[np.arange(chosen.size), chosen] = 1.0
    small, rows_map = _fewer_rows(small)
    columns = _useful_unknowns(small)
    if columns.shape[1] < columns.shape[0]:
        small = replace(
            small,
            p=columns.T**2 @ small.p,
            G=np.ascontiguousarray(small.G @ columns),
            q0=columns.T @ small.q0,
            q1=np.ascontiguousarray(columns.T @ small.q1),
            increment_y=small.increment_y @ columns,
        )
        small, more = _fewer_rows(small)
        rows_map = more @ rows_map
    else:
        columns = np.eye(kept.size)
    unknowns = np.zeros((columns.shape[1], program.p.size))
    unknowns[:, kept] = columns.T
    return Compact(small, unknowns, rows_map @ select)


def _fewer_rows(program: StepProgram) -> tuple[StepProgram, NDArray[np.float64]]:
    """Rows of orthants go that follow from others and from t ≥ 0 of second-order cones, each w in a basis of its values; with the map of
    the rows, as multipliers follow it."""
    right = np.hstack([program.h0[:, None], program.h1])
    size = np.abs(right).max(axis=0, initial=0.0)
    # columns of G have unit size by construction; what the right side has, is measured by itself
    whole = np.hstack([program.G, right / np.where(size > 0.0, size, 1.0)])
    blocks: list[NDArray[np.float64]] = []
    cones: list[Cone] = []
    tips: list[int] = []
    start = 0
    for cone in program.cones:
        if cone.kind == SECOND_ORDER:
            tips.append(start)
        start += cone.size
    start, count = 0, program.h0.size
    carried: list[tuple[int, int, float]] = []
    left = np.concatenate(
        [np.arange(a, a + c.size) for a, c in zip(_starts(program), program.cones, strict=True) if c.kind == ORTHANT]
        or [[]]
    )
    left = left.astype(np.int64)
    for cone in program.cones:
        place = np.arange(start, start + cone.size)
        start += cone.size
        if cone.kind == ORTHANT:
            keep = []
            for r in place:
                others = [*tips, *left[left != r]]
                weights = _weights(whole[r], whole[others])
                if weights is None:
                    keep.append(r)
                else:
                    left = left[left != r]
                    carried += [(t, int(r), c) for t, c in zip(others, weights, strict=True) if c > 0.0]
            if keep:
                blocks.append(np.eye(count)[keep])
                cones.append(replace(cone, size=len(keep)))
        elif cone.kind == SECOND_ORDER:
            u, s, _ = np.linalg.svd(whole[place[1:]], full_matrices=False)
            rank = int((s > NOISE * s.max(initial=0.0)).sum())
            part = np.eye(count)[place]
            if 0 < rank < cone.size - 1:
                part = np.vstack([part[:1], u[:, :rank].T @ part[1:]])
            blocks.append(part)
            cones.append(replace(cone, size=len(part)))
        else:
            blocks.append(np.eye(count)[place])
            cones.append(cone)
    if not blocks:
        return program, np.zeros((0, count))
    maps = np.vstack(blocks)
    small = replace(
        program,
        G=np.ascontiguousarray(maps @ program.G),
        h0=maps @ program.h0,
        h1=np.ascontiguousarray(maps @ program.h1),
        cones=tuple(cones),
    )
    multipliers = maps.copy()
    for target, row, factor in carried:
        # the multiplier of a row that went acts along the row that stays
        multipliers[:, row] += factor * maps[:, target]
    return small, multipliers


def _starts(program: StepProgram) -> list[int]:
    return [int(a) for a in np.cumsum([0, *(c.size for c in program.cones)])[:-1]]


def _weights(row: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """c ≥ 0 with row = Σ c_j others_j, or None."""
    from scipy.optimize import nnls

    if not len(others):
        return None
    weights, missed = nnls(others.T, row)
    return weights if missed <= NOISE * np.abs(row).max() else None


def _useful_unknowns(program: StepProgram) -> NDArray[np.float64]:
    """Orthonormal columns B, y = B y′: all unknowns but directions without cost and effect that lie in the w of one second-order cone,
    square to all else that w can be. They could only lengthen w, so that zero is right for them."""
    idle = program.p == 0.0
    for effect in (program.q0[:, None], program.q1, program.increment_y.T):
        size = np.abs(effect).max(axis=1, initial=0.0)
        idle &= size <= NOISE * size.max(initial=0.0)
    right = np.hstack([program.h0[:, None], program.h1])
    size = np.abs(right).max(axis=0, initial=0.0)
    others = np.hstack([program.G[:, ~idle], right / np.where(size > 0.0, size, 1.0)])
    basis = np.eye(int(idle.sum()))
    for start, cone in zip(_starts(program), program.cones, strict=True):
        if cone.kind != SECOND_ORDER or not basis.shape[1]:
            continue
        inside = np.zeros(program.h0.size, dtype=bool)
        inside[start + 1 : start + cone.size] = True
        images = program.G[:, idle] @ basis
        within = _null_space(images[~inside])
        rest = np.hstack([others[inside], images[inside] @ _null_space(within.T)])
        alone = within @ _null_space(rest.T @ images[inside] @ within)
        basis = basis @ _null_space(alone.T)
    columns = np.zeros((program.p.size, int((~idle).sum()) + basis.shape[1]))
    columns[np.flatnonzero(~idle), np.arange(int((~idle).sum()))] = 1.0
    columns[idle, int((~idle).sum()) :] = basis
    return columns


def _null_space(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal columns that the matrix, whose entries are of unit size, sends to zero."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, s, vt = np.linalg.svd(matrix)
    found = vt[int((s > NOISE).sum()) :].T
    return np.where(np.abs(found) < 1e-14, 0.0, found)


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
