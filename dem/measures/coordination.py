r"""Coordination: contacts per body, with and without rattlers, and the surplus of contacts over degrees of freedom.

Z = (2 N_c + N_w)/N: a contact between bodies counts for both, one with a wall for its body. Rattlers carry no force network: bodies
with fewer than `least` contacts, taken out again and again until none is left (what remains is the core of that order of the contact
graph). A body between frictionless contacts needs d + 1 of them, with friction two can hold it: that is the default. A frictionless
packing at jamming is isostatic: as many contacts as degrees of freedom, d per body that is no rattler, so Z → 2d far from walls.

Moukarzel (1998), PRL 81, 1634; O'Hern et al. (2003), PRE 68, 011306; Agnolin and Roux (2007), PRE 76, 061302.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = ["Coordination", "coordination", "rattlers"]


@dataclass(frozen=True, kw_only=True)
class Coordination:
    """Mean numbers of contacts per body of a phase [-]."""

    mean: float  # over all bodies of the phase
    without_rattlers: float  # over those that are none, contacts among them
    rattler_fraction: float
    by_body: NDArray[np.int64]  # (n,) contacts of every body of the sample
    surplus: (
        int  # contacts (and taut links) less d per body that is no rattler, whole sample, fixed bodies without freedom
    )


def _edges(network: Network, *, links: bool) -> NDArray[np.int64]:
    taut = network.link[network.tension > 0.0] if links else network.link[:0]
    return np.concatenate([network.pair, taut])


def _degrees(network: Network, edges: NDArray[np.int64], kept: NDArray[np.bool_]) -> NDArray[np.int64]:
    inside = edges[kept[edges].all(axis=1)]
    walls = network.wall[:, 0]
    return (
        np.bincount(inside.ravel(), minlength=len(kept)) + np.bincount(walls[kept[walls]], minlength=len(kept))
    ).astype(np.int64)


def rattlers(network: Network, *, least: int | None = None) -> NDArray[np.bool_]:
    """(n,) True for bodies outside the core in which everybody has `least` contacts; taut links hold a bead, too.

    Default: 2, or d + 1 in a sample without friction. Fixed bodies never rattle.
    """
    if least is None:
        least = network.dimension + 1 if len(network.pair) and not network.friction.any() else 2
    if least < 1:
        raise InputError(f"least = {least}: a body without contact rattles, least is 1 or more")
    edges = _edges(network, links=True)
    kept = np.ones(len(network.x), dtype=bool)
    while True:
        loose = kept & ~network.fixed & (_degrees(network, edges, kept) < least)
        if not loose.any():
            return ~kept
        kept &= ~loose


def coordination(network: Network, *, phase: str = "grains", least: int | None = None) -> Coordination:
    """Coordination of a phase ("grains", "beads", "all"), contacts with any body and with walls counted; `least` as in `rattlers`."""
    chosen = network.of_phase(phase) & ~network.fixed
    everybody = np.ones(len(network.x), dtype=bool)
    degree = _degrees(network, network.pair, everybody)
    loose = rattlers(network, least=least)
    kept = ~loose
    core = _degrees(network, network.pair, kept)
    held = _edges(network, links=True)
    count = int(kept[held].all(axis=1).sum() + kept[network.wall[:, 0]].sum())
    return Coordination(
        mean=float(degree[chosen].mean()) if chosen.any() else float("nan"),
        without_rattlers=float(core[chosen & kept].mean()) if (chosen & kept).any() else float("nan"),
        rattler_fraction=float(loose[chosen].mean()) if chosen.any() else float("nan"),
        by_body=degree,
        surplus=count - network.dimension * int((kept & ~network.fixed).sum()),
    )
