"""What the compiled reduced step found, before it becomes tensors: trial values, increments, forces, P, and the law's functions there.

The trial values and the method are those of the reduced step itself, called through the same pointers: derivatives that are built on its
answer speak of the same active set. Of the closed form the region is found by its own inequalities, in its own order of operations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from .kernel_types import LAW, METHOD, PLACES, TABLE, compiled, no_law, no_method
from .kernels import trial_kernel
from .plan import FROZEN, MOVING, SURFACES, UNKNOWNS
from .pointers import StepPointers
from .spectral import add_positive_derivative, positive_part

__all__ = ["ReducedAnswer", "closed_faces", "function_values", "positive_parts", "reduced_answer"]

Array = NDArray[np.float64]

_ANSWERS = types.void(METHOD, LAW, TABLE, TABLE, PLACES, TABLE, PLACES)
_VALUES = types.void(LAW, TABLE, TABLE, TABLE, TABLE, TABLE)
_POSITIVE = types.void(TABLE, TABLE, TABLE)


def _answers(method, law, trial, found, status, coefficients, plan):
    method(law, trial, coefficients, 0, plan, found, status, trial.shape[0])


def _values(law, z, s, gamma, coefficients, out):
    step = 1 if coefficients.shape[0] > 1 else 0
    for m in range(z.shape[0]):
        law(z[m], s[m], gamma[m], coefficients[step * m], 2, out[m])


def _positive(tensors, parts, derivatives):
    work = np.zeros(12)
    for m in range(tensors.shape[0]):
        positive_part(tensors[m], work, parts[m])
        add_positive_derivative(1.0, work, derivatives[m])


@dataclass(frozen=True)
class ReducedAnswer:
    """At p points: `trial` z^tr (p, n), `data` moving and frozen scalars at the start (p, ·), `b` B of the trial (its deviator for a norm),
    `axes` its eigenvalues and vectors, increments `e`, forces `z` (p, n), `slope` P (p, n, n)."""

    trial: Array
    data: Array
    b: Array
    axes: Array
    e: Array
    z: Array
    slope: Array

    def at(self, points: Any) -> ReducedAnswer:
        """The same at some of the points."""
        return ReducedAnswer(*(getattr(self, f)[points] for f in ReducedAnswer.__dataclass_fields__))


def reduced_answer(
    pointers: StepPointers | None, plan: NDArray[np.int64], coefficients: Array, eps: Array, old: Array
) -> ReducedAnswer:
    """Trial values and, with `pointers` of a reduced method, its answer (zeros without)."""
    n, data, count = int(plan[UNKNOWNS]), int(plan[MOVING] + plan[FROZEN]), len(eps)
    trial, b, axes = np.zeros((count, n + data + 1)), np.zeros((count, 6)), np.zeros((count, 12))
    found, status = np.zeros((count, 2 * n + n * n + 1)), np.zeros(count, dtype=np.int64)
    method, law = (no_method(), no_law()) if pointers is None else (pointers.method, pointers.law)
    trial_kernel(6, tuple(int(i) for i in plan))(eps, old, coefficients, trial, b, axes)
    compiled(_answers, _ANSWERS)(method, law, trial, found, status, coefficients, plan)
    slope = found[:, 2 * n : 2 * n + n * n].reshape(count, n, n)
    return ReducedAnswer(trial[:, :n], trial[:, n : n + data], b, axes, found[:, :n], found[:, n : 2 * n], slope)


def function_values(law: Any, plan: NDArray[np.int64], z: Array, s: Array, gamma: Array, coefficients: Array) -> Any:
    """(f (p, m), ∇f (p, m, n), ∇Φ (p, n), Hessian of Φ + Σ γ_i f_i (p, n, n), ∂²ψ_s (p, r, r)) of a law's generated function."""
    m, n, r = int(plan[SURFACES]), int(plan[UNKNOWNS]), int(plan[MOVING])
    count, start = len(z), m + m * n
    out = np.zeros((count, start + n + n * n + 2 + r + r * r + 9 + m))
    width = max(1, s.shape[1])
    state = np.zeros((count, width))
    state[:, : s.shape[1]] = s
    compiled(_values, _VALUES)(
        law, np.array(z), state, np.ascontiguousarray(gamma), np.ascontiguousarray(coefficients), out
    )
    block = start + n + n * n + 2 + r
    return (
        out[:, :m],
        out[:, m:start].reshape(count, m, n),
        out[:, start : start + n],
        out[:, start + n : start + n + n * n].reshape(count, n, n),
        out[:, block : block + r * r].reshape(count, r, r),
    )


def positive_parts(tensors: Array) -> tuple[Array, Array]:
    """T^≥ (p, 6) and its derivative (p, 6, 6), H(0) = 0."""
    parts, derivatives = np.zeros_like(tensors), np.zeros((len(tensors), 36))
    compiled(_positive, _POSITIVE)(np.ascontiguousarray(tensors), parts, derivatives)
    return parts, derivatives.reshape(-1, 6, 6)


def closed_faces(plan: NDArray[np.int64], coefficients: Array, eps: Array, old: Array) -> NDArray[np.int64]:
    """Region of the closed form at every point: 0 elastic, 1 cone, 2 apex, by the inequalities of `closed_step`, operation by operation."""
    c = coefficients.T
    tensors, scalars = int(plan[0]), int(plan[1])
    a, w_q, w_m, g_q, g_t = c[0], c[1], c[2], c[3], c[4]
    f = c[5] + g_t * (eps[:, 0] + eps[:, 1] + eps[:, 2])
    b = [g_q * eps[:, i] for i in range(6)]
    for k in range(tensors):
        p, o = int(plan[3 + k]), 10 + 6 * k
        b = [b[i] + c[o] * old[:, p + i] for i in range(6)]
        f = f + c[o + 1] * (old[:, p] + old[:, p + 1] + old[:, p + 2])
    mean = (b[0] + b[1] + b[2]) * (1.0 / 3.0)
    b[0], b[1], b[2] = b[0] - mean, b[1] - mean, b[2] - mean
    total = b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + b[3] * b[3] + b[4] * b[4] + b[5] * b[5]
    q = np.sqrt(total)
    far = ~((total > 1e-280) & (total < 1e280))
    if far.any():
        part = np.abs(np.array(b)[:, far])
        size = part.max(axis=0)
        q[far] = size * np.sqrt(((part / np.where(size > 0.0, size, 1.0)) ** 2).sum(axis=0))
    first = 10 + 6 * tensors
    for j in range(scalars):
        f = f + c[first + 2 * j] * old[:, int(plan[3 + tensors + j])]
    f = f + a * q
    h = a * a * w_q + w_m
    with np.errstate(all="ignore"):
        gamma = f * (1.0 / h)
        cone = q >= gamma * a * w_q
    return np.where(f <= 0.0, 0, np.where(cone, 1, 2))
