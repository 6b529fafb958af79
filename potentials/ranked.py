"""What tensors and vectors share: sums, products with scalars, a typed zero, and refusals.

A ranked quantity is a sympy `Basic` but not an `Expr`: it can be added to its own kind and multiplied by scalars, and nothing else, so
that it never commutes into a product of scalars by accident. It is kept as a canonical linear combination Σ c_k a_k of atoms a_k.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sympy import Basic, Expr, Integer, S, Tuple, default_sort_key, sympify

from ..errors import DeclarationError

__all__ = ["Ranked", "rank_word", "scalar_operand", "sorted_terms"]


def scalar_operand(value: object, action: str, kind: str = "tensor") -> Expr:
    """Turn a number or sympy scalar into an `Expr`; strings are refused (they would be evaluated)."""
    if isinstance(value, Ranked):
        raise DeclarationError(
            f"rank mismatch: {action} a {kind} and a {value.kind} is not defined; use inner(a, b) for the scalar product"
        )
    try:
        number = sympify(value, strict=True)
    except Exception:
        raise DeclarationError(f"rank mismatch: {action} a {kind} and {type(value).__name__} is not defined") from None
    if not isinstance(number, Expr):
        raise DeclarationError(f"rank mismatch: {action} a {kind} and {type(value).__name__} is not defined")
    if number is S.NaN or number.has(S.NaN, S.ComplexInfinity, S.Infinity, S.NegativeInfinity):
        raise DeclarationError(f"a coefficient of a {kind} must be finite")
    return number


def rank_word(value: object) -> str:
    """What a value is, as a word in messages: "tensor", "vector", "scalar", or the name of its type."""
    if isinstance(value, Ranked):
        return value.kind
    return "scalar" if isinstance(value, (Expr, int, float)) else type(value).__name__


class Ranked(Basic):
    """Quantity of rank 1 or 2; `kind` is its word in messages."""

    __slots__ = ()
    __array_ufunc__ = None
    rank = 0
    kind = ""

    def terms(self) -> dict[Any, Expr]:
        """Atoms and their coefficients."""
        return {self: S.One}

    @classmethod
    def linear(cls, pairs: Iterable[tuple[Any, Any]]) -> Any:
        """Canonical sum of (quantity, coefficient) pairs of this kind; the empty sum is the typed zero."""
        raise NotImplementedError

    def _operand(self, value: object, action: str) -> Any:
        if isinstance(value, Ranked):
            if value.rank == self.rank:
                return value
            raise DeclarationError(f"rank mismatch: {action} a {self.kind} and a {value.kind}")
        if isinstance(value, (int, Integer)) and value == 0:
            return self.linear(())
        remedy = "; write scalar * identity for a spherical tensor" if self.rank == 2 else ""
        raise DeclarationError(f"rank mismatch: {action} a {self.kind} and a scalar{remedy}")

    def __add__(self, other: object) -> Any:
        return self.linear([(self, S.One), (self._operand(other, "adding"), S.One)])

    __radd__ = __add__

    def __sub__(self, other: object) -> Any:
        return self.linear([(self, S.One), (self._operand(other, "subtracting"), S.NegativeOne)])

    def __rsub__(self, other: object) -> Any:
        return self.linear([(self._operand(other, "subtracting"), S.One), (self, S.NegativeOne)])

    def __neg__(self) -> Any:
        return self.linear([(self, S.NegativeOne)])

    def __mul__(self, other: object) -> Any:
        return self.linear([(self, scalar_operand(other, "multiplying", self.kind))])

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Any:
        divisor = scalar_operand(other, "dividing", self.kind)
        if divisor.is_zero:
            raise DeclarationError(f"a {self.kind} cannot be divided by zero")
        return self.linear([(self, S.One / divisor)])

    def __rtruediv__(self, other: object) -> Any:
        raise DeclarationError(f"rank mismatch: nothing can be divided by a {self.kind}")

    def __pow__(self, other: object) -> Any:
        raise DeclarationError(f"rank mismatch: a {self.kind} has no power; write inner(a, a) or norm(a)**n")

    _eval_power = __pow__  # sympy's sqrt asks here

    def __abs__(self) -> Any:
        raise DeclarationError(f"rank mismatch: a {self.kind} has no absolute value; write norm(a)")

    def _shown(self, printer: Any, latex: bool) -> str:
        """Text of an atom; sums are written by `shown_sum`."""
        raise NotImplementedError

    def _sympystr(self, printer: Any) -> str:
        return self._shown(printer, latex=False)

    def _latex(self, printer: Any) -> str:
        return self._shown(printer, latex=True)

    _sympyrepr = _sympystr

    def _repr_latex_(self) -> str:
        from sympy import latex

        return f"$\\displaystyle {latex(self)}$"


def sorted_terms(pairs: Iterable[tuple[Ranked, Any]]) -> list[Tuple]:
    """Pairs (atom, coefficient) with equal atoms gathered and zeros dropped, in a fixed order."""
    found: dict[Any, Expr] = {}
    for quantity, coefficient in pairs:
        for atom, inner_coefficient in quantity.terms().items():
            found[atom] = found.get(atom, S.Zero) + coefficient * inner_coefficient
    return [Tuple(a, found[a]) for a in sorted(found, key=default_sort_key) if found[a] != 0]


def shown_term(text: str, c: Expr, body: str, printer: Any, latex: bool) -> str:
    """`text` with the term c·body appended."""
    negative = c.could_extract_minus_sign()
    size = -c if negative else c
    factor = printer._print(size)
    if size.is_Add:
        factor = rf"\left({factor}\right)" if latex else f"({factor})"
    shown = body if size == 1 else f"{factor}{' ' if latex else '*'}{body}"
    return text + (" - " if text else "-") + shown if negative else text + (" + " if text else "") + shown
