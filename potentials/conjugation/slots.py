"""Slots of a conjugation: the variables that are exchanged for their duals; everything else in the expression is data.

A scalar linear functional of the slots is kept by its coefficients: X ↦ a:X of a tensor slot, v ↦ a·v of a vector, p ↦ a p of a scalar.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from sympy import Add, Expr, Mul, S

from ..atoms.inner import InnerLeaf, inner
from ..atoms.linear import linear_part
from ..atoms.trace import TraceLeaf, tr
from ..ranked import Ranked
from ..scalars import ScalarVariable
from ..tensor import identity

__all__ = ["FreeMultiplier", "Functional", "Multiplier", "Parts", "functional_of", "mentions", "parts_of"]


class Multiplier(ScalarVariable):
    """Unknown γ ≥ 0 of a minimisation."""

    __slots__ = ()
    role = "multiplier"

    def __new__(cls, name: str) -> Multiplier:
        # positive: √γ² is γ; the value at γ = 0 is the limit
        return ScalarVariable.__xnew__(cls, name, positive=True)


class FreeMultiplier(Multiplier):
    """Unknown of either sign, of an equality f = 0."""

    __slots__ = ()

    def __new__(cls, name: str) -> FreeMultiplier:
        return ScalarVariable.__xnew__(cls, name, real=True)


def mentions(thing: Any, symbols: Iterable[Any]) -> bool:
    """True if one of `symbols` stands in `thing` itself, not only inside a paired symbol (a force holds its variable)."""
    wanted = symbols if isinstance(symbols, (set, frozenset, dict)) else set(symbols)
    if thing in wanted:
        return True
    if getattr(thing, "role", "state") != "state":
        return False
    return any(mentions(a, wanted) for a in thing.args)


@dataclass(frozen=True)
class Parts:
    """T = Σ (c 𝕀 + d 𝕂) X + rest over the slots X, 𝕂 = 𝕀 − I⊗I/3."""

    linear: dict[Any, tuple[Expr, Expr]]
    rest: Ranked


def parts_of(quantity: Ranked, slots: Iterable[Any]) -> Parts:
    """Linear parts of a tensor or vector in the slots of its rank."""
    linear: dict[Any, tuple[Expr, Expr]] = {}
    rest: Any = quantity
    for slot in slots:
        if not isinstance(slot, Ranked) or slot.rank != quantity.rank:
            continue
        c, d = linear_part(quantity, slot)
        if c != 0 or d != 0:
            linear[slot] = (c, d)
            rest = rest - slot * c
            if d != 0:
                from ..tensor import dev

                rest = rest - dev(slot) * d  # type: ignore[arg-type]
    return Parts(linear, rest)


@dataclass
class Functional:
    """x ↦ Σ a_i·x_i + constant."""

    parts: dict[Any, Any] = field(default_factory=dict)
    constant: Expr = S.Zero

    def add(self, slot: Any, coefficient: Any) -> None:
        """Add a coefficient of a slot."""
        total = self.parts[slot] + coefficient if slot in self.parts else coefficient
        if (isinstance(total, Ranked) and not total.terms()) or total == 0:
            self.parts.pop(slot, None)
        else:
            self.parts[slot] = total

    def include(self, other: Functional, factor: Expr) -> None:
        """Add `factor` times another functional."""
        for slot, coefficient in other.parts.items():
            self.add(slot, coefficient * factor)
        self.constant = self.constant + factor * other.constant

    def is_isotropic(self) -> bool:
        """True if every tensor coefficient is a multiple of I and no vector is in it."""
        return all(not isinstance(a, Ranked) or set(a.terms()) == {identity} for a in self.parts.values())


def functional_of(expression: Expr, slots: dict[Any, Any] | list[Any]) -> Functional | None:
    """The affine functional that an expression is, or None."""
    found = Functional()
    if not mentions(expression, slots):
        found.constant = expression
        return found
    if expression in slots:
        found.add(expression, S.One)
        return found
    if isinstance(expression, TraceLeaf):
        split = parts_of(expression.args[0], slots)  # type: ignore[arg-type]
        for slot, (c, _) in split.linear.items():
            found.add(slot, identity * c)
        found.constant = tr(split.rest) if split.rest.terms() else S.Zero  # type: ignore[arg-type]
        return found
    if isinstance(expression, InnerLeaf):
        first, second = expression.args
        if mentions(first, slots) and mentions(second, slots):
            return None
        moving, fixed = (first, second) if mentions(first, slots) else (second, first)
        from ..atoms.linear import adjoint

        split = parts_of(moving, slots)  # type: ignore[arg-type]
        for slot, part in split.linear.items():
            found.add(slot, adjoint(part, fixed))
        found.constant = inner(split.rest, fixed) if split.rest.terms() else S.Zero  # type: ignore[arg-type]
        return found
    if isinstance(expression, Add):
        for term in expression.args:
            part = functional_of(term, slots)  # type: ignore[arg-type]
            if part is None:
                return None
            found.include(part, S.One)
        return found
    if isinstance(expression, Mul):
        moving = [f for f in expression.args if mentions(f, slots)]
        if len(moving) != 1:
            return None
        part = functional_of(moving[0], slots)  # type: ignore[arg-type]
        if part is None:
            return None
        found.include(part, Mul(*(f for f in expression.args if f is not moving[0])))
        return found
    return None
