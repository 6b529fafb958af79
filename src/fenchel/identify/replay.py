"""Replaying a triaxial test with the law: the only place of the identification that calls the integrators.

Control: the axial strain ε_zz is prescribed, the other stresses are σ_xx = σ_yy = −P and no shear, with P the lateral pressure
of the measuring sphere (constant, or as it was measured). The test starts from the isotropic state −P with natural wires: the law
starts there at ε = 0 with the plastic strain ε^p = P/(3 K_s) I, α = 0, p = 0, so that A = K_s(0 − ε^p) = −P I and σ_w(0) = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, Status
from ..notebook import Summary
from .elastic import unit_wire
from .parameters import LawParameters

__all__ = ["Replay", "Simulate", "replay"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, repr=False)
class Replay(Summary):
    """Strain [-] and stress [Pa] of the law along a test, Mandel, shape (frame_count, 6); whole and of the wires."""

    UNITS: ClassVar[Mapping[str, str]] = {
        "strain": "-",
        "stress": "Pa",
        "wire": "Pa",
    }

    strain: Array
    stress: Array
    wire: Array

    def _title(self) -> str:
        return "the law along a test"


class Simulate(Protocol):
    """A route from parameters and a path to a `Replay`; `replay` is the default, tests give an independent one."""

    def __call__(self, parameters: LawParameters, pressure: Array | float, axial_strain: Array) -> Replay: ...


@lru_cache(maxsize=1)
def _update() -> Any:
    from fenchel.potentials.library import texsol

    return texsol.compile("3d", tangent=True)


def _values(parameters: LawParameters) -> dict[str, float]:
    """The parameters under the names of the library law."""
    return {
        "E_s": parameters.E_s,
        "nu_s": parameters.nu,
        "lambda_w": parameters.lambda_w,
        "mu_w": parameters.mu_w,
        "theta_f": parameters.theta_f,
        "C_0": parameters.C_0,
        "H_k": parameters.H_k,
        "H_i": parameters.H_i,
    }


def replay(parameters: LawParameters, pressure: Array | float, axial_strain: Array) -> Replay:
    """The law along ε_zz = `axial_strain` [-], shape (n,), at the lateral stress −`pressure` [Pa], one value or shape (n,).

    Raises `ConvergenceError` naming the first step that did not converge.
    """
    from fenchel.integrators import drive_arrays

    targets = np.zeros((len(axial_strain), 6))
    lateral = np.broadcast_to(np.asarray(pressure, dtype=float), axial_strain.shape)
    targets[:, :2] = -lateral[:, None]
    targets[:, 2] = axial_strain
    control = np.array([True, True, False, True, True, True])
    plastic = np.zeros((1, 6))
    plastic[0, :3] = lateral[0] / (3.0 * parameters.bulk)
    start = {"eps_p": plastic, "alpha": np.zeros((1, 6)), "p": np.zeros(1)}
    history = drive_arrays(_update(), control, targets, _values(parameters), initial_state=start)
    failed = np.flatnonzero(np.asarray(history.status) != int(Status.CONVERGED))
    if len(failed):
        raise ConvergenceError(
            f"the law did not converge at step {failed[0]} (axial strain {axial_strain[failed[0]]:.3e}, {lateral[failed[0]]:g} Pa): "
            "take smaller strain steps"
        )
    strain = np.asarray(history.eps)
    wire = parameters.E_w * unit_wire(strain, parameters.nu)
    return Replay(strain=strain, stress=np.asarray(history.sig), wire=wire)
