"""The misfit of a law to laboratory tests as a function of its free parameters.

Minimise over the tests i and their two channels c (q, and volume strain or pore pressure), n_i rows each,

    J = Σ_i Σ_c w_c/n_i Σ_k [(law − data)/max|data|]²,      w_q = 1,  w of the other channel `weight`,

within the bounds that the parameters declare, the unknowns counted from their lower bounds in units of their start. The derivatives are
differences: the strain of the start depends on the parameters, which exact derivatives along a path exclude, and a test takes milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, FenchelError
from .bounded_fit import bounded_least_squares, difference_columns
from .laboratory_file import LaboratoryTest
from .laboratory_replay import replay_laboratory

__all__ = ["LaboratoryProblem", "relative_scales"]

Array = NDArray[np.float64]
FLOOR = 0.01  # the volume strain is scaled by at least this part of the axial strain, the pore pressure of the confining pressure
MARGIN = 1e-3  # of a finite upper bound, such as that of the Poisson ratio, which is not admissible itself
FAILED = 10.0  # relative misfit that stands for a path the law cannot follow


class LaboratoryProblem:
    """Weighted residuals of some tests as a function of the free parameters, scaled to order one from their lower bounds."""

    def __init__(
        self,
        update: Any,
        tests: Sequence[LaboratoryTest],
        values: Mapping[str, float],
        free: Sequence[str],
        weight: float,
    ) -> None:
        self.update, self.tests, self.values, self.free, self.weight = update, tests, dict(values), tuple(free), weight
        largest = max(float(np.max(np.abs(test.q))) for test in tests)
        symbols = {symbol.name: symbol for symbol in update.law.parameters}
        lower, scale, upper = [], [], []
        for name in self.free:
            symbol, value = symbols[name], self.values[name]
            typical = largest if symbol.unit == "Pa" else max(abs(value), 0.1)
            low = symbol.lower if isfinite(symbol.lower) else value - 1e3 * typical
            size = value - low if isfinite(symbol.lower) and value - low > 0.01 * typical else typical
            high = symbol.upper - MARGIN * abs(symbol.upper) if isfinite(symbol.upper) else inf
            lower.append(low)
            scale.append(size)
            upper.append((high - low) / size)
        self.lower, self.scale, self.upper = np.array(lower), np.array(scale), np.array(upper)
        self.channels = [piece for test in tests for piece in relative_scales(test, weight)]

    def start(self) -> Array:
        return np.clip((np.array([self.values[n] for n in self.free]) - self.lower) / self.scale, 0.0, self.upper)

    def at(self, y: Array) -> dict[str, float]:
        """All parameter values at the scaled unknowns y."""
        return self.values | {n: float(v) for n, v in zip(self.free, self.lower + self.scale * y, strict=True)}

    def exact(self, y: Array) -> Array:
        """Residuals; raises where the law cannot follow."""
        out = []
        for k, test in enumerate(self.tests):
            run = replay_laboratory(self.update, self.at(y), test)
            out.append((run.q - test.q) * self.channels[2 * k])
            out.append((run.second - test.second) * self.channels[2 * k + 1])
        found = np.concatenate(out)
        if not np.isfinite(found).all():
            raise ConvergenceError(f"law '{self.update.law.name}' gives a value that is not finite along a test")
        return found

    def residual(self, y: Array) -> Array:
        """The same; a path that fails counts as a large misfit, so that the step to it is refused."""
        try:
            return self.exact(y)
        except FenchelError:
            return np.concatenate([np.full(len(t.q), FAILED * len(t.q) ** -0.5) for t in self.tests for _ in range(2)])

    def pieces(self) -> list[slice]:
        """Rows of the channels, two per test, in the stacked residual."""
        ends = np.cumsum([0, *(len(t.q) for t in self.tests for _ in range(2))])
        return [slice(a, b) for a, b in pairwise(ends)]

    def solve(self) -> Array:
        if not self.free:
            return np.zeros(0)
        names = ", ".join(self.free)
        return bounded_least_squares(self.residual, self.start(), self.upper, what=names)

    def columns(self, y: Array) -> Array:
        if not self.free:
            return np.zeros((sum(2 * len(t.q) for t in self.tests), 0))
        return difference_columns(self.residual, y, self.residual(y), self.upper)

    def inner(self, y: Array) -> NDArray[np.bool_]:
        """Which unknowns are not on a bound."""
        return (y > 1e-9) & (y < self.upper - 1e-9)

    def pushed(self, y: Array, columns: Array) -> NDArray[np.bool_]:
        """Which unknowns sit on a bound because the data push them there, not by chance."""
        gradient = columns.T @ self.residual(y)
        return ((y <= 1e-9) & (gradient > 0.0)) | ((y >= self.upper - 1e-9) & (gradient < 0.0))


def relative_scales(test: LaboratoryTest, weight: float) -> tuple[float, float]:
    """Factors that turn residuals of q and of the second channel into relative ones with equal weight for every test."""
    least = FLOOR * (float(np.max(np.abs(test.axial_strain))) if test.drained else test.pressure)
    second = max(float(np.max(np.abs(test.second))), least)
    root = len(test.q) ** -0.5
    return root / float(np.max(np.abs(test.q))), weight**0.5 * root / second
