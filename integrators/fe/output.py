"""Results for ParaView: displacements at the vertices, averages over the elements."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, StorageError
from .body import Body
from .equilibrium import Equilibrium

__all__ = ["tensor_names", "write_vtk"]

tensor_names = ("xx", "yy", "zz", "yz", "xz", "xy")


def write_vtk(path: str | Path, body: Body, state: Equilibrium, fields: Mapping[str, Any] | None = None) -> None:
    """Write one state as a VTK file (`.vtu` or `.vtk`): displacement [m]; per element strain [-], stress [Pa], pressure −tr σ/3, √J₂,
    internal variables and dissipation, plain tensor components xx, yy, zz, yz, xz, xy; `fields` adds quadrature fields (point_count, …).

    In an axisymmetric body x = r, y (of the mesh) = z, and the components are those of (r, hoop, z).
    """
    place = Path(path)
    if place.suffix not in (".vtu", ".vtk"):
        raise InputError(f"write_vtk: {place.name!r} must end in .vtu or .vtk")
    quadrature: dict[str, Any] = {
        "strain": state.strain,
        "stress": state.stress,
        **state.state,
        "dissipation": state.dissipation,
    }
    quadrature |= dict(fields or {})
    cells: dict[str, Any] = {}
    for name, field in quadrature.items():
        mean = body.average(field)
        if mean.ndim == 2 and mean.shape[1] == 6:
            plain = mean * np.array([1.0, 1.0, 1.0, *(3 * [np.sqrt(0.5)])])
            cells |= {f"{name}_{word}": plain[:, i] for i, word in enumerate(tensor_names)}
        else:
            cells[name] = mean
    stress = body.average(state.stress)
    mean = stress[:, :3].mean(axis=1)
    cells["pressure"] = -mean
    shear = stress - mean[:, None] * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    cells["sqrt_J2"] = np.sqrt(0.5 * (shear * shear).sum(axis=1))
    moved = np.zeros((body.mesh.p.shape[1], 3))
    moved[:, : body.mesh.dim()] = state.displacement[body.basis.nodal_dofs].T
    try:
        body.mesh.save(str(place), point_data={"displacement": moved}, cell_data={k: [v] for k, v in cells.items()})
    except OSError as error:
        raise StorageError(f"cannot write {str(path)!r}: {error.strerror}") from error
