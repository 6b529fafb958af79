"""Potentials: declare a free energy and a force function as symbols, obtain a law.

Tensor algebra on sympy, parameters with units and bounds, forces and indicators, `Law`, and a library of laws. Light to import
(sympy only); numerical work lives in `fenchel.integrators` and is loaded when asked for.
"""

from ..errors import DeclarationError
from .forces import Indicator, forces, indicator
from .invariants import inner, norm, pos, tr
from .law import Law
from .resolve import load_law
from .scalars import parameter, parameters, scalar
from .stiffness import isotropic, lame
from .tensor import dev, identity, sym_tensor
from .unilateral import unilateral_conjugate, unilateral_energy

__all__ = [
    "DeclarationError",
    "Indicator",
    "Law",
    "dev",
    "forces",
    "identity",
    "indicator",
    "inner",
    "isotropic",
    "lame",
    "load_law",
    "norm",
    "parameter",
    "parameters",
    "pos",
    "scalar",
    "sym_tensor",
    "tr",
    "unilateral_conjugate",
    "unilateral_energy",
]
