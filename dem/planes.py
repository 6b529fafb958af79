r"""Planes that bound a sample: fixed, driven by a velocity, or pushed by a force, with inertia or as a servo.

A plane is {x : n·x = n·point}, its normal n points into the sample. Along n it has one degree of freedom w:

* fixed, or with a `velocity` V: w = n·V is given, and the rest of V slides in the plane (a belt);
* pushed by a `force` F [N] (or a `pressure` on an `area`) with a `mass` M: M ẇ = F − R, R the normal force of the sample on the plane;
* a servo, with a `mobility` λ instead of the mass: w = λ (F − R), taken implicitly: R is the force at the end of the step. The sample
  cannot make it oscillate, at any λ; `speed_limit` bounds how fast it looks for the sample.

All of them are rows of one and the same step, no loop around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["Plane", "box_planes"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A plane (a line in two dimensions). Raises `InputError` for a normal of zero length or a drive that is said twice."""

    normal: tuple[float, ...]  # into the sample, of any length > 0
    point: tuple[float, ...]  # a point of the plane at the start [m]
    friction: float = 0.0  # Coulomb coefficient [-]
    velocity: tuple[float, ...] | None = None  # [m/s]
    force: float | None = None  # along the normal, towards the sample [N]
    pressure: float | None = None  # [Pa], with `area`
    area: float | None = None  # [m2] (per unit depth: [m])
    mass: float | None = None  # of a pushed plane [kg]
    mobility: float | None = None  # of a servo [m/(N s)]
    speed_limit: float = np.inf  # of a servo [m/s]

    def __post_init__(self) -> None:
        n = np.asarray(self.normal, dtype=float)
        if not (np.all(np.isfinite(n)) and np.linalg.norm(n) > 0.0 and len(n) == len(self.point)):
            raise InputError("plane.normal: needs a direction with as many finite components as `point`, not all zero")
        if self.velocity is not None and len(self.velocity) != len(n):
            raise InputError("plane.velocity: needs as many components as the normal")
        if not self.friction >= 0.0:
            raise InputError(f"plane.friction = {self.friction}: must be ≥ 0")
        if (self.pressure is None) != (self.area is None):
            raise InputError("plane.pressure: comes with plane.area, the area it acts on")
        pushes = [name for name in ("velocity", "force", "pressure") if getattr(self, name) is not None]
        if len(pushes) > 1:
            raise InputError(f"plane: {' and '.join(pushes)} are both given; one of them drives a plane")
        pushed = self.push is not None
        if pushed and (self.mass is None) == (self.mobility is None):
            raise InputError("plane: a pushed plane has either a mass (inertia) or a mobility (servo)")
        if not pushed and (self.mass is not None or self.mobility is not None):
            raise InputError("plane: mass and mobility belong to a plane with a force or a pressure")
        for name in ("mass", "mobility", "speed_limit", "area"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise InputError(f"plane.{name} = {value}: must be positive")

    @property
    def push(self) -> float | None:
        """Force along the normal [N], None where the plane is fixed or driven by a velocity."""
        if self.force is not None:
            return self.force
        return None if self.pressure is None or self.area is None else self.pressure * self.area

    @property
    def direction(self) -> Array:
        """The unit normal."""
        n = np.asarray(self.normal, dtype=float)
        return n / np.linalg.norm(n)

    @property
    def place(self) -> float:
        """n·point [m]."""
        return float(self.direction @ np.asarray(self.point, dtype=float))


def box_planes(dimension: int) -> tuple[Array, Array, NDArray[np.int64]]:
    """The walls of a box |x_a| ≤ half_a: normals (2d, d), senses (2d,), degrees of freedom (2d,), lower wall before upper.

    The degree of freedom is the rate of the half length, so that a wall moves with −1 times it along its normal.
    """
    normal = np.zeros((2 * dimension, dimension))
    for axis in range(dimension):
        normal[2 * axis, axis], normal[2 * axis + 1, axis] = 1.0, -1.0
    return normal, np.full(2 * dimension, -1.0), np.repeat(np.arange(dimension), 2)


def motion_of(planes: Sequence[Plane], velocity: Array, step: float) -> tuple[Array, NDArray[np.bool_], Array]:
    """Free motion of planes in a step: (w without contacts, inverse mass) (P, 2), which have no inertia (P,), and how they slide (P, d).

    `velocity` [m/s] is the present one of those with inertia.
    """
    motion = np.zeros((len(planes), 2))
    given = np.ones(len(planes), dtype=bool)
    slide = np.zeros((len(planes), len(planes[0].normal) if planes else 0))
    for k, plane in enumerate(planes):
        if plane.velocity is not None:
            n, v = plane.direction, np.asarray(plane.velocity, dtype=float)
            motion[k, 0] = n @ v
            slide[k] = v - (n @ v) * n
        elif plane.push is not None and plane.mass is not None:
            motion[k] = velocity[k] + step * plane.push / plane.mass, 1.0 / plane.mass
            given[k] = False
        elif plane.push is not None and plane.mobility is not None:
            wanted = plane.mobility * plane.push
            motion[k] = np.clip(wanted, -plane.speed_limit, plane.speed_limit), plane.mobility / step
    return motion, given, slide
