"""A rigid rod between two beads: the distance is kept, in tension and compression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import WireLaw, WireRule

__all__ = ["RigidRod"]


@dataclass(frozen=True, kw_only=True)
class RigidRod(WireLaw):
    r"""u_n + β = 0 on the tension impulse r, which may have either sign; β = (d − (1+π) l₀)/h.

    `prestrain` π < 0 pre-tensions, π > 0 gives slack.
    `corrected` False leaves β out: the length then drifts with the step (the rod of the field's codes).
    No tangential impulse and no moment: free bending. Jean (1999), CMAME 177, 235–257.
    """

    label: ClassVar[str] = "rigid_rod"
    prestrain: float = 0.0  # π [-]
    corrected: bool = True

    def rule(self) -> WireRule:
        """Both signs."""
        return WireRule(
            unilateral=False,
            bias="(distance - (1.0 + prestrain) * natural) / step" if self.corrected else "",
        )
