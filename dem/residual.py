r"""How good is a solved step? Recomputed from the impulses alone: velocities are rebuilt as v = v_free + M⁻¹ H p, then measured.

With the law's velocity ũ = (u_n + b + c_n p_n, u_t + c_t (p_t − p_t⁰)) the law is Coulomb's cone complementarity
K_μ ∋ p' ⊥ û ∈ K_μ*, û = ũ + μ‖ũ_t‖ n (p' = p less the law's least normal impulse), and the natural map

    ‖p' − P_K(p' − ρ û)‖ / ‖p‖ ,   ρ = 1/(W_n + c_n) per contact,

is zero exactly at solutions (de Saxcé and Feng 1998; Acary, Brémond and Huber 2018); where all impulses are rounding, relative to the size
below which the sweeps take them for that. Walls and links are half lines (rods: lines).

Energy of a step of the θ-scheme, with v_θ = θ v⁺ + (1−θ) v⁻ and so q⁺ − q⁻ = h v_θ, exactly:

    ΔE_kin = F·(q⁺ − q⁻) + Σ p·u_θ − (θ − ½) Δv·M Δv .

The first term is the work of weight, pressures and drives; the last is the damping of the scheme. The work of the contacts is split into
the change of elastic energy, the friction dissipation −p_t·ũ_t ≥ 0, the algorithmic dissipation ½c|p − p⁰|² ≥ 0 of the implicit
compliance (that of the links apart), the shock term (1−θ) Σ p·(u⁺ − u⁻) (with what recovery or restitution give back), and what is left:
the change of geometry between steps (`balance`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["MEASURES", "SUMS", "finish"]

MEASURES = (
    "natural_map",  # relative, as above
    "natural_map_max",  # worst contact, relative to the mean impulse
    "violation_max",  # largest gap less elastic deflection [m]
    "overlap_mean",  # mean over closed contacts of the end-of-step overlap [m]
    "overlap_max",
    "force_mean",  # mean normal force of closed contacts [N]
    "unbalanced",  # mean net force of bodies / mean contact force
    "sliding",  # fraction of closed contacts on the cone
    "closed",  # number of closed contacts
    "elastic",  # stored elastic energy at the end of the step [J]
    "friction",  # dissipated by friction in the step [J]
    "algorithmic",  # dissipated by the implicit compliance of contacts and links [J]
    "shock",  # dissipated by inelastic shocks, less what restitution and recovery give back [J]
    "external",  # work of weight, pressures and driven walls [J]
    "kinetic",  # kinetic energy at the end of the step [J]
    "balance",  # energy error of the step [J]
    "wires",  # the part of `algorithmic` that is the links' [J]
    "damping",  # dissipated by the scheme, (θ − ½) Δv·M Δv [J]
    "weight",  # the part of `external` that is the weight's [J]
    "drive",  # the part of `external` that is the walls' and planes': pressures, forces, velocities [J]
)

# places in the array that the generated kernels add to
SUMS = {
    name: place
    for place, name in enumerate(
        (
            "squared", "worst", "size", "violation_max", "overlap", "overlap_max", "force", "unbalanced", "sliding", "closed", "elastic",
            "friction_loss", "algorithmic", "wires", "shock", "work", "weight", "drive", "kinetic", "damping",
        )
    )
}  # fmt: skip


def finish(
    out: NDArray[np.float64], step: float, bodies: int, elastic_before: float, floor: float = 0.0
) -> dict[str, float]:
    """The measures by name, from the sums of the kernels; impulses below `floor` [N s] are rounding, to the sweeps too."""
    s = {name: float(out[place]) for name, place in SUMS.items()}
    closed = s["closed"]
    mean_impulse = s["force"] / closed if closed else 0.0
    algorithmic = s["algorithmic"] + s["wires"]
    size = max(s["size"], floor * floor)
    return {
        "natural_map": float(np.sqrt(s["squared"] / size if size > 0.0 else s["squared"])),
        "natural_map_max": float(np.sqrt(s["worst"])) / (mean_impulse if mean_impulse > 0.0 else 1.0),
        "violation_max": s["violation_max"],
        "overlap_mean": s["overlap"] / closed if closed else 0.0,
        "overlap_max": s["overlap_max"],
        "force_mean": mean_impulse / step,
        "unbalanced": s["unbalanced"] / bodies / mean_impulse if mean_impulse > 0.0 and bodies else 0.0,
        "sliding": s["sliding"] / closed if closed else 0.0,
        "closed": closed,
        "elastic": s["elastic"],
        "friction": s["friction_loss"],
        "algorithmic": algorithmic,
        "shock": s["shock"],
        "external": s["weight"] + s["drive"],
        "kinetic": s["kinetic"],
        # what the contacts gave to the kinetic energy, not accounted for
        "balance": elastic_before - s["work"] - s["elastic"] - s["friction_loss"] - algorithmic - s["shock"],
        "wires": s["wires"],
        "damping": s["damping"],
        "weight": s["weight"],
        "drive": s["drive"],
    }
