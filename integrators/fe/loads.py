"""What is done to a body: supports (prescribed displacements) and pressures on named parts of its boundary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .body import Body

__all__ = ["Pressure", "Support", "nodal_pressure", "supported"]

Array = NDArray[np.float64]
History = float | Callable[[float], float]


@dataclass(frozen=True)
class Support:
    """Displacement [m] of a named part of the boundary: per axis a number, a function of time, or None (free)."""

    where: str
    x: History | None = None
    y: History | None = None
    z: History | None = None


@dataclass(frozen=True)
class Pressure:
    """Pressure [Pa] on a named part of the boundary, positive when it pushes; a number or a function of time."""

    where: str
    value: History


def at_time(history: History, time: float) -> float:
    """Value at a time."""
    return float(history(time)) if callable(history) else float(history)


def _part(body: Body, where: str) -> None:
    known = sorted(body.mesh.boundaries or {})
    if where not in known:
        raise InputError(f"the mesh has no boundary {where!r}; its boundaries: {', '.join(known) or 'none'}")


def supported(body: Body, supports: tuple[Support, ...]) -> tuple[Any, list[tuple[Any, History]]]:
    """Supported degrees of freedom (sorted) and, per support and axis, its degrees of freedom with their history."""
    parts: list[tuple[Any, History]] = []
    for support in supports:
        _part(body, support.where)
        for axis, history in enumerate((support.x, support.y, support.z)):
            if history is None:
                continue
            if axis >= body.mesh.dim():
                raise InputError(
                    f"support '{support.where}': a body in {body.mesh.dim()} dimensions has no axis {'xyz'[axis]}"
                )
            # P2 and Q2 name their edge and interior values u^1, u^2 as well
            found = body.basis.get_dofs(support.where).all([f"u^{axis + 1}"])
            parts.append((found, history))
    every = np.unique(np.concatenate([p for p, _ in parts])) if parts else np.zeros(0, dtype=int)
    return every, parts


def nodal_pressure(body: Body, where: str) -> Array:
    """Nodal forces of a unit pressure on a part of the boundary [N/Pa], (dof_count,)."""
    import skfem

    _part(body, where)
    facets = skfem.FacetBasis(body.mesh, body.basis.elem, facets=where, intorder=body.basis.elem.maxdeg * 2 + 1)
    dx = np.asarray(facets.dx)
    if body.dimension == "axisymmetric":
        dx = 2.0 * np.pi * np.asarray(facets.global_coordinates())[0] * dx
    force = np.zeros(body.basis.N)
    for i, dofs in enumerate(facets.element_dofs):
        value = np.asarray(facets.basis[i][0])
        np.add.at(force, dofs, -(value * facets.normals * dx).sum(axis=(0, 2)))
    return force
