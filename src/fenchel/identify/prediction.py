"""How well the law replays a test: q(ε_zz), and the lateral and volume strain that the fit does not see.

error_q = rms(q_law − q)/max|q| over the whole path, frame by frame; error_lateral the same for ε_r. The volume strain
is a finding, not
a target: associated flow dilates with slope t from first yield, while grains contract first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..notebook import Summary
from .curves import Curves, deviator, lateral, pressure
from .elastic import unit_wire
from .parameters import LawParameters
from .replay import Simulate

__all__ = ["Prediction", "predict"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction(Summary):
    """One test and its replay; arrays of shape (frame_count,), errors relative to the largest measured magnitude."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "pressure": "Pa",
        "axial_strain": "-",
        "lateral_pressure": "Pa",
        "q": "Pa",
        "q_law": "Pa",
        "q_sand": "Pa",
        "mean_sand": "Pa",
        "lateral_strain": "-",
        "lateral_strain_law": "-",
        "volume_strain": "-",
        "volume_strain_law": "-",
        "volume_end": "-",
        "volume_end_law": "-",
        "wire": "Pa",
        "wire_law": "Pa",
    }

    pressure: float
    seed: int
    linked: bool
    held_out: bool
    error_q: float
    error_lateral: float
    error_wire: float  # of the lateral wire stress; nan without wires
    volume_end: float  # tr ε measured at the end of the first leg [-]
    volume_end_law: float  # the same of the law
    leg: NDArray[np.int64]
    axial_strain: Array
    lateral_pressure: Array  # of the sphere [Pa], the path of the replay
    q: Array
    q_law: Array
    q_sand: Array  # of the sand, whole [Pa]
    mean_sand: Array  # mean pressure P_s of the sand [Pa]
    lateral_strain: Array
    lateral_strain_law: Array
    volume_strain: Array
    volume_strain_law: Array
    wire: Array  # lateral wire stress, less its start [Pa]
    wire_law: Array

    def _title(self) -> str:
        return f"law against grains at {self.pressure / 1e3:g} kPa, seed {self.seed}" + (
            ", held out" if self.held_out else ""
        )


def _relative(law: Array, data: Array) -> float:
    largest = float(np.max(np.abs(data)))
    return float(np.sqrt(np.mean((law - data) ** 2)) / largest) if largest > 0.0 else float("nan")


def predict(
    test: Curves, parameters: LawParameters, simulate: Simulate, *, seed: int, linked: bool, held_out: bool
) -> Prediction:
    """Replay one test with given parameters and compare. Raises `ConvergenceError` if the law does not converge."""
    run = simulate(parameters, test.lateral_pressure, test.axial_strain - test.axial_strain[0])
    q_law = deviator(run.stress)
    q_law = q_law - q_law[0]
    side, side_law = test.lateral_strain - test.lateral_strain[0], lateral(run.strain)
    volume, volume_law = test.volume_strain - test.volume_strain[0], run.strain[:, :3].sum(axis=1)
    wire = lateral(test.wire - test.wire[0])
    wire_law = lateral(parameters.E_w * unit_wire(run.strain, parameters.nu))
    end = int(np.flatnonzero(test.leg == 0)[-1])
    return Prediction(
        pressure=test.pressure,
        seed=seed,
        linked=linked,
        held_out=held_out,
        error_q=_relative(q_law, test.q),
        error_lateral=_relative(side_law, side),
        error_wire=_relative(wire_law, wire),
        volume_end=float(volume[end]),
        volume_end_law=float(volume_law[end]),
        leg=test.leg,
        axial_strain=test.axial_strain,
        lateral_pressure=test.lateral_pressure,
        q=test.q,
        q_law=q_law,
        q_sand=deviator(test.sand),
        mean_sand=pressure(test.sand),
        lateral_strain=side,
        lateral_strain_law=side_law,
        volume_strain=volume,
        volume_strain_law=volume_law,
        wire=wire,
        wire_law=wire_law,
    )
