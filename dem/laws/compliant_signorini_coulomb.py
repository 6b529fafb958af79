"""Signorini–Coulomb with a stiffness in both directions, taken as implicit compliance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .rule import ContactLaw, ContactRule
from .signorini_coulomb import coefficient

__all__ = ["CompliantSignoriniCoulomb"]


@dataclass(frozen=True, kw_only=True)
class CompliantSignoriniCoulomb(ContactLaw):
    r"""0 ≤ u_n + g/h + c_n p_n ⊥ p_n ≥ 0 and Coulomb on u_t + c_t (p_t − p_t⁰), c = 1/(k h²), p_t⁰ the impulse of the step before.

    The force at the end of the step is −k g there: implicit Euler, stable at any step. Elasticity is that of the grains and no trace of
    the tolerance. `k_n` and `k_t` [N/m], `friction` μ [-], `bead_friction` where a bead takes
    part (None: the same).
    Alart and Curnier (1991), CMAME 92, 353–375.
    """

    label: ClassVar[str] = "compliant_signorini_coulomb"
    friction: float
    k_n: float
    k_t: float
    bead_friction: float | None = None

    def rule(self) -> ContactRule:
        """Without friction there is no tangential compliance either."""
        mu = coefficient(self.friction, self.bead_friction)
        return ContactRule(
            bias="gap / step",
            normal_compliance="1.0 / (k_n * step**2)",
            tangential_compliance="1.0 / (k_t * step**2)" if mu else "",
            friction=mu,
        )

    def normal_stiffness(self) -> float:
        """k_n [N/m]."""
        return self.k_n
