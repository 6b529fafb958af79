"""Search for points that break convexity, a sign or a value: many starts, then climbing; every find is computed again with fifty digits.

A search can refute and never prove. Starts are Gaussian points over many decades, with whole variables, spherical, diagonal and full
tensors, and directions of negative curvature; the seed is fixed, so that the same law gives the same answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Add, Expr, expand

from ..scalars import ScalarVariable, Temperature
from .counterexample import CounterExample
from .exact import DIGITS, NotExact, exact_value

__all__ = ["Budget", "Space", "search_negative", "search_not_convex", "search_set"]

SEEN, SURE = 1e-7, 1e-8
"""Violations relative to the size of the terms: what a search takes for a find, and what must be left with fifty digits."""


@dataclass
class Budget:
    """How long to look: seconds, counted from when the budget is made, and starts of every kind."""

    seconds: float = 2.0
    starts: int = 400
    rounds: int = 40
    restarts: int = 8

    def __post_init__(self) -> None:
        self.end = time.monotonic() + self.seconds

    @property
    def over(self) -> bool:
        """True when the time is used up."""
        return time.monotonic() > self.end


class Space:
    """Variables side by side in one array, with data (parameters, temperature, frozen state) that is the same for all points."""

    def __init__(self, variables: Sequence[Any], data: dict[Any, Any], parameters: dict[Any, float]) -> None:
        self.variables = tuple(variables)
        self.sizes = [1 if isinstance(v, ScalarVariable) else (6 if v.rank == 2 else 3) for v in self.variables]
        self.dimension = sum(self.sizes)
        self.data, self.parameters = data, parameters
        self.opened: dict[Expr, Any] = {}

    def environment(self, points: Any) -> dict[Any, Any]:
        """Symbols and their arrays at points (n, dimension)."""
        found: dict[Any, Any] = {**self.data, **self.parameters}
        start = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            part = points[:, start : start + size]
            found[variable] = part[:, 0] if size == 1 else part
            start += size
        return found

    def values(self, expression: Expr, points: Any) -> tuple[Any, Any]:
        """(value, sum of the sizes of the terms) at points; NaN outside the domain."""
        import numpy as np

        from ..evaluate import evaluate

        environment = self.environment(points)
        if expression not in self.opened:
            # sizes are those of the terms multiplied out: a product that vanishes on a line is not small beside it
            self.opened[expression] = Add.make_args(expand(expression))
        size = np.zeros(len(points))
        with np.errstate(all="ignore"):
            total = np.array(np.broadcast_to(evaluate(expression, environment), len(points)))
            for term in self.opened[expression]:
                size = size + np.abs(evaluate(term, environment))
        bad = ~(np.isfinite(total) & np.isfinite(size))
        for column in self.positive:
            bad |= points[:, column] <= 0.0
        total[bad] = np.nan
        return total, size

    @property
    def positive(self) -> list[int]:
        """Columns of temperatures."""
        starts = [sum(self.sizes[:k]) for k in range(len(self.sizes))]
        return [s for s, v in zip(starts, self.variables, strict=True) if isinstance(v, Temperature)]

    def named(self, point: Any) -> dict[str, Any]:
        """One point by the names of the variables."""
        found, start = {}, 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            part = [float(x) for x in point[start : start + size]]
            found[str(variable)] = part[0] if size == 1 else part
            start += size
        return found

    def exact(self, expression: Expr, point: Any) -> Any:
        """Value at one point with fifty digits."""
        values: dict[Any, Any] = {**self.data, **self.parameters}
        start = 0
        for variable, size in zip(self.variables, self.sizes, strict=True):
            part = list(point[start : start + size])
            values[variable] = part[0] if size == 1 else part
            start += size
        return exact_value(expression, values)

    def starts(self, rng: Any, count: int) -> Any:
        """Points over many decades, with some variables zero and tensors of every kind."""
        import numpy as np

        points = rng.standard_normal((count, self.dimension))
        whole = rng.random(count) < 0.3
        points[whole] = rng.integers(-2, 3, (int(whole.sum()), self.dimension))
        start = 0
        for size in self.sizes:
            block = points[:, start : start + size]
            if size == 6:
                block[rng.random(count) < 0.6, 3:] = 0.0
                sphere = rng.random(count) < 0.2
                block[sphere, 1], block[sphere, 2] = block[sphere, 0], block[sphere, 0]
            if len(self.sizes) > 1:
                block[rng.random(count) < 0.35] = 0.0
            block *= 10.0 ** rng.normal(0.0, 0.7, (count, 1))
            start += size
        # of the order of one or of a parameter: far beyond, rounding of the deviator is all that is seen
        sizes = np.array([1.0, *{abs(float(v)) for v in self.parameters.values() if v != 0.0}])
        wide = np.where(rng.random(count) < 0.3, rng.uniform(-4, 4, count), rng.uniform(-1.5, 1.5, count))
        points *= (rng.choice(sizes, count) * 10.0**wide)[:, None]
        for column in self.positive:
            points[:, column] = 10.0 ** rng.uniform(-1, 3.3, count)
        return points

    def reflected(self, points: Any, rng: Any) -> Any:
        """Pairs of points and their images: every variable, and both parts of a tensor, as it is, turned, or stretched."""
        import numpy as np

        def factors() -> Any:
            sign = np.where(rng.random((len(points), 1)) < 0.5, -1.0, 1.0)
            stretch = 10.0 ** rng.normal(0.0, 0.5, (len(points), 1))
            return sign * np.where(rng.random((len(points), 1)) < 0.6, 1.0, stretch)

        found, start = points.copy(), 0
        for size in self.sizes:
            block = points[:, start : start + size]
            mean = np.zeros_like(block)
            if size == 6:
                mean[:, :3] = block[:, :3].mean(axis=1, keepdims=True)
            found[:, start : start + size] = factors() * (block - mean) + factors() * mean
            start += size
        return np.hstack([points, found])


def search_not_convex(
    space: Space, expression: Expr, name: str, goal: int, surfaces: Sequence[Expr], rng: Any, budget: Budget
) -> CounterExample | None:
    """Two points, in {f ≤ 0} of all `surfaces`, whose middle breaks convexity (goal = 1) or concavity (goal = −1)."""
    import numpy as np

    n = space.dimension

    def score(pairs: Any) -> Any:
        x, y = pairs[:, :n], pairs[:, n:]
        parts = [space.values(expression, p) for p in (x, y, 0.5 * (x + y))]
        size = sum(s for _, s in parts)
        with np.errstate(all="ignore"):
            found = goal * (parts[2][0] - 0.5 * (parts[0][0] + parts[1][0])) / size
            for p in (x, y):
                found = np.minimum(found, _inside(space, surfaces, p))
        return np.where(np.isfinite(found), found, -np.inf)

    def begin() -> Any:
        starts = space.starts(rng, budget.starts)
        others = space.starts(rng, budget.starts)
        step = starts * (1.0 + 0.3 * rng.standard_normal(starts.shape)) + 0.1 * others
        pairs = [np.hstack(p) for p in ((starts, others), (starts, step))]
        bent = _bent(space, expression, goal, starts[:24])
        return np.concatenate([*pairs, space.reflected(starts, rng), bent])

    def verified(pair: Any) -> CounterExample | None:
        points = (pair[:n], pair[n:], _middle(pair[:n], pair[n:]))
        try:
            values = [space.exact(expression, p) for p in points]
            if any(space.exact(f, p) > 0 for f in surfaces for p in points[:2]):
                return None
        except NotExact:
            return None
        violation = goal * (values[2] - (values[0] + values[1]) / 2)
        if violation <= SURE * sum(abs(v) for v in values):
            return None
        rule = f"{name} is not {'convex' if goal > 0 else 'concave'}"
        return _example(space, rule, name, points, values, violation)

    return _find(score, begin, verified, rng, budget)


def search_set(space: Space, surfaces: Sequence[Expr], name: str, rng: Any, budget: Budget) -> CounterExample | None:
    """Two points with f ≤ 0 for all surfaces whose middle lies outside: the set is not convex."""
    import numpy as np

    n = space.dimension

    def score(pairs: Any) -> Any:
        x, y = pairs[:, :n], pairs[:, n:]
        found, scale = np.full(len(pairs), np.inf), np.zeros(len(pairs))
        for k, p in enumerate((x, y, 0.5 * (x + y))):
            worst = np.full(len(pairs), -np.inf)
            for surface in surfaces:
                value, size = space.values(surface, p)
                worst, scale = np.maximum(worst, value), np.maximum(scale, size)
            found = np.minimum(found, worst if k == 2 else -worst)
        with np.errstate(all="ignore"):
            found = found / scale
        return np.where(np.isfinite(found), found, -np.inf)

    def begin() -> Any:
        inside = _points_inside(space, surfaces, rng, budget)
        if not len(inside):
            return inside.reshape(0, 2 * n)
        # pairs of like size: the middle of a large and a small point is the large one again
        inside = inside[np.argsort(np.abs(inside).max(axis=1))]
        count = 6 * budget.starts
        place = rng.integers(0, len(inside), count)
        near = place + np.rint(rng.normal(0.0, 0.05 * len(inside), count)).astype(int)
        first, second = inside[place], inside[np.clip(near, 0, len(inside) - 1)]
        return np.concatenate([np.hstack([first, second]), space.reflected(first, rng)])

    def verified(pair: Any) -> CounterExample | None:
        points = (pair[:n], pair[n:], _middle(pair[:n], pair[n:]))
        try:
            values = [max(space.exact(f, p) for f in surfaces) for p in points]
        except NotExact:
            return None
        if values[0] > 0 or values[1] > 0 or values[2] <= SURE * (abs(values[0]) + abs(values[1])):
            return None
        shown = "f" if len(surfaces) == 1 else "max f"
        return _example(space, f"{name} is not convex, its set {{f <= 0}} is not", shown, points, values, values[2])

    return _find(score, begin, verified, rng, budget)


def search_negative(
    space: Space, expression: Expr, name: str, surfaces: Sequence[Expr], rng: Any, budget: Budget
) -> CounterExample | None:
    """A point, in {f ≤ 0}, where the function is negative."""
    import numpy as np

    def score(points: Any) -> Any:
        value, size = space.values(expression, points)
        with np.errstate(all="ignore"):
            found = np.minimum(-value / size, _inside(space, surfaces, points))
        return np.where(np.isfinite(found), found, -np.inf)

    def verified(point: Any) -> CounterExample | None:
        try:
            value = space.exact(expression, point)
            if any(space.exact(f, point) > 0 for f in surfaces):
                return None
        except NotExact:
            return None
        size = float(space.values(expression, np.asarray(point)[None, :])[1][0])
        return (
            None if value >= -SURE * size else _example(space, f"{name} is negative", name, (point,), (value,), -value)
        )

    return _find(score, lambda: space.starts(rng, 3 * budget.starts), verified, rng, budget)


def _inside(space: Space, surfaces: Sequence[Expr], points: Any) -> Any:
    """−max f relative to the size of its terms: not negative inside."""
    import numpy as np

    found = np.full(len(points), np.inf)
    with np.errstate(all="ignore"):
        for surface in surfaces:
            value, size = space.values(surface, points)
            found = np.minimum(found, -value / np.where(size > 0.0, size, 1.0))
    return found


def _points_inside(space: Space, surfaces: Sequence[Expr], rng: Any, budget: Budget) -> Any:
    """Points of the set, among them points near its boundary, along rays from the origin."""
    import numpy as np

    rays = space.starts(rng, budget.starts)
    lengths = 10.0 ** np.linspace(-4, 4, 49)
    points = (lengths[None, :, None] * rays[:, None, :]).reshape(-1, space.dimension)
    inside = (_inside(space, surfaces, points) >= 0.0).reshape(len(rays), -1)
    found = [points[inside.ravel()]]
    crossing = inside[:, :-1] != inside[:, 1:]
    ray, place = np.nonzero(crossing)
    low, high, within = lengths[place], lengths[place + 1], inside[ray, place]
    for _ in range(30):
        middle = 0.5 * (low + high)
        hit = _inside(space, surfaces, middle[:, None] * rays[ray]) >= 0.0
        low, high = np.where(hit == within, middle, low), np.where(hit == within, high, middle)
    edge = np.where(within, low, high)
    edge = edge[:, None] * rays[ray]
    # near the boundary as often as anywhere
    everything = found[0]
    if len(everything) > 4 * max(len(edge), 1):
        everything = everything[rng.integers(0, len(everything), 4 * max(len(edge), 50))]
    return np.concatenate([everything, *([edge] * 4)])


def _bent(space: Space, expression: Expr, goal: int, bases: Any) -> Any:
    """Pairs along the most negative curvature at the given points, by finite differences."""
    import numpy as np

    n = space.dimension
    found = []
    for base in bases:
        step = 1e-3 * (np.abs(base) + 1e-2 * np.abs(base).max() + 1e-12)
        i, j = np.triu_indices(n)
        eye = np.eye(n)
        offsets = [(a * eye[i] + b * eye[j]) * step for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        values = [space.values(expression, base + o)[0] for o in offsets]
        curvature = goal * (values[0] - values[1] - values[2] + values[3]) / 4.0
        matrix = np.zeros((n, n))
        matrix[i, j] = matrix[j, i] = np.where(np.isfinite(curvature), curvature, 0.0)
        _, vectors = np.linalg.eigh(matrix)
        for direction in vectors[:, :2].T * step:
            for t in (1.0, 30.0, 1e3, 1e5):
                found.append(np.concatenate([base + t * direction, base - t * direction]))
    return np.array(found).reshape(-1, 2 * n)


def _find(
    score: Callable[[Any], Any], begin: Callable[[], Any], verified: Callable[[Any], Any], rng: Any, budget: Budget
) -> CounterExample | None:
    """A find that stands with fifty digits, from several beginnings; of the clear ones the plainest, with few digits."""
    for _ in range(budget.restarts):
        points, values = _ascent(score, begin(), rng, budget)
        for candidate in _plainest(points, values):
            found = _rounded(candidate, score, verified)
            if found is not None:
                return found
        if budget.over:
            break
    return None


def _plainest(points: Any, values: Any, count: int = 12) -> Any:
    """Of the clear finds those with few entries, of the order of one."""
    import numpy as np

    top = float(values.max(initial=-np.inf))
    if top <= SEEN:
        return []
    clear = points[values > 0.3 * min(top, 0.3)]
    size = np.abs(clear)
    least = np.where(size > 0.0, size, np.inf).min(axis=1)
    spread = np.abs(np.log10(size.max(axis=1) + 1e-300)) + np.abs(np.log10(np.minimum(least, 1e300)))
    return clear[np.argsort(spread + 0.1 * (size > 0.0).sum(axis=1))[:count]]


def _ascent(score: Callable[[Any], Any], starts: Any, rng: Any, budget: Budget) -> tuple[Any, Any]:
    import numpy as np

    points = np.concatenate([starts, np.round(starts, 1)])
    values = score(points)
    width = 0.5
    for _ in range(budget.rounds):
        order = np.argsort(-values)[:48]
        points, values = points[order], values[order]
        if not len(values) or values[0] > 1e-2 or budget.over:
            break
        parents = points[rng.integers(0, len(points), 240)]
        size = np.abs(parents).max(axis=1, keepdims=True)
        noise = rng.standard_normal(parents.shape) * (rng.random(parents.shape) < 0.4)
        children = parents + width * noise * np.where(rng.random((len(parents), 1)) < 0.5, size, np.abs(parents))
        points = np.concatenate([points, children])
        values = np.concatenate([values, score(children)])
        width = max(0.9 * width, 0.02)
    return points, values


def _rounded(best: Any, score: Callable[[Any], Any], verified: Callable[[Any], Any]) -> Any:
    """The find with as few digits as it stands, verified; None if it does not stand."""
    import numpy as np

    reached = float(score(best[None, :])[0])
    for digits in (1, 2, 3, 5, 8, 17):
        point = np.array([float(f"{x:.{digits - 1}e}") for x in best])
        without = np.where(np.abs(point) < 1e-9 * np.abs(point).max(), 0.0, point)
        for trial in (without, point):
            found = verified(trial) if float(score(trial[None, :])[0]) > max(0.2 * reached, SEEN) else None
            if found is not None:
                return found
    return None


def _middle(x: Any, y: Any) -> Any:
    """(x + y)/2 without rounding."""
    import mpmath

    with mpmath.workdps(DIGITS):
        return [(mpmath.mpf(float(a)) + mpmath.mpf(float(b))) / 2 for a, b in zip(x, y, strict=True)]


def _example(space: Space, rule: str, name: str, points: Any, values: Any, violation: Any) -> CounterExample:
    return CounterExample(
        rule,
        name,
        tuple(space.named(p) for p in points),
        tuple(float(v) for v in values),
        float(violation),
        {s.name: float(v) for s, v in space.parameters.items()},
        {str(s): v if isinstance(v, float) else [float(x) for x in v] for s, v in space.data.items()},
    )
