"""Projection on an intersection of half-spaces {g_i·z ≤ k_i}, exactly, from a table of its faces.

    min ½ eᵀW e ... :   z = z^tr − W e,   e = Σ γ_i g_i,   0 ≤ γ ⊥ k − G z ≥ 0.

With S = G W Gᵀ constant, every linearly independent active set A has its own constant matrix N_A = S_AA⁻¹ (padded with zeros): γ = N_A f,
f = G z^tr − k. The projection is the face whose multipliers are non-negative and whose other inequalities hold; by Carathéodory one of the
independent sets always is. The table is computed once per set of parameters.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernel_types import METHOD_SIGNATURE, compiled
from .plan import METHOD_START, UNKNOWNS

__all__ = ["affine_method", "face_table"]


def affine_method() -> Any:
    """The compiled projection."""
    return compiled(_project, METHOD_SIGNATURE)


def face_table(normals: NDArray[np.float64], limits: NDArray[np.float64], metric: NDArray[np.float64]) -> Any:
    """Numbers that `affine_method` reads: faces, rows, then G, −k, sizes 1/√S_ii, W, and per face N and P = Gᵀ N G.

    `normals` G (m, n), `limits` k (m,), `metric` W (n, n).
    """
    m, n = normals.shape
    gram = normals @ metric @ normals.T
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    faces = []
    for length in range(1, min(m, n) + 1):
        for face in combinations(range(m), length):
            inverse = _inverse(gram[np.ix_(face, face)])
            if inverse is not None:
                full = np.zeros((m, m))
                full[np.ix_(face, face)] = inverse
                faces.append(full)
    with np.errstate(divide="ignore"):
        scale = np.where(size > 0.0, 1.0 / size, 0.0)
    head = [np.array([len(faces), m]), normals.ravel(), -limits, scale, metric.ravel()]
    return np.concatenate([*head, *(np.concatenate([f.ravel(), (normals.T @ f @ normals).ravel()]) for f in faces)])


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


def _project(law, trial, coefficients, first, plan, found, status, count):
    n = plan[UNKNOWNS]
    step = 1 if coefficients.shape[0] > 1 else 0
    f, gamma = np.zeros(12), np.zeros(12)
    for point in range(count):
        c = coefficients[first + step * point]
        o = plan[METHOD_START]
        faces, m = int(c[o]), int(c[o + 1])
        normal = o + 2
        limit = normal + m * n
        scale = limit + m
        metric = scale + m
        table = metric + n * n
        width = m * m + n * n
        z, out = trial[point], found[point]
        plastic = False
        worst, rounding = 0.0, 0.0
        for i in range(m):
            value = c[limit + i]
            largest = abs(value)
            for k in range(n):
                part = c[normal + i * n + k] * z[k]
                largest = max(largest, abs(part))
                value += part
            f[i] = value
            if not value <= 0.0:
                plastic = True
            worst = max(worst, abs(value) * c[scale + i])
            rounding = max(rounding, largest * c[scale + i])
        status[point] = 0
        for k in range(2 * n + n * n):
            out[k] = 0.0
        for k in range(n):
            out[n + k] = z[k]
        if not plastic:
            continue
        best, least = -1, math.inf
        for face in range(faces):
            o = table + width * face
            miss = 0.0
            for i in range(m):
                value = 0.0
                for j in range(m):
                    value += c[o + i * m + j] * f[j]
                gamma[i] = value
                if value < 0.0 and c[scale + i] > 0.0:
                    miss = max(miss, -value / c[scale + i])
            if miss < least:
                # z = z^tr − W Gᵀγ, and what is left of the inequalities there
                for k in range(n):
                    value = 0.0
                    for i in range(m):
                        value += c[normal + i * n + k] * gamma[i]
                    out[k] = value
                for k in range(n):
                    value = z[k]
                    for l in range(n):
                        value -= c[metric + k * n + l] * out[l]
                    out[n + k] = value
                for i in range(m):
                    value = c[limit + i]
                    for k in range(n):
                        value += c[normal + i * n + k] * out[n + k]
                    if value > 0.0:
                        miss = max(miss, value * c[scale + i] if c[scale + i] > 0.0 else math.inf)
                if miss < least:
                    best, least = face, miss
                    if miss <= 4e-16 * worst:
                        break
        # barely outside all surfaces of an apex, f itself is rounding of its terms
        if best < 0 or not least <= 1e-9 * worst + 1e-14 * rounding:
            status[point] = 3
            continue
        o = table + width * best
        for i in range(m):
            value = 0.0
            for j in range(m):
                value += c[o + i * m + j] * f[j]
            gamma[i] = max(value, 0.0)
        for k in range(n):
            value = 0.0
            for i in range(m):
                value += c[normal + i * n + k] * gamma[i]
            out[k] = value
        for k in range(n):
            value = z[k]
            for l in range(n):
                value -= c[metric + k * n + l] * out[l]
            out[n + k] = value
        for k in range(n * n):
            out[2 * n + k] = c[o + m * m + k]
