"""Signorini's condition and Coulomb's friction between rigid bodies (inelastic quasi-shock)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from .rule import ContactLaw, ContactRule
from .signorini import Signorini

__all__ = ["SignoriniCoulomb", "coefficient"]


@dataclass(frozen=True, kw_only=True)
class SignoriniCoulomb(ContactLaw):
    r"""0 ≤ u_n + b ⊥ p_n ≥ 0 and ‖p_t‖ ≤ μ p_n, u_t = −κ p_t with κ ≥ 0 where equality holds; b as in `Signorini`.

    `friction` μ [-] between grains, `bead_friction` where a bead takes part (None: the same), `recovery` as in `Signorini`. Jean (1999).
    """

    label: ClassVar[str] = "signorini_coulomb"
    friction: float
    bead_friction: float | None = None
    recovery: float = 0.0

    def rule(self) -> ContactRule:
        """Without a coefficient it is Signorini's."""
        smooth = Signorini(recovery=self.recovery).rule()
        return replace(smooth, friction=coefficient(self.friction, self.bead_friction))


def coefficient(friction: float, bead_friction: float | None = None) -> str:
    """The expression of μ: absent, one number, or a column."""
    if bead_friction is None or friction == bead_friction:
        return "friction" if friction > 0.0 else ""
    return "bead_friction if bead else friction"
