"""Values of declared expressions at one point with fifty digits (mpmath), so that no counter-example is an artefact of rounding.

Invariants that a user registered have the digits of their own `value`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Lambda, Pow

from ..atoms import atom_of
from ..atoms.atom import Invariant
from ..atoms.eig_max import EigMaxLeaf
from ..atoms.eig_min import EigMinLeaf
from ..atoms.eig_sum import EigSumLeaf
from ..atoms.inner import InnerLeaf
from ..atoms.maximum import Maximum
from ..atoms.norm import NormLeaf
from ..atoms.positive_part import PositivePart
from ..atoms.positive_square import PositiveSquareLeaf
from ..atoms.positive_trace import PositiveTraceLeaf
from ..atoms.trace import TraceLeaf
from ..ranked import Ranked
from ..tensor import Deviator, IdentityTensor

__all__ = ["DIGITS", "NotExact", "exact_value"]

DIGITS = 50


class NotExact(Exception):
    """The expression holds an atom without a value in many digits, or it is not defined at the point."""


def exact_value(expression: Any, values: Mapping[Any, Any]) -> Any:
    """Value as an mpmath number; `values` maps symbols to floats and lists of floats (Mandel), which count as exact."""
    import mpmath

    with mpmath.workdps(DIGITS):
        found = _Exact(values, mpmath).scalar(expression)
        if not mpmath.isfinite(found) or isinstance(found, mpmath.mpc):
            raise NotExact(f"{expression} is not finite and real")
        return found


class _Exact:
    def __init__(self, values: Mapping[Any, Any], mp: Any) -> None:
        self.values, self.mp = values, mp

    def ranked(self, thing: Any) -> list[Any]:
        mp = self.mp
        if thing in self.values:
            return [mp.mpf(x) for x in self.values[thing]]
        if isinstance(thing, IdentityTensor):
            return [mp.mpf(1)] * 3 + [mp.mpf(0)] * 3
        if isinstance(thing, Deviator):
            inside = self.ranked(thing.args[0])
            mean = sum(inside[:3]) / 3
            return [x - mean for x in inside[:3]] + inside[3:]
        terms = thing.terms()
        if thing in terms:
            raise NotExact(f"no value for {thing}")
        total = [mp.mpf(0)] * (6 if thing.rank == 2 else 3)
        for atom, coefficient in terms.items():
            c, part = self.scalar(coefficient), self.ranked(atom)
            total = [x + c * y for x, y in zip(total, part, strict=True)]
        return total

    def eigenvalues(self, thing: Any) -> list[Any]:
        mp = self.mp
        a = self.ranked(thing)
        half = mp.sqrt(mp.mpf(1) / 2)
        d, e, f = (half * x for x in a[3:])
        found = mp.eigsy(mp.matrix([[a[0], f, e], [f, a[1], d], [e, d, a[2]]]), eigvals_only=True)
        return sorted(found)

    def scalar(self, thing: Any) -> Any:
        mp = self.mp
        if thing in self.values:
            return mp.mpf(self.values[thing])
        if thing.is_number:
            return mp.mpf(thing.evalf(DIGITS)._mpf_) if thing.is_real else mp.nan
        if thing.is_Add:
            return mp.fsum(self.scalar(a) for a in thing.args)
        if thing.is_Mul:
            return mp.fprod(self.scalar(a) for a in thing.args)
        if isinstance(thing, Pow):
            return self._power(thing)
        rule = _RULES.get(type(thing))
        if rule is not None:
            return rule(self, *thing.args)
        if isinstance(thing, Invariant):
            return self._by_its_atom(thing)
        function = getattr(mp, thing.func.__name__, None)
        if function is None or any(isinstance(a, (Ranked, Lambda)) for a in thing.args):
            raise NotExact(f"no exact value of {thing.func.__name__}")
        return function(*(self.scalar(a) for a in thing.args))

    def _by_its_atom(self, leaf: Any) -> Any:
        """Sixteen digits of an atom of the user, which are enough beside what a violation has to be."""
        import numpy as np

        if any(isinstance(a, Lambda) for a in leaf.args):
            raise NotExact(f"no exact value of {leaf}")
        parts = [self.ranked(a) if isinstance(a, Ranked) else [self.scalar(a)] for a in leaf.args]
        arrays = tuple(np.array([[float(x) for x in part]]) for part in parts)
        value = float(np.squeeze(atom_of(leaf).value(leaf, arrays)))
        return self.mp.mpf(value)

    def _power(self, thing: Any) -> Any:
        base, exponent = self.scalar(thing.base), self.scalar(thing.exp)
        if (base < 0 and exponent != int(exponent)) or (base == 0 and exponent < 0):
            raise NotExact(f"{thing} is not defined")
        return base**exponent

    def positive(self, x: Any) -> Any:
        return max(x, self.mp.mpf(0))


class _WithDigits(_Exact):
    def __init__(self, values: Mapping[Any, Any], mp: Any, symbol: Any, value: Any) -> None:
        super().__init__(values, mp)
        self.symbol, self.value = symbol, value

    def scalar(self, thing: Any) -> Any:
        return self.value if thing == self.symbol else super().scalar(thing)


def _eig_sum(self: _Exact, function: Any, tensor: Any) -> Any:
    symbol = function.variables[0]
    return sum(_WithDigits(self.values, self.mp, symbol, e).scalar(function.expr) for e in self.eigenvalues(tensor))


_RULES: dict[Any, Any] = {
    TraceLeaf: lambda s, t: sum(s.ranked(t)[:3]),
    InnerLeaf: lambda s, a, b: sum(x * y for x, y in zip(s.ranked(a), s.ranked(b), strict=True)),
    NormLeaf: lambda s, t: s.mp.sqrt(sum(x * x for x in s.ranked(t))),
    EigMaxLeaf: lambda s, t: s.eigenvalues(t)[2],
    EigMinLeaf: lambda s, t: s.eigenvalues(t)[0],
    PositiveSquareLeaf: lambda s, t: sum(s.positive(e) ** 2 for e in s.eigenvalues(t)),
    PositiveTraceLeaf: lambda s, t: sum(s.positive(e) for e in s.eigenvalues(t)),
    EigSumLeaf: _eig_sum,
    PositivePart: lambda s, x: s.positive(s.scalar(x)),
    Maximum: lambda s, x, y: max(s.scalar(x), s.scalar(y)),
}
