r"""Size distributions of grains, by number and by mass, and how radii are drawn from them.

A distribution is given by its quantiles by number: r(u), u in (0, 1). The mass finer than a radius follows from r³ dN. Radii are drawn in
strata, one from each n-th part of the numbers, in random order: the mass in the few largest grains then scatters as little as a sample of
n grains allows.

| class | density |
|---|---|
| `UniformByNumber` | dN/dr constant |
| `UniformByVolume` | r³ dN/dr constant: every radius holds the same volume |
| `LogNormal` | ln r normal, cut at ± `cut` standard deviations |
| `Sieve` | a sieve curve, mass against ln d constant within each class |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError

__all__ = ["LogNormal", "Sieve", "Sizes", "UniformByNumber", "UniformByVolume", "draw_radii"]

Array = NDArray[np.float64]


class Sizes(Protocol):
    """A size distribution."""

    def quantile(self, share: Array) -> Array:
        """Radius [m] below which a share (n,) of the grains lies, by number."""
        ...

    def finer(self, radius: Array) -> Array:
        """Share of the mass in grains of at most these radii [m]."""
        ...


def draw_radii(sizes: Sizes, rng: np.random.Generator, count: int) -> Array:
    """`count` radii [m] in random order, one from each stratum of 1/count of the numbers."""
    if count < 1:
        raise InputError(f"count = {count}: a sample has at least one grain")
    return sizes.quantile((rng.permutation(count) + rng.random(count)) / count)


def _check_span(small: float, large: float) -> None:
    if not 0.0 < small <= large < np.inf:
        raise InputError(f"sizes: radii from {small:g} to {large:g} m: needs 0 < smallest ≤ largest")


def _between(values: ArrayLike) -> Array:
    return np.clip(np.asarray(values, dtype=float), 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class UniformByNumber:
    """Radii uniform between `small` and `large` [m]."""

    small: float
    large: float

    def __post_init__(self) -> None:
        _check_span(self.small, self.large)

    def quantile(self, share: Array) -> Array:
        """r = a + u (b − a)."""
        return self.small + np.asarray(share) * (self.large - self.small)

    def finer(self, radius: Array) -> Array:
        """(r⁴ − a⁴)/(b⁴ − a⁴)."""
        if self.large == self.small:
            return np.where(np.asarray(radius) >= self.small, 1.0, 0.0)
        return _between((np.asarray(radius) ** 4 - self.small**4) / (self.large**4 - self.small**4))


@dataclass(frozen=True, kw_only=True)
class UniformByVolume:
    """Volume uniform over the radii between `small` and `large` [m]: dN ∝ r⁻³ dr."""

    small: float
    large: float

    def __post_init__(self) -> None:
        _check_span(self.small, self.large)

    def quantile(self, share: Array) -> Array:
        """r⁻² = a⁻² − u (a⁻² − b⁻²)."""
        a, b = self.small**-2.0, self.large**-2.0
        return (a - np.asarray(share) * (a - b)) ** -0.5

    def finer(self, radius: Array) -> Array:
        """(r − a)/(b − a)."""
        if self.large == self.small:
            return np.where(np.asarray(radius) >= self.small, 1.0, 0.0)
        return _between((np.asarray(radius) - self.small) / (self.large - self.small))


@dataclass(frozen=True, kw_only=True)
class LogNormal:
    """ln r normal about ln `median` [m] with standard deviation `spread` [-], by number, cut at ± `cut` of them."""

    median: float
    spread: float
    cut: float = 2.5

    def __post_init__(self) -> None:
        if not (self.median > 0.0 and self.spread > 0.0 and self.cut > 0.0 and np.isfinite(self.cut)):
            raise InputError("sizes: a log-normal distribution has a positive median, spread and cut")

    def quantile(self, share: Array) -> Array:
        """median · exp(spread Φ⁻¹(Φ(−cut) + u (Φ(cut) − Φ(−cut))))."""
        from scipy.special import ndtr, ndtri

        low, high = ndtr(-self.cut), ndtr(self.cut)
        return self.median * np.exp(self.spread * ndtri(low + np.asarray(share) * (high - low)))

    def finer(self, radius: Array) -> Array:
        """By mass the distribution is log-normal about median · exp(3 spread²)."""
        from scipy.special import ndtr

        s = np.log(np.asarray(radius) / self.median) / self.spread - 3.0 * self.spread
        low, high = -self.cut - 3.0 * self.spread, self.cut - 3.0 * self.spread
        return _between((ndtr(s) - ndtr(low)) / (ndtr(high) - ndtr(low)))


@dataclass(frozen=True, kw_only=True)
class Sieve:
    """A sieve curve: `opening` are diameters [m], ascending, `passing` the shares of the mass that pass them, from 0 to 1."""

    opening: tuple[float, ...]
    passing: tuple[float, ...]

    def __post_init__(self) -> None:
        d, p = np.asarray(self.opening, dtype=float), np.asarray(self.passing, dtype=float)
        if len(d) != len(p) or len(d) < 2:
            raise InputError("sizes: a sieve curve has as many openings as shares, two or more")
        if not (d[0] > 0.0 and np.all(np.diff(d) > 0.0) and np.all(np.isfinite(d))):
            raise InputError("sizes: the openings of a sieve curve are positive and ascend")
        if p[0] != 0.0 or p[-1] != 1.0 or np.any(np.diff(p) < 0.0):
            raise InputError("sizes: the shares passing ascend from 0 (nothing is finer) to 1 (all pass); no per cent")

    def _numbers(self) -> tuple[Array, Array]:
        """Grains up to every opening, as a share, and d⁻³ of the openings."""
        d = np.asarray(self.opening)
        cubes = d**-3.0
        numbers = np.diff(self.passing) * -np.diff(cubes) / np.diff(np.log(d))
        return np.concatenate([[0.0], np.cumsum(numbers) / numbers.sum()]), cubes

    def quantile(self, share: Array) -> Array:
        """Within a class dN ∝ d⁻³ d(ln d), so d⁻³ falls linearly with the number."""
        below, cubes = self._numbers()
        share = np.asarray(share, dtype=float)
        k = np.clip(np.searchsorted(below, share, side="right") - 1, 0, len(below) - 2)
        part = (share - below[k]) / (below[k + 1] - below[k])
        return 0.5 * (cubes[k] + part * (cubes[k + 1] - cubes[k])) ** (-1.0 / 3.0)

    def finer(self, radius: Array) -> Array:
        """The curve itself, linear in ln d within a class."""
        return np.interp(np.log(2.0 * np.asarray(radius)), np.log(self.opening), self.passing)
