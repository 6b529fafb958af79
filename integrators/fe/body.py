"""A body: a mesh, an element, a kinematic hypothesis and a law, reduced to one sparse matrix B from displacements to strains.

The strain at all quadrature points is ε = B u (Mandel components), the internal forces are Bᵀ (w ⊙ σ), the stiffness is Bᵀ (w ⊙ C) B. Axes:

    "3d"            x, y, z ↦ 1, 2, 3
    "plane_strain"  x, y    ↦ 1, 2;  ε₃₃ = 0
    "plane_stress"  x, y    ↦ 1, 2;  σ₃₃ = 0, by an update of that dimension; per unit thickness
    "axisymmetric"  x = r, y = z ↦ 1, 3;  the hoop strain u_r/r is ε₂₂;  weights hold 2π r

An update compiled for three dimensions serves them all but plane stress; one compiled for the dimension of the body holds only the
components that exist: (11, 22, 33, √2·12), (rr, zz, θθ, √2·rz) or (11, 22, √2·12).

Selective integration replaces the volume strain by its mean over the element (Hughes 1980), which removes the locking of low-order elements
under nearly isochoric or dilatant flow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError
from ..dimension import DIMENSIONS as COMPILED

__all__ = ["DIMENSIONS", "ELEMENTS", "Body"]

Array = NDArray[np.float64]

DIMENSIONS = ("3d", "plane_strain", "axisymmetric", "plane_stress")
# name: (mesh shape, element class of scikit-fem, quadrature order that integrates the linear elastic stiffness)
ELEMENTS = {
    "Q1": ("quad", "ElementQuad1", 2),
    "Q2": ("quad", "ElementQuad2", 4),
    "P1": ("tri", "ElementTriP1", 1),
    "P2": ("tri", "ElementTriP2", 2),
    "H1": ("hex", "ElementHex1", 2),
    "H2": ("hex", "ElementHex2", 4),
    "T1": ("tet", "ElementTetP1", 1),
    "T2": ("tet", "ElementTetP2", 2),
}
_SHAPES = {"MeshQuad": "quad", "MeshTri": "tri", "MeshHex": "hex", "MeshTet": "tet"}
_ROOT = np.sqrt(0.5)


@dataclass(frozen=True)
class Body:
    """Mesh of scikit-fem, compiled `update` of a law, parameter `values` by name.

    `element` is one of "Q1", "Q2" (quadrilaterals), "P1", "P2" (triangles), "H1", "H2" (hexahedra), "T1", "T2" (tetrahedra), or None for
    the linear one of the mesh; `integration` "full" or "selective"; `quadrature` the polynomial order that is integrated exactly.
    Raises `InputError` for a combination that does not exist.
    """

    mesh: Any
    update: Any
    values: Mapping[str, Any]
    dimension: str = "plane_strain"
    element: str | None = None
    integration: str = "full"
    quadrature: int | None = None

    def __post_init__(self) -> None:
        shape = next((s for key, s in _SHAPES.items() if type(self.mesh).__name__.startswith(key)), None)
        if shape is None:
            raise InputError(
                f"a mesh of type {type(self.mesh).__name__} is not known; use MeshQuad, MeshTri, MeshHex or MeshTet"
            )
        if self.dimension not in DIMENSIONS:
            raise InputError(f"dimension {self.dimension!r} is not known; it is one of {', '.join(DIMENSIONS)}")
        if (self.dimension == "3d") != (self.mesh.dim() == 3):
            raise InputError(f"dimension {self.dimension!r} does not fit a mesh in {self.mesh.dim()} dimensions")
        name = self.element or next(n for n, (s, _, _) in ELEMENTS.items() if s == shape)
        if name not in ELEMENTS or ELEMENTS[name][0] != shape:
            fitting = ", ".join(n for n, (s, _, _) in ELEMENTS.items() if s == shape)
            raise InputError(f"element {self.element!r} does not fit a {shape} mesh; use one of {fitting}")
        object.__setattr__(self, "element", name)
        if self.integration not in ("full", "selective"):
            raise InputError(f"integration {self.integration!r} is not known; it is full or selective")
        if self.compiled.name not in ("3d", self.dimension) or (self.dimension == "plane_stress" and not self.narrow):
            raise InputError(
                f"the update is compiled for '{self.compiled.name}', the body is '{self.dimension}': compile the law for that dimension"
            )
        if self.dimension == "plane_stress" and self.integration == "selective":
            raise InputError(
                "plane_stress: the volume strain is free there, selective integration has nothing to mend; use full"
            )
        if self.dimension == "axisymmetric" and float(self.mesh.p[0].min()) < 0.0:
            raise InputError("axisymmetric: the first coordinate is the radius and must not be negative")

    @property
    def compiled(self) -> Any:
        """Dimension that the update is compiled for; three dimensions where it does not say."""
        return getattr(self.update, "dimension", COMPILED["3d"])

    @property
    def narrow(self) -> bool:
        """True if strains and stresses have the components of the dimension only."""
        return self.dimension != "3d" and self.compiled.name == self.dimension

    @property
    def components(self) -> int:
        """Number of components of a strain that goes into the update."""
        return len(self.compiled.given) if self.narrow else 6

    def whole(self, field: Array) -> Array:
        """Tensors (n, m) of the update or its state with six components, axes as in three dimensions; other fields as they are."""
        if not self.narrow or field.ndim != 2:
            return field
        inside = (0, 2, 1, 4) if self.dimension == "axisymmetric" else (0, 1, 2, 5)
        if field.shape[1] == 3 and self.components == 3:
            inside = (0, 1, 5)
        elif field.shape[1] != 4:
            return field
        found = np.zeros((field.shape[0], 6))
        found[:, inside] = field
        return found

    @cached_property
    def basis(self) -> Any:
        """Basis of scikit-fem."""
        import skfem

        _, word, order = ELEMENTS[self.element]  # type: ignore[index]
        if self.dimension == "axisymmetric":
            order += 1  # the factor r
        return skfem.Basis(
            self.mesh,
            skfem.ElementVector(getattr(skfem, word)()),
            intorder=max(order, 1) if self.quadrature is None else self.quadrature,
        )

    @cached_property
    def points(self) -> Array:
        """Coordinates of the quadrature points [m], (point_count, dim), elements first."""
        return np.moveaxis(np.asarray(self.basis.global_coordinates()), 0, -1).reshape(-1, self.mesh.dim())

    @cached_property
    def weights(self) -> Array:
        """Volume of each quadrature point [m³], (point_count,); per unit thickness in plane strain."""
        volume = np.asarray(self.basis.dx).reshape(-1)
        return 2.0 * np.pi * self.points[:, 0] * volume if self.dimension == "axisymmetric" else volume

    @property
    def point_count(self) -> int:
        """Number of quadrature points."""
        return self.weights.size

    @cached_property
    def strain_matrix(self) -> sp.csr_matrix:
        """B: nodal displacements to the strains of all points, (components · point_count, dof_count)."""
        elements, per_element = self.basis.dx.shape
        count = self.point_count
        rows, columns, entries = [], [], []
        place = np.arange(count).reshape(elements, per_element)
        for i, dofs in enumerate(self.basis.element_dofs):
            field = self.basis.basis[i][0]
            strain = self._strain(np.asarray(field.grad), np.asarray(field))
            if self.integration == "selective":
                strain = self._with_mean_volume(strain)
            column = np.broadcast_to(dofs[:, None], (elements, per_element))
            for k in range(self.components):
                if strain[k] is None:
                    continue
                rows.append((self.components * place + k).reshape(-1))
                columns.append(column.reshape(-1))
                entries.append(strain[k].reshape(-1))
        matrix = sp.coo_matrix(
            (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))),
            shape=(self.components * count, self.basis.N),
        ).tocsr()
        matrix.eliminate_zeros()
        return matrix

    def _strain(self, grad: Array, value: Array) -> list[Any]:
        """Mandel components of one basis function, each (elements, points) or None."""
        if self.dimension == "3d":
            found: list[Any] = [grad[0, 0], grad[1, 1], grad[2, 2]]
            return [*found, *(_ROOT * (grad[i, j] + grad[j, i]) for i, j in ((1, 2), (0, 2), (0, 1)))]
        shear = _ROOT * (grad[0, 1] + grad[1, 0])
        if self.dimension == "plane_stress":
            return [grad[0, 0], grad[1, 1], shear]
        if self.dimension == "plane_strain":
            found = [grad[0, 0], grad[1, 1], None, shear]
            return found if self.narrow else [*found[:3], None, None, shear]
        hoop = value[0] / self.points[:, 0].reshape(self.basis.dx.shape)
        if self.narrow:
            return [grad[0, 0], grad[1, 1], hoop, shear]
        return [grad[0, 0], hoop, grad[1, 1], None, shear, None]

    def _with_mean_volume(self, strain: list[Any]) -> list[Any]:
        weights = self.weights.reshape(self.basis.dx.shape)
        volume = sum(s for s in strain[:3] if s is not None)
        mean = (weights * volume).sum(axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True)
        change = (mean - volume) / 3.0
        return [(change if s is None else s + change) for s in strain[:3]] + strain[3:]

    def strain(self, displacement: Array) -> Array:
        """Strains [-] at the quadrature points, (point_count, components)."""
        return (self.strain_matrix @ displacement).reshape(-1, self.components)

    def internal_force(self, stress: Array) -> Array:
        """∫ σ:ε(v) for every basis function [N; N/m in plane strain], (dof_count,)."""
        return self.strain_matrix.T @ (self.weights[:, None] * stress).reshape(-1)

    def stiffness(self, tangent: Array) -> sp.csc_matrix:
        """∫ ε(v):C:ε(u) [N/m], sparse."""
        blocks = self.weights[:, None, None] * tangent
        count = self.point_count
        size = self.components * count
        middle = sp.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(size, size))
        return (self.strain_matrix.T @ (middle @ self.strain_matrix)).tocsc()

    def average(self, field: Array) -> Array:
        """Volume average of a quadrature field over every element, (element_count, ...)."""
        shape = self.basis.dx.shape
        weights = self.weights.reshape(shape)
        values = np.asarray(field).reshape(*shape, *np.shape(field)[1:])
        extra = (1,) * (values.ndim - 2)
        return (weights.reshape(*shape, *extra) * values).sum(axis=1) / weights.sum(axis=1).reshape(-1, *extra)
