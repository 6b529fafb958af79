"""Projection on an intersection of half-spaces {g_i·z ≤ k_i}, exactly, from a table of its faces.

    min ½ eᵀW e ... :   z = z^tr − W e,   e = Σ γ_i g_i,   0 ≤ γ ⊥ k − G z ≥ 0.

With S = G W Gᵀ constant, every linearly independent active set A has its own constant matrix N_A = S_AA⁻¹: γ_A = N_A f_A, f = G z^tr − k,
and what is left of the others is f − S γ. Both are rows of one matrix Y_A, scaled by √S_ii to units of the metric:

    y = Y_A f,    y_i = √S_ii γ_i  (i in A),    y_i = (Σ S_ij γ_j − f_i)/√S_ii  (else).

The projection is the face with y ≥ 0; by Carathéodory one of the independent sets always is. The table is computed once per set of
parameters. If rounding leaves no face, or the answer misses its own active inequalities, the face with the least violation is taken.
"""

from __future__ import annotations

import functools
import math
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cache import njit
from .kernel_types import METHOD_SIGNATURE, compiled
from .key import kernels_hash
from .plan import METHOD_START

__all__ = ["affine_method", "face_table"]

_FOLDER = kernels_hash()
_IMMOVABLE = 1e200  # weight of an inequality that no flow can change: it holds, or there is no answer


@functools.cache
def affine_method(unknowns: int, rows: int) -> Any:
    """The compiled projection of so many unknowns on so many half-spaces; the sizes are constants of the code."""
    return compiled(_method(unknowns, rows), METHOD_SIGNATURE)


def face_table(normals: NDArray[np.float64], limits: NDArray[np.float64], metric: NDArray[np.float64]) -> Any:
    """Numbers that `affine_method` reads: number of faces, G, −k, sizes 1/√S_ii, G W, and per face 1/√S_ii if i in A, Y_A, P = Gᵀ N G.

    `normals` G (m, n), `limits` k (m,), `metric` W (n, n).
    """
    m, n = normals.shape
    gram = normals @ metric @ normals.T
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    with np.errstate(divide="ignore"):
        scale = np.where(size > 0.0, 1.0 / size, 0.0)
    left = np.where(size > 0.0, scale, _IMMOVABLE)
    faces = []
    for length in range(1, min(m, n) + 1):
        for face in combinations(range(m), length):
            inverse = _inverse(gram[np.ix_(face, face)])
            if inverse is not None:
                full = np.zeros((m, m))
                full[np.ix_(face, face)] = inverse
                inside = np.zeros(m, dtype=bool)
                inside[list(face)] = True
                others = left[:, None] * (gram @ full - np.eye(m))
                y = np.where(inside[:, None], size[:, None] * full, others)
                faces += [np.where(inside, scale, 0.0), y.ravel(), (normals.T @ full @ normals).ravel()]
    head = [np.array([len(faces) // 3]), normals.ravel(), -limits, scale, (normals @ metric).ravel()]
    return np.concatenate([*head, *faces])


def _inverse(gram: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Inverse of a symmetric matrix that is definite to 1e-12 of its diagonal, else None."""
    diagonal = np.diag(gram)
    if not (diagonal > 0.0).all() or not np.isfinite(gram).all():
        return None
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(gram * scale[:, None] * scale[None, :])
    if values[0] < 1e-12:
        return None
    return (vectors / values) @ vectors.T * scale[:, None] * scale[None, :]


def _method(n: int, m: int) -> Any:
    @njit(folder=_FOLDER)
    def answer(c, o, face, z, f, y, out):
        """Multipliers, increments and forces of one face; returns the largest violation in metric units."""
        limit = o + 1 + m * n
        scale = limit + m
        moved = scale + m
        miss = 0.0
        for i in range(m):
            value = 0.0
            for j in range(m):
                value += c[face + m + m * i + j] * f[j]
            if c[face + i] > 0.0:
                miss = max(miss, -value)
            y[i] = max(value, 0.0) * c[face + i] if c[face + i] > 0.0 else 0.0
        for k in range(n):
            e, drop = 0.0, 0.0
            for i in range(m):
                e += c[o + 1 + n * i + k] * y[i]
                drop += c[moved + n * i + k] * y[i]
            out[k] = e
            out[n + k] = z[k] - drop
        for i in range(m):
            value = c[limit + i]
            for k in range(n):
                value += c[o + 1 + n * i + k] * out[n + k]
            if value > 0.0:
                miss = max(miss, value * c[scale + i] if c[scale + i] > 0.0 else math.inf)
        return miss

    def project(law, trial, coefficients, first, plan, found, status, count):
        step = 1 if coefficients.shape[0] > 1 else 0
        f, y = np.zeros(m), np.zeros(m)
        o = plan[METHOD_START]
        limit = o + 1 + m * n
        scale = limit + m
        table = scale + m + m * n
        width = m + m * m + n * n
        for point in range(count):
            c, z, out = coefficients[first + step * point], trial[point], found[point]
            status[point] = 0
            plastic = False
            for i in range(m):
                value = c[limit + i]
                for k in range(n):
                    value += c[o + 1 + n * i + k] * z[k]
                f[i] = value
                if not value <= 0.0:
                    plastic = True
            if not plastic:
                for k in range(n):
                    out[k] = 0.0
                    out[n + k] = z[k]
                for k in range(n * n):
                    out[2 * n + k] = 0.0
                continue
            worst, rounding = 0.0, 0.0
            for i in range(m):
                worst = max(worst, abs(f[i]) * c[scale + i])
                part = abs(c[limit + i])
                for k in range(n):
                    part += abs(c[o + 1 + n * i + k] * z[k])
                rounding = max(rounding, part * c[scale + i])
            tolerance = -4e-16 * worst
            faces = int(c[o])
            best = -1
            for face in range(faces):
                place = table + width * face + m
                inside = True
                for i in range(m):
                    value = 0.0
                    for j in range(m):
                        value += c[place + m * i + j] * f[j]
                    if not value >= tolerance:
                        inside = False
                        break
                if inside:
                    best = face
                    break
            allowed = 1e-13 * worst + 1e-15 * rounding
            if best < 0 or not answer(c, o, table + width * best, z, f, y, out) <= allowed:
                best, least = -1, math.inf
                for face in range(faces):
                    miss = answer(c, o, table + width * face, z, f, y, out)
                    if miss < least:
                        best, least = face, miss
                if best < 0 or not least <= 1e-9 * worst + 1e-15 * rounding:
                    status[point] = 3
                    continue
                answer(c, o, table + width * best, z, f, y, out)
            place = table + width * best + m + m * m
            for k in range(n * n):
                out[2 * n + k] = c[place + k]

    return project
