"""Identification from data that hold too little: planted parameters (`planted_law`, a law written without fenchel) in triaxial tests
without reversal, with hardly any plastic strain, at one pressure or at pressures close to each other, with noise.

A parameter comes out right in one of three ways, and any other is a narrow wrong interval:

* with an interval of 95 %: error ≤ 2 half-widths. Of Student's t with seven degrees of freedom (eight octants) one in five hundred honest
  intervals misses by more, and all cells together hold some sixty; what is narrow and wrong misses by many;
* without one, as no two samples or octants differ: error ≤ 1e-3 of the value;
* without one, and the note says why: not separable, or at its bound. `H_eff` and what was said of it is judged with the seven.

Or the whole is refused with the reason. The note of a row holds the widest relative half-width and the condition number of (H_k, H_i).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import planted_law
from extreme_rows import Cell, Measured, nothing_but

from fenchel.identify import IdentifyOptions, Specimen, effective_hardening, identify_law

TRUTH = planted_law.Planted(E_s=12.167e6, E_w=0.332e6, nu=0.2, theta_f=0.079, C_0=2842.0, H_k=0.944e6, H_i=0.472e6)
SEVEN = ("E_s", "E_w", "nu", "theta_f", "C_0", "H_k", "H_i")
CYCLE, ONE_WAY = (0.0, -0.01, 0.006, -0.01), (0.0, -0.01)


def specimens(pressures: Any, seeds: Any, corners: Any, spread: float, noise: float) -> list[Specimen]:
    """Samples whose octants scatter by `spread`, or, with `noise`, single curves with that noise on every frame."""
    found = []
    for seed in seeds:
        tests = {}
        for P in pressures:
            if noise:
                rng = np.random.default_rng([seed, round(P)])
                tests[P] = planted_law.history(TRUTH, P, corners, step=2e-4, noise=noise, rng=rng)
            else:
                tests[P] = planted_law.record(TRUTH, P, seed, spread=spread, corners=corners, step=2e-4)
        found.append(Specimen(seed=seed, linked=tests))
    return found


def identified(
    pressures: tuple[float, ...] = (5e4, 9e4),
    corners: tuple[float, ...] = CYCLE,
    *,
    seeds: tuple[int, ...] = (1,),
    spread: float = 0.04,
    noise: float = 0.0,
    separable: bool = True,
) -> tuple[Measured, str]:
    """Parameters against the planted ones; `separable` says whether (H_k, H_i) can be told apart in theory."""
    options = IdentifyOptions(fit_frames=20, strength_strains=(0.005,))
    found = identify_law(specimens(pressures, seeds, corners, spread, noise), options)
    errors: dict[str, tuple[float, float]] = {}
    widest, without = 0.0, []
    H_eff = effective_hardening(TRUTH.H_k, TRUTH.H_i, math.tan(TRUTH.theta_f))
    for name, true in {**{n: getattr(TRUTH, n) for n in SEVEN}, "H_eff": H_eff}.items():
        e = found.estimates[name]
        if np.isfinite(e.low) and np.isfinite(e.high):
            half = max(e.high - e.value, e.value - e.low)
            errors[f"{name} over its half-width"] = (abs(e.value - true) / half, 2.0)
            widest = max(widest, half / true)
        elif e.note:
            without.append(f"{name} {e.note}")
        else:
            errors[f"{name}, relative"] = (abs(e.value - true) / true, 1e-3)
    hard = found.pooled.hardening
    assert hard is not None
    errors["(H_k, H_i) told apart"] = nothing_but(hard.separable == separable)
    condition = hard.joint.condition
    note = f"condition {condition:.0e}" if math.isfinite(condition) else "condition infinite"
    note += f"; widest half-width {widest:.0%}" if widest else "; no scatter, no interval"
    return errors, "; ".join([note, *without])


PATH, LEVEL, NOISE = "path", "pressures", "scatter"
CELLS: list[Cell] = [
    Cell(PATH, "reversal into extension", identified),
    Cell(PATH, "no reversal", lambda: identified(corners=ONE_WAY, separable=False)),
    Cell(
        PATH,
        "reversal that stays elastic",
        lambda: identified(corners=(0.0, -0.01, -0.009), separable=False),
        long=True,
    ),
    Cell(PATH, "0.15 % strain", lambda: identified(corners=(0.0, -0.0015)), says="no plastic flow on the first leg"),
    Cell(PATH, "0.3 % strain", lambda: identified(corners=(0.0, -0.003), separable=False)),
    Cell(LEVEL, "one", lambda: identified((5e4,)), says="cohesion and friction need two or more"),
    Cell(LEVEL, "10 % apart, no reversal", lambda: identified((5e4, 5.5e4), ONE_WAY, separable=False), long=True),
    Cell(LEVEL, "1 % apart", lambda: identified((5e4, 5.05e4))),
    Cell(LEVEL, "1 % apart, no reversal", lambda: identified((5e4, 5.05e4), ONE_WAY, separable=False)),
    Cell(NOISE, "none", lambda: identified(spread=0.0)),
    Cell(NOISE, "octants 30 %", lambda: identified(spread=0.3), long=True),
    Cell(NOISE, "two samples, octants 4 %", lambda: identified(seeds=(1, 2)), long=True),
    Cell(NOISE, "three curves, frames 0.1 %", lambda: identified(seeds=(1, 2, 3), noise=1e-3), long=True),
    Cell(NOISE, "three curves, frames 3 %", lambda: identified(seeds=(1, 2, 3), noise=3e-2)),
]
