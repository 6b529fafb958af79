"""eˣ."""

from __future__ import annotations

from typing import Any

from sympy import Expr, exp, log

from .atom import Atom

__all__ = ["Exponential"]


class Exponential(Atom):
    """Convex, increasing, positive; its conjugate is y log y − y on y ≥ 0."""

    word = "exp"
    node = exp

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        return (1,)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        return np.exp(arguments[0])

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        return cvxpy.exp(arguments[0])

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        return dual * log(dual) - dual, (-dual,)
