"""An elastic rod between two beads: a spring in tension and compression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import WireLaw, WireRule

__all__ = ["ElasticRod"]


@dataclass(frozen=True, kw_only=True)
class ElasticRod(WireLaw):
    r"""u_n + β − c r = 0, β = (d − (1+π) l₀)/h, c = l₀/(k h²): exactly implicit Euler of a spring k/l₀.

    `stiffness` k [N] is a force per unit strain (EA), the spring constant is k/l₀ [N/m];
    `prestrain` π < 0 pre-tensions, π > 0 gives slack.
    No tangential impulse and no moment: free bending. Jean (1999), CMAME 177, 235–257.
    """

    label: ClassVar[str] = "elastic_rod"
    stiffness: float  # k [N]
    prestrain: float = 0.0  # π [-]

    def rule(self) -> WireRule:
        """Both signs."""
        return WireRule(
            unilateral=False,
            bias="(distance - (1.0 + prestrain) * natural) / step",
            compliance="natural / (stiffness * step**2)",
        )
