"""Potentials: declare a free energy and a force function as symbols, obtain a law.

Tensor algebra on sympy, parameters with units and bounds, forces and indicators, `Law`, and a library of laws. Light to import
(sympy only); numerical work lives in `fenchel.integrators` and is loaded when asked for.
"""

from typing import TYPE_CHECKING, Any

from ..errors import DeclarationError
from .extended import Extended, indicator
from .invariants import eig_max, eig_min, eig_sum, inner, norm, pos, tr
from .law import Law
from .resolve import load_law
from .roles import entropy_flux, forces, frozen, gradient, rates
from .scalars import parameter, parameters, scalar, temperature
from .stiffness import isotropic, lame
from .tensor import dev, identity, sym_tensor
from .unilateral import unilateral_conjugate, unilateral_energy
from .vector import vector

if TYPE_CHECKING:
    from .conjugation import numerical_conjugate, partial_conjugate, total_conjugate

__all__ = [
    "DeclarationError",
    "Extended",
    "Law",
    "dev",
    "eig_max",
    "eig_min",
    "eig_sum",
    "entropy_flux",
    "forces",
    "frozen",
    "gradient",
    "identity",
    "indicator",
    "inner",
    "isotropic",
    "lame",
    "load_law",
    "norm",
    "numerical_conjugate",
    "parameter",
    "parameters",
    "partial_conjugate",
    "pos",
    "rates",
    "scalar",
    "sym_tensor",
    "temperature",
    "total_conjugate",
    "tr",
    "unilateral_conjugate",
    "unilateral_energy",
    "vector",
]


def __getattr__(name: str) -> Any:
    # the rules of conjugation are loaded when they are asked for: declaring a law does not need them
    if name in ("numerical_conjugate", "partial_conjugate", "total_conjugate"):
        from . import conjugation

        return getattr(conjugation, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
