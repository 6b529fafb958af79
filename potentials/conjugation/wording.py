"""A conjugate in words: plain text and LaTeX of values, domains and minima."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sympy import Add, Expr, Mul, S, Symbol, default_sort_key, latex, sstr

from ..atoms.eig_min import EigMinLeaf
from ..atoms.maximum import Maximum
from ..ranked import Ranked
from ..tensor import from_terms
from .slots import Multiplier

__all__ = [
    "Words",
    "comparison",
    "conditions_of",
    "domain_words",
    "joined",
    "paired",
    "shown",
    "value_words",
    "variables_shown",
]

Words = tuple[str, str]
"""Plain text and LaTeX."""


def shown(thing: Any) -> Words:
    """An expression in both ways; the typed zero as 0."""
    if isinstance(thing, Ranked) and not thing.terms():
        return "0", "0"
    return sstr(thing), latex(thing)


def joined(parts: Iterable[Words], text: str = ", ", tex: str = r",\ ") -> Words:
    """Several words in a row."""
    found = list(parts)
    return text.join(t for t, _ in found), tex.join(t for _, t in found)


def comparison(residual: Any, sign: str) -> Words:
    """residual = 0 or residual ≤ 0 with nothing negative left on either side."""
    if isinstance(residual, Ranked):
        left = {a: c for a, c in residual.terms().items() if not c.could_extract_minus_sign()}
        right = {a: -c for a, c in residual.terms().items() if c.could_extract_minus_sign()}
        make: Any = from_terms if residual.rank == 2 else lambda t: residual.linear(t.items())
        sides: list[Any] = [make(left), make(right)]
    else:
        terms = Add.make_args(residual.expand() if _short(residual) else residual)
        left = [t for t in terms if not t.could_extract_minus_sign()]
        right = [-t for t in terms if t.could_extract_minus_sign()]
        alone = left if len(left) == 1 else right if not left and len(right) == 1 else []
        # a side of one term is written without its number
        number = Mul(*(f for t in alone for f in Mul.make_args(t) if f.is_number))
        sides = [Add(*(t / number for t in left)), Add(*(t / number for t in right))]
    (a, at), (b, bt) = shown(sides[0]), shown(sides[1])
    if sign == "=" and a == "0":
        a, at, b, bt = b, bt, a, at
    if sign == "<=" and a == "0":
        return f"{b} >= 0", rf"{bt} \geq 0"
    return (f"{a} = {b}", f"{at} = {bt}") if sign == "=" else (f"{a} <= {b}", rf"{at} \leq {bt}")


def _short(residual: Expr) -> bool:
    return residual.count_ops() < 60


def domain_words(inequalities: Iterable[Expr], equalities: Iterable[Any]) -> list[Words]:
    """Equalities, then inequalities."""
    return [comparison(e, "=") for e in equalities] + [comparison(f, "<=") for f in inequalities]


def value_words(value: Expr) -> tuple[Words, list[Words]]:
    """A value, with the smaller of two quantities named y, and what y stands for."""
    nodes = sorted((m for m in value.atoms(Maximum) if any(a.has(EigMinLeaf) for a in m.args)), key=default_sort_key)
    definitions: list[Words] = []
    table = {}
    taken = {s.name for s in value.free_symbols if isinstance(s, Symbol)}
    names = (n for n in ("y", "z", *(f"y_{k}" for k in range(1, 99))) if n not in taken)
    for node in nodes:
        y = Symbol(next(names), real=True)
        table[node] = -y
        (a, at), (b, bt) = (shown(-x) for x in node.args)
        definitions.append((f"{y.name} = min({a}, {b})", rf"{y.name} = \min\left({at}, {bt}\right)"))
    return shown(value.xreplace(table)), definitions


def paired(dual: Any, slot: Any) -> Words:
    """The product of a dual and a slot."""
    (a, at), (b, bt) = shown(dual), shown(slot)
    if isinstance(slot, Ranked):
        return f"inner({a}, {b})", rf"{at}:{bt}" if slot.rank == 2 else rf"{at}\cdot {bt}"
    return f"{a}*{b}", rf"{at}\,{bt}"


def conditions_of(conditions: Iterable[Expr]) -> tuple[Expr, ...]:
    """Expressions in parameters that have to be positive, without numerical factors, repetition and what always holds."""
    found: list[Expr] = []
    for condition in conditions:
        top, bottom = condition.together().as_numer_denom()
        product = S.One
        for factor in (*Mul.make_args(top.factor()), *Mul.make_args(bottom.factor())):
            base, power = factor.as_base_exp()
            if base.is_number:
                product = product * (-1 if base.is_negative and power.is_odd else 1)
            elif not (base.is_positive or power.is_even):
                product = product * base
        if product != 1 and product not in found and not product.has(Multiplier):
            found.append(product)
    singles = {c for c in found if c.is_Symbol}
    return tuple(c for c in found if c.is_Symbol or not set(Mul.make_args(c)) <= singles)


def variables_shown(symbols: Iterable[Any]) -> Words:
    """Names of unknowns; multipliers with their sign."""
    found = []
    for symbol in symbols:
        a, at = shown(symbol)
        found.append(
            (f"{a} >= 0", rf"{at} \geq 0") if symbol.is_positive and isinstance(symbol, Multiplier) else (a, at)
        )
    return joined(found)
