r"""Do grains and wires deform alike? The mismatch of their best-fit strains with intervals from bootstrap over grains and whole wires.

δ = ‖ε_s − ε_w‖/‖ε_s‖. The norm of a noisy difference is never zero and too large on average; the bootstrap shows by how much, and the
corrected value takes it off, δ_c² = ⟨2δ² − mean of δ*²⟩. The mismatch of two random halves of the grains stands beside it: what a
sample of this size cannot tell from zero. Without an interval the question ε_s = ε_w cannot be decided.

Efron and Tibshirani (1993), An Introduction to the Bootstrap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .strain import best_fit_gradient

__all__ = ["PhaseMismatch", "phase_mismatch"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PhaseMismatch:
    """Strains of the phases (d, d) [-] and how far they differ."""

    grains: Array
    wires: Array
    mismatch: float
    corrected: float  # less what noise adds to a norm
    low: float  # of the interval
    high: float
    noise: float  # mean mismatch of two random halves of the grains


def _strain(x: Array, u: Array) -> Array:
    gradient = best_fit_gradient(x, u)
    return 0.5 * (gradient + gradient.T)


def phase_mismatch(
    reference: Array,
    displacement: Array,
    wire: NDArray[np.int64],
    rng: np.random.Generator,
    *,
    level: float = 0.9,
    samples: int = 400,
) -> PhaseMismatch:
    """Mismatch of the strains of grains (`wire` = −1) and beads; positions and displacements (n, d) [m] of the bodies that count.

    Raises `InputError` when there are fewer than eight grains or two wires.
    """
    x, u = np.asarray(reference, dtype=float), np.asarray(displacement, dtype=float)
    grains = np.flatnonzero(wire < 0)
    chains = [np.flatnonzero(wire == w) for w in np.unique(wire[wire >= 0])]
    if len(grains) < 8 or len(chains) < 2:
        raise InputError(f"phase mismatch: needs 8 grains and 2 wires, here are {len(grains)} and {len(chains)}")
    beads = np.concatenate(chains)
    sand, wires = _strain(x[grains], u[grains]), _strain(x[beads], u[beads])

    def off(one: Array, other: Array) -> float:
        return float(np.linalg.norm(one - other) / np.linalg.norm(one))

    found, noise = np.empty(samples), np.empty(samples)
    for k in range(samples):
        g = rng.choice(grains, len(grains))
        b = np.concatenate([chains[w] for w in rng.integers(0, len(chains), len(chains))])
        found[k] = off(_strain(x[g], u[g]), _strain(x[b], u[b]))
        mixed = rng.permutation(grains)
        half = len(grains) // 2
        noise[k] = off(_strain(x[mixed[:half]], u[mixed[:half]]), _strain(x[mixed[half:]], u[mixed[half:]]))
    low, high = np.quantile(found, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    mismatch = off(sand, wires)
    return PhaseMismatch(
        grains=sand,
        wires=wires,
        mismatch=mismatch,
        corrected=float(np.sqrt(max(0.0, min(mismatch**2, 2.0 * mismatch**2 - float(np.mean(found**2)))))),
        low=float(low),
        high=float(high),
        noise=float(noise.mean()),
    )
