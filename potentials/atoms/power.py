"""xⁿ, with an exponent that is a number or a parameter."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Integer, Pow, Rational

from ...errors import DeclarationError
from ..scalars import ScalarVariable
from .atom import Atom, Require

__all__ = ["Power"]


class Power(Atom):
    """On x ≥ 0: convex and non-decreasing for n ≥ 1, concave and non-decreasing for 0 ≤ n ≤ 1, convex and non-increasing for n ≤ 0
    (x > 0); for even n convex on all x. The conjugate of xⁿ/n on x ≥ 0 is y^m/m, 1/n + 1/m = 1."""

    word = "**"
    node = Pow

    def curvature(self, node: Any, require: Require) -> str:
        exponent = node.exp
        if exponent == 1:
            return "affine"
        if exponent.is_odd and exponent > 1 and not node.base.is_nonnegative:
            return "unknown"  # x³ is defined, and bends down, on x < 0
        if exponent.is_number:
            return "convex" if exponent > 1 or exponent < 0 else "concave"
        # a parameter: the only reading that makes a potential is n >= 1
        require(exponent - 1)
        return "convex"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        exponent = node.exp
        if signs[0] == 1:
            return (-1 if exponent.is_number and exponent < 0 else 1,)
        if signs[0] == -1 and exponent.is_even:
            return (-1 if exponent > 0 else 1,)
        return (0,)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1 if signs[0] == 1 or node.exp.is_even else 0

    def degree(self, node: Any) -> Expr:
        return node.exp

    def domain(self, node: Any) -> tuple[Expr, ...]:
        exponent = node.exp
        return () if exponent.is_integer and exponent.is_nonnegative else (node.base,)

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        base, exponent = arguments
        with np.errstate(all="ignore"):
            found = np.power(np.asarray(base, dtype=float), exponent)
        # 1/0 stands beside a quantity that vanishes with it (the gradient of a norm at zero): zero is an element of the subdifferential
        return np.where((np.asarray(base) == 0.0) & (np.asarray(exponent) < 0.0), 0.0, found)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        base, exponent = arguments[0], float(node.exp)
        if exponent == 1.0:
            return base
        if exponent == 2.0:
            return cvxpy.square(base)
        if exponent > 1.0:
            # |x|^n <= t, by a power cone: t^(1/n) 1^(1-1/n) >= |x|
            if not base.is_affine() and not base.is_nonneg():
                raise DeclarationError(f"the base of {node} may be negative; write pos(...) of it")
            inside, top = cvxpy.Variable(), cvxpy.Variable()
            constraints.append(inside == base if base.is_affine() else inside >= base)
            if exponent % 2.0 != 0.0 and not base.is_nonneg():
                constraints.append(inside >= 0)  # convex on the base >= 0 only, which is its domain
            constraints.append(cvxpy.PowCone3D(top, cvxpy.Constant(1.0), inside, 1.0 / exponent))
            return top
        if exponent == 0.5:
            return cvxpy.sqrt(base)
        if 0.0 < exponent < 1.0:
            low = cvxpy.Variable()
            constraints.append(cvxpy.PowCone3D(base, cvxpy.Constant(1.0), low, exponent))
            return low
        if exponent == -1.0:
            return cvxpy.inv_pos(base)
        # x^(-n) <= t, by a power cone: t^(1/(1+n)) x^(n/(1+n)) >= 1
        inside, top = cvxpy.Variable(), cvxpy.Variable()
        constraints.append(inside == base if base.is_affine() else inside <= base)
        constraints.append(cvxpy.PowCone3D(top, inside, cvxpy.Constant(1.0), 1.0 / (1.0 - exponent)))
        return top

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]] | None:
        """Of xⁿ as a function on x ≥ 0 (of all x for even n ≥ 2); for 0 < n < 1, of −xⁿ."""
        from .maximum import Maximum
        from .positive_part import PositivePart

        n = node.exp
        if n.is_number and 0 < n < 1:
            return (1 - n) * (-dual / n) ** (n / (n - 1)), (dual,)
        if n.is_number and n < 0:
            return (n - 1) * (dual / n) ** (n / (n - 1)), (dual,)
        if n.is_number and n <= 1:
            return None
        inside = dual if n == 2 else Maximum(dual, -dual) if n.is_even else PositivePart(dual)
        return (n - 1) * (inside / n) ** (n / (n - 1)), ()

    def examples(self) -> tuple[Any, ...]:
        x = ScalarVariable("x")
        return tuple(
            x**n for n in (Integer(2), Integer(3), Rational(3, 2), Rational(1, 2), Integer(-1), Rational(-1, 2))
        )
