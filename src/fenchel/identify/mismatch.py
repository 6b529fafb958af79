"""Whether the phases share one strain: ‖ε_s − ε_w‖/‖ε_s‖ along a test, with its band from the octants.

A norm of noisy differences is positive even for equal strains; the jackknife band (one standard deviation of the
delete-one-octant
values) is the scale below which a mismatch means nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .curves import Curves
from .interval import jackknife_deviation

__all__ = ["Mismatch", "phase_mismatch"]

Array = NDArray[np.float64]
SMALLEST = 2e-4  # strain [-] below which the ratio is noise over nothing
LATER = 0.3  # after the first leg: below this part of the largest strain (a reversal passes near zero) the ratio says nothing


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """Shape (frame_count,) each; nan where the strain is too small. `deviation` is nan without octants."""

    pressure: float
    seed: int
    linked: bool
    axial_strain: Array
    value: Array
    deviation: Array
    end_of_first_leg: float
    end_deviation: float


def _ratio(test: Curves) -> Array:
    size = np.linalg.norm(test.strain, axis=1)
    if not np.any(test.strain_wire):  # no wires, or too few beads in the sphere for a strain
        return np.full(len(size), np.nan)
    valid = size > np.where(test.leg == 0, SMALLEST, LATER * float(size.max()))
    out = np.full(len(size), np.nan)
    out[valid] = np.linalg.norm(test.strain - test.strain_wire, axis=1)[valid] / size[valid]
    return out


def phase_mismatch(test: Curves, replicas: Sequence[Curves], *, seed: int, linked: bool) -> Mismatch:
    """Mismatch of one test; `replicas`: the same test with each octant left out, may be empty."""
    value = _ratio(test)
    if len(replicas) >= 2:
        deviation = np.asarray(jackknife_deviation(np.stack([_ratio(r) for r in replicas])))
    else:
        deviation = np.full(len(value), np.nan)
    end = int(np.flatnonzero(test.leg == 0)[-1])
    return Mismatch(
        pressure=test.pressure,
        seed=seed,
        linked=linked,
        axial_strain=test.axial_strain,
        value=value,
        deviation=deviation,
        end_of_first_leg=float(value[end]),
        end_deviation=float(deviation[end]),
    )
