r"""The characteristic length λ̄^m_max: the longest active segment of a wire, and whether chance alone would make it as long.

With p_avg = (1/L) ∫ |p| ds over the whole network (slack links count as zero), a segment is active where |p| ≥ m p_avg; λ̄^m_max is the
length of the longest contiguous active run over all wires; m = 3 by default. It is non-increasing in m, equals the longest wire at m = 0,
and does not change when all tensions are scaled.

A maximum over many links is positive also where tension is spatially random: among n independent links with exceedance probability π
the longest run has about ln(n(1 − π))/ln(1/π) links. So the permutation test stands beside the length: tensions are shuffled along the
wires, lengths and threshold stay.

Length after Laniel, Alart and Pagano; longest runs: Erdős and Rényi (1970), J. Anal. Math. 23, 103–111; Schilling (1990), Coll. Math.
J. 21, 196–207.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .network import Network

__all__ = [
    "ActiveLength", "PermutationTest", "Straightness", "active_length", "expected_longest_run", "permutation_test", "straightness",
]  # fmt: skip

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ActiveLength:
    """The longest active segment and what it is measured against."""

    length: float  # λ̄^m_max [m]
    radii: float  # over the mean grain radius [-]
    links: int  # links of that segment
    share: float  # share of the wire length that is active [-]
    mean_tension: float  # p_avg [N]
    spacing: float  # mean link length [m]: the resolution


@dataclass(frozen=True, kw_only=True)
class PermutationTest:
    """λ̄^m_max against shuffled tensions."""

    observed: float  # [m]
    null_mean: float  # [m]
    null_high: float  # 95 % quantile [m]
    p_value: float  # (1 + count at least as long)/(1 + samples)
    expected_links: float  # ln(n(1 − π))/ln(1/π)


@dataclass(frozen=True, kw_only=True)
class Straightness:
    """End-to-end over arc length of pieces of equal numbers of links, mean [-] and number of pieces."""

    active: float
    inactive: float
    active_pieces: int
    inactive_pieces: int


def expected_longest_run(links: int, share: float) -> float:
    """Leading term ln(n(1 − π))/ln(1/π) of the expected longest run among n independent links, each active with probability π."""
    if not 0.0 < share < 1.0:
        return 0.0 if share <= 0.0 else float(links)
    return (
        max(0.0, float(np.log(links * (1.0 - share)) / -np.log(share))) if links * (1.0 - share) > 1.0 else float(links)
    )


def _joined(network: Network) -> NDArray[np.bool_]:
    """(l,) whether a link goes on where the one before it ends."""
    joined = np.zeros(len(network.link), dtype=bool)
    joined[1:] = network.link[1:, 0] == network.link[:-1, 1]
    return joined


def _longest(active: NDArray[np.bool_], joined: NDArray[np.bool_], length: Array) -> tuple[float, int]:
    """Length [m] and links of the longest run of active links."""
    at = np.flatnonzero(active)
    if not len(at):
        return 0.0, 0
    begins = np.ones(len(at), dtype=bool)
    begins[1:] = ~((np.diff(at) == 1) & joined[at[1:]])
    starts = np.flatnonzero(begins)
    sums = np.add.reduceat(length[at], starts)
    best = int(np.argmax(sums))
    return float(sums[best]), int(np.diff(np.append(starts, len(at)))[best])


def _active(tension: Array, length: Array, m: float, taut_only: bool) -> tuple[NDArray[np.bool_], float]:
    size = np.abs(tension)
    counted = size > 0.0 if taut_only else np.ones(len(size), dtype=bool)
    total = float(length[counted].sum())
    mean = float(size @ length) / total if total > 0.0 else 0.0
    if m > 0.0 and mean == 0.0:
        return np.zeros(len(size), dtype=bool), 0.0
    return size >= m * mean, mean


def _check(network: Network, m: float) -> None:
    if not len(network.link):
        raise InputError("active length: the sample has no links")
    if not m >= 0.0:
        raise InputError(f"m = {m}: the threshold is a multiple ≥ 0 of the mean tension")


def active_length(network: Network, *, m: float = 3.0, taut_only: bool = False) -> ActiveLength:
    """λ̄^m_max of the network; `taut_only` takes the mean tension over taut links alone. `InputError` without links or for m < 0."""
    _check(network, m)
    length = network.link_length
    active, mean = _active(network.tension, length, m, taut_only)
    longest, links = _longest(active, _joined(network), length)
    return ActiveLength(
        length=longest,
        radii=longest / network.grain_radius,
        links=links,
        share=float(length[active].sum() / length.sum()),
        mean_tension=mean,
        spacing=float(length.mean()),
    )


def permutation_test(
    network: Network,
    rng: np.random.Generator,
    *,
    m: float = 3.0,
    taut_only: bool = False,
    within_wires: bool = True,
    samples: int = 999,
) -> PermutationTest:
    """Is the longest active segment longer than with tensions shuffled along the wires (or over the whole network)?"""
    _check(network, m)
    length, wire, joined = network.link_length, network.link_wire, _joined(network)
    active, _ = _active(network.tension, length, m, taut_only)
    observed, _ = _longest(active, joined, length)
    null = np.empty(samples)
    for k in range(samples):
        key = rng.random(len(active))
        # links stand wire by wire, so sorting by (wire, random) permutes within each
        order = np.lexsort((key, wire)) if within_wires else np.argsort(key)
        null[k], _ = _longest(active[order], joined, length)
    count = int(np.sum(null >= observed * (1.0 - 1e-12)))
    return PermutationTest(
        observed=observed,
        null_mean=float(null.mean()),
        null_high=float(np.quantile(null, 0.95)),
        p_value=(1 + count) / (1 + samples),
        expected_links=expected_longest_run(len(active), float(active.mean())),
    )


def straightness(network: Network, *, m: float = 3.0, links: int = 3, taut_only: bool = False) -> Straightness:
    """Are active segments straighter? Pieces of `links` successive links, all active or none active, at every place along the wires.

    Pieces of equal length are compared, since a longer one is more bent whatever its tension.
    """
    _check(network, m)
    if links < 2:
        raise InputError(f"links = {links}: one link is straight by itself; take two or more")
    active, _ = _active(network.tension, network.link_length, m, taut_only)
    joined, length, link = _joined(network), network.link_length, network.link
    first = np.arange(len(link) - links + 1)
    whole = np.ones(len(first), dtype=bool)
    arc = np.zeros(len(first))
    held = np.zeros(len(first), dtype=np.int64)
    for k in range(links):
        if k:
            whole &= joined[first + k]
        arc += length[first + k]
        held += active[first + k]
    chord = np.linalg.norm(network.x[link[first + links - 1, 1]] - network.x[link[first, 0]], axis=1)
    ratio = chord / arc
    on, off = whole & (held == links), whole & (held == 0)
    return Straightness(
        active=float(ratio[on].mean()) if on.any() else float("nan"),
        inactive=float(ratio[off].mean()) if off.any() else float("nan"),
        active_pieces=int(on.sum()),
        inactive_pieces=int(off.sum()),
    )
