"""All cones of a program together: projection, its generalised Jacobian V as a spectrum per block, and GᵀF(V)G for functions F of it.

A second-order block has the eigenvalues 1, 0 and r, a semidefinite block six with their tensors, so that GᵀF(V)G is a few updates of rank one
to the Gram matrix of the block, which is made once per program. Three functions are needed:

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
    total = 0.0
    for b in range(cones.kinds.size):
        kind, s, size = cones.kinds[b], cones.starts[b], cones.sizes[b]
        if kind == ORTHANT:
            given, image = v[s : s + size], out[s : s + size]
            for i in range(size):
                image[i] = given[i] if given[i] > 0.0 else 0.0
        elif kind == SECOND_ORDER:
            jacobian.marks[b] = _second_order(v[s : s + size], out[s : s + size], jacobian.units[s : s + size], jacobian.numbers[b])
        elif kind == SEMIDEFINITE:
            jacobian.marks[b] = semidefinite_parts(v, s, out, jacobian.numbers[b], jacobian.parts[b], jacobian.work)
        elif kind >= POWER_TERM:
            out[s], jacobian.numbers[b, 0], value = proximal_step(kind, alphas[b], betas[b], v[s], tau)
            total += value
        else:
            jacobian.marks[b] = project(kind, alphas[b], v, s, size, out, jacobian.raw[b], jacobian.work)
    return total


@njit(folder=_FOLDER, nogil=True)
def _second_order(v, out, unit, numbers):
    """Projection of v = (t, w); with a mixed Jacobian w/|w| in unit[1:] and the third eigenvalue in numbers[0]."""
    size = v.size
    t = v[0]
    total = 0.0
    for i in range(1, size):
        total += v[i] * v[i]
    if 1e-200 < total < 1e200:
        length = math.sqrt(total)
    else:
        largest = 0.0
        for i in range(1, size):
            largest = max(largest, abs(v[i]))
        total = 0.0
        if largest > 0.0:
            for i in range(1, size):
                part = v[i] / largest
                total += part * part
        length = largest * math.sqrt(total)
    if length <= t:
        # the tip itself counts as inside where t > 0 only
        for i in range(size):
            out[i] = v[i]
        return 1 if t > 0.0 else 0
    if length <= -t:
        for i in range(size):
            out[i] = 0.0
        return 0
    half = 0.5 * (t + length)
    ratio = half / length
    out[0] = half
    inverse = 1.0 / length
    for i in range(1, size):
        out[i] = ratio * v[i]
        unit[i] = v[i] * inverse
    numbers[0] = ratio
    return 2


@njit(folder=_FOLDER, nogil=True)
def linearise(cones, jacobian):
    """Take the Jacobians of the exponential and power cones apart, after `project_all`."""
    root = 1.4142135623730951
    for b in range(cones.kinds.size):
        if SEMIDEFINITE < cones.kinds[b] < POWER_TERM and jacobian.marks[b] == 2:
            raw, work = jacobian.raw[b], jacobian.work
            part = work[12:18]
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
def add_curvature(cones, jacobian, v, mode, tau, delta, matrix, one, two):
    """matrix += GᵀF(V)G, upper triangle, F = PENALTY or SLOPE (both vanish at zero); `one`, `two` (n,) are room."""
    n = matrix.shape[0]
    full = _value(mode, 1.0, tau, delta)
    for b in range(cones.kinds.size):
        kind, s, size = cones.kinds[b], cones.starts[b], cones.sizes[b]
        rows = cones.G[s : s + size]
        mark = jacobian.marks[b]
        if kind == ORTHANT:
            given = v[s : s + size]
            for r in range(size):
                if given[r] > 0.0:
                    _add_square(matrix, rows[r], full)
        elif kind >= POWER_TERM:
            _add_square(matrix, rows[0], _value(mode, jacobian.numbers[b, 0], tau, delta))
        elif mark == 1:
            gram = cones.grams[b]
            for i in range(n):
                line, add = matrix[i], gram[i]
                for j in range(i, n):
                    line[j] += full * add[j]
            if kind == SECOND_ORDER:
                _add_square(matrix, rows[0], full)
        elif mark == 2 and kind == SECOND_ORDER:
            unit = jacobian.units[s : s + size]
            gram, first = cones.grams[b], rows[0]
            for i in range(n):
                two[i] = 0.0
            for r in range(1, size):
                factor, row = unit[r], rows[r]
                for i in range(n):
                    two[i] += factor * row[i]
            for i in range(n):
                one[i] = first[i] + two[i]
            third = _value(mode, jacobian.numbers[b, 0], tau, delta)
            for i in range(n):
                line, add = matrix[i], gram[i]
                x, y = 0.5 * full * one[i], third * two[i]
                for j in range(i, n):
                    line[j] += third * add[j] + x * one[j] - y * two[j]
        elif mark == 2:
            for k in range(size):
                weight = _value(mode, jacobian.numbers[b, k], tau, delta)
                if weight != 0.0:
                    part = jacobian.parts[b, k]
                    for i in range(n):
                        one[i] = 0.0
                    for r in range(size):
                        factor, row = part[r], rows[r]
                        for i in range(n):
                            one[i] += factor * row[i]
                    _add_square(matrix, one, weight)


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def _add_square(matrix, a, weight):
    n = matrix.shape[0]
    for i in range(n):
        x = weight * a[i]
        if x != 0.0:
            line = matrix[i]
            for j in range(i, n):
                line[j] += x * a[j]


@njit(folder=_FOLDER, nogil=True, fastmath=FAST)
def apply(cones, jacobian, v, mode, tau, delta, given, out):
    """out = F(V) given."""
    full, none = _value(mode, 1.0, tau, delta), _value(mode, 0.0, tau, delta)
    for b in range(cones.kinds.size):
        kind, s, size = cones.kinds[b], cones.starts[b], cones.sizes[b]
        a, image = given[s : s + size], out[s : s + size]
        mark = jacobian.marks[b]
        if kind == ORTHANT:
            at = v[s : s + size]
            for i in range(size):
                image[i] = (full if at[i] > 0.0 else none) * a[i]
        elif kind >= POWER_TERM:
            image[0] = _value(mode, jacobian.numbers[b, 0], tau, delta) * a[0]
        elif mark < 2:
            factor = full if mark == 1 else none
            for i in range(size):
                image[i] = factor * a[i]
        elif kind == SECOND_ORDER:
            unit = jacobian.units[s : s + size]
            along = 0.0
            for i in range(1, size):
                along += unit[i] * a[i]
            third = _value(mode, jacobian.numbers[b, 0], tau, delta)
            up, down = 0.5 * full * (a[0] + along), 0.5 * none * (a[0] - along)
            image[0] = up + down
            rest = up - down - third * along
            for i in range(1, size):
                image[i] = third * a[i] + rest * unit[i]
        else:
            for i in range(size):
                image[i] = none * a[i]
            for k in range(size):
                e = jacobian.numbers[b, k]
                if e != 0.0:
                    part = jacobian.parts[b, k]
                    along = 0.0
                    for i in range(size):
                        along += part[i] * a[i]
                    along *= _value(mode, e, tau, delta) - none
                    for i in range(size):
                        image[i] += along * part[i]
