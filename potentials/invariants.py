"""Scalar invariants of tensors: the leaves that a potential is written in.

    tr T,   S:T,   ‖T‖ = √(T:T),   T^≥:T^≥

are real sympy expressions that hold tensors. Their arguments are linear in the variables, with coefficients that depend on
parameters only. `inner(pos(e), pos(e))` and `inner(e, pos(e))` are recognised as the spectral sum Σ ⟨e_i⟩².
"""

from __future__ import annotations

from typing import Any

from sympy import Expr, S, sqrt

from ..errors import DeclarationError
from .scalars import PositivePart
from .tensor import Deviator, IdentityTensor, PositiveTensor, SymmetricTensor, from_terms, scalar_operand

__all__ = ["InnerLeaf", "Invariant", "NormLeaf", "PositiveSquareLeaf", "TraceLeaf", "inner", "norm", "pos", "tr"]


class Invariant(Expr):
    """Real scalar function of tensors, kept whole; `_derivative` differentiates it to a tensor."""

    __slots__ = ()
    is_commutative = True
    is_real = True
    is_extended_real = True
    is_finite = True
    word = ""

    def _eval_derivative(self, s: Any) -> Expr:
        if s in self.free_symbols:
            raise NotImplementedError(f"derivative of {self} by the parameter {s} inside its tensor argument")
        return S.Zero

    def _sympystr(self, printer: Any) -> str:
        return f"{self.word}({', '.join(printer._print(a) for a in self.args)})"

    _sympyrepr = _sympystr


class TraceLeaf(Invariant):
    """tr T."""

    __slots__ = ()
    word = "tr"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\mathrm{{tr}}\left({printer._print(self.args[0])}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


class InnerLeaf(Invariant):
    """S:T."""

    __slots__ = ()
    word = "inner"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        left, right = (rf"\left({printer._print(a)}\right)" for a in self.args)
        body = rf"{left}\!:\!{right}"
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


class NormLeaf(Invariant):
    """‖T‖, Frobenius."""

    __slots__ = ()
    is_nonnegative = True
    is_extended_nonnegative = True
    word = "norm"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\left\|{printer._print(self.args[0])}\right\|"
        return body if exp is None else rf"{body}^{{{exp}}}"


class PositiveSquareLeaf(Invariant):
    """T^≥:T^≥ = Σ ⟨t_i⟩² = dist²(T, negative semidefinite tensors)."""

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


def _tensor(value: object, word: str) -> SymmetricTensor:
    if not isinstance(value, SymmetricTensor):
        raise DeclarationError(f"rank mismatch: {word} takes a tensor, not a scalar")
    return value


def tr(tensor: SymmetricTensor) -> Expr:
    """Trace."""
    terms = _tensor(tensor, "tr").terms()
    if any(a.has(PositiveTensor) for a in terms):
        raise DeclarationError(
            "tr(pos(e)) is not differentiable and not available as an energy; use inner(pos(e), pos(e))"
        )
    rest = from_terms({a: c for a, c in terms.items() if not isinstance(a, (IdentityTensor, Deviator))})
    constant = 3 * sum((c for a, c in terms.items() if isinstance(a, IdentityTensor)), S.Zero)
    return (TraceLeaf(rest) if rest.terms() else S.Zero) + constant


def inner(left: SymmetricTensor, right: SymmetricTensor) -> Expr:
    """Scalar product S:T = tr(ST)."""
    a, b = _tensor(left, "inner"), _tensor(right, "inner")
    if not a.terms() or not b.terms():
        return S.Zero
    if not (a.has(PositiveTensor) or b.has(PositiveTensor)):
        ordered = sorted((a, b), key=lambda t: t.sort_key())
        return InnerLeaf(*ordered)
    if len(a.terms()) == 1 and len(b.terms()) == 1:
        ((x, c),), ((y, d),) = a.terms().items(), b.terms().items()
        if x == y and isinstance(x, PositiveTensor):
            return c * d * PositiveSquareLeaf(x.args[0])
    for x, y in ((a, b), (b, a)):
        if isinstance(x, PositiveTensor) and x.args[0] == y:
            return PositiveSquareLeaf(y)
    raise DeclarationError(
        f"inner({a}, {b}) is not available: the positive part pairs with itself, inner(pos(e), pos(e)), or with its own argument"
    )


def norm(tensor: SymmetricTensor) -> Expr:
    """Frobenius norm ‖T‖ = √(T:T)."""
    value = _tensor(tensor, "norm")
    if not value.terms():
        return S.Zero
    return sqrt(inner(value, value)) if value.has(PositiveTensor) else NormLeaf(value)


def pos(value: Any) -> Any:
    """Positive part: ⟨x⟩ = max(x, 0) of a scalar, the spectral positive part of a tensor."""
    if isinstance(value, SymmetricTensor):
        return PositiveTensor(value)
    return PositivePart(scalar_operand(value, "taking pos of"))
