"""All cones of a program together: projection, its generalised Jacobian V as a spectrum per block, and GᵀF(V)G for functions F of it.

A second-order block has the eigenvalues 1, 0 and r, a semidefinite block six with their tensors, so that GᵀF(V)G is a few updates of
rank one to the Gram matrix of the block, which is made once per program. Three functions are needed:

    PENALTY  τ e                           of the augmented Lagrangian,
    SLOPE    τ e / (1 + δ − e)             of the optimality system with its multipliers eliminated, and
    SPREAD   1 / (1 + δ − e)               of its residuals, δ small.
"""

from __future__ import annotations

import math
from collections import namedtuple

from ..cache import njit
from .cone_projection import ORTHANT, SECOND_ORDER, SEMIDEFINITE, project, semidefinite_parts
from .key import files_hash
from .scalar_terms import POWER_TERM, proximal_step
from .small_cholesky import FAST
from .spectral import eigen

__all__ = ["PENALTY", "SLOPE", "SPREAD", "Cones", "Jacobian", "add_curvature", "apply", "linearise", "project_all"]

PENALTY, SLOPE, SPREAD = range(3)

_FOLDER = files_hash("cone_blocks.py", "cone_projection.py", "scalar_terms.py", "small_cholesky.py", "spectral.py")

# grams (blocks, n, n): GᵀG of the block's rows, without the first row for a second-order cone; Gt = Gᵀ
Cones = namedtuple("Cones", "kinds starts sizes G Gt grams")
# marks: 0 zero, 1 identity, 2 mixed; numbers (blocks, 6) eigenvalues; parts (blocks, 6, 6) eigenvectors, of other than second-order cones
# `raw` (blocks, 3, 3) Jacobians of exponential and power cones before they are taken apart; units (m,) directions of second-order cones
Jacobian = namedtuple("Jacobian", "marks numbers parts raw units work")


@njit(folder=_FOLDER, nogil=True)
def project_all(cones, alphas, betas, tau, v, out, jacobian):
    """Π_{K*}(v) cone by cone, the proximal step for scalar terms; keeps what V needs. Returns the sum of the scalar terms."""
    kinds, starts, sizes = cones.kinds, cones.starts, cones.sizes
    marks, numbers, units = jacobian.marks, jacobian.numbers, jacobian.units
    total = 0.0
    for b in range(kinds.size):
        kind, s, size = kinds[b], starts[b], sizes[b]
        if kind == ORTHANT:
            for i in range(s, s + size):
                out[i] = v[i] if v[i] > 0.0 else 0.0
        elif kind == SECOND_ORDER:
            marks[b], numbers[b, 0] = _second_order(v, s, size, out, units)
        elif kind == SEMIDEFINITE:
            marks[b] = semidefinite_parts(v, s, out, numbers[b], jacobian.parts[b], jacobian.work)
        elif kind >= POWER_TERM:
            out[s], numbers[b, 0], value = proximal_step(kind, alphas[b], betas[b], v[s], tau)
            total += value
        else:
            marks[b] = project(kind, alphas[b], v, s, size, out, jacobian.raw[b], jacobian.work)
    return total


@njit(folder=_FOLDER, nogil=True)
def _second_order(v, s, size, out, unit):
    """Projection of v[s : s + size] = (t, w), w/|w| into `unit`; returns (mark, third eigenvalue of a mixed Jacobian)."""
    t = v[s]
    total = 0.0
    for i in range(s + 1, s + size):
        total += v[i] * v[i]
    if 1e-200 < total < 1e200:
        length = math.sqrt(total)
    else:
        largest = 0.0
        for i in range(s + 1, s + size):
            largest = max(largest, abs(v[i]))
        total = 0.0
        if largest > 0.0:
            for i in range(s + 1, s + size):
                part = v[i] / largest
                total += part * part
        length = largest * math.sqrt(total)
    if length <= t:
        for i in range(s, s + size):
            out[i] = v[i]
        # the tip itself counts as outside
        return (1, 1.0) if t > 0.0 else (0, 0.0)
    if length <= -t:
        for i in range(s, s + size):
            out[i] = 0.0
        return 0, 0.0
    half = 0.5 * (t + length)
    ratio, inverse = half / length, 1.0 / length
    out[s] = half
    for i in range(s + 1, s + size):
        out[i] = ratio * v[i]
        unit[i] = v[i] * inverse
    return 2, ratio


@njit(folder=_FOLDER, nogil=True)
def linearise(cones, jacobian):
    """Take the Jacobians of the exponential and power cones apart, after `project_all`."""
    root = 1.4142135623730951
    kinds, marks, work = cones.kinds, jacobian.marks, jacobian.work
    for b in range(kinds.size):
        if SEMIDEFINITE < kinds[b] < POWER_TERM and marks[b] == 2:
            raw, part = jacobian.raw[b], work[12:18]
            part[0], part[1], part[2] = raw[0, 0], raw[1, 1], raw[2, 2]
            part[3], part[4], part[5] = root * raw[1, 2], root * raw[0, 2], root * raw[0, 1]
            eigen(part, work)
            for k in range(3):
                jacobian.numbers[b, k] = min(max(work[k], 0.0), 1.0)
                for i in range(3):
                    jacobian.parts[b, k, i] = work[3 + 3 * i + k]


@njit(folder=_FOLDER, nogil=True)
def _value(mode, e, tau, delta):
    if mode == PENALTY:
        return tau * e
    below = 1.0 + delta - e
    return tau * e / below if mode == SLOPE else 1.0 / below


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def _add_row(matrix, G, row, weight):
    """matrix += weight g gᵀ, g a row of G."""
    for i in range(matrix.shape[0]):
        x = weight * G[row, i]
        if x != 0.0:
            for j in range(i + 1):
                matrix[i, j] += x * G[row, j]


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def add_curvature(cones, jacobian, v, mode, tau, delta, matrix, one, two):
    """matrix += GᵀF(V)G, lower triangle, F = PENALTY or SLOPE (both vanish at zero); `one`, `two` (n,) are room."""
    n = matrix.shape[0]
    kinds, starts, sizes, G, grams = cones.kinds, cones.starts, cones.sizes, cones.G, cones.grams
    marks, numbers, parts, units = jacobian.marks, jacobian.numbers, jacobian.parts, jacobian.units
    full = _value(mode, 1.0, tau, delta)
    for b in range(kinds.size):
        kind, s, size, mark = kinds[b], starts[b], sizes[b], marks[b]
        if kind == ORTHANT:
            for r in range(s, s + size):
                if v[r] > 0.0:
                    _add_row(matrix, G, r, full)
        elif kind >= POWER_TERM:
            _add_row(matrix, G, s, _value(mode, numbers[b, 0], tau, delta))
        elif mark == 1:
            for i in range(n):
                for j in range(i + 1):
                    matrix[i, j] += full * grams[b, i, j]
            if kind == SECOND_ORDER:
                _add_row(matrix, G, s, full)
        elif mark == 2 and kind == SECOND_ORDER:
            for i in range(n):
                two[i] = 0.0
            for r in range(s + 1, s + size):
                part = units[r]
                for i in range(n):
                    two[i] += part * G[r, i]
            for i in range(n):
                one[i] = G[s, i] + two[i]
            third = _value(mode, numbers[b, 0], tau, delta)
            for i in range(n):
                x, y = 0.5 * full * one[i], third * two[i]
                for j in range(i + 1):
                    matrix[i, j] += third * grams[b, i, j] + x * one[j] - y * two[j]
        elif mark == 2:
            for k in range(size):
                weight = _value(mode, numbers[b, k], tau, delta)
                if weight != 0.0:
                    for i in range(n):
                        one[i] = 0.0
                    for r in range(size):
                        part = parts[b, k, r]
                        for i in range(n):
                            one[i] += part * G[s + r, i]
                    for i in range(n):
                        x = weight * one[i]
                        if x != 0.0:
                            for j in range(i + 1):
                                matrix[i, j] += x * one[j]


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def apply(cones, jacobian, v, mode, tau, delta, given, out):
    """out = F(V) given."""
    kinds, starts, sizes = cones.kinds, cones.starts, cones.sizes
    marks, numbers, parts, units = jacobian.marks, jacobian.numbers, jacobian.parts, jacobian.units
    full, none = _value(mode, 1.0, tau, delta), _value(mode, 0.0, tau, delta)
    for b in range(kinds.size):
        kind, s, size, mark = kinds[b], starts[b], sizes[b], marks[b]
        if kind == ORTHANT:
            for i in range(s, s + size):
                out[i] = (full if v[i] > 0.0 else none) * given[i]
        elif kind >= POWER_TERM:
            out[s] = _value(mode, numbers[b, 0], tau, delta) * given[s]
        elif mark < 2:
            weight = full if mark == 1 else none
            for i in range(s, s + size):
                out[i] = weight * given[i]
        elif kind == SECOND_ORDER:
            along = 0.0
            for i in range(s + 1, s + size):
                along += units[i] * given[i]
            third = _value(mode, numbers[b, 0], tau, delta)
            up, down = 0.5 * full * (given[s] + along), 0.5 * none * (given[s] - along)
            out[s] = up + down
            rest = up - down - third * along
            for i in range(s + 1, s + size):
                out[i] = third * given[i] + rest * units[i]
        else:
            for i in range(s, s + size):
                out[i] = none * given[i]
            for k in range(size):
                e = numbers[b, k]
                if e != 0.0:
                    along = 0.0
                    for i in range(size):
                        along += parts[b, k, i] * given[s + i]
                    along *= _value(mode, e, tau, delta) - none
                    for i in range(size):
                        out[s + i] += along * parts[b, k, i]
