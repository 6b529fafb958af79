"""Means over seeds with Student intervals, and how many seeds would decide what these have not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mean", "combined_p", "few", "mean_of", "seeds_for_width", "seeds_to_exclude"]

MOST = 1000  # seeds: beyond that the question is not one of seeds


@dataclass(frozen=True)
class Mean:
    """Mean of the values of the seeds with its 95 % interval (nan for one seed)."""

    value: float
    low: float
    high: float
    deviation: float
    count: int

    @property
    def half(self) -> float:
        """Half width of the interval."""
        return 0.5 * (self.high - self.low)

    def excludes(self, level: float) -> bool:
        """Whether the interval is there and leaves the level out."""
        return bool(self.low > level or self.high < level)

    def text(self, form: str = ".3g") -> str:
        """Value and interval in words."""
        if np.isnan(self.low):
            return f"{self.value:{form}} (one seed)" if self.count == 1 else f"{self.value:{form}}"
        return f"{self.value:{form}} [{self.low:{form}}, {self.high:{form}}]"

    def numbers(self) -> dict[str, float]:
        """For the file of the claims."""
        return {
            "mean": self.value, "low": self.low, "high": self.high, "deviation": self.deviation, "seeds": float(self.count),
        }  # fmt: skip


def mean_of(values: Sequence[float] | NDArray[np.float64], *, level: float = 0.95) -> Mean:
    """Mean over seeds, those without a value left out."""
    from scipy.stats import t as student

    x = np.asarray(values, dtype=float)
    x = x[np.isfinite(x)]
    if not x.size:
        return Mean(np.nan, np.nan, np.nan, np.nan, 0)
    if x.size == 1:
        return Mean(float(x[0]), np.nan, np.nan, np.nan, 1)
    s = float(x.std(ddof=1))
    half = float(student.ppf(0.5 + 0.5 * level, x.size - 1)) * s / np.sqrt(x.size)
    return Mean(float(x.mean()), float(x.mean() - half), float(x.mean() + half), s, int(x.size))


def _seeds(deviation: float, reach: float) -> int:
    """Least number of seeds whose interval is narrower than `reach` on each side."""
    from scipy.stats import t as student

    for n in range(2, MOST + 1):
        if float(student.ppf(0.975, n - 1)) * deviation / np.sqrt(n) < reach:
            return n
    return MOST


def seeds_to_exclude(found: Mean, level: float) -> int:
    """About how many seeds would part this mean from the level, if mean and scatter stay as they are."""
    if found.count < 2:
        return 5
    return _seeds(found.deviation, abs(found.value - level))


def seeds_for_width(found: Mean, half: float) -> int:
    """About how many seeds give an interval of that half width."""
    return 5 if found.count < 2 else _seeds(found.deviation, half)


def few(found: Mean, level: float) -> str:
    """What would decide, in words."""
    n = seeds_to_exclude(found, level)
    return f"about {n} seeds" if n < MOST else f"more than {MOST} seeds: the difference is small against the scatter"


def combined_p(values: Sequence[float]) -> float:
    """Fisher's combination of independent p values."""
    from scipy.stats import combine_pvalues

    answer: Any = combine_pvalues(np.asarray(values, dtype=float))
    return float(answer.pvalue)


def monotone(values: Sequence[float], *, slack: float = 0.0) -> bool:
    """Whether the values rise, each by more than −slack."""
    return all(b - a >= -slack for a, b in pairwise(values))
