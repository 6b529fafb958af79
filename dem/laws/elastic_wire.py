"""An elastic wire between two beads: a spring in tension, nothing when slack."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import WireLaw, WireRule

__all__ = ["ElasticWire"]


@dataclass(frozen=True, kw_only=True)
class ElasticWire(WireLaw):
    r"""0 ≤ r ⊥ −(u_n + β − c r) ≥ 0, β = (d − (1+π) l₀)/h, c = l₀/(k h²).

    `stiffness` k [N] is a force per unit strain (EA), the spring constant is k/l₀ [N/m];
    `prestrain` π < 0 pre-tensions, π > 0 gives slack.
    No tangential impulse and no moment: free bending. Jean (1999), CMAME 177, 235–257.
    """

    label: ClassVar[str] = "elastic_wire"
    stiffness: float  # k [N]
    prestrain: float = 0.0  # π [-]

    def rule(self) -> WireRule:
        """Tension only."""
        return WireRule(
            unilateral=True,
            bias="(distance - (1.0 + prestrain) * natural) / step",
            compliance="natural / (stiffness * step**2)",
        )
