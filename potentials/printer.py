"""Scalar expressions as Python text for numba: floats only, `math` functions, ⟨·⟩ and H as plain comparisons."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Rational
from sympy.printing.pycode import PythonCodePrinter

from ..errors import DeclarationError

__all__ = ["NumberPrinter", "number_code"]

_KNOWN = frozenset(
    ("exp log sin cos tan asin acos atan sinh cosh tanh sqrt Abs PositivePart Step").split()  # noqa: SIM905
)


class NumberPrinter(PythonCodePrinter):
    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": True, "allow_unknown_functions": False})

    def _print_Integer(self, expr: Any) -> str:
        return f"{int(expr)}.0"

    def _print_Rational(self, expr: Any) -> str:
        return f"{expr.p}.0/{expr.q}.0"

    _print_Half = _print_Rational

    def _print_Float(self, expr: Any) -> str:
        return repr(float(expr))

    def _print_NumberSymbol(self, expr: Any) -> str:
        return repr(float(expr))

    def _print_Pow(self, expr: Any, rational: bool = False) -> str:
        base, exponent = expr.as_base_exp()
        inside = self.parenthesize(base, 60)
        if exponent == Rational(1, 2):
            return f"math.sqrt({self._print(base)})"
        if exponent == Rational(-1, 2):
            return f"1.0/math.sqrt({self._print(base)})"
        if exponent.is_Integer and 1 < int(exponent) <= 4:
            return "(" + "*".join([f"({self._print(base)})" if not base.is_Symbol else inside] * int(exponent)) + ")"
        if exponent.is_Integer and -4 <= int(exponent) < 0:
            return "1.0/(" + "*".join([f"({self._print(base)})"] * -int(exponent)) + ")"
        return f"({self._print(base)})**({self._print(exponent)})"

    def _print_PositivePart(self, expr: Any) -> str:
        return f"max({self._print(expr.args[0])}, 0.0)"

    def _print_Step(self, expr: Any) -> str:
        return f"(1.0 if {self._print(expr.args[0])} > 0.0 else 0.0)"


def number_code(expression: Expr) -> str:
    """Python text of a scalar expression in symbols; refuses what has no numerical form."""
    for function in expression.atoms():
        if function.is_number and not function.is_finite:
            raise DeclarationError(f"the expression {expression} holds {function}")
    try:
        return str(NumberPrinter().doprint(expression))
    except Exception as error:
        raise DeclarationError(f"no code can be written for {expression}: {str(error).splitlines()[0]}") from None
