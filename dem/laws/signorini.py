"""Signorini's condition between rigid bodies without friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import ContactLaw, ContactRule

__all__ = ["Signorini"]


@dataclass(frozen=True, kw_only=True)
class Signorini(ContactLaw):
    r"""0 ≤ u_n + b ⊥ p_n ≥ 0 with b = g/h for g > 0 and b = η g/h for g < 0 (velocity form with the gap at detection).

    `recovery` η [-] in [0, 1] is the part of an overlap that is pushed out in one step: 0 is the inelastic quasi-shock of the
    field's codes, which never pushes back; 1 removes the overlap at once and leaves its velocity behind.
    Moreau (1988); Jean (1999), CMAME 177, 235–257.
    """

    label: ClassVar[str] = "signorini"
    recovery: float = 0.0

    def rule(self) -> ContactRule:
        """Normal only: neither tangential unknown nor rotation."""
        return ContactRule(bias="(gap if gap > 0.0 else recovery * gap) / step")
