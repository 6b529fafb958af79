"""Contact laws and wire laws, one file each, and the two tables that find them by the name a scene file uses.

`rule` says how a law is written and how to add one.
"""

from .compliant_signorini_coulomb import CompliantSignoriniCoulomb
from .elastic_rod import ElasticRod
from .elastic_wire import ElasticWire
from .newton_restitution import NewtonRestitution
from .rigid_rod import RigidRod
from .rigid_wire import RigidWire
from .rule import ContactLaw, ContactRule, WireLaw, WireRule
from .signorini import Signorini
from .signorini_coulomb import SignoriniCoulomb

__all__ = [
    "CONTACT_LAWS",
    "WIRE_LAWS",
    "CompliantSignoriniCoulomb",
    "ContactLaw",
    "ContactRule",
    "ElasticRod",
    "ElasticWire",
    "NewtonRestitution",
    "RigidRod",
    "RigidWire",
    "Signorini",
    "SignoriniCoulomb",
    "WireLaw",
    "WireRule",
]

CONTACT_LAWS: dict[str, type[ContactLaw]] = {
    law.label: law for law in (Signorini, SignoriniCoulomb, CompliantSignoriniCoulomb, NewtonRestitution)
}
WIRE_LAWS: dict[str, type[WireLaw]] = {law.label: law for law in (RigidRod, ElasticRod, RigidWire, ElasticWire)}
