"""Largest eigenvalue of a tensor: the support function of {Y ⪰ 0, tr Y = 1}."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S

from ...errors import DeclarationError
from ..operator import Operator
from ..ranked import rank_word
from ..spectral import EigenDyad, as_matrix, eigenvalues
from ..tensor import PositiveTensor, SymmetricTensor
from .atom import Atom, Invariant
from .linear import adjoint, linear_part

__all__ = ["EigMax", "EigMaxLeaf", "checked_tensor", "eig_max"]


class EigMaxLeaf(Invariant):
    """Largest eigenvalue."""

    __slots__ = ()
    word = "eig_max"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\lambda_{{\max}}\left({printer._print(self.args[0])}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


class EigMax(Atom):
    """Convex, of degree 1, with kinks at repeated largest eigenvalues."""

    word = "eig_max"
    node = EigMaxLeaf
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def degree(self, node: Any) -> Expr:
        return S.One

    def gradient(self, node: Any, variable: Any) -> Any:
        if variable.rank != 2:
            return variable.linear(())
        return adjoint(linear_part(node.args[0], variable), EigenDyad(node.args[0], 1))

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        if x.rank != 2 or y.rank != 2:
            return Operator()
        tensor = node.args[0]
        dyad = EigenDyad(tensor, 1)
        return Operator(extremes=((weight, dyad),)).between(linear_part(tensor, x), linear_part(tensor, y))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        return eigenvalues(arguments[0])[..., 2]

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy
        import numpy as np

        top = cvxpy.Variable()
        constraints.append(top * np.eye(3) - as_matrix(arguments[0]) >> 0)
        return top

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        from .eig_min import eig_min
        from .trace import tr

        return S.Zero, (-eig_min(dual), tr(dual) - 1, 1 - tr(dual))


def checked_tensor(value: object, word: str) -> SymmetricTensor:
    """A tensor without positive parts; refuses the rest in one line."""
    if not isinstance(value, SymmetricTensor):
        raise DeclarationError(f"rank mismatch: {word} takes a tensor, not a {rank_word(value)}")
    if value.has(PositiveTensor):
        raise DeclarationError(f"{word}(pos(...)) is not available; write pos({word}(...)), which is the same number")
    return value


def eig_max(tensor: SymmetricTensor) -> Expr:
    """Largest eigenvalue, convex."""
    value = checked_tensor(tensor, "eig_max")
    return EigMaxLeaf(value) if value.terms() else S.Zero
