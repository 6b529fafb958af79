"""log x on x > 0."""

from __future__ import annotations

from typing import Any

from sympy import Expr, log

from .atom import Atom

__all__ = ["Logarithm"]


class Logarithm(Atom):
    """Concave, increasing, on x > 0; the conjugate of −log x is −1 − log(−y) on y < 0."""

    word = "log"
    node = log

    def curvature(self, node: Any, require: Any) -> str:
        return "concave"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        return (1,)

    def domain(self, node: Any) -> tuple[Expr, ...]:
        return (node.args[0],)

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        with np.errstate(all="ignore"):
            return np.log(arguments[0])

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        return cvxpy.log(arguments[0])

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        return -1 - log(-dual), (dual,)
