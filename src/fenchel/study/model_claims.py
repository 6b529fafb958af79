"""Part C: the continuum model of the study, its wires, its sand, its implicit step.

`model_wires` (11, 12), `model_sand` (13, 14), `model_step` (15) and `model_tangent` (16) compute; `model_figures` draws.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import FenchelError
from .claim import Claim, Picture
from .formulation_check import Check, part_of
from .model_figures import cone_figure, gap_figure
from .model_sand import ANGLES, COHESION, PRESSURE, dissipated, elastic_domain
from .model_step import projections
from .model_tangent import BODIES, tangents
from .model_wires import LAMBDA, MU, closed_cycles, wire_energy
from .sizes import Size

__all__ = ["MODEL"]

_WIRES = {"lambda_w [Pa]": LAMBDA, "mu_w [Pa]": MU}
_LIBRARY = {"laws": "at the values that the library keeps"}

CHECKS = (
    Check(
        claim=Claim(
            11, "T", "The wire energy resists principal directions that extend and volume that grows, and nothing else.",
            "No stress in compression; stress, gradient, second derivative, conjugate and the bounds at equal strain exact, "
            "also where principal values coincide.",
        ),
        name="C: wire energy",
        function=wire_energy,
        arguments=lambda s: {"seed": 11, "count": 10 * s.samples, "programs": max(12, s.samples // 20)},
        below={
            "slack": 1e-15, "stress": 1e-12, "gradient": 1e-8, "hessian": 1e-8, "euler": 1e-12, "fenchel": 1e-12, "conjugate": 1e-7,
            "known": 1e-8, "bounds": 1e-12,
        },
        above={"differentiable": 0.5},
        sentence="At {strains} strains the wires are stressless in compression ({slack:.0e}), their stress is the closed one to "
        "{stress:.1e}, the derivative of the energy to {gradient:.1e} and their tangent that of the stress to "
        "{hessian:.1e}; the closed conjugate is the supremum of {programs} semidefinite programs to {conjugate:.1e}.",
        headline="stress",
        held=_WIRES | {"principal strains": "1e-4 to 1e-1, some equal", "conjugate": "moduli 0.2 to 2, a third with lambda 0"},
        cost=2.0,
    ),
    Check(
        claim=Claim(
            12, "T", "The wires lose nothing.",
            "Work over closed cycles of strain below 1e-12 of the work that passes; no dissipation reported by the step.",
        ),
        name="C: closed cycles",
        function=closed_cycles,
        arguments=lambda s: {"seed": 12, "cycles": max(10, s.samples // 10), "sides": 5},
        below={"work": 1e-12, "dissipation": 0.0},
        above={"kinks": 10},
        sentence="Over {cycles} closed polygons of strain, through {kinks} passages between slack and taut, the wires give back "
        "all but {work:.1e} of the work that passes through them.",
        headline="work",
        held=_WIRES | {"corners": "normal, 1e-3", "quadrature": "Gauss, 24 nodes on 16 panels between kinks"},
    ),
    Check(
        claim=Claim(
            13, "T", "Texsol dissipates what its sand dissipates, C_0 ṗ.",
            "At every step: equal to sand and to C_0 Δp to 1e-12, to the sum of fluxes times forces to 1e-9; never negative.",
        ),
        name="C: dissipation of sand",
        function=dissipated,
        arguments=lambda s: {"seed": 13, "paths": max(10, s.samples // 10), "steps": 8},
        below={"sand": 1e-12, "C_0": 1e-12, "forces": 1e-9, "negative": 0.0},
        above={"flowing": 0.1, "apex": 1},
        sentence="At each of {steps} steps, {apex:.0f} of them at the apex, texsol dissipates what sand does to {sand:.1e} and "
        "C_0 Δp to {C_0:.1e}.",
        headline="C_0",
        held=_LIBRARY | {"hardening": "both readings, K1 and K2"},
    ),
    Check(
        claim=Claim(
            14, "T", "Sand yields on a cone, smooth but for its apex, that stands near Mohr and Coulomb's hexagon.",
            "Convex, with a gradient off the apex; radii of the laws and the theorems on three matchings to 1e-9; the "
            "distance is reported.",
        ),
        name="C: elastic domain",
        function=elastic_domain,
        arguments=lambda s: {"seed": 14, "count": 5 * s.samples, "angles": 721},
        below={"bulge": 1e-12, "gradient": 1e-8, "misfit": 1e-9, "theorems": 1e-9, "turn, sand": 1.001, "given": 2e-3},
        above={"turn, mohr_coulomb": 10.0},
        sentence="The cone is convex and its normal turns evenly. Over the Lode angle at θ = 0.079 rad it is at most "
        "{far_compression_at_0_079:.0%} from the hexagon through the compressive edges, {far_extension_at_0_079:.0%} "
        "through the extensive ones, {far_plane_strain_at_0_079:.0%} matched in plane strain; at 0.6 rad "
        "{far_compression_at_0_6:.0%}, {far_extension_at_0_6:.0%} and {far_plane_strain_at_0_6:.0%}. The study's angle "
        "is a Mohr–Coulomb one of {angle_compression:.2f}° to {angle_plane_strain:.2f}°.",
        headline="far, compression at 0.079",
        held={"friction angles [rad]": list(ANGLES), "cohesion [Pa]": COHESION, "pressure [Pa]": PRESSURE},
    ),
    Check(
        claim=Claim(
            15, "T", "The implicit step minimises a convex energy; its dual projects the trial forces.",
            "Compiled step between primal and dual program, gap below 1e-7, for every law; the gap of any admissible pair "
            "bounds its error.",
        ),
        name="C: projection",
        function=projections,
        arguments=lambda s: {
            "seed": 15, "count": max(s.samples, 300), "programs": max(6, s.samples // 40), "reference": max(3, s.samples // 100),
        },
        below={"gap": 1e-7, "programs": 1e-7, "admissible": 1e-9, "certified": 1e-7, "bound": 1.0, "reference": 1e-3},
        above={"apex": 1, "plastic": 0.5},
        sentence="The return map leaves a gap of {gap:.1e} between primal and dual, whose cone programs give the same value to "
        "{programs:.1e}; over {laws} laws the certified gap is at most {certified:.1e} of the energy. Of {steps} "
        "admissible pairs none has an error above its gap (largest ratio {bound:.3f}).",
        headline="gap",
        held=_LIBRARY | {"reference": "clarabel at its own tolerances, stress to about their root"},
        cost=10.0,
    ),
    Check(
        claim=Claim(
            16, "T", "The tangent of the step is consistent.",
            "Differences of the stress to 1e-6 of the stiffness away from kinks, for every law; Newton's method on a body of order two.",
        ),
        name="C: tangents",
        function=tangents,
        arguments=lambda s: {"seed": 16, "count": min(max(24, s.samples // 20), 100), "cells": 6, "shortening": 1e-3},
        below={"difference": 1e-6, "asymmetry": 1e-9, "negative": 1e-9, "constant": 30.0},
        above={"smooth": 0.5, "order": 1.8, "plastic": 0.05},
        sentence="Tangents of {laws} laws are the derivatives of the stress to {difference:.1e} of the stiffness, symmetric and "
        "not negative; on a crushed cylinder of 36 elements Newton's method converges with the order {order:.2f}.",
        headline="difference",
        held=_LIBRARY | {"bodies": f"{' and '.join(BODIES)}, cylinder of 1 m × 1 m, rough platens, one step"},
        cost=8.0,
    ),
)  # fmt: skip


def _pictures(_size: Size, _folder: Path, results: Mapping[str, Any]) -> list[Picture]:
    domain, pairs = results.get("C: elastic domain"), results.get("C: projection")
    found = []
    if domain is not None and not isinstance(domain, FenchelError):
        found.append(
            Picture(
                "cone",
                "The cone of sand in its three matchings beside Mohr and Coulomb's hexagon: the deviatoric plane at φ = 0.6 rad "
                "and a pressure of 50 kPa, and the ratio of the radii from triaxial compression (0°) to extension (60°).",
                lambda: cone_figure(domain),
            )
        )
    if pairs is not None and not isinstance(pairs, FenchelError):
        found.append(
            Picture(
                "gap",
                "Duality gap of random admissible pairs of a step of sand, and their error in the energy norm: none above the line.",
                lambda: gap_figure(pairs),
            )
        )
    return found


MODEL = part_of("C", "Continuum model", CHECKS, _pictures)
