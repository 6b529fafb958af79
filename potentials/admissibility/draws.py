"""Values of free parameters for a search: plain ones first, then random ones, all inside the declared bounds."""

from __future__ import annotations

import math
from typing import Any

from sympy import Expr

from ..law import Law
from ..scalars import Parameter
from .conditions import Need, as_conditions, holds

__all__ = ["parameter_draws"]

TRIES = 60


def parameter_draws(
    law: Law, given: dict[Any, float], wishes: list[Expr], rng: Any, count: int = 5, wide: int = 7
) -> list[dict[Any, float]]:
    """`count` plain sets of values and `wide` ones over four decades of either sign, the `given` ones kept, that break as few of the
    `wishes` (≥ 0) as can be; one set if nothing is free.

    A search that finds a counter-example only at values that are wrong for another reason would say nothing about the law.
    """
    free = [p for p in law.parameters if p not in given]
    if not free:
        return [dict(given)]
    wanted = as_conditions([Need(w) for w in dict.fromkeys(wishes)], "")
    plain = [{**given, **{p: _plain(p) for p in free}}]
    plain += [{**given, **{p: _random(p, rng) for p in free}} for _ in range(TRIES)]
    far = [{**given, **{p: _far(p, rng) for p in free}} for _ in range(TRIES)]
    return _best(plain, wanted, count) + _best(far, wanted, wide)


def _best(found: list[dict[Any, float]], wanted: list[Any], count: int) -> list[dict[Any, float]]:
    broken = [sum(holds(c, draw) is False for c in wanted) for draw in found]
    order = sorted(range(len(found)), key=lambda k: (broken[k], k))
    return [found[k] for k in order[:count]]


def _plain(p: Parameter) -> float:
    """The default, or 1, or the middle, or the bound that there is and 1."""
    if p.default is not None:
        return p.default
    if p.lower < 1.0 < p.upper and not (math.isfinite(p.lower) and math.isfinite(p.upper)):
        return 1.0
    return _between(p, 0.5)


def _between(p: Parameter, share: float) -> float:
    if math.isfinite(p.lower) and math.isfinite(p.upper):
        return p.lower + share * (p.upper - p.lower)
    if math.isfinite(p.lower):
        return p.lower + share / (1.0 - share)
    return p.upper - share / (1.0 - share)


def _random(p: Parameter, rng: Any) -> float:
    if math.isfinite(p.lower) or math.isfinite(p.upper):
        value = _between(p, float(rng.uniform(0.05, 0.95)))
    else:
        # most free parameters are moduli; a third are drawn of either sign
        value = float(10.0 ** rng.normal(0.0, 0.5)) * (-1.0 if rng.random() < 0.17 else 1.0)
    short = float(f"{value:.2e}")
    return short if p.lower <= short <= p.upper else value


def _far(p: Parameter, rng: Any) -> float:
    value = float(10.0 ** rng.uniform(-2.0, 2.0)) * (-1.0 if rng.random() < 0.5 else 1.0)
    short = float(f"{value:.2e}")
    return short if p.lower <= short <= p.upper else _random(p, rng)
