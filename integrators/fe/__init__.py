"""Finite elements: quasi-static equilibrium of a body of any declared law, on the meshes and elements of scikit-fem.

    find u:   ∫ σ(ε(u)) : ε(v) = ℓ(v)   for all v,   u = u_D on the supports,

an implicit step at a time: the stress is the gradient of the convex incremental energy W_n of the law, so each step is itself a convex
minimisation. scikit-fem is imported when a body is made.
"""

from .body import Body
from .equilibrium import Equilibrium, solve, walk
from .loads import Pressure, Support
from .meshes import cylinder_section, read_mesh, rectangle, ring_section
from .output import quadrature_map, write_vtk

__all__ = [
    "Body",
    "Equilibrium",
    "Pressure",
    "Support",
    "cylinder_section",
    "quadrature_map",
    "read_mesh",
    "rectangle",
    "ring_section",
    "solve",
    "walk",
    "write_vtk",
]
