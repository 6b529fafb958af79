"""Terms of ψ that depend on the strain alone: they have no part in the minimisation, and are added to stress and tangent as they are.

    σ += ∂ψ_ε/∂ε,   ℂ += ∂²ψ_ε/∂ε∂ε,

the second from the declared operator c₀ 𝕀 + c₁ I⊗I + Σ w G⊗H + Σ w D[g′](T), with divided differences of g′ between eigenvalues (the
derivative where they coincide): an element of the generalised derivative at kinks (Ogden 1984, §6.1.4, for distinct eigenvalues).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Expr, S

from ..potentials.derivative import Operator, partial, second_derivative, variables_of
from ..potentials.evaluate import evaluate
from ..potentials.scalars import Temperature
from ..potentials.spectral import decompose
from ..potentials.tensor import TensorSymbol

__all__ = ["StrainEnergy", "without_strain_terms"]

Array = NDArray[np.float64]
_I = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def without_strain_terms(energy: Expr, strain: TensorSymbol) -> tuple[Expr, Expr]:
    """(terms with other variables, terms of the strain alone); the temperature is data.

    A quadratic form of the strain stays with the rest: written out term by term, a square of ε − ε^p is convex with it only.
    """
    rest, alone = [], []
    for term in Add.make_args(energy):
        aside = _variables(term) == {strain} and not _is_quadratic(term, strain)
        (alone if aside else rest).append(term)
    return Add(*rest), Add(*alone)


def _variables(thing: Any) -> set[Any]:
    return {v for v in variables_of(thing) if not isinstance(v, Temperature)}


def _is_quadratic(term: Expr, strain: TensorSymbol) -> bool:
    operator = second_derivative(term, strain, strain)
    parts = [operator.c0, operator.c1, *(part for dyad in operator.dyads for part in dyad)]
    return not operator.spectral and not operator.functions and not any(_variables(part) for part in parts)


@dataclass(frozen=True)
class StrainEnergy:
    """`energy` of the strain (and data) alone; zero where there is none."""

    energy: Expr
    strain: TensorSymbol

    @cached_property
    def _slope(self) -> Any:
        return partial(self.energy, self.strain)

    @cached_property
    def _operator(self) -> Operator:
        return second_derivative(self.energy, self.strain, self.strain)

    def add(self, stress: Array, tangent: Array | None, known: Mapping[Any, Any]) -> None:
        """Add to `stress` (n, 6) and `tangent` (n, 6, 6); `known` holds the strain (n, 6), parameters and the temperature."""
        if self.energy == S.Zero:
            return
        stress += evaluate(self._slope, known)
        if tangent is not None:
            tangent += operator_matrices(self._operator, known, len(stress))


def operator_matrices(operator: Operator, known: Mapping[Any, Any], count: int) -> Array:
    """Operator at every point as matrices (count, 6, 6) on Mandel components."""
    found = np.zeros((count, 6, 6))
    found += np.reshape(evaluate(operator.c0, known), (-1, 1, 1)) * np.eye(6)
    found += np.reshape(evaluate(operator.c1, known), (-1, 1, 1)) * np.outer(_I, _I)
    for weight, left, right in operator.dyads:
        g, h = np.atleast_2d(evaluate(left, known)), np.atleast_2d(evaluate(right, known))
        found += np.reshape(evaluate(weight, known), (-1, 1, 1)) * g[:, :, None] * h[:, None, :]
    for weight, tensor in operator.spectral:
        matrices = _spectral_derivative(
            np.atleast_2d(evaluate(tensor, known)), lambda e: np.maximum(e, 0.0), lambda e: e > 0
        )
        found += np.reshape(evaluate(weight, known), (-1, 1, 1)) * matrices
    for weight, spectral in operator.functions:
        function, tensor = spectral.args
        body, x = function.expr, function.variables[0]
        slope, bend = _numbers(body, x, known), _numbers(body.diff(x), x, known)
        matrices = _spectral_derivative(np.atleast_2d(evaluate(tensor, known)), slope, bend)
        found += np.reshape(evaluate(weight, known), (-1, 1, 1)) * matrices
    return found


def _numbers(body: Expr, x: Any, known: Mapping[Any, Any]) -> Any:
    return lambda e: np.broadcast_to(evaluate(body, {**known, x: e}), e.shape)


def _spectral_derivative(tensor: Array, function: Any, derivative: Any) -> Array:
    """Derivative of Σ g(t_i) n_i⊗n_i by T, (n, 6, 6)."""
    values, vectors = decompose(tensor)
    g, slope = function(values), derivative(values).astype(float)
    n = len(tensor)
    found = np.zeros((n, 6, 6))
    size = np.abs(values).max(axis=1)
    for i in range(3):
        for j in range(i + 1):
            gap = values[:, i] - values[:, j]
            apart = np.abs(gap) > 1e-7 * size
            quotient = np.where(
                apart, (g[:, i] - g[:, j]) / np.where(apart, gap, 1.0), 0.5 * (slope[:, i] + slope[:, j])
            )
            theta = slope[:, i] if i == j else quotient
            a, b = vectors[:, :, i], vectors[:, :, j]
            dyad = np.stack(
                [(a[:, r] * b[:, c] + a[:, c] * b[:, r]) * (0.5 if r == c else np.sqrt(0.5)) for r, c in _PAIRS], axis=1
            ) * (1.0 if i == j else np.sqrt(2.0))
            found += theta[:, None, None] * dyad[:, :, None] * dyad[:, None, :]
    return found
