r"""The four wire laws between consecutive beads, as data.

With d = |x_i − x_j|, u_n = ḋ, tension impulse r = −p_n = h T, β = (d − (1+π) l₀)/h and c = l₀/(k h²):

| law | one-step form |
|---|---|
| rigid rod | u_n + β = 0 (without β when `corrected` is False) |
| elastic rod | u_n + β − c r = 0 |
| rigid wire | 0 ≤ r ⊥ −(u_n + β) ≥ 0 |
| elastic wire | 0 ≤ r ⊥ −(u_n + β − c r) ≥ 0 |

All four are "add c to the diagonal, add β to the free velocity, with or without the sign". Elastic rod is exactly implicit Euler of a
spring; the rigid laws are the limit k → ∞. k [N] is a force per unit strain (EA); the spring constant is k/l₀. No tangential
impulse, no moment: free bending. Laws after Jean (1999) and the LMGC90 documentation (ROD, WIRE laws).
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["WIRE_LAWS", "WireLaw"]


@dataclass(frozen=True)
class WireLaw:
    """One-step behaviour of a link: `unilateral` (tension only), `elastic` (finite stiffness)."""

    name: str
    unilateral: bool
    elastic: bool


WIRE_LAWS: dict[str, WireLaw] = {
    law.name: law
    for law in (
        WireLaw("rigid_rod", unilateral=False, elastic=False),
        WireLaw("elastic_rod", unilateral=False, elastic=True),
        WireLaw("rigid_wire", unilateral=True, elastic=False),
        WireLaw("elastic_wire", unilateral=True, elastic=True),
    )
}
