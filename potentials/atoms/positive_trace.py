"""tr T^≥ = Σ ⟨t_i⟩: the support function of {0 ⪯ Y ⪯ I}."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S

from ..operator import Operator
from .atom import Atom, Invariant
from .linear import adjoint, linear_part

__all__ = ["PositiveTrace", "PositiveTraceLeaf"]


class PositiveTraceLeaf(Invariant):
    """tr T^≥."""

    __slots__ = ()
    is_nonnegative = True
    is_extended_nonnegative = True

    def _sympystr(self, printer: Any) -> str:
        return f"tr(pos({printer._print(self.args[0])}))"

    _sympyrepr = _sympystr

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\mathrm{{tr}}\left({printer._print(self.args[0])}\right)^{{\geq}}"
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


class PositiveTrace(Atom):
    """Convex, non-negative, of degree 1, with kinks where an eigenvalue vanishes."""

    word = "tr(pos(.))"
    node = PositiveTraceLeaf
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def degree(self, node: Any) -> Expr:
        return S.One

    def gradient(self, node: Any, variable: Any) -> Any:
        from ..spectral import spectral_tensor
        from .positive_part import Step

        if variable.rank != 2:
            return variable.linear(())
        return adjoint(linear_part(node.args[0], variable), spectral_tensor(Step, node.args[0]))

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        from ..spectral import spectral_tensor
        from .positive_part import Step

        if x.rank != 2 or y.rank != 2:
            return Operator()
        tensor = node.args[0]
        slope = spectral_tensor(Step, tensor)
        return Operator(functions=((weight, slope),)).between(linear_part(tensor, x), linear_part(tensor, y))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        from ..spectral import eigenvalues

        return np.maximum(eigenvalues(arguments[0]), 0.0).sum(axis=-1)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        from ..spectral import as_matrix

        upper = cvxpy.Variable((3, 3), PSD=True)
        constraints.append(upper >> as_matrix(arguments[0]))
        return cvxpy.trace(upper)

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        from .eig_max import eig_max
        from .eig_min import eig_min

        return S.Zero, (-eig_min(dual), eig_max(dual) - 1)
