"""Which formulation suits a law and a path, by the rule of `comparison`, with the figures that it was decided from."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FormulationFigures", "Verdict", "judge"]

SLOWER = 4.0


@dataclass(frozen=True)
class FormulationFigures:
    """What is known of a formulation on the path: unknowns per step, worst condition number of the matrix that they are solved from, its
    fastest solver that agrees, the process time per step [s], linear systems per step, difference of stress and duality gap of that solver;
    `failure` says why there is none."""

    formulation: str
    unknowns: int
    condition: float | None
    solver: str = ""
    time_per_step: float | None = None
    iterations: float | None = None
    difference: float | None = None
    gap: float | None = None
    failure: str = ""

    @property
    def text(self) -> str:
        """The figures in one line."""
        count = _count(self.unknowns)
        condition = "" if self.condition is None else f", condition {self.condition:.3g}"
        if self.failure:
            return f"{self.formulation}: {count}{condition}, {self.failure}"
        parts = [
            f"{self.formulation}: {count}{condition}, {(self.time_per_step or 0.0) * 1e6:.3g} µs per step ({self.solver})"
        ]
        if self.iterations is not None:
            parts.append(f"{self.iterations:.2g} linear systems per step")
        if self.gap is not None:
            parts.append(f"gap {self.gap:.0e}")
        return ", ".join(parts)


@dataclass(frozen=True)
class Verdict:
    """`best` formulation (None if none follows the path), the `reason`, and the figures of both."""

    best: str | None
    reason: str
    figures: tuple[FormulationFigures, ...]

    @property
    def headline(self) -> str:
        """The best formulation and the reason."""
        return f"{self.best} suits best, {self.reason}" if self.best else self.reason

    @property
    def text(self) -> str:
        """Verdict, reason and figures in one line."""
        return f"{self.headline} ({'; '.join(one.text for one in self.figures)})"


def _count(unknowns: int) -> str:
    return f"{unknowns} unknown{'' if unknowns == 1 else 's'}"


def judge(strain: FormulationFigures, stress: FormulationFigures) -> Verdict:
    """Apply the rule stated in `comparison`."""
    both = (strain, stress)
    able = [one for one in both if not one.failure]
    if not able:
        return Verdict(None, "no formulation follows this path", both)
    if len(able) == 1:
        other = stress if able[0] is strain else strain
        return Verdict(able[0].formulation, f"as the {other.formulation} formulation is no use here", both)
    fast, slow = sorted(both, key=lambda one: one.time_per_step or 0.0)
    ratio = (slow.time_per_step or 0.0) / max(fast.time_per_step or 0.0, 1e-12)
    if strain.unknowns != stress.unknowns:
        few, many = sorted(both, key=lambda one: one.unknowns)
        if few is slow and ratio > SLOWER:
            return Verdict(
                fast.formulation,
                f"{ratio:.2g} times as fast in spite of {_count(many.unknowns)} against {few.unknowns}",
                both,
            )
        return Verdict(few.formulation, f"with {_count(few.unknowns)} per step against {many.unknowns}", both)
    conditions = (strain.condition, stress.condition)
    if None not in conditions:
        good, bad = sorted(both, key=lambda one: one.condition or 0.0)
        if (good.condition or 0.0) < 0.1 * (bad.condition or 0.0):
            return Verdict(
                good.formulation, f"better conditioned, {good.condition:.3g} against {bad.condition:.3g}", both
            )
    return Verdict(fast.formulation, f"{ratio:.2g} times as fast with as many unknowns", both)
