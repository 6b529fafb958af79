"""The axisymmetric part of a triaxial test: the few curves that the identification reads.

In a triaxial test about z every symmetric tensor is, up to sampling noise, a = diag(a_r, a_r, a_z). Its axisymmetric part is
the orthogonal projection a_r = (a_xx + a_yy)/2, a_z = a_zz, shear dropped. The projection is linear, so noise of mean zero
stays of mean zero (the norm of a noisy deviator would be biased upwards). With tension positive and compression of
the axis in mind,

    q = a_r − a_z  (positive in triaxial compression),   √J₂ = |q|/√3,   P = −(2 a_r + a_z)/3,
    ‖dev ε‖ = √(2/3) |ε_r − ε_z|,   so that   √2 ‖dev ε‖ = (2/√3) |ε_r − ε_z|.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..dem.record import PhaseHistory
from ..errors import InputError
from ..notebook import Summary

__all__ = ["Curves", "axial", "by_pressure", "curves", "deviator", "lateral", "pressure", "thin"]

Array = NDArray[np.float64]


def axial(tensor: Array) -> Array:
    """Component zz of Mandel tensors, shape (..., 6) to (...)."""
    return tensor[..., 2]


def lateral(tensor: Array) -> Array:
    """Mean of the components xx and yy of Mandel tensors, shape (..., 6) to (...)."""
    return 0.5 * (tensor[..., 0] + tensor[..., 1])


def deviator(tensor: Array) -> Array:
    """q = lateral − axial; positive in triaxial compression. Shape (..., 6) to (...)."""
    return lateral(tensor) - axial(tensor)


def pressure(tensor: Array) -> Array:
    """P = −tr/3 of Mandel tensors, positive in compression. Shape (..., 6) to (...)."""
    return -tensor[..., :3].sum(axis=-1) / 3.0


@dataclass(frozen=True, kw_only=True, repr=False)
class Curves(Summary):
    """One test reduced to curves, shape (frame_count,) each; strains [-] from the start, stresses [Pa], tension positive."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "box_strain": "-",
        "strain": "-",
        "strain_wire": "-",
        "sand": "Pa",
        "wire": "Pa",
        "total": "Pa",
    }

    pressure: float  # confining pressure [Pa]
    leg: NDArray[np.int64]
    box_strain: Array  # (frame_count,) axial strain of the box: the same for every phase and octant
    strain: Array  # (frame_count, 6) of the sand, Mandel: the strain of the law
    strain_wire: Array  # (frame_count, 6) of the wires, Mandel
    sand: Array  # (frame_count, 6) stress of the sand, whole, Mandel
    wire: Array  # (frame_count, 6) stress of the wires, whole, Mandel
    total: Array  # (frame_count, 6) their sum

    def _title(self) -> str:
        return f"curves of a test at {self.pressure / 1e3:g} kPa, {len(self.leg)} frames"

    @property
    def axial_strain(self) -> Array:
        """ε_zz of the sand [-]."""
        return axial(self.strain)

    @property
    def lateral_strain(self) -> Array:
        """Mean of ε_xx and ε_yy of the sand [-]."""
        return lateral(self.strain)

    @property
    def lateral_pressure(self) -> Array:
        """What the sphere is confined by [Pa], positive: the mean pressure at the start, then −σ_r of the whole as it moves.

        In a box of few grains the sphere carries more than the walls (next to a wall a layer of half a grain carries nothing), so
        that the confining pressure of the test is not that of the sphere.
        """
        side = -lateral(self.total)
        return pressure(self.total[0]) + side - side[0]

    @property
    def volume_strain(self) -> Array:
        """tr ε of the sand [-], positive for dilation."""
        return self.strain[:, :3].sum(axis=1)

    @property
    def q(self) -> Array:
        """σ_r − σ_z of the whole [Pa], less its value at the start."""
        whole = deviator(self.total)
        return whole - whole[0]


def curves(history: PhaseHistory, split: str = "links") -> Curves:
    """The curves of one test under a split of the bead contacts ("links" or "total").

    Raises `InputError` for arrays that disagree in length, numbers that are not finite, or fewer than three frames.
    """
    if split not in ("links", "total"):
        raise InputError(f'split "{split}" is unknown: use "links" (wire = links) or "total" (wire = links + beads)')
    count = len(history.axial_strain)
    tensors = {
        "strain_sand": history.strain_sand,
        "strain_wire": history.strain_wire,
        "stress_sand": history.stress_sand(split),
        "stress_wire": history.stress_wire(split),
    }
    if count < 3 or len(history.leg) != count:
        raise InputError(
            f"a test at {history.pressure:g} Pa has {count} frames and {len(history.leg)} leg marks: give 3 or more"
        )
    if not history.pressure > 0.0:
        raise InputError(f"confining pressure {history.pressure:g} Pa: it must be positive")
    for name, values in tensors.items():
        if values.shape != (count, 6):
            raise InputError(f"{name} at {history.pressure:g} Pa has shape {values.shape}, expected ({count}, 6)")
        if not np.all(np.isfinite(values)):
            frame = int(np.argmax(~np.isfinite(values).all(axis=1)))
            raise InputError(
                f"{name} at {history.pressure:g} Pa is not finite at frame {frame}: rerun or cut that test"
            )
    return Curves(
        pressure=float(history.pressure),
        leg=np.asarray(history.leg, dtype=np.int64),
        box_strain=np.asarray(history.axial_strain, dtype=float),
        strain=tensors["strain_sand"],
        strain_wire=tensors["strain_wire"],
        sand=tensors["stress_sand"],
        wire=tensors["stress_wire"],
        total=tensors["stress_sand"] + tensors["stress_wire"],
    )


def thin(test: Curves, count: int) -> Curves:
    """About `count` frames of a test, evenly spaced in frame number; first, last and the ends of the legs are kept."""
    frames = len(test.leg)
    if frames <= count:
        return test
    turning = np.flatnonzero(np.diff(test.leg)) if frames > 1 else np.zeros(0, dtype=np.int64)
    keep = np.unique(np.concatenate([np.linspace(0, frames - 1, count).round().astype(np.int64), turning, turning + 1]))
    return Curves(
        pressure=test.pressure,
        leg=test.leg[keep],
        box_strain=test.box_strain[keep],
        strain=test.strain[keep],
        strain_wire=test.strain_wire[keep],
        sand=test.sand[keep],
        wire=test.wire[keep],
        total=test.total[keep],
    )


def by_pressure(tests: Sequence[Curves]) -> dict[float, list[Curves]]:
    """Tests grouped by confining pressure, ascending."""
    groups: dict[float, list[Curves]] = {}
    for test in sorted(tests, key=lambda item: item.pressure):
        groups.setdefault(test.pressure, []).append(test)
    return groups
