"""What the wires of one sample carry and how they lie, from the state that a deposit or a triaxial test left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem.bodies import Assembly
from ..dem.measures import (
    Network,
    active_length,
    permutation_test,
    straightness,
    wire_fabric,
    wire_fabric_interval,
    wire_isotropy_test,
)

__all__ = ["MULTIPLES", "Segments", "definition_holds", "knee", "local_fabric", "network_of", "segments"]

Array = NDArray[np.float64]

MULTIPLES = np.arange(0.0, 8.01, 0.25)  # m


def network_of(content: Mapping[str, Any], friction: float) -> Network:
    """The network in the content of a finished run."""
    return Network.of_assembly(Assembly.from_arrays(dict(content["assembly"])), friction=friction)


@dataclass(frozen=True, kw_only=True)
class Segments:
    """λ̄^m_max in mean grain radii over `MULTIPLES`, share of active length, permutation test at m = 3, straightness, fabric."""

    radii: Array
    share: Array
    at_three: float
    null_mean: float  # radii
    null_high: float
    p_value: float
    straight_active: float
    straight_inactive: float
    fabric: Array  # (3, 3)
    fabric_low: Array
    fabric_high: Array
    isotropy_p: float
    local: Array  # radial, around, vertical
    spacing: float  # radii
    mean_tension: float  # N


def segments(network: Network, seed: int, samples: int) -> Segments:
    """The measures of one state; `seed` of the permutations, `samples` of each."""
    rng = np.random.default_rng([6, seed])
    radius = network.grain_radius
    found = [active_length(network, m=float(m)) for m in MULTIPLES]
    three = active_length(network)
    chance = permutation_test(network, rng, samples=samples)
    straight = straightness(network)
    low, high = wire_fabric_interval(network, rng, samples=samples)
    return Segments(
        radii=np.array([f.radii for f in found]),
        share=np.array([f.share for f in found]),
        at_three=three.radii,
        null_mean=chance.null_mean / radius,
        null_high=chance.null_high / radius,
        p_value=chance.p_value,
        straight_active=straight.active,
        straight_inactive=straight.inactive,
        fabric=wire_fabric(network),
        fabric_low=low,
        fabric_high=high,
        isotropy_p=wire_isotropy_test(network, rng, samples=samples).p_value,
        local=local_fabric(network),
        spacing=three.spacing / radius,
        mean_tension=three.mean_tension,
    )


def local_fabric(network: Network) -> Array:
    """Mean squares of the directions of the wire segments along the radius from the axis of the sample, around it, and upwards; sum 1."""
    middle = 0.5 * (network.x[network.link[:, 0]] + network.x[network.link[:, 1]])
    centre = middle[:, :2].mean(axis=0)
    out = middle[:, :2] - centre
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    around = np.stack([-out[:, 1], out[:, 0]], axis=1)
    vector, length = network.link_vector, network.link_length
    n = vector / length[:, None]
    parts = np.stack([np.sum(n[:, :2] * out, axis=1), np.sum(n[:, :2] * around, axis=1), n[:, 2]])
    return np.asarray(parts**2 @ length / length.sum(), dtype=np.float64)


def knee(curve: Array) -> float:
    """m at which the falling curve is farthest below the chord between its ends: where it bends most."""
    curve = np.asarray(curve, dtype=float)
    zero = np.flatnonzero(curve <= 0.0)
    last = int(zero[0]) if zero.size else len(curve) - 1
    m, y = MULTIPLES[: last + 1], curve[: last + 1] / curve[0]
    chord = y[0] + (y[-1] - y[0]) * (m - m[0]) / (m[-1] - m[0])
    return float(m[int(np.argmax(chord - y))])


def definition_holds(network: Network) -> dict[str, bool]:
    """The four properties of λ̄^m_max that follow from its definition, on this network."""
    from dataclasses import replace

    lengths = [active_length(network, m=float(m)).length for m in MULTIPLES]
    wires, place = np.unique(network.link_wire, return_inverse=True)
    longest = float(np.bincount(place, weights=network.link_length, minlength=len(wires)).max())
    doubled = replace(network, tension=2.0 * network.tension)
    mean = active_length(network).mean_tension
    beyond = float(np.abs(network.tension).max()) / mean * (1.0 + 1e-9) if mean > 0.0 else 1.0
    return {
        "falls with m": all(b <= a for a, b in pairwise(lengths)),
        "longest wire at m = 0": bool(abs(lengths[0] - longest) <= 1e-12 * longest),
        "independent of scale": [active_length(doubled, m=float(m)).length for m in MULTIPLES] == lengths,
        "zero above the largest tension": active_length(network, m=beyond).length == 0.0,
    }
