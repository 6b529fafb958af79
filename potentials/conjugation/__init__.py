"""Legendre–Fenchel conjugates, by rule and by certified numbers; see `laws` for the two that are exported, partial and total."""

from .conjugate import Conjugate, conjugate
from .form import NoRule
from .laws import (
    dissipation_pair,
    energy_from_conjugate,
    force_potential_from_rates,
    partial_conjugate,
    slots_of,
    total_conjugate,
)
from .numerical import NumericalConjugate, numerical_conjugate

__all__ = [
    "Conjugate",
    "NoRule",
    "NumericalConjugate",
    "conjugate",
    "dissipation_pair",
    "energy_from_conjugate",
    "force_potential_from_rates",
    "numerical_conjugate",
    "partial_conjugate",
    "slots_of",
    "total_conjugate",
]
