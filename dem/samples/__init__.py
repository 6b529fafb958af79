"""Samples: size distributions, how wires lie, random dense samples, isotropic states at a chosen friction and density."""

from .isotropic import IsotropicState, isotropic_state
from .random_dense import random_sample
from .sizes import LogNormal, Sieve, Sizes, UniformByNumber, UniformByVolume, draw_radii
from .wire_layout import lay_layers, wire_count_of

__all__ = [
    "IsotropicState",
    "LogNormal",
    "Sieve",
    "Sizes",
    "UniformByNumber",
    "UniformByVolume",
    "draw_radii",
    "isotropic_state",
    "lay_layers",
    "random_sample",
    "wire_count_of",
]
