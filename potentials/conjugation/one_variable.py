"""Conjugates of convex functions of one scalar.

    (c h)(s)          ↦  c h*(y/c)                     h(a s + b)   ↦  h*(y/a) − b y/a
    h(s) + m s + k    ↦  h*(y − m) − k                 s log s      ↦  exp(y − 1)
    U(⟨s⟩) + V(⟨−s⟩)  ↦  U⁺(⟨y⟩) + V⁺(⟨−y⟩)            U⁺(y) = sup over r ≥ 0 of y r − U(r)

Atoms bring their own conjugates; the half-line rule covers every sum of |s|ⁿ, ⟨s⟩ⁿ, ⟨−s⟩ⁿ and s² with one power and one linear term
per side.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sympy import Add, Dummy, Expr, Mul, Pow, S, Symbol, exp, log, powsimp, simplify

from ..atoms import ATOMS
from ..atoms.maximum import Maximum
from ..atoms.positive_part import PositivePart
from ..scalars import Parameter
from .quadratic import tidy_scalar

__all__ = ["ScalarConjugate", "conjugate_of_one_variable", "positive_view"]


@dataclass
class ScalarConjugate:
    """Value at y, domain as expressions ≤ 0, expressions in parameters that have to be positive, and the name of the rule."""

    value: Expr
    domain: tuple[Expr, ...] = ()
    conditions: list[Expr] = field(default_factory=list)
    rule: str = ""


def conjugate_of_one_variable(h: Expr, s: Symbol, y: Expr, *, increasing: bool = False) -> ScalarConjugate | None:
    """h*(y) for convex h of the symbol s, or None; with `increasing`, h counts on s ≥ 0 only and is continued by h(0) to the left, which
    is what the outer function of a composition with a non-negative function needs."""
    slope, constant, rest = S.Zero, S.Zero, []
    for term in Add.make_args(h.expand(deep=False)):
        if not term.has(s):
            constant = constant + term
        elif not (c := term / s).has(s):
            slope = slope + c
        else:
            rest.append(term)
    if increasing:
        return _of_increasing(slope, rest, s, y, constant)
    inside = y - slope
    if not rest:
        return None  # affine: an equality, which is handled where the coordinates are known
    found = _of_halves(rest, s, inside) or _of_entropy(rest, s, inside)
    if found is None and len(rest) == 1:
        found = _of_single(rest[0], s, inside)
    if found is not None:
        found.value = found.value - constant
    return found


def _of_increasing(slope: Expr, rest: list[Expr], s: Symbol, y: Expr, constant: Expr) -> ScalarConjugate | None:
    if len(rest) == 1:
        single = _of_single(rest[0], s, y - slope)
        base = single is not None and _power_of(rest[0], s)
        if single is not None and not base:
            # an increasing function of its own, exp: its conjugate counts as it stands
            single.value = single.value - constant
            return single
    side = _Side()
    if slope != 0:
        side.linear = side.linear + slope
    for term in rest:
        split = _power_of(term, s)
        if split is None:
            return None
        c, n, _, a, b = split
        if b != 0:
            return None
        side.powers[n] = side.powers.get(n, S.Zero) + powsimp(c * a**n)
    found = side.conjugate(y)
    if found is not None:
        found.value = found.value - constant
    return found


def positive_view(expression: Expr) -> dict[Any, Any]:
    """Positive stand-ins for the parameters that are bounded by zero from below."""
    return {
        p: Dummy(p.name, positive=True) for p in expression.free_symbols if isinstance(p, Parameter) and p.lower >= 0
    }


def _plain(inequality: Expr) -> Expr:
    """c f ≤ 0 with c > 0 as f ≤ 0."""
    table = positive_view(inequality)
    return Mul(*(f for f in Mul.make_args(inequality) if not f.xreplace(table).is_positive))


def _affine(expression: Expr, s: Symbol) -> tuple[Expr, Expr] | None:
    """(a, b) of a s + b."""
    a = expression.diff(s) if not expression.has(PositivePart, Maximum) else None
    if a is None or a.has(s) or a == 0:
        return None
    return a, expression.xreplace({s: S.Zero})


def _of_single(term: Expr, s: Symbol, y: Expr) -> ScalarConjugate | None:
    """c · atom(a s + b) through the record of the atom."""
    factors = Mul.make_args(term)
    moving = [f for f in factors if f.has(s)]
    if len(moving) != 1 or type(moving[0]) not in ATOMS:
        return None
    node = moving[0]
    c = Mul(*(f for f in factors if f is not node))
    if isinstance(node, Pow) and node.exp.has(s):
        return None
    inside = node.args[0]
    affine = _affine(inside, s)  # type: ignore[arg-type]
    if affine is None:
        return None
    a, b = affine
    record = ATOMS[type(node)]
    negative = record.curvature(node, lambda _: None) == "concave"
    weight = -c if negative else c
    if weight.is_negative:
        return None
    found = record.conjugate(node, y / (a * weight))
    if found is None:
        return None
    value, domain = found
    return ScalarConjugate(
        weight * value - y * b / a,
        tuple(_plain(f) for f in domain),
        [weight],
        f"conjugate of {record.word}, scaling, translation",
    )


def _of_entropy(terms: list[Expr], s: Symbol, y: Expr) -> ScalarConjugate | None:
    """c s log(k s) ↦ c exp(y/c − 1)/k."""
    if len(terms) != 1:
        return None
    factors = list(Mul.make_args(terms[0]))
    logs = [f for f in factors if isinstance(f, log) and f.has(s)]
    if len(logs) != 1 or s not in factors:
        return None
    k = logs[0].args[0] / s
    c = Mul(*(f for f in factors if f is not logs[0] and f is not s))
    if k.has(s) or c.has(s) or c.is_negative:
        return None
    return ScalarConjugate(c * exp(y / c - 1) / k, (), [c], "conjugate of the entropy x log x, scaling")


# -- half lines ------------------------------------------------------------------------------------------------------------------


@dataclass
class _Side:
    """U(r) = linear r + Σ c rⁿ on r ≥ 0."""

    linear: Expr = S.Zero
    powers: dict[Expr, Expr] = field(default_factory=dict)

    def conjugate(self, y: Expr) -> ScalarConjugate | None:
        """sup over r ≥ 0 of y r − U(r)."""
        powers = {n: c for n, c in self.powers.items() if c != 0}
        inside = y - self.linear
        if not powers:
            return ScalarConjugate(
                S.Zero, (inside,), [], "positively homogeneous function ↔ indicator of its polar set"
            )
        if len(powers) > 1:
            return None
        ((n, c),) = powers.items()
        if c.is_negative or (n.is_number and not n > 1):
            return None
        top = inside if inside.is_nonnegative else PositivePart(inside)
        conditions = [c] if n.is_number else [c, n - 1]
        if n == 2:
            return ScalarConjugate(top**2 / (4 * c), (), conditions, "conjugate of the square")
        exponent = tidy_scalar(n / (n - 1))
        # c (n−1) (y/(c n))^(n/(n−1)), written with one power of y
        factor = powsimp(tidy_scalar((n - 1) / n) * (c * n) ** (-1 / (n - 1)))
        return ScalarConjugate(simplify(factor) * top**exponent, (), conditions, "conjugate of a power, 1/n + 1/m = 1")


def _power_of(term: Expr, s: Symbol) -> tuple[Expr, Expr, int, Expr, Expr] | None:
    """(c, n, side, a, b) of c |a s + b|ⁿ; side +1 for ⟨·⟩ⁿ or sⁿ with odd or unknown n, 0 for both sides."""
    factors = Mul.make_args(term)
    moving = [f for f in factors if f.has(s)]
    if len(moving) != 1:
        return None
    c = Mul(*(f for f in factors if not f.has(s)))
    base, n = moving[0].as_base_exp()
    if n.has(s):
        return None
    side = 1
    if isinstance(base, PositivePart):
        inside = base.args[0]
    elif isinstance(base, Maximum) and base.args[0] == -base.args[1]:
        inside, side = base.args[0], 0
    else:
        inside = base
        side = 0 if n.is_even else 1
        if side == 1 and n == 1:
            return None
    affine = _affine(inside, s)  # type: ignore[arg-type]
    return None if affine is None else (c, n, side, *affine)


def _of_halves(terms: list[Expr], s: Symbol, y: Expr) -> ScalarConjugate | None:
    sides = {1: _Side(), -1: _Side()}
    shift: Expr | None = None
    scales: list[Expr] = []
    for term in terms:
        split = _power_of(term, s)
        if split is None:
            return None
        c, n, side, a, b = split
        if side == 1 and not (term.has(PositivePart)):
            return None  # sⁿ with odd n is not convex on the whole line
        offset = tidy_scalar(b / a)
        if shift is not None and offset != shift:
            return None
        shift = offset
        sign = -1 if a.could_extract_minus_sign() else 1
        size = sign * a
        scales += [] if size.is_positive else [size]
        for place in (1, -1) if side == 0 else (sign,):
            half = sides[place]
            if n == 1:
                half.linear = half.linear + c * size
            else:
                half.powers[n] = half.powers.get(n, S.Zero) + tidy_scalar(c * size**n)
    left = _half_or_zero(sides[-1], -y)
    right = _half_or_zero(sides[1], y)
    if left is None or right is None:
        return None
    value = _joined(left.value, right.value, y) - y * (shift or S.Zero)
    rules = sorted({r for r in (left.rule, right.rule) if r})
    return ScalarConjugate(
        value, (*right.domain, *left.domain), [*right.conditions, *left.conditions, *scales], "; ".join(rules)
    )


def _joined(left: Expr, right: Expr, y: Expr) -> Expr:
    """⟨y⟩² a + ⟨−y⟩² a is a y²."""
    two = left.xreplace({PositivePart(-y): PositivePart(y)})
    if two == right and left != right:
        power = next((p for p in right.atoms(Pow) if p.base == PositivePart(y)), None)
        if power is not None and power.exp == 2:
            return right.xreplace({PositivePart(y): y})
    return left + right


def _half_or_zero(side: _Side, y: Expr) -> ScalarConjugate | None:
    if not side.powers and side.linear == 0:
        return ScalarConjugate(S.Zero, (y,), [], "positively homogeneous function ↔ indicator of its polar set")
    return side.conjugate(y)
