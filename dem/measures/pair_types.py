"""How many closed contacts of which kind there are."""

from __future__ import annotations

import numpy as np

from .network import KINDS, Network

__all__ = ["contact_counts"]


def contact_counts(network: Network) -> dict[str, int]:
    """Closed contacts by kind: grain_grain, grain_bead, bead_bead, grain_wall, bead_wall, and links: taut, slack, pushing (rods)."""
    pairs = np.bincount(network.kind, minlength=len(KINDS))
    beads = network.is_bead[network.wall[:, 0]]
    return {
        **{kind: int(count) for kind, count in zip(KINDS, pairs, strict=True)},
        "grain_wall": int((~beads).sum()),
        "bead_wall": int(beads.sum()),
        "link_taut": int((network.tension > 0.0).sum()),
        "link_slack": int((network.tension == 0.0).sum()),
        "link_pushing": int((network.tension < 0.0).sum()),
    }
