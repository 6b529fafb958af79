r"""An isotropic state at a chosen friction, and at a chosen density if one is asked for.

The density of a compacted sample is set by the friction that acts while it is compacted: none gives the dense limit of random packing,
more gives looser ones. For a wanted solid fraction the friction of compaction is searched between 0 and a bound, from one and the
same densified sample; every trial is a whole preparation (compression, friction of the test on, rest).

Agnolin and Roux (2007), PRE 76, 061302.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from ...errors import InputError
from ..bodies import Assembly
from ..preparation import make_sample, preparation
from ..scene import Grains, Sample, SceneSolve, Wires

__all__ = ["IsotropicState", "isotropic_state"]


@dataclass(frozen=True, kw_only=True)
class IsotropicState:
    """A sample at rest under a pressure."""

    assembly: Assembly
    solid_fraction: float  # grains and beads in the box
    compaction_friction: float  # coefficient while it was compacted
    trials: tuple[tuple[float, float], ...]  # (friction of compaction, solid fraction) of all trials


def isotropic_state(
    grains: Grains,
    wires: Wires | None = None,
    sample: Sample | None = None,
    solve: SceneSolve | None = None,
    *,
    pressure: float,
    seed: int,
    solid_fraction: float | None = None,
    tolerance: float = 1e-3,
    friction_limit: float = 1.0,
    trial_limit: int = 12,
) -> IsotropicState:
    """A sample at rest at `pressure` [Pa] under the friction of `grains`, compacted with `sample.friction` or to a `solid_fraction` [-].

    The search narrows an interval of coefficients by secants kept inside it and stops within `tolerance` of the wanted fraction or after
    `trial_limit` trials. Raises `InputError` when the fraction is outside of what frictions from 0 to `friction_limit` give from this start
    (the message says what they give) or when no trial came near enough.
    """
    sample = Sample() if sample is None else sample
    solve = SceneSolve() if solve is None else solve
    start = make_sample(grains, wires, sample, seed)
    trials: list[tuple[float, float]] = []
    states: dict[float, Assembly] = {}

    def trial(friction: float) -> float:
        assembly = start.copy()
        for make in preparation(grains, wires, msgspec.structs.replace(sample, friction=friction), solve, pressure):
            stage = make(assembly)
            while not stage.done:
                stage.advance()
        states[friction] = assembly
        trials.append((friction, assembly.solid_fraction()))
        return trials[-1][1]

    def found(friction: float) -> IsotropicState:
        return IsotropicState(
            assembly=states[friction],
            solid_fraction=dict(trials)[friction],
            compaction_friction=friction,
            trials=tuple(trials),
        )

    if solid_fraction is None:
        trial(sample.friction)
        return found(sample.friction)
    low, high = 0.0, friction_limit
    dense, loose = trial(low) - solid_fraction, trial(high) - solid_fraction
    for friction, off in ((low, dense), (high, loose)):
        if abs(off) <= tolerance:
            return found(friction)
    if not dense > 0.0 > loose:
        raise InputError(
            f"solid_fraction = {solid_fraction:.4g}: frictions of compaction from 0 to {friction_limit:g} give "
            f"{dense + solid_fraction:.4f} to {loose + solid_fraction:.4f} from sample.solid_fraction = {sample.solid_fraction:g}; "
            "a looser start widens this range"
        )
    while len(trials) < trial_limit:
        # density falls fast at first and hardly at high friction: a secant in the square root, kept off the ends
        share = np.clip(dense / (dense - loose), 0.1, 0.9)
        friction = float((np.sqrt(low) + share * (np.sqrt(high) - np.sqrt(low))) ** 2)
        off = trial(friction) - solid_fraction
        if abs(off) <= tolerance:
            return found(friction)
        if off > 0.0:
            low, dense = friction, off
        else:
            high, loose = friction, off
    nearest = min(trials, key=lambda t: abs(t[1] - solid_fraction))
    raise InputError(
        f"solid_fraction = {solid_fraction:.4g}: {trial_limit} trials came to {nearest[1]:.4f} at the nearest (friction {nearest[0]:.3g}); "
        "loosen tolerance: one sample scatters"
    )
