"""Derivative of the reduced projection at its solution: active faces, multipliers, and the linear system that answers a change.

    z = z^tr − W e,   e = ∇Φ(z) + Σ γ_i ∇f_i(z),   f_A(z) = 0,   or y = f_0(z), γ_0 = Σ C_j y^N_j for the function of the power terms.

With H the Hessian of Φ + Σ γ_i f_i, M = 𝕀 + H W, G = ∇f_A, a change of z^tr, W and of the functions at fixed z, a = dz^tr − dW e,
b = d(∇Φ + Σ γ_i ∇f_i), c = df_A, is answered by (Fiacco 1976, Robinson 1980)

    u = M⁻¹(H a + b),   dγ = (G W M⁻¹ Gᵀ + D⁻¹)⁻¹ (G (a − W u) + c + D⁻¹ dγ|_y),   de = u + M⁻¹ Gᵀ dγ,   dz = a − W de,

D⁻¹ = dy/dγ for the power terms, zero for surfaces. No division by a modulus. The active set is the independent one whose P = ∂e/∂z^tr is
the P of the compiled step, so that stress, tangent and sensitivity speak of one region also on a boundary.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from .parameter_slopes import FunctionSlopes

__all__ = [
    "Change",
    "Faces",
    "Local",
    "answered",
    "face_slope",
    "find_faces",
    "multipliers_of",
    "power_compliance",
    "times",
]

Array = NDArray[np.float64]
NEAR = 1e-6
SAME = 1e-5


def times(left: Array, right: Array) -> Array:
    """left (p, i, j) · right (p or 1, j, k); one right side for all points is one product."""
    if right.shape[0] == 1:
        found = np.ascontiguousarray(left).reshape(-1, left.shape[2]) @ right[0]
        return found.reshape(left.shape[0], left.shape[1], -1)
    return np.matmul(left, right)


@dataclass(frozen=True)
class Local:
    """Functions at the solution, rows of the reduction's own constraints behind the surfaces: `metric` W (L, n, n), `f` (p, m), `normals`
    (L, m, n), `flow` ∇Φ (p, n), `hessian` (p, n, n) or None where nothing is curved; L is 1 or p."""

    metric: Array
    f: Array
    normals: Array
    flow: Array
    hessian: Array | None

    def at(self, rows: Any) -> Local:
        """The same at some of the points."""
        return Local(
            _at(self.metric, rows),
            self.f[rows],
            _at(self.normals, rows),
            self.flow[rows],
            None if self.hessian is None else self.hessian[rows],
        )


def _at(array: Array, rows: Any) -> Array:
    return array if array.shape[0] == 1 else array[rows]


@dataclass(frozen=True)
class Faces:
    """`members[i]` the active rows, `points[i]` where, `gamma` (p, m) all multipliers."""

    members: list[tuple[int, ...]]
    points: list[NDArray[np.int64]]
    gamma: Array


def find_faces(local: Local, answer: Any, smooth: bool, soft: bool, bend: Any) -> Faces:
    """Active sets of a `ReducedAnswer`; `bend(points, γ)` gives the Hessian at multipliers (or None) and D⁻¹ of the power terms (`soft`);
    `smooth` says that Φ is not zero, so that nothing is elastic.

    Raises `ConvergenceError` where none explains the answer.
    """
    e, z, trial, slope = answer.e, answer.z, answer.trial, answer.slope
    count, m = local.f.shape
    gamma, face = np.zeros((count, m)), np.full(count, -1)
    table: list[tuple[int, ...]] = [()]
    still = np.full(count, not smooth) & ~e.any(axis=1) & ~slope.reshape(count, -1).any(axis=1)
    face[still] = 0
    moving = np.flatnonzero(~still)
    if moving.size:
        gram = np.broadcast_to(((local.normals @ local.metric) * local.normals).sum(axis=2), (count, m))
        diagonal = np.broadcast_to(np.diagonal(local.metric, axis1=1, axis2=2), z.shape)
        unit = np.sqrt(np.maximum(diagonal, 0.0))
        scale = np.where(unit > 0.0, 1.0 / np.where(unit > 0.0, unit, 1.0), 0.0)
        size = (np.maximum(np.abs(z), np.abs(trial)) * scale).max(axis=1, initial=0.0)
        near = (np.abs(local.f) <= NEAR * size[:, None] * np.sqrt(np.maximum(gram, 0.0))) & (gram > 0.0)
        if soft:
            near[:, 0] |= (local.f[:, 0] > 0.0) & (gram[:, 0] > 0.0)
        patterns, place = np.unique(near[moving], axis=0, return_inverse=True)
        for number, pattern in enumerate(patterns):
            points = moving[place.reshape(-1) == number]
            _search(np.flatnonzero(pattern), points, local, e, slope, unit, soft, bend, gamma, face, table)
    numbers = np.unique(face)
    return Faces([table[i] for i in numbers], [np.flatnonzero(face == i) for i in numbers], gamma)


def _search(
    near: Any,
    points: Any,
    local: Local,
    e: Array,
    slope: Array,
    unit: Array,
    soft: bool,
    bend: Any,
    gamma: Array,
    face: Any,
    table: list[tuple[int, ...]],
) -> None:
    """Try the subsets of `near` at `points`, large ones first, until each point has one whose P is its own."""
    best = np.full(len(face), np.inf)
    left = points
    for length in range(min(len(near), e.shape[1]), -1, -1):
        for chosen in combinations([int(i) for i in near], length):
            if left.size == 0:
                return
            rows = list(chosen)
            here = local.at(left)
            found, good = multipliers_of(here, rows, e[left])
            size = np.abs(found).max(axis=1, initial=0.0)
            good = good & (found >= -1e-7 * size[:, None]).all(axis=1)
            powers = soft and rows[:1] == [0]
            if powers:
                good = good & (found[:, 0] > 0.0)
            if not good.any():
                continue
            tried, found, here = left[good], found[good], here.at(np.flatnonzero(good))
            full = np.zeros((tried.size, gamma.shape[1]))
            full[:, rows] = found
            hessian, compliance = bend(tried, full)
            here = replace(here, hessian=hessian)
            mine = face_slope(here, rows, compliance if powers else None)
            missed = np.abs((mine - slope[tried]) * unit[tried][:, :, None] * unit[tried][:, None, :])
            wrong = missed.reshape(tried.size, -1).max(axis=1, initial=0.0)
            better = wrong < best[tried]
            if chosen not in table:
                table.append(chosen)
            chosen_points = tried[better]
            best[chosen_points], face[chosen_points] = wrong[better], table.index(chosen)
            gamma[chosen_points] = full[better]
            left = left[~(best[left] <= SAME)]
    if left.size and not (best[left] <= 1e-2).all():
        raise ConvergenceError(
            f"sensitivities: no active set explains the answer of the step at point {int(left[np.argmax(best[left])])}"
        )


def multipliers_of(local: Local, rows: list[int], e: Array) -> tuple[Array, NDArray[np.bool_]]:
    """γ of an independent set from e = ∇Φ + Gᵀγ, and where the set is independent."""
    count = len(e)
    if not rows:
        return np.zeros((count, 0)), np.ones(count, dtype=bool)
    G = local.normals[:, rows]
    across = G @ local.metric
    gram = across @ G.transpose(0, 2, 1)
    root = 1.0 / np.sqrt(np.diagonal(gram, axis1=1, axis2=2))
    unit = gram * root[:, :, None] * root[:, None, :]
    good = np.linalg.eigvalsh(unit)[:, 0] > 1e-11
    unit = np.where(good[:, None, None], unit, np.eye(len(rows)))
    right = np.matmul(across, (e - local.flow)[:, :, None]) * root[:, :, None]
    found = np.linalg.solve(unit, right)[:, :, 0] * root
    return found, np.broadcast_to(good, (count,))


def face_slope(local: Local, rows: list[int], compliance: Array | None = None) -> Array:
    """P of the set (p or 1, n, n); `compliance` D⁻¹ (p,) of its first row, which is then that of the power terms."""
    n = local.metric.shape[1]
    count = max(local.metric.shape[0], local.normals.shape[0])
    if local.hessian is not None or compliance is not None:
        count = len(local.f)
    identity = np.broadcast_to(np.eye(n)[None], (count, n, n))
    change = Change(identity, np.zeros((count, n, n)), np.zeros((count, len(rows), n)), compliance)
    return answered(local, rows, change)[0]


@dataclass(frozen=True)
class Change:
    """a, b (p, n, K) and c (p, active, K) of the module's docstring; `compliance` D⁻¹ (p,) of the first active row, or None."""

    a: Array
    b: Array
    c: Array
    compliance: Array | None = None


def answered(local: Local, rows: list[int], change: Change) -> tuple[Array, Array]:
    """(de, dz), each (p, n, K)."""
    a, b = change.a, change.b
    metric = local.metric
    if local.hessian is None:
        u, bent = b, None
    else:
        bent = np.linalg.inv(np.eye(metric.shape[1]) + local.hessian @ metric)
        u = bent @ (local.hessian @ a + b)
    de = u
    if rows:
        G = local.normals[:, rows]
        turned = G.transpose(0, 2, 1) if bent is None else bent @ G.transpose(0, 2, 1)
        gram = G @ metric @ turned
        if change.compliance is not None:
            gram = np.array(np.broadcast_to(gram, (len(change.compliance), *gram.shape[1:])))
            gram[:, 0, 0] += change.compliance
        right = _into(G, a - _into(metric, u)) + change.c
        de = u + _into(turned, _into(np.asarray(np.linalg.inv(gram), dtype=float), right))
    return de, a - _into(metric, de)


def _into(left: Array, right: Array) -> Array:
    """left (L, i, j) · right (p, j, k)."""
    if left.shape[0] > 1 or right.shape[0] == 1:
        return np.matmul(left, right)
    found = np.zeros((right.shape[0], left.shape[1], right.shape[2]))
    for i, j in zip(*np.nonzero(left[0]), strict=True):
        found[:, i] += left[0, i, j] * right[:, j]
    return found


def power_compliance(gamma: Array, slopes: FunctionSlopes) -> tuple[Array, Array]:
    """(D⁻¹ (p,), D⁻¹ ∂γ/∂θ at fixed y (p, K)) of γ = Σ C_j y^N_j > 0; ln y by Newton's method from the right, where the sum is convex."""
    goal = np.log(gamma)
    one, power = slopes.power_logarithms, slopes.power_exponents
    u = ((goal[:, None] - one) / power).min(axis=1)
    for _ in range(60):
        parts = one + power * u[:, None]
        top = parts.max(axis=1)
        weights = np.exp(parts - top[:, None])
        total = weights.sum(axis=1)
        step = (top + np.log(total) - goal) * total / (power * weights).sum(axis=1)
        u = u - step
        if (np.abs(step) <= 1e-15 * np.maximum(1.0, np.abs(u))).all():
            break
    parts = np.exp(one + power * u[:, None])
    bend = (power * parts).sum(axis=1)
    y = np.exp(u)
    compliance = y / bend
    moved = (parts[:, :, None] * (slopes.logarithms + slopes.exponents * u[:, None, None])).sum(axis=1)
    return compliance, compliance[:, None] * moved
