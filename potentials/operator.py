"""Symmetric fourth-order operators as short lists, never as 36 entries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, S

__all__ = ["Operator"]


@dataclass(frozen=True)
class Operator:
    """c₀ 𝕀 + c₁ I⊗I + Σ w G⊗H + Σ w D[·]^≥(T) + Σ w D²[Σ g(e_i)](T) + Σ w D²e(T) + Σ 𝕃 O 𝕄.

    `functions` hold (w, g′(T)); `extremes` hold (w, n⊗n of the extreme eigenvalue e of T); `sandwiched` hold an operator between two maps
    𝕃 = c 𝕀 + d 𝕂, 𝕂 = 𝕀 − I⊗I/3, each as (c, d), where the argument T is a deviator.
    """

    c0: Expr = S.Zero
    c1: Expr = S.Zero
    dyads: tuple[tuple[Expr, Any, Any], ...] = ()
    spectral: tuple[tuple[Expr, Any], ...] = ()
    functions: tuple[tuple[Expr, Any], ...] = ()
    extremes: tuple[tuple[Expr, Any], ...] = ()
    sandwiched: tuple[tuple[tuple[Expr, Expr], Operator, tuple[Expr, Expr]], ...] = ()

    @property
    def is_isotropic(self) -> bool:
        """True if only the pair (c₀, c₁) is there."""
        return not (self.dyads or self.spectral or self.functions or self.extremes or self.sandwiched)

    def between(self, left: tuple[Expr, Expr], right: tuple[Expr, Expr]) -> Operator:
        """𝕃 O 𝕄 for spectral operators O: multiplied out where both maps are multiples of 𝕀; zero if one of them is zero."""
        if left == (S.Zero, S.Zero) or right == (S.Zero, S.Zero):
            return Operator()
        if left[1] == 0 and right[1] == 0:
            factor = left[0] * right[0]
            return Operator(
                spectral=tuple((w * factor, t) for w, t in self.spectral),
                functions=tuple((w * factor, t) for w, t in self.functions),
                extremes=tuple((w * factor, t) for w, t in self.extremes),
            )
        return Operator(sandwiched=((left, self, right),))

    def __add__(self, other: Operator) -> Operator:
        return Operator(
            self.c0 + other.c0,
            self.c1 + other.c1,
            self.dyads + other.dyads,
            self.spectral + other.spectral,
            self.functions + other.functions,
            self.extremes + other.extremes,
            self.sandwiched + other.sandwiched,
        )
