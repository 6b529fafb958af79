"""T^≥:T^≥ = Σ ⟨t_i⟩² = dist²(T, negative semidefinite tensors)."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Integer, S

from ..operator import Operator
from ..tensor import PositiveTensor, TensorSum
from .atom import Atom, Invariant
from .linear import adjoint, linear_part

__all__ = ["PositiveSquare", "PositiveSquareLeaf"]


class PositiveSquareLeaf(Invariant):
    """T^≥:T^≥."""

    __slots__ = ()
    is_nonnegative = True
    is_extended_nonnegative = True

    def _sympystr(self, printer: Any) -> str:
        part = f"pos({printer._print(self.args[0])})"
        return f"inner({part}, {part})"

    _sympyrepr = _sympystr

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        part = rf"\left({printer._print(self.args[0])}\right)^{{\geq}}"
        body = rf"{part}\!:\!{part}"
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


class PositiveSquare(Atom):
    """Convex, C^{1,1}, non-negative, of degree 2; its generalised Hessian is right at repeated eigenvalues (Sun & Sun 2002)."""

    word = "inner(pos(.), pos(.))"
    node = PositiveSquareLeaf
    smoothness = "C1"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def degree(self, node: Any) -> Expr:
        return Integer(2)

    def gradient(self, node: Any, variable: Any) -> Any:
        part = linear_part(node.args[0], variable) if variable.rank == 2 else (S.Zero, S.Zero)
        return TensorSum() if part == (S.Zero, S.Zero) else adjoint(part, PositiveTensor(node.args[0])) * 2

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        if x.rank != 2 or y.rank != 2:
            return Operator()
        tensor = node.args[0]
        return Operator(spectral=((2 * weight, tensor),)).between(linear_part(tensor, x), linear_part(tensor, y))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        from ..spectral import eigenvalues

        return (np.maximum(eigenvalues(arguments[0]), 0.0) ** 2).sum(axis=-1)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        from ..spectral import as_matrix

        rest = cvxpy.Variable(6)
        constraints.append(as_matrix(rest) >> 0)
        return cvxpy.sum_squares(arguments[0] + rest)

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        from .eig_min import eig_min
        from .inner import inner

        return inner(dual, dual) / 4, (-eig_min(dual),)
