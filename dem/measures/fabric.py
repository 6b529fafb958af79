r"""Fabric: how contacts and wires are directed.

F = Σ w n ⊗ n / Σ w over directions n: trace 1, and I/d when no direction is preferred. Contacts count once each (or by their normal
force), wire segments by their length, F = (1/L) ∫ τ ⊗ τ ds. The density of directions of second order that has this fabric is
E(n) = (1 + n·D n)/ω, D = (d (d+2)/2) dev F, with ω the area of the unit sphere: D = 15/2 dev F in space, 4 dev F in the plane.

Satake (1982), IUTAM Conf. Deformation and Failure of Granular Materials; Kanatani (1984), Int. J. Eng. Sci. 22, 149–164.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = [
    "IsotropyTest",
    "anisotropy",
    "contact_fabric",
    "fabric",
    "wire_fabric",
    "wire_fabric_interval",
    "wire_isotropy_test",
]

Array = NDArray[np.float64]


def fabric(direction: Array, weight: Array | None = None) -> Array:
    """F [-] of directions (k, d), of any length > 0, with weights (k,) ≥ 0; shape (d, d), nan where there is nothing to average."""
    direction = np.asarray(direction, dtype=float)
    weight = np.ones(len(direction)) if weight is None else np.asarray(weight, dtype=float)
    size = np.linalg.norm(direction, axis=1)
    total = weight.sum()
    if not total > 0.0:
        return np.full((direction.shape[1], direction.shape[1]), np.nan)
    if np.any(size == 0.0):
        raise InputError("fabric: a direction has length zero: leave such segments out")
    n = direction / size[:, None]
    return np.einsum("k,ki,kj->ij", weight / total, n, n)


def contact_fabric(network: Network, *, kind: str | None = None, by_force: bool = False) -> Array:
    """F of the contact normals (d, d), of one of `KINDS` or of all; `by_force` weighs each by its normal force."""
    chosen = network.of_kind(kind)
    return fabric(network.normal[chosen], network.normal_force[chosen] if by_force else None)


def wire_fabric(network: Network, *, by_tension: bool = False) -> Array:
    """F of the wire segments (d, d), each by its length, or by length times tension."""
    length = network.link_length
    return fabric(network.link_vector, length * np.maximum(network.tension, 0.0) if by_tension else length)


def anisotropy(tensor: Array) -> tuple[Array, Array]:
    """D = (d (d+2)/2) dev F of a fabric (d, d), and its eigenvalues in ascending order (d,)."""
    d = tensor.shape[0]
    deviator = 0.5 * d * (d + 2) * (tensor - np.trace(tensor) / d * np.eye(d))
    return deviator, np.asarray(np.linalg.eigvalsh(deviator), dtype=np.float64)


def _wire_sums(network: Network) -> tuple[Array, Array]:
    """Σ τ ⊗ τ ds (k, d, d) and length (k,) of every wire."""
    wires, place = np.unique(network.link_wire, return_inverse=True)
    vector, length = network.link_vector, network.link_length
    sums = np.zeros((len(wires), network.dimension, network.dimension))
    np.add.at(sums, place, np.einsum("ki,kj->kij", vector, vector) / length[:, None, None])
    return sums, np.asarray(np.bincount(place, weights=length, minlength=len(wires)), dtype=np.float64)


def wire_fabric_interval(
    network: Network, rng: np.random.Generator, *, level: float = 0.95, samples: int = 2000
) -> tuple[Array, Array]:
    """Lower and upper bounds (d, d) of the components of the wire fabric: bootstrap over whole wires, percentiles.

    Segments of one wire are not independent, wires are.
    """
    sums, length = _wire_sums(network)
    if len(length) < 2:
        raise InputError(f"fabric: an interval over wires needs two or more, here are {len(length)}")
    drawn = rng.integers(0, len(length), (samples, len(length)))
    found = sums[drawn].sum(axis=1) / length[drawn].sum(axis=1)[:, None, None]
    low, high = np.quantile(found, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=0)
    return low, high


@dataclass(frozen=True, kw_only=True)
class IsotropyTest:
    """Is a fabric further from I/d than wires without preferred direction would be?"""

    observed: float  # ‖dev F‖
    null_mean: float  # its mean where every wire is turned at random
    p_value: float  # share of turned networks that are at least as far off, (1 + count)/(1 + samples)


def wire_isotropy_test(network: Network, rng: np.random.Generator, *, samples: int = 999) -> IsotropyTest:
    """Randomisation test of isotropy: every wire is turned as a whole, shape and all, by a random rotation.

    Turned wires have no direction in common and keep their own persistence, which segments taken one by one would lose.
    """
    sums, length = _wire_sums(network)
    d = network.dimension
    eye = np.eye(d) / d

    def distance(tensors: Array) -> float:
        return float(np.linalg.norm(tensors.sum(axis=0) / length.sum() - eye))

    observed = distance(sums)
    null = np.empty(samples)
    for k in range(samples):
        q, r = np.linalg.qr(rng.normal(size=(len(length), d, d)))
        q = q * np.sign(np.einsum("kii->ki", r))[:, None, :]
        null[k] = distance(np.einsum("kab,kbc,kdc->kad", q, sums, q))
    count = int(np.sum(null >= observed * (1.0 - 1e-12)))
    return IsotropyTest(observed=observed, null_mean=float(null.mean()), p_value=(1 + count) / (1 + samples))
