"""Smallest eigenvalue of a tensor, concave."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S

from ..operator import Operator
from ..spectral import EigenDyad, as_matrix, eigenvalues
from ..tensor import SymmetricTensor
from .atom import Atom, Invariant
from .eig_max import checked_tensor
from .linear import adjoint, linear_part

__all__ = ["EigMin", "EigMinLeaf", "eig_min"]


class EigMinLeaf(Invariant):
    """Smallest eigenvalue."""

    __slots__ = ()
    word = "eig_min"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\lambda_{{\min}}\left({printer._print(self.args[0])}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


class EigMin(Atom):
    """Concave, of degree 1, with kinks at repeated smallest eigenvalues."""

    word = "eig_min"
    node = EigMinLeaf
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "concave"

    def degree(self, node: Any) -> Expr:
        return S.One

    def gradient(self, node: Any, variable: Any) -> Any:
        if variable.rank != 2:
            return variable.linear(())
        return adjoint(linear_part(node.args[0], variable), EigenDyad(node.args[0], -1))

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        if x.rank != 2 or y.rank != 2:
            return Operator()
        tensor = node.args[0]
        dyad = EigenDyad(tensor, -1)
        return Operator(extremes=((weight, dyad),)).between(linear_part(tensor, x), linear_part(tensor, y))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        return eigenvalues(arguments[0])[..., 0]

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy
        import numpy as np

        low = cvxpy.Variable()
        constraints.append(as_matrix(arguments[0]) - low * np.eye(3) >> 0)
        return low

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        from .eig_max import eig_max
        from .trace import tr

        return S.Zero, (eig_max(dual), tr(dual) + 1, -tr(dual) - 1)


def eig_min(tensor: SymmetricTensor) -> Expr:
    """Smallest eigenvalue, concave."""
    value = checked_tensor(tensor, "eig_min")
    return EigMinLeaf(value) if value.terms() else S.Zero
