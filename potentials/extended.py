"""Extended-real-valued convex functions: a finite part plus the indicator of {f ≤ 0, g ≤ 0, …}.

The indicator I_D of a closed convex set D is 0 in D and +∞ outside; its subdifferential is the normal cone.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sympy import Expr, S, latex, sstr, sympify

from ..errors import DeclarationError
from .atoms.maximum import rewrite_maximum
from .derivative import variables_of
from .ranked import Ranked

__all__ = ["Extended", "as_extended", "indicator", "scalar_expression"]


def scalar_expression(value: Any, what: str, remedy: str) -> Expr:
    """A scalar expression without strings, relations, tensors; sympy's Max, Min and Abs are rewritten."""
    if isinstance(value, Ranked):
        raise DeclarationError(f"rank mismatch: {what} is a {value.kind}, it must be a scalar; {remedy}")
    try:
        found = sympify(value, strict=True)
    except Exception:
        found = None
    if not isinstance(found, Expr) or getattr(found, "is_Matrix", False):
        raise DeclarationError(f"{what} must be a scalar expression, not {type(value).__name__}; {remedy}")
    return rewrite_maximum(found)


@dataclass(frozen=True)
class Extended:
    """`finite` + I{f ≤ 0 for all f in `surfaces`}; sums with scalars and with each other are of the same kind."""

    finite: Expr = S.Zero
    surfaces: tuple[Expr, ...] = ()

    __array_ufunc__ = None

    @property
    def functions(self) -> tuple[Expr, ...]:
        """All scalar expressions that are in it."""
        return ((self.finite,) if self.finite != 0 else ()) + self.surfaces

    def __add__(self, other: Any) -> Extended:
        more = as_extended(other, "a term added to an indicator")
        return Extended(self.finite + more.finite, self.surfaces + more.surfaces)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Extended:
        return self + (-as_extended(other, "a term subtracted from an indicator"))

    def __rsub__(self, other: Any) -> Extended:
        return -self + other

    def __neg__(self) -> Extended:
        if self.surfaces:
            raise DeclarationError("an indicator cannot be subtracted: minus infinity outside a set is not convex")
        return Extended(-self.finite)

    def __pow__(self, other: Any) -> Extended:
        raise DeclarationError("an indicator has no power; write indicator(f) + h(f) with a convex h")

    def __mul__(self, other: Any) -> Extended:
        remedy = "multiply by a positive number or parameter"
        factor = scalar_expression(other, "the factor of a potential", remedy)
        if factor.is_nonpositive or variables_of(factor):
            raise DeclarationError(f"the factor {factor} of a potential is not positive for sure; {remedy}")
        return Extended(factor * self.finite, self.surfaces)

    __rmul__ = __mul__

    def map(self, function: Any) -> Extended:
        """The same with `function` applied to every expression."""
        return Extended(function(self.finite), tuple(function(f) for f in self.surfaces))

    def __str__(self) -> str:
        parts = [sstr(self.finite)] if self.finite != 0 else []
        if self.surfaces:
            parts.append(f"indicator({', '.join(sstr(f) for f in self.surfaces)})")
        return " + ".join(parts) or "0"

    def latex(self) -> str:
        """LaTeX."""
        parts = [latex(self.finite)] if self.finite != 0 else []
        if self.surfaces:
            inside = ",\\ ".join(rf"{latex(f)} \leq 0" for f in self.surfaces)
            parts.append(rf"I\left\{{{inside}\right\}}")
        return " + ".join(parts) or "0"

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {self.latex()}$"


def as_extended(value: Any, what: str) -> Extended:
    """An `Extended` from one or from a scalar expression."""
    if isinstance(value, Extended):
        return value
    return Extended(scalar_expression(value, what, "write a scalar expression, indicator(f, ...), or their sum"))


def indicator(*functions: Any) -> Extended:
    """Indicator of {f ≤ 0, g ≤ 0, ...}; each argument is the left side of one inequality."""
    if not functions:
        raise DeclarationError("indicator needs at least one function f of {f <= 0}")
    return Extended(S.Zero, tuple(_functions(functions)))


def _functions(functions: Iterable[Any]) -> Iterable[Expr]:
    for function in functions:
        if isinstance(function, Ranked):
            raise DeclarationError(
                f"rank mismatch: indicator takes scalar functions f of {{f <= 0}}, not a {function.kind}"
            )
        yield scalar_expression(
            function,
            "the argument of indicator",
            "indicator takes the left side of f <= 0; write indicator(f), not indicator(f <= 0)",
        )
