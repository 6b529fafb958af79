"""Symmetric fourth-order operators as short lists, never as 36 entries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, S

__all__ = ["Operator"]


@dataclass(frozen=True)
class Operator:
    """c₀ 𝕀 + c₁ I⊗I + Σ w G⊗H + Σ w D[·]^≥(T) + Σ w D²[Σ g(e_i)](T), the last by (w, g′, T)."""

    c0: Expr = S.Zero
    c1: Expr = S.Zero
    dyads: tuple[tuple[Expr, Any, Any], ...] = ()
    spectral: tuple[tuple[Expr, Any], ...] = ()
    functions: tuple[tuple[Expr, Any], ...] = ()

    @property
    def is_isotropic(self) -> bool:
        """True if only the pair (c₀, c₁) is there."""
        return not self.dyads and not self.spectral and not self.functions

    def __add__(self, other: Operator) -> Operator:
        return Operator(
            self.c0 + other.c0,
            self.c1 + other.c1,
            self.dyads + other.dyads,
            self.spectral + other.spectral,
            self.functions + other.functions,
        )
