"""Measures of a sample: one file each, from a `Network` (bodies, closed contacts with their forces, links with their tension).

Stress by phase is in `homogenise`, measures of how well a step was solved are in `residual`.
"""

from .active_length import (
    ActiveLength,
    PermutationTest,
    Straightness,
    active_length,
    expected_longest_run,
    permutation_test,
    straightness,
)
from .bead_slip import bead_slip
from .coordination import Coordination, coordination, rattlers
from .fabric import (
    IsotropyTest,
    anisotropy,
    contact_fabric,
    fabric,
    wire_fabric,
    wire_fabric_interval,
    wire_isotropy_test,
)
from .force_distribution import ForceDistribution, force_distribution, force_values, strong_contacts
from .network import KINDS, Network
from .pair_types import contact_counts
from .phase_mismatch import PhaseMismatch, phase_mismatch
from .repose import Repose, angle_of_repose
from .sliding import mobilised_friction, sliding_fraction
from .solid_fraction import shared_volume, solid_fraction
from .strain import accumulated_gradient, best_fit_gradient, boundary_gradient, delaunay_cells, delaunay_gradient
from .summary import SUMMARY, summary

__all__ = [
    "KINDS",
    "SUMMARY",
    "ActiveLength",
    "Coordination",
    "ForceDistribution",
    "IsotropyTest",
    "Network",
    "PermutationTest",
    "PhaseMismatch",
    "Repose",
    "Straightness",
    "accumulated_gradient",
    "active_length",
    "angle_of_repose",
    "anisotropy",
    "bead_slip",
    "best_fit_gradient",
    "boundary_gradient",
    "contact_counts",
    "contact_fabric",
    "coordination",
    "delaunay_cells",
    "delaunay_gradient",
    "expected_longest_run",
    "fabric",
    "force_distribution",
    "force_values",
    "mobilised_friction",
    "permutation_test",
    "phase_mismatch",
    "rattlers",
    "shared_volume",
    "sliding_fraction",
    "solid_fraction",
    "straightness",
    "strong_contacts",
    "summary",
    "wire_fabric",
    "wire_fabric_interval",
    "wire_isotropy_test",
]
