"""⟨x⟩ = max(x, 0) of a scalar, and its step.

sympy's `Max` differentiates to `Heaviside` and `DiracDelta`, which take values at the kink that are neither one-sided limit;
`PositivePart` and `Step` are used instead: d⟨x⟩/dx = H(x), dH/dx = 0, H(0) = 0, an element of the generalised derivative.
"""

from __future__ import annotations

from typing import Any

from sympy import Expr, Function, S

from ...errors import DeclarationError
from ..ranked import Ranked, scalar_operand
from ..tensor import PositiveTensor, SymmetricTensor
from .atom import Atom

__all__ = ["Positive", "PositivePart", "Step", "StepAtom", "pos", "tidy"]


class PositivePart(Function):
    """⟨x⟩ = max(x, 0): convex, non-decreasing, positively homogeneous of degree 1."""

    is_real = True
    is_nonnegative = True

    @classmethod
    def eval(cls, x: Any) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        if x.is_nonnegative:
            return x
        return S.Zero if x.is_nonpositive else None

    def fdiff(self, argindex: int = 1) -> Any:
        return Step(self.args[0])

    def _sympystr(self, printer: Any) -> str:
        return f"pos({printer._print(self.args[0])})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\left\langle {printer._print(self.args[0])}\right\rangle"
        return body if exp is None else rf"{body}^{{{exp}}}"


class Step(Function):
    """H(x) = 1 for x > 0, else 0; its derivative is taken as 0 (the kink has measure zero)."""

    is_real = True
    is_nonnegative = True

    @classmethod
    def eval(cls, x: Any) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        if x.is_positive:
            return S.One
        return S.Zero if x.is_nonpositive else None

    def fdiff(self, argindex: int = 1) -> Expr:
        return S.Zero

    def _eval_power(self, expt: Expr) -> Expr | None:
        return self if expt.is_positive else None

    def _sympystr(self, printer: Any) -> str:
        return f"step({printer._print(self.args[0])})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"H\left({printer._print(self.args[0])}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


def tidy(expression: Any) -> Any:
    """Write ⟨x⟩ H(x) as ⟨x⟩, xⁿ⁺¹/x as xⁿ and (cx)ⁿ⁺¹/x as c(cx)ⁿ (the quotients would be 0/0 at zero)."""
    if expression.is_Add:
        return expression.func(*(tidy(a) for a in expression.args))
    if not expression.is_Mul:
        return expression
    parts = [tidy(a) for a in expression.args]
    positive = {part.as_base_exp()[0].args[0] for part in parts if isinstance(part.as_base_exp()[0], PositivePart)}
    kept = [a for a in parts if not (isinstance(a, Step) and a.args[0] in positive)]
    exponents: dict[Any, Any] = {}
    for part in kept:
        base, exponent = part.as_base_exp()
        exponents[base] = exponents.get(base, S.Zero) + exponent
    _merge_multiples(exponents)
    if any(not e.is_number for e in exponents.values()):
        kept = [base**exponent for base, exponent in exponents.items()]
    return expression.func(*kept)


def _merge_multiples(exponents: dict[Any, Any]) -> None:
    """1/x into a power of cx, in place of a product kept as exponents by base."""
    for base in [b for b, e in exponents.items() if e.is_integer and e.is_negative and b.free_symbols]:
        for other in list(exponents):
            if other == base or exponents[other].is_number or not base.free_symbols <= other.free_symbols:
                continue
            factor = other / base
            if not factor.free_symbols & base.free_symbols:
                exponent = exponents.pop(base)
                exponents[other] += exponent
                exponents[factor] = exponents.get(factor, S.Zero) - exponent
                break


class Positive(Atom):
    """Convex, non-decreasing, non-negative, of degree 1; its conjugate is the indicator of [0, 1]."""

    word = "pos"
    node = PositivePart
    smoothness = "continuous"

    def curvature(self, node: Any, require: Any) -> str:
        return "convex"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        return (1,)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def degree(self, node: Any) -> Expr:
        return S.One

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        return np.maximum(arguments[0], 0.0)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        import cvxpy

        return cvxpy.pos(arguments[0])

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        return S.Zero, (-dual, dual - 1)


class StepAtom(Atom):
    """Derivative of ⟨x⟩; it appears in gradients, never in a convex potential."""

    word = "step"
    node = Step
    smoothness = "continuous"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        return (1,)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        return 1

    def degree(self, node: Any) -> Expr:
        return S.Zero

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        import numpy as np

        return np.where(np.asarray(arguments[0]) > 0.0, 1.0, 0.0)


def pos(value: Any) -> Any:
    """Positive part: ⟨x⟩ = max(x, 0) of a scalar, the spectral positive part of a tensor."""
    if isinstance(value, SymmetricTensor):
        return PositiveTensor(value)
    if isinstance(value, Ranked):
        raise DeclarationError(f"rank mismatch: pos takes a scalar or a tensor, not a {value.kind}")
    return PositivePart(scalar_operand(value, "taking pos of", "scalar"))
