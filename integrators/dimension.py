"""The kinematic hypotheses: which components a tensor has, which strains are given, which follow from a stress that is zero.

    "3d"            11, 22, 33, √2·23, √2·13, √2·12        all given
    "plane_strain"  11, 22, 33, √2·12                      all given; ε₃₃ is zero if left out (the in-plane three are given then)
    "axisymmetric"  rr, zz, θθ, √2·rz                      all given
    "plane_stress"  11, 22, 33, √2·12                      11, 22, √2·12 given, σ₃₃ = 0
    "uniaxial"      11, 22, 33                             11 given, σ₂₂ = σ₃₃ = 0

What a law leaves out by symmetry stays zero: an isotropic law under strains and states without the shears 23 and 13 answers without them.
Code is written for the components that exist, and for no others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["DIMENSIONS", "SPACE", "Dimension", "dimension_named", "require_space"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Dimension:
    """`places` of the components among the six of three dimensions; positions among them that are `given`, and `relaxed` by zero stress."""

    name: str
    places: tuple[int, ...]
    given: tuple[int, ...]
    relaxed: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Number of components of a tensor."""
        return len(self.places)

    def strains(self, given: Any) -> Array:
        """Strains (n, size) from what the user gives; relaxed components begin at zero. `InputError` for other shapes and values."""
        inside = (0, 1, 3) if self.name == "plane_strain" and np.shape(given)[-1:] == (3,) else self.given
        return self._full("eps_new", given, inside)

    def complete(self, eps: Any) -> Array:
        """Strains (n, size) from all components, or from the given ones as `strains`."""
        if np.shape(eps)[-1:] == (self.size,):
            return self._full("eps_new", eps, tuple(range(self.size)))
        return self.strains(eps)

    def stresses(self, given: Any) -> Array:
        """Stresses (n, size) from what the user gives; those that are relaxed are zero."""
        return self._full("sig_new", given, self.given)

    def _full(self, name: str, given: Any, inside: tuple[int, ...]) -> Array:
        try:
            found = np.atleast_2d(np.asarray(given, dtype=float))
        except (TypeError, ValueError):
            raise InputError(f"{name} must be an array of numbers") from None
        width = found.shape[-1] if found.ndim == 2 else -1
        if width != len(inside):
            raise InputError(
                f"{name} has shape {np.shape(given)}; it must be (n, {len(self.given)}) or ({len(self.given)},), {self.words}"
            )
        if not np.isfinite(found).all():
            row = int(np.argmax(~np.isfinite(found).all(axis=1)))
            raise InputError(f"{name} holds a value that is not finite (point {row})")
        if width == self.size:
            return np.ascontiguousarray(found)
        full = np.zeros((found.shape[0], self.size))
        full[:, inside] = found
        return full

    @property
    def words(self) -> str:
        """The given components in words."""
        return _WORDS[self.name]

    def embedded(self, tensors: Array) -> Array:
        """The six components (n, 6) of tensors (n, size)."""
        if self.size == 6:
            return tensors
        found = np.zeros((tensors.shape[0], 6))
        found[:, self.places] = tensors
        return found


_WORDS = {
    "3d": "Mandel components",
    "plane_strain": "11, 22, 33, sqrt(2)*12 (or the three without 33, which is then zero)",
    "axisymmetric": "rr, zz, tt, sqrt(2)*rz",
    "plane_stress": "11, 22, sqrt(2)*12",
    "uniaxial": "11",
}
_PLANE = (0, 1, 2, 5)
DIMENSIONS = {
    d.name: d
    for d in (
        Dimension("3d", (0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 4, 5)),
        Dimension("plane_strain", _PLANE, (0, 1, 2, 3)),
        Dimension("axisymmetric", _PLANE, (0, 1, 2, 3)),
        Dimension("plane_stress", _PLANE, (0, 1, 3), (2,)),
        Dimension("uniaxial", (0, 1, 2), (0,), (1, 2)),
    )
}


SPACE = DIMENSIONS["3d"]


def require_space(update: Any, what: str) -> None:
    """`InputError` unless an update works on six components in double precision, the only kind that `what` can follow."""
    dimension, precision = getattr(update, "dimension", SPACE), getattr(update, "precision", "float64")
    if dimension.name != "3d" or precision != "float64":
        kind = dimension.name if dimension.name != "3d" else precision
        raise InputError(f"{what}: the update is compiled for '{kind}'; compile the law for '3d' in float64")


def dimension_named(name: str) -> Dimension:
    """The hypothesis of a name; `InputError` lists those that exist."""
    if name not in DIMENSIONS:
        raise InputError(f"dimension {name!r} is not available; it is one of {', '.join(DIMENSIONS)}")
    return DIMENSIONS[name]
