"""How far beads move against the grains around them: their displacement less the mean displacement of the nearest grains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

__all__ = ["bead_slip"]

Array = NDArray[np.float64]


def bead_slip(reference: Array, displacement: Array, wire: NDArray[np.int64], *, neighbours: int = 4) -> Array:
    """Displacement of every bead relative to its nearest grains in the reference configuration (b, d) [m]; arguments (n, d) [m], (n,).

    Rigid translation gives zero. Raises `InputError` with fewer grains than `neighbours`.
    """
    from scipy.spatial import cKDTree

    beads = wire >= 0
    if np.sum(~beads) < neighbours:
        raise InputError(f"bead slip: needs {neighbours} grains, here are {int(np.sum(~beads))}")
    _, near = cKDTree(reference[~beads]).query(reference[beads], k=neighbours)
    near = np.asarray(near).reshape(int(beads.sum()), neighbours)
    return displacement[beads] - displacement[~beads][near].mean(axis=1)
