"""Results: maps over the quadrature points by name; for ParaView displacements at the vertices and averages over the elements."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, StorageError
from .body import Body
from .equilibrium import Equilibrium

__all__ = ["quadrature_map", "tensor_names", "write_vtk"]

tensor_names = ("xx", "yy", "zz", "yz", "xz", "xy")


def quadrature_map(
    body: Body, state: Equilibrium, name: str, fields: Mapping[str, Any] | None = None
) -> tuple[Any, Any]:
    """(points [m] (n, dim), values (n,)) of any scalar: `stress_xx`, `strain_xy`, `pressure` −tr σ/3, `sqrt_J2` [Pa], `eps_p_zz`, a scalar
    variable, `dissipation`, or one of `fields`. Names are those of `write_vtk`; `InputError` lists them."""
    found = _scalars(_fields(body, state, fields))
    if name not in found:
        raise InputError(f"there is no field {name!r}; there are: {', '.join(found)}")
    return body.points, found[name]


def _fields(body: Body, state: Equilibrium, more: Mapping[str, Any] | None) -> dict[str, Any]:
    """Quadrature fields by name, tensors with six components."""
    found = {"strain": state.strain, "stress": state.stress, **state.state, "dissipation": state.dissipation}
    return {name: body.whole(np.asarray(field)) for name, field in (found | dict(more or {})).items()}


def _scalars(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Plain components and invariants of fields, (n,) each."""
    found: dict[str, Any] = {}
    for name, field in fields.items():
        if field.ndim == 2 and field.shape[1] == 6:
            plain = field * np.array([1.0, 1.0, 1.0, *(3 * [np.sqrt(0.5)])])
            found |= {f"{name}_{word}": plain[:, i] for i, word in enumerate(tensor_names)}
        else:
            found[name] = field
    stress = fields["stress"]
    mean = stress[:, :3].mean(axis=1)
    shear = stress - mean[:, None] * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return found | {"pressure": -mean, "sqrt_J2": np.sqrt(0.5 * (shear * shear).sum(axis=1))}


def write_vtk(path: str | Path, body: Body, state: Equilibrium, fields: Mapping[str, Any] | None = None) -> None:
    """Write one state as a VTK file (`.vtu` or `.vtk`): displacement [m]; per element strain [-], stress [Pa], pressure −tr σ/3, √J₂,
    internal variables and dissipation, plain tensor components xx, yy, zz, yz, xz, xy; `fields` adds quadrature fields (point_count, …).

    In an axisymmetric body x = r, y (of the mesh) = z, and the components are those of (r, hoop, z).
    """
    place = Path(path)
    if place.suffix not in (".vtu", ".vtk"):
        raise InputError(f"write_vtk: {place.name!r} must end in .vtu or .vtk")
    cells = _scalars({k: body.average(v) for k, v in _fields(body, state, fields).items()})
    moved = np.zeros((body.mesh.p.shape[1], 3))
    moved[:, : body.mesh.dim()] = state.displacement[body.basis.nodal_dofs].T
    try:
        body.mesh.save(str(place), point_data={"displacement": moved}, cell_data={k: [v] for k, v in cells.items()})
    except OSError as error:
        raise StorageError(f"cannot write {str(path)!r}: {error.strerror}") from error
