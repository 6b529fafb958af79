"""Where a constant lies while its parameters run through their bounds: interval arithmetic, rounded outward.

An expression that divides by an interval that touches zero is unbounded there; the answer holds wherever the expression is finite.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from sympy import Expr, Integer, Lambda, Pow, Rational, factor, together

from ..atoms import ATOMS
from ..scalars import Parameter, Temperature

__all__ = ["EVERYWHERE", "Interval", "interval", "natural_range", "sharp_interval"]

Interval = tuple[float, float]
Ranges = Callable[[Any], Interval]
EVERYWHERE: Interval = (-math.inf, math.inf)
_BOXES = 64


def natural_range(symbol: Any) -> Interval:
    """Bounds of a parameter, (0, ∞) for a temperature, everything for the rest."""
    if isinstance(symbol, Parameter):
        return (symbol.lower, symbol.upper)
    return (0.0, math.inf) if isinstance(symbol, Temperature) or symbol.is_positive else EVERYWHERE


def interval(expression: Any, ranges: Ranges = natural_range) -> Interval:
    """Enclosure of the values of a scalar expression."""
    if expression.is_number:
        return _number(expression)
    if expression.is_Symbol:
        return ranges(expression)
    if expression.is_Add:
        low = high = 0.0
        for part in expression.args:
            a, b = interval(part, ranges)
            low, high = _sum(low, a, -1), _sum(high, b, 1)
        return low, high
    if expression.is_Mul:
        found: Interval = (1.0, 1.0)
        for part in expression.args:
            found = _product(found, interval(part, ranges))
        return found
    if isinstance(expression, Pow):
        return _power(interval(expression.base, ranges), expression.exp, ranges)
    rule = _FUNCTIONS.get(expression.func.__name__)
    if rule is not None and len(expression.args) == 1:
        return rule(interval(expression.args[0], ranges))
    if expression.func.__name__ == "Maximum":
        (a, b), (c, d) = (interval(x, ranges) for x in expression.args)
        least = 0.0 if expression.args[0] == -expression.args[1] else -math.inf
        return max(a, c, least), max(b, d)
    return _atom(expression, ranges)


def sharp_interval(expression: Expr, ranges: Ranges = natural_range) -> Interval:
    """The best of the enclosures of the expression as it stands and factored, then over a partition of the bounded parameters."""
    found = interval(expression, ranges)
    if found[0] >= 0.0 or found[1] <= 0.0:
        return found
    tidy: Any = factor(together(expression))
    found = _meet(found, interval(tidy, ranges))
    if found[0] >= 0.0 or found[1] <= 0.0:
        return found
    bounded = [s for s in sorted(tidy.free_symbols, key=str) if all(map(math.isfinite, ranges(s)))]
    if not bounded or len(bounded) > 3:
        return found
    cells = int(_BOXES ** (1.0 / len(bounded)))
    return _meet(found, _partition(tidy, ranges, bounded, cells))


def _partition(expression: Any, ranges: Ranges, symbols: list[Any], cells: int) -> Interval:
    import itertools

    low, high = math.inf, -math.inf
    for places in itertools.product(range(cells), repeat=len(symbols)):
        box = {}
        for symbol, k in zip(symbols, places, strict=True):
            a, b = ranges(symbol)
            box[symbol] = (a + (b - a) * k / cells, b if k == cells - 1 else a + (b - a) * (k + 1) / cells)
        one = interval(expression, lambda s, box=box: box.get(s) or ranges(s))
        low, high = min(low, one[0]), max(high, one[1])
        if low < 0.0 < high:
            break
    return low, high


def _meet(a: Interval, b: Interval) -> Interval:
    return max(a[0], b[0]), min(a[1], b[1])


def _down(x: float) -> float:
    return x if x == 0.0 or math.isinf(x) else math.nextafter(x, -math.inf)


def _up(x: float) -> float:
    return x if x == 0.0 or math.isinf(x) else math.nextafter(x, math.inf)


def _number(value: Any) -> Interval:
    if not (value.is_finite and value.is_real):
        return EVERYWHERE
    number = float(value)
    exact = isinstance(value, Integer) or (isinstance(value, Rational) and value.q & (value.q - 1) == 0)
    return (number, number) if exact else (_down(number), _up(number))


def _product(a: Interval, b: Interval) -> Interval:
    corners = [(0.0 if x == 0.0 or y == 0.0 else x * y, _is_binary(x) or _is_binary(y)) for x in a for y in b]
    (low, first), (high, last) = min(corners), max(corners)
    return low if first else _down(low), high if last else _up(high)


def _sum(x: float, y: float, direction: int) -> float:
    """x + y rounded outward, exact where floating point is (Knuth's two-sum)."""
    total = x + y
    if math.isinf(total):
        return total
    part = total - x
    error = (x - (total - part)) + (y - part)
    if error == 0.0 or (error > 0.0) != (direction > 0):
        return total
    return math.nextafter(total, direction * math.inf)


def _is_binary(x: float) -> bool:
    """True for 0 and ±2ᵏ, whose products are exact."""
    return x == 0.0 or abs(math.frexp(x)[0]) == 0.5


def _inverse(a: Interval) -> Interval:
    low, high = a
    if low < 0.0 < high:
        return EVERYWHERE
    if low == 0.0 and high == 0.0:
        return EVERYWHERE
    if low >= 0.0:
        return (0.0 if math.isinf(high) else _down(1.0 / high)), (math.inf if low == 0.0 else _up(1.0 / low))
    return (-math.inf if high == 0.0 else _down(1.0 / high)), (0.0 if math.isinf(low) else _up(1.0 / low))


def _raise(x: float, n: float) -> float:
    try:
        return x**n
    except OverflowError:
        return math.inf if x > 0 or n % 2 == 0 else -math.inf


def _power(base: Interval, exponent: Any, ranges: Ranges) -> Interval:
    if exponent.is_Integer:
        n = int(exponent)
        if n < 0:
            return _inverse(_power(base, -exponent, ranges))
        low, high = _raise(base[0], n), _raise(base[1], n)
        if n % 2 == 0:
            top = max(low, high)
            return (0.0 if base[0] <= 0.0 <= base[1] else _down(min(low, high))), _up(top)
        return _down(low), _up(high)
    # defined on a non-negative base only
    low, high = max(base[0], 0.0), max(base[1], 0.0)
    a, b = interval(exponent, ranges)
    if math.isinf(high) or math.isinf(a) or math.isinf(b) or (low == 0.0 and a <= 0.0):
        return (_down(low**a) if a > 0.0 and math.isinf(b) and low > 1.0 else 0.0), math.inf
    corners = [_raise(x, n) for x in (low, high) for n in (a, b)]
    return max(0.0, _down(min(corners))), _up(max(corners))


def _atom(expression: Any, ranges: Ranges) -> Interval:
    record = ATOMS.get(type(expression))
    if record is None:
        return EVERYWHERE
    signs = tuple(0 if _is_ranked(a) else _sign(interval(a, ranges)) for a in expression.args)
    sign = record.sign(expression, signs)
    return (0.0, math.inf) if sign > 0 else ((-math.inf, 0.0) if sign < 0 else EVERYWHERE)


def _is_ranked(argument: Any) -> bool:
    return not isinstance(argument, Expr) or isinstance(argument, Lambda)


def _sign(found: Interval) -> int:
    return 1 if found[0] >= 0.0 else (-1 if found[1] <= 0.0 else 0)


def _increasing(function: Callable[[float], float], least: float = -math.inf) -> Callable[[Interval], Interval]:
    def rule(a: Interval) -> Interval:
        ends = []
        for x in a:
            try:
                ends.append(function(x))
            except (OverflowError, ValueError):
                ends.append(math.inf if x > 0 else -math.inf)
        return max(_down(ends[0]), least), _up(ends[1])

    return rule


def _tangent(a: Interval) -> Interval:
    half = math.pi / 2
    return (_down(math.tan(a[0])), _up(math.tan(a[1]))) if -half < a[0] and a[1] < half else EVERYWHERE


def _sine(a: Interval) -> Interval:
    half = math.pi / 2
    if -half <= a[0] and a[1] <= half:
        return _down(math.sin(a[0])), _up(math.sin(a[1]))
    if a[0] >= 0.0 and a[1] <= math.pi:
        return 0.0, 1.0
    return -1.0, 1.0


def _cosine(a: Interval) -> Interval:
    if a[0] >= 0.0 and a[1] <= math.pi:
        return _down(math.cos(a[1])), _up(math.cos(a[0]))
    if -math.pi / 2 <= a[0] and a[1] <= math.pi / 2:
        return 0.0, 1.0
    return -1.0, 1.0


def _logarithm(a: Interval) -> Interval:
    low = -math.inf if a[0] <= 0.0 else _down(math.log(a[0]))
    high = -math.inf if a[1] <= 0.0 else (math.inf if math.isinf(a[1]) else _up(math.log(a[1])))
    return low, high


_FUNCTIONS: dict[str, Callable[[Interval], Interval]] = {
    "Abs": lambda a: (max(a[0], -a[1], 0.0), max(-a[0], a[1])),
    "exp": _increasing(math.exp, 0.0),
    "atan": _increasing(math.atan),
    "tan": _tangent,
    "sin": _sine,
    "cos": _cosine,
    "log": _logarithm,
    "PositivePart": lambda a: (max(a[0], 0.0), max(a[1], 0.0)),
    "Step": lambda a: (1.0 if a[0] > 0.0 else 0.0, 0.0 if a[1] <= 0.0 else 1.0),
}
