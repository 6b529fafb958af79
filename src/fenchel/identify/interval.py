"""Intervals for another sample.

A value x from n samples (seeds) is asked for one more sample: x ± t s √(1 + 1/n), t the two-sided Student quantile. Two
sources give s:

* "seeds": the standard deviation between the values of the samples, n − 1 degrees of freedom;
* "octants": the delete-one-group jackknife inside each sample, s_J² = (g−1)/g Σ(x_(i) − x̄)² over its g = 8 octants, g
  − 1 degrees of
  freedom each, root mean square over the samples. It is the floor of the spread, and the only source with one sample.

A replica whose fit failed is missing; the sum over the rest is scaled up to all g, else a failure would narrow the interval.
With fewer than half of them a sample says nothing.

A value that is the same in every sample and replica (at a bound, or no wires) has no interval: none is given, rather than one of no width.

The half-width is the larger of the two; `source` says which. Two seeds give t = 12.7: such an interval is wide, and rightly so.

Source: Quenouille–Tukey jackknife (Efron 1982, delete-a-group); prediction interval of a normal sample (any textbook).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Estimate", "estimate", "jackknife_deviation"]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value with the interval in which another sample is expected; `source` "seeds", "octants" or "none"."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    source: str
    seed_values: tuple[float, ...]
    seed_deviation: float  # between seeds; nan with one seed
    octant_deviation: float  # jackknife, root mean square over the seeds; nan without octants
    note: str = ""


def jackknife_deviation(leave_one_out: Sequence[float] | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """√((g−1)/g Σ(x_(i) − x̄)²) over the first axis, of g leave-one-out values; for a mean it equals s/√g exactly."""
    values = np.asarray(leave_one_out, dtype=float)
    count = values.shape[0]
    out = np.sqrt((count - 1) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    return float(out) if out.ndim == 0 else out


def estimate(
    name: str,
    unit: str,
    value: float,
    seed_values: Sequence[float],
    replicas: Sequence[Sequence[float]],
    *,
    confidence: float = 0.95,
    lower: float | None = 0.0,
    note: str = "",
) -> Estimate:
    """Interval of `value` from the values per seed and, per seed, the leave-one-octant-out values (may be empty).

    `lower` clips the interval at a physical bound (None: no bound).
    """
    from scipy.stats import t as student

    samples = np.asarray(seed_values, float)[np.isfinite(np.asarray(seed_values, float))]
    count = len(samples)
    factor = float(np.sqrt(1.0 + 1.0 / max(count, 1)))
    tail = 0.5 + 0.5 * confidence
    whole = [np.asarray(r, float) for r in replicas]
    groups = [(len(r), r[np.isfinite(r)]) for r in whole]
    groups = [(g, r) for g, r in groups if len(r) >= max(2, 0.5 * g)]
    # the jackknife, from those that are there
    squares = [(g - 1) ** 2 / g * float(np.var(r, ddof=1)) for g, r in groups]
    between = float(np.std(samples, ddof=1)) if count >= 2 else float("nan")
    within = float(np.sqrt(np.mean(squares))) if squares else float("nan")
    widths: dict[str, float] = {}
    if np.isfinite(between):
        widths["seeds"] = float(student.ppf(tail, count - 1)) * between * factor
    if np.isfinite(within):
        widths["octants"] = float(student.ppf(tail, sum(len(r) - 1 for _, r in groups))) * within * factor
    if np.isfinite(value) and max(widths.values(), default=0.0) > 1e-12 * abs(value):
        source = max(widths, key=lambda key: widths[key])
        low, high = value - widths[source], value + widths[source]
        if lower is not None:
            low = max(low, min(lower, value))
    else:
        source, low, high = "none", float("nan"), float("nan")
    return Estimate(
        name=name,
        unit=unit,
        value=float(value),
        low=float(low),
        high=float(high),
        source=source,
        seed_values=tuple(float(v) for v in seed_values),
        seed_deviation=between,
        octant_deviation=within,
        note=note,
    )
