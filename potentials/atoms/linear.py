"""Linear arguments of invariants: the pair (c, d) of T = c X + d dev X + …, and its action."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Rational, S

from ..tensor import Deviator, SymmetricTensor, dev

__all__ = ["adjoint", "as_pair", "compose", "linear_part"]

Part = tuple[Expr, Expr]


def linear_part(quantity: Any, variable: Any) -> Part:
    """(c, d) with quantity = c X + d dev X + rest; d = 0 for vectors."""
    terms = quantity.terms()
    c = terms.get(variable, S.Zero)
    return c, (terms.get(Deviator(variable), S.Zero) if isinstance(variable, SymmetricTensor) else S.Zero)


def adjoint(part: Part, quantity: Any) -> Any:
    """(c 𝕀 + d 𝕂) G, 𝕂 = 𝕀 − I⊗I/3; the map is its own adjoint."""
    found = quantity * part[0]
    return found if part[1] == 0 else found + dev(quantity) * part[1]


def as_pair(part: Part) -> Part:
    """c 𝕀 + d 𝕂 as c₀ 𝕀 + c₁ I⊗I."""
    return part[0] + part[1], -part[1] * Rational(1, 3)


def compose(a: Part, b: Part) -> Part:
    """Product of two isotropic pairs (c₀, c₁)."""
    return a[0] * b[0], a[0] * b[1] + a[1] * b[0] + 3 * a[1] * b[1]
