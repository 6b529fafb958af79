"""Newton's restitution with Coulomb friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import ContactLaw, ContactRule
from .signorini_coulomb import coefficient

__all__ = ["NewtonRestitution"]


@dataclass(frozen=True, kw_only=True)
class NewtonRestitution(ContactLaw):
    r"""0 ≤ u_n⁺ + e u_n⁻ ⊥ p_n ≥ 0 where g ≤ 0 at detection, no contact else; Coulomb at μ p_n.

    A contact enters when it is closed, so a body sinks in by up to h|u_n⁻| before it bounces. `restitution` e in [0, 1], `friction` μ [-].
    In the θ-scheme a single shock loses ½(1 − e²) of the kinetic energy of the approach for any θ; several at once may gain energy with
    friction (Kane's effect): read `shock` in the energy balance. Moreau (1988); Acary (2016), CMAME 313, 1–26.
    """

    label: ClassVar[str] = "newton_restitution"
    restitution: float
    friction: float = 0.0

    def rule(self) -> ContactRule:
        """Only closed candidates are contacts."""
        return ContactRule(
            bias="restitution * approach",
            friction=coefficient(self.friction),
            touching="gap <= 0.0",
        )
