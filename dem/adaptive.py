r"""A step that adapts: shorter where a step does not converge or a body would fly too far in it, longer again after easy steps.

Where the length changes, the mid configuration moves along, q_m = q + h(1−θ)v, so that q stays where it is; the impulses that the next
step starts from are forces times the new length.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import ConvergenceError, InputError
from .stepping import Drive, Simulation

__all__ = ["AdaptiveStep"]


@dataclass(kw_only=True)
class AdaptiveStep:
    """Advances a simulation with a step between `least` and `most` [s].

    A step is halved when it does not converge or when the fastest body would travel more than `travel` mean radii, and grows by a fifth
    after a step that took less than a quarter of the sweep limit. Raises `ConvergenceError` when a step of length `least` fails, and
    `InputError` for lengths that are not 0 < least ≤ most.
    """

    simulation: Simulation
    most: float
    least: float
    travel: float = 0.2
    step: float = 0.0  # the next one [s]; 0: start with `most`
    cuts: int = 0  # halvings so far

    def __post_init__(self) -> None:
        if not 0.0 < self.least <= self.most:
            raise InputError(
                f"adaptive step: least = {self.least}, most = {self.most}: needs 0 < least ≤ most, in seconds"
            )
        if not self.travel > 0.0:
            raise InputError(f"adaptive step: travel = {self.travel}: must be positive, in mean radii")
        self.step = self.step or self.most

    def advance(self, drive: Drive, *, until: float | None = None) -> dict[str, float]:
        """One step, never past the time `until` [s]; returns its measures."""
        s = self.simulation
        wanted = self.step
        reach = self.travel * s.assembly.grain_radius
        speed = s.fastest(drive, wanted)
        while wanted > self.least and wanted * speed > reach:
            wanted = max(self.least, 0.5 * wanted)
            self.cuts += 1
        while True:
            h = wanted if until is None else min(wanted, max(until - s.assembly.time, 1e-3 * self.least))
            s.change_step(h)
            try:
                measures = s.advance(h, drive)
                break
            except ConvergenceError:
                if wanted <= self.least:
                    raise
                wanted = max(self.least, 0.5 * wanted)
                self.cuts += 1
        easy = s.sweeps < 0.25 * s.solver.sweep_limit
        self.step = min(self.most, 1.2 * wanted) if easy else wanted
        return measures
