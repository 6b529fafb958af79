"""A rigid wire between two beads: inextensible, without force when slack."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import WireLaw, WireRule

__all__ = ["RigidWire"]


@dataclass(frozen=True, kw_only=True)
class RigidWire(WireLaw):
    r"""0 ≤ r ⊥ −(u_n + β) ≥ 0, β = (d − (1+π) l₀)/h: taut or slack, never longer.

    `prestrain` π < 0 pre-tensions, π > 0 gives slack.
    `corrected` False leaves β out: the length then drifts with the step (the rod of the field's codes).
    No tangential impulse and no moment: free bending. Jean (1999), CMAME 177, 235–257.
    """

    label: ClassVar[str] = "rigid_wire"
    prestrain: float = 0.0  # π [-]
    corrected: bool = True

    def rule(self) -> WireRule:
        """Tension only."""
        return WireRule(
            unilateral=True,
            bias="(distance - (1.0 + prestrain) * natural) / step" if self.corrected else "",
        )
