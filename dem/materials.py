"""What a sample is made of, in numbers; the laws follow from which of them are given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .laws import (
    CompliantSignoriniCoulomb,
    ContactLaw,
    ElasticRod,
    ElasticWire,
    RigidRod,
    RigidWire,
    SignoriniCoulomb,
    WireLaw,
)

__all__ = ["Laws", "Material"]


@dataclass(frozen=True, kw_only=True)
class Laws:
    """Laws of contacts and wires; None: there are none in the scene."""

    contact: ContactLaw | None = None
    wire: WireLaw | None = None


@dataclass(frozen=True, kw_only=True)
class Material:
    """Contact and wire laws of a sample. Stiffness inf: rigid. `links` False: the beads are loose."""

    friction: float = 0.4
    bead_friction: float = 0.4
    normal_stiffness: float = np.inf  # k_n [N/m]
    tangential_stiffness: float = np.inf  # k_t [N/m]
    wire_law: str = "elastic_wire"
    wire_stiffness: float = 100.0  # k [N], force per unit strain
    prestrain: float = 0.0
    length_correction: bool = True
    links: bool = True

    def laws(self, *, beads: bool = True) -> Laws:
        """The laws that these numbers mean; without `beads` there is neither a second coefficient nor a wire."""
        bead_friction = self.bead_friction if beads else self.friction
        contact: ContactLaw
        if np.isfinite(self.normal_stiffness):
            contact = CompliantSignoriniCoulomb(
                friction=self.friction,
                bead_friction=bead_friction,
                k_n=self.normal_stiffness,
                k_t=self.tangential_stiffness,
            )
        else:
            contact = SignoriniCoulomb(friction=self.friction, bead_friction=bead_friction)
        return Laws(contact=contact, wire=self._wire() if self.links and beads else None)

    def _wire(self) -> WireLaw:
        if self.wire_law == "rigid_rod":
            return RigidRod(prestrain=self.prestrain, corrected=self.length_correction)
        if self.wire_law == "rigid_wire":
            return RigidWire(prestrain=self.prestrain, corrected=self.length_correction)
        law = ElasticRod if self.wire_law == "elastic_rod" else ElasticWire
        return law(stiffness=self.wire_stiffness, prestrain=self.prestrain)
