r"""How forces are distributed: density of f/⟨f⟩, moments, participation, decay above the mean.

The participation Γ = (Σ f)²/(N Σ f²) is 1 where all forces are equal, 1/2 for an exponential density and 1/N for one force alone. The decay
β of P(f/⟨f⟩) ~ exp(−β f/⟨f⟩) above the mean is the maximum-likelihood estimate 1/(⟨f | f > ⟨f⟩⟩/⟨f⟩ − 1).

Radjai, Jean, Moreau and Roux (1996), PRL 77, 274; strong and weak network: Radjai, Wolf, Jean and Moreau (1998), PRL 80, 61.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = ["ForceDistribution", "force_distribution", "force_values", "strong_contacts"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ForceDistribution:
    """Distribution of k forces around their mean."""

    count: int
    mean: float  # [N]
    edges: Array  # (b + 1,) of f/⟨f⟩
    density: Array  # (b,) P(f/⟨f⟩); its integral is the share of forces between the first and the last edge
    moments: dict[int, float]  # ⟨f^k⟩/⟨f⟩^k for k = 2, 3, 4
    participation: float
    decay: float  # β above the mean, nan where no force is above it


def force_distribution(force: Array, *, edges: Array | None = None) -> ForceDistribution:
    """Distribution of forces ≥ 0 [N], shape (k,); `edges` of the bins in units of the mean, default 0 to 6 by 0.2."""
    force = np.asarray(force, dtype=float)
    if not len(force) or not force.sum() > 0.0:
        raise InputError("force distribution: there is no force; a network has some after the first step under load")
    edges = np.linspace(0.0, 6.0, 31) if edges is None else np.asarray(edges, dtype=float)
    mean = float(force.mean())
    f = force / mean
    counts, _ = np.histogram(f, bins=edges)
    above = f[f > 1.0]
    return ForceDistribution(
        count=len(f),
        mean=mean,
        edges=edges,
        density=counts / (len(f) * np.diff(edges)),
        moments={k: float(np.mean(f**k)) for k in (2, 3, 4)},
        participation=float(1.0 / np.mean(f**2)),
        decay=float(1.0 / (above.mean() - 1.0)) if len(above) else float("nan"),
    )


def force_values(network: Network, which: str = "normal", *, kind: str | None = None) -> Array:
    """Forces [N] of the closed contacts of a kind, (k,): "normal", "tangential" (sizes), or "tension" of the taut links."""
    chosen = network.of_kind(kind)
    if which == "normal":
        return network.normal_force[chosen]
    if which == "tangential":
        return np.linalg.norm(network.tangential_force[chosen], axis=1)
    if which == "tension":
        return network.tension[network.tension > 0.0]
    raise InputError(f'which = {which!r}: is "normal", "tangential" or "tension"')


def strong_contacts(network: Network, *, at: float = 1.0) -> NDArray[np.bool_]:
    """(m,) contacts whose normal force exceeds `at` times the mean: the strong network."""
    return network.normal_force > at * network.normal_force.mean() if len(network.pair) else np.zeros(0, dtype=bool)
