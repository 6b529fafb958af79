"""Numbers of a second derivative: matrices (n, 6, 6) in Mandel components, (n, 3, 3) of vectors, at many points at once.

At repeated eigenvalues the divided difference of g′ is g″, and the curvature of an extreme eigenvalue towards its equals is left out: an
element of the generalised Hessian of a smooth piece that meets the point.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .evaluate import evaluate
from .operator import Operator
from .ranked import Ranked
from .spectral import decompose, from_matrix
from .tensor import identity

__all__ = ["operator_matrix"]

EQUAL = 1e-10
"""Relative difference below which two eigenvalues count as one."""


def operator_matrix(operator: Operator, values: Mapping[Any, Any], rank: int = 2) -> Any:
    """Matrix of the operator at the points of `values` (see `evaluate`), shape (n, 6, 6), or (n, 3, 3) for `rank` 1; without n where all
    values are of single points."""
    import numpy as np

    size = 6 if rank == 2 else 3
    total: Any = np.zeros((size, size))

    def number(expression: Any) -> Any:
        return np.asarray(evaluate(expression, values))[..., None, None]

    if operator.c0 != 0:
        total = total + number(operator.c0) * np.eye(size)
    if rank == 2 and operator.c1 != 0:
        sphere = evaluate(identity, {})
        total = total + number(operator.c1) * np.outer(sphere, sphere)
    for weight, left, right in operator.dyads:
        one, two = evaluate(left, values), evaluate(right, values)
        total = total + number(weight) * one[..., :, None] * two[..., None, :]
    for weight, tensor in operator.spectral:
        total = total + number(weight) * _positive_derivative(tensor, values)
    for weight, slope in operator.functions:
        total = total + number(weight) * _function_derivative(slope, values)
    for weight, dyad in operator.extremes:
        total = total + number(weight) * _extreme_derivative(dyad, values)
    for left, inner, right in operator.sandwiched:
        total = total + _map(left, values) @ operator_matrix(inner, values, rank) @ _map(right, values)
    return total


def _map(part: tuple[Any, Any], values: Mapping[Any, Any]) -> Any:
    import numpy as np

    sphere = evaluate(identity, {})
    c, d = (np.asarray(evaluate(x, values))[..., None, None] for x in part)
    return c * np.eye(6) + d * (np.eye(6) - np.outer(sphere, sphere) / 3.0)


def _dyads(vectors: Any) -> Any:
    """Mandel components (…, 3, 3, 6) of the symmetric parts of n_i⊗n_j."""
    import numpy as np

    outer = np.einsum("...ai,...bj->...ijab", vectors, vectors)
    return from_matrix(0.5 * (outer + np.swapaxes(outer, -1, -2)))


def _quotients(tensor: Ranked, values: Mapping[Any, Any], function: Any, slope: Any) -> Any:
    """Σ_ij Θ_ij (n_i⊗n_j)⊗(n_i⊗n_j), Θ the divided differences of `function`, its `slope` where two eigenvalues are equal."""
    import numpy as np

    e, vectors = decompose(evaluate(tensor, values))
    a, b = e[..., :, None], e[..., None, :]
    equal = np.abs(a - b) <= EQUAL * np.abs(e).max(axis=-1)[..., None, None]
    theta = np.where(equal, slope(0.5 * (a + b)), (function(a) - function(b)) / np.where(equal, 1.0, a - b))
    dyads = _dyads(vectors)
    return np.einsum("...ij,...ijk,...ijl->...kl", theta, dyads, dyads)


def _positive_derivative(tensor: Any, values: Mapping[Any, Any]) -> Any:
    import numpy as np

    return _quotients(tensor, values, lambda x: np.maximum(x, 0.0), lambda x: np.where(x > 0.0, 1.0, 0.0))


def _function_derivative(slope: Any, values: Mapping[Any, Any]) -> Any:
    import numpy as np

    function, tensor = slope.args
    x = function.variables[0]

    def of(expression: Any) -> Any:
        return lambda e: np.broadcast_to(evaluate(expression, {**values, x: e}), np.shape(e))

    return _quotients(tensor, values, of(function.expr), of(function.expr.diff(x)))


def _extreme_derivative(dyad: Any, values: Mapping[Any, Any]) -> Any:
    """D²e = Σ_j 2/(e − e_j) (n⊗n_j)⊗(n⊗n_j) over the eigenvalues e_j that differ from the extreme one."""
    import numpy as np

    tensor, which = dyad.args
    e, vectors = decompose(evaluate(tensor, values))
    place = 2 if which == 1 else 0
    difference = e[..., place, None] - e
    equal = np.abs(difference) <= EQUAL * np.abs(e).max(axis=-1, keepdims=True)
    weight = np.where(equal, 0.0, 2.0 / np.where(equal, 1.0, difference))
    dyads = _dyads(vectors)[..., place, :, :]
    return np.einsum("...j,...jk,...jl->...kl", weight, dyads, dyads)
