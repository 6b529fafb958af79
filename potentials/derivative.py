"""Derivatives of a potential by tensors, through its invariants.

With F(l_1, l_2, …) a function of invariants l_i of T = (c 𝕀 + d 𝕂) X + …, 𝕂 = 𝕀 − I⊗I/3,

    ∂F/∂X       = Σ_i F_i ∂l_i,
    ∂²F/∂X∂Y    = Σ_ij F_ij ∂l_i ⊗ ∂l_j + Σ_i F_i ∂²l_i,

the second as an `Operator`, a short list c₀ 𝕀 + c₁ I⊗I + Σ w G⊗H + Σ w D[·]^≥(T), never as 36 entries. The scalar derivatives
are taken by sympy with the invariants replaced by dummies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from sympy import Dummy, Expr, Rational, S, default_sort_key, sympify

from ..errors import DeclarationError
from .invariants import InnerLeaf, Invariant, NormLeaf, PositiveSquareLeaf, TraceLeaf
from .scalars import ForceScalar, ScalarVariable, tidy
from .tensor import Deviator, IdentityTensor, PositiveTensor, SymmetricTensor, TensorSum, TensorSymbol, dev, identity

__all__ = ["Operator", "gradient", "invariants_of", "is_constant", "second_derivative"]


@dataclass(frozen=True)
class Operator:
    """Symmetric fourth-order operator c₀ 𝕀 + c₁ I⊗I + Σ w G⊗H + Σ w D[·]^≥(T)."""

    c0: Expr = S.Zero
    c1: Expr = S.Zero
    dyads: tuple[tuple[Expr, SymmetricTensor, SymmetricTensor], ...] = ()
    spectral: tuple[tuple[Expr, SymmetricTensor], ...] = ()

    @property
    def is_isotropic_constant(self) -> bool:
        """True if the operator is an isotropic pair (c₀, c₁) of parameters."""
        return not self.dyads and not self.spectral and is_constant(self.c0) and is_constant(self.c1)

    def __add__(self, other: Operator) -> Operator:
        return Operator(
            self.c0 + other.c0, self.c1 + other.c1, self.dyads + other.dyads, self.spectral + other.spectral
        )


def invariants_of(expression: Expr) -> list[Invariant]:
    """Invariants in the expression, in a fixed order."""
    return sorted(expression.atoms(Invariant), key=default_sort_key)


def is_constant(expression: Expr) -> bool:
    """True if the expression depends on parameters only."""
    return not expression.has(Invariant) and not expression.atoms(ScalarVariable, ForceScalar)


def linear_part(tensor: SymmetricTensor, variable: TensorSymbol) -> tuple[Expr, Expr]:
    """(c, d) with tensor = c X + d dev X + rest."""
    terms = tensor.terms()
    return terms.get(variable, S.Zero), terms.get(Deviator(variable), S.Zero)


def _apply(part: tuple[Expr, Expr], tensor: SymmetricTensor) -> SymmetricTensor:
    return tensor * part[0] + dev(tensor) * part[1]


def _leaf_gradient(leaf: Invariant, x: TensorSymbol) -> SymmetricTensor:
    first = leaf.args[0]
    assert isinstance(first, SymmetricTensor)
    part = linear_part(first, x)
    if isinstance(leaf, TraceLeaf):
        return identity * part[0]
    if isinstance(leaf, InnerLeaf):
        second = leaf.args[1]
        assert isinstance(second, SymmetricTensor)
        return _apply(part, second) + _apply(linear_part(second, x), first)
    if part == (S.Zero, S.Zero):
        return TensorSum()
    if isinstance(leaf, NormLeaf):
        return _apply(part, first) / leaf
    if isinstance(leaf, PositiveSquareLeaf):
        return _apply(part, PositiveTensor(first)) * 2
    raise DeclarationError(f"no derivative is known for {leaf}")


def _pair(part: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return part[0] + part[1], -part[1] * Rational(1, 3)


def _compose(a: tuple[Expr, Expr], b: tuple[Expr, Expr]) -> tuple[Expr, Expr]:
    return a[0] * b[0], a[0] * b[1] + a[1] * b[0] + 3 * a[1] * b[1]


def _leaf_second(leaf: Invariant, x: TensorSymbol, y: TensorSymbol, weight: Expr) -> Operator:
    first = leaf.args[0]
    assert isinstance(first, SymmetricTensor)
    px, py = linear_part(first, x), linear_part(first, y)
    if isinstance(leaf, TraceLeaf):
        return Operator()
    if isinstance(leaf, InnerLeaf):
        second = leaf.args[1]
        assert isinstance(second, SymmetricTensor)
        qx, qy = linear_part(second, x), linear_part(second, y)
        one, two = _compose(_pair(px), _pair(qy)), _compose(_pair(qx), _pair(py))
        return Operator(weight * (one[0] + two[0]), weight * (one[1] + two[1]))
    if px == (S.Zero, S.Zero) or py == (S.Zero, S.Zero):
        return Operator()
    if isinstance(leaf, NormLeaf):
        pair = _compose(_pair(px), _pair(py))
        left, right = _apply(px, first) / leaf, _apply(py, first) / leaf
        return Operator(weight * pair[0] / leaf, weight * pair[1] / leaf, ((-weight / leaf, left, right),))
    if isinstance(leaf, PositiveSquareLeaf):
        if px[1] != 0 or py[1] != 0:
            raise DeclarationError(
                f"the second derivative of {leaf} by a deviator is not available; take pos of the tensor itself"
            )
        return Operator(spectral=((2 * weight * px[0] * py[0], first),))
    raise DeclarationError(f"no second derivative is known for {leaf}")


def _opened(expression: Any) -> tuple[Any, list[Invariant], list[Dummy]]:
    leaves = invariants_of(expression)
    dummies = [Dummy(f"l{i}", real=True) for i in range(len(leaves))]
    return expression.xreplace(dict(zip(leaves, dummies, strict=True))), leaves, dummies


def gradient(expression: Expr, variable: TensorSymbol | ScalarVariable) -> SymmetricTensor | Expr:
    """∂F/∂X: a tensor for a tensor variable, a scalar for a scalar one."""
    body, leaves, dummies = _opened(sympify(expression))
    back = dict(zip(dummies, leaves, strict=True))
    if isinstance(variable, ScalarVariable):
        return tidy(body.diff(variable).xreplace(back))
    total: SymmetricTensor = TensorSum()
    for dummy, leaf in zip(dummies, leaves, strict=True):
        weight = body.diff(dummy)
        if weight != 0:
            total = total + tidy(weight.xreplace(back)) * _leaf_gradient(leaf, variable)
    return total


def second_derivative(expression: Expr, x: TensorSymbol, y: TensorSymbol) -> Operator:
    """∂²F/∂X∂Y as an operator list."""
    body, leaves, dummies = _opened(sympify(expression))
    back = dict(zip(dummies, leaves, strict=True))
    total = Operator()
    for i, a in zip(dummies, leaves, strict=True):
        slope = body.diff(i)
        if slope == 0:
            continue
        total = total + _leaf_second(a, x, y, tidy(slope.xreplace(back)))
        for j, b in zip(dummies, leaves, strict=True):
            weight = slope.diff(j)
            if weight == 0:
                continue
            g, h = _leaf_gradient(a, x), _leaf_gradient(b, y)
            total = total + _dyad(tidy(weight.xreplace(back)), g, h)
    return _gathered(total)


def _dyad(weight: Expr, g: SymmetricTensor, h: SymmetricTensor) -> Operator:
    a, b = g.terms(), h.terms()
    if not a or not b:
        return Operator()
    if all(isinstance(t, IdentityTensor) for t in (*a, *b)):
        return Operator(c1=weight * a[identity] * b[identity])
    return Operator(dyads=((weight, g, h),))


def _gathered(operator: Operator) -> Operator:
    found: dict[SymmetricTensor, Expr] = {}
    for weight, tensor in operator.spectral:
        found[tensor] = found.get(tensor, S.Zero) + weight
    ordered = sorted(found, key=default_sort_key)
    return replace(operator, spectral=tuple((found[t], t) for t in ordered if found[t] != 0))
