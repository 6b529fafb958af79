"""The measures of a state in one table: what `fenchel dem` prints beside the quality of a run."""

from __future__ import annotations

import numpy as np

from .active_length import active_length, permutation_test
from .coordination import coordination
from .fabric import anisotropy, contact_fabric, wire_fabric
from .force_distribution import force_distribution
from .network import Network
from .pair_types import contact_counts
from .sliding import sliding_fraction
from .solid_fraction import solid_fraction

__all__ = ["SUMMARY", "summary"]

SUMMARY = {  # unit and meaning of what `summary` returns
    "grain_grain": ("1", "closed contacts between grains"),
    "grain_bead": ("1", "closed contacts of grains with beads"),
    "bead_bead": ("1", "closed contacts between beads"),
    "grain_wall": ("1", "closed contacts of grains with walls and planes"),
    "bead_wall": ("1", "closed contacts of beads with walls and planes"),
    "link_taut": ("1", "links under tension"),
    "link_slack": ("1", "links without force"),
    "link_pushing": ("1", "links under compression (rods)"),
    "coordination": ("1", "contacts per grain, walls counted"),
    "coordination_core": ("1", "the same without rattlers"),
    "rattlers": ("1", "share of grains with fewer than two contacts (d + 1 without friction), again and again"),
    "coordination_beads": ("1", "contacts per bead, links not counted"),
    "sliding": ("1", "share of frictional contacts at the Coulomb limit, within 1e-6 of it"),
    "sliding_grain_bead": ("1", "the same among contacts of grains with beads"),
    "force_mean": ("N", "mean normal force of closed contacts"),
    "force_participation": ("1", "(Σf)²/(N Σf²): 1 if all are equal, 1/2 if exponential"),
    "strong": ("1", "share of contacts above the mean normal force"),
    "fabric_zz": ("1", "share of the contact fabric along the last axis; 1/d if isotropic"),
    "fabric_anisotropy": ("1", "largest minus smallest eigenvalue of D = (d (d+2)/2) dev F"),
    "wire_fabric_zz": ("1", "share of the wire fabric along the last axis"),
    "solid_fraction_sphere": ("1", "of all bodies in the sphere of 0.8 half widths of the box"),
    "grain_fraction_sphere": ("1", "of the grains alone in it"),
    "tension_mean": ("N", "length-weighted mean tension, slack counts as zero"),
    "active_length": ("m", "longest segment with three times the mean tension or more"),
    "active_length_radii": ("1", "the same over the mean grain radius"),
    "active_length_null": ("m", "its mean with tensions shuffled along the wires"),
    "active_length_p": ("1", "share of shuffled tensions that give as long a segment"),
}


def summary(network: Network, *, samples: int = 199) -> dict[str, float]:
    """The measures of `SUMMARY` by name, nan where there is nothing to measure; `samples` of the permutation test, always the same ones."""
    nothing = float("nan")
    out: dict[str, float] = {name: float(count) for name, count in contact_counts(network).items()}
    grains, beads = coordination(network), coordination(network, phase="beads")
    known = not np.isnan(network.friction).any()
    loaded = len(network.pair) > 0
    forces = force_distribution(network.normal_force) if loaded else None
    directions = contact_fabric(network)
    spread = anisotropy(directions)[1] if loaded else np.full(2, nothing)
    boxed = bool(np.all(np.isfinite(network.half)))
    sphere = 0.8 * float(network.half.min()) if boxed else 0.0
    out |= {
        "coordination": grains.mean,
        "coordination_core": grains.without_rattlers,
        "rattlers": grains.rattler_fraction,
        "coordination_beads": beads.mean,
        "sliding": sliding_fraction(network) if known else nothing,
        "sliding_grain_bead": sliding_fraction(network, kind="grain_bead") if known else nothing,
        "force_mean": forces.mean if forces else nothing,
        "force_participation": forces.participation if forces else nothing,
        "strong": float(np.mean(network.normal_force > forces.mean)) if forces else nothing,
        "fabric_zz": float(directions[-1, -1]),
        "fabric_anisotropy": float(spread[-1] - spread[0]),
        "wire_fabric_zz": float(wire_fabric(network)[-1, -1]),
        "solid_fraction_sphere": solid_fraction(network, sphere) if boxed else nothing,
        "grain_fraction_sphere": solid_fraction(network, sphere, phase="grains") if boxed else nothing,
    }
    if len(network.link):
        active = active_length(network)
        test = permutation_test(network, np.random.default_rng(0), samples=samples)
        lengths = (active.mean_tension, active.length, active.radii, test.null_mean, test.p_value)
    else:
        lengths = (nothing,) * 5
    names = ("tension_mean", "active_length", "active_length_radii", "active_length_null", "active_length_p")
    return out | dict(zip(names, lengths, strict=True))
