r"""Mobilised friction: how near contacts are to the Coulomb limit, and which of them are on it.

The mobilised friction of a contact is ‖f_t‖/(μ f_n) in [0, 1]. It slides where this reaches 1 − tolerance; a step whose contacts were cut
to the cone holds equality to round-off, so the default tolerance 1e-6 only absorbs that. Contacts without friction have no limit and
are left out.

Radjai, Jean, Moreau and Roux (1996), PRL 77, 274.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = ["mobilised_friction", "sliding_fraction"]


def mobilised_friction(network: Network, *, kind: str | None = None) -> NDArray[np.float64]:
    """‖f_t‖/(μ f_n) [-] of the contacts of a kind that have friction, (k,). `InputError` where the coefficients are not known."""
    chosen = network.of_kind(kind)
    mu = network.friction[chosen]
    if np.isnan(mu).any():
        raise InputError("sliding: the friction of some contacts is not known: make the network with friction=...")
    limit = mu * network.normal_force[chosen]
    with_friction = (mu > 0.0) & (limit != 0.0)  # a coefficient of 1e-320 is none
    tangential = np.linalg.norm(network.tangential_force[chosen][with_friction], axis=1)
    return tangential / limit[with_friction]


def sliding_fraction(network: Network, *, kind: str | None = None, tolerance: float = 1e-6) -> float:
    """Share of the frictional contacts of a kind with ‖f_t‖ ≥ (1 − tolerance) μ f_n [-]; nan without such contacts."""
    if not 0.0 <= tolerance < 1.0:
        raise InputError(f"tolerance = {tolerance}: lies in [0, 1), relative to the limit μ f_n")
    mobilised = mobilised_friction(network, kind=kind)
    return float(np.mean(mobilised >= 1.0 - tolerance)) if len(mobilised) else float("nan")
