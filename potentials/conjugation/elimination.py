"""Unknowns of a conjugate that its equalities, or a monotone objective, determine.

An equality that is linear in an unknown gives it. A multiplier γ that only has lower bounds and on which the objective depends
increasingly takes its largest lower bound; b γ + a γ^(−q) has its minimum where the derivative vanishes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from sympy import Add, Expr, Mul, Pow, S, default_sort_key, log, powsimp, solve

from ..atoms.eig_min import EigMinLeaf
from ..atoms.maximum import Maximum
from ..atoms.norm import NormLeaf
from ..atoms.positive_part import PositivePart
from ..atoms.positive_trace import PositiveTraceLeaf
from ..atoms.trace import TraceLeaf, tr
from ..ranked import Ranked
from ..scalars import Parameter
from ..tensor import Deviator, from_terms
from .form import MinForm, is_zero, substituted
from .quadratic import gathered, opened, tidy_scalar
from .slots import FreeMultiplier, Multiplier, mentions

__all__ = ["eliminated"]


def eliminated(form: MinForm, duals: dict[Any, Any]) -> MinForm:
    """The same function with as few unknowns as the rules allow; shares that stay unknown keep their equality."""
    form = form.map(_clean)
    form = replace(form, equalities=whole_tensors(form.equalities))
    trial = _solve_all(form, duals)
    ranked_left = [u for u in trial.unknowns if not isinstance(u, Multiplier)]
    if ranked_left:
        # shares that cannot be determined are kept as they were declared, with the equality between them
        return _solve_all(form, duals, shares=False)
    return replace(
        trial, phases=(), inequalities=_independent(trial.inequalities), equalities=whole_tensors(trial.equalities)
    )


def whole_tensors(equalities: tuple[Any, ...]) -> tuple[Any, ...]:
    """dev T = 0 as T = 0 where the scalar equalities say that tr T = 0; the one that says it falls away."""
    found = list(equalities)
    for equality in equalities:
        if not isinstance(equality, Ranked) or equality.rank != 2:
            continue
        if not all(isinstance(a, Deviator) for a in equality.terms()):
            continue
        whole = from_terms({a.args[0]: c for a, c in equality.terms().items()})  # type: ignore[misc]
        trace = gathered(opened(tr(whole)))
        scalars = [e for e in found if not isinstance(e, Ranked)]
        combined = [(e, e) for e in scalars]
        combined += [(e, s * e - f) for f in scalars for e in scalars if e is not f for s in (1, -1)]
        for one, sum_of_two in combined:
            ratio = S.Zero if is_zero(gathered(sum_of_two)) else tidy_scalar(gathered(sum_of_two) / trace)
            if ratio != 0 and ratio.is_number:
                found = [whole if e is equality else e for e in found if e is not one]
                break
    return tuple(found)


def _independent(inequalities: tuple[Expr, ...]) -> tuple[Expr, ...]:
    """The inequalities without −u ≤ 0 where another one says that a length is at most a multiple of u, or that a tensor is ⪰ 0."""
    kept = []
    for f in inequalities:
        size = [
            a
            for a in Mul.make_args(f)
            if (a.is_Symbol and not a.is_positive and a not in _parameters(f)) or isinstance(a, TraceLeaf)
        ]
        implied = False
        if len(size) == 1 and f.could_extract_minus_sign() and f.is_Add is False:
            u = size[0]
            for g in inequalities:
                if g is f:
                    continue
                c = g.expand().coeff(u, 1)
                rest = (g - c * u).expand()
                if c != 0 and c.could_extract_minus_sign() and not mentions(rest, {u}) and _is_length(rest):
                    implied = True
                if isinstance(u, TraceLeaf) and g == -EigMinLeaf(u.args[0]):
                    implied = True
        if not implied:
            kept.append(f)
    return tuple(kept)


def _parameters(expression: Expr) -> set[Any]:
    return {s for s in expression.free_symbols if isinstance(s, Parameter)}


def _clean(thing: Any) -> Any:
    return thing if isinstance(thing, Ranked) else gathered(opened(thing))


def _solve_all(form: MinForm, duals: dict[Any, Any], shares: bool = True) -> MinForm:
    given = {s for d in duals.values() for s in (d.atoms() if not hasattr(d, "role") else [d])}
    while True:
        found = _by_equality(form, given, shares) or _by_bound(form)
        if found is None:
            return form
        form = found


def _by_equality(form: MinForm, given: set[Any], shares: bool) -> MinForm | None:
    candidates = []
    for k, equality in enumerate(form.equalities):
        for unknown in form.unknowns:
            if not shares and not isinstance(unknown, Multiplier):
                continue
            solved = _solved(equality, unknown, set(form.unknowns))
            if solved is not None:
                weight, solution = solved
                rank = (not weight.is_number, not solution.is_Symbol, weight.count_ops(), k)
                candidates.append((rank, k, unknown, weight, solution))
    if not candidates:
        return None
    _, k, unknown, weight, solution = min(candidates, key=lambda c: c[0])
    extra: tuple[Expr, ...] = ()
    if isinstance(unknown, Multiplier) and not isinstance(unknown, FreeMultiplier) and not solution.is_nonnegative:
        extra = (-solution,)
    rest = replace(
        form,
        equalities=tuple(e for i, e in enumerate(form.equalities) if i != k),
        unknowns=tuple(u for u in form.unknowns if u != unknown),
        conditions=form.conditions if weight.is_number else (*form.conditions, _bare(weight)),
    )
    table = {unknown: solution}
    rest = rest.map(lambda e: substituted(e, table))
    return replace(rest, inequalities=tuple(dict.fromkeys((*rest.inequalities, *extra))))


def _bare(weight: Expr) -> Expr:
    return -weight if weight.could_extract_minus_sign() else weight


def _solved(equality: Any, unknown: Any, unknowns: set[Any]) -> tuple[Expr, Any] | None:
    """(weight, solution) of an equality that is linear in an unknown of its own rank."""
    if isinstance(equality, Ranked):
        if not isinstance(unknown, Ranked) or unknown.rank != equality.rank:
            return None
        terms = equality.terms()
        weight = terms.get(unknown, S.Zero)
        if weight == 0 or Deviator(unknown) in terms if equality.rank == 2 else weight == 0:  # type: ignore[arg-type]
            return None
        if any(mentions(weight, unknowns) for _ in (0,)) or weight.atoms(Multiplier):
            return None
        return weight, (equality - unknown * weight) * (-1 / weight)
    if isinstance(unknown, Ranked) or not mentions(equality, {unknown}):
        return None
    weight = equality.expand().coeff(unknown, 1)
    rest = (equality - weight * unknown).expand()
    if weight == 0 or mentions(rest, {unknown}) or mentions(weight, unknowns) or _has_duals(weight):
        return None
    return weight, gathered(opened(-rest / weight))


def _has_duals(weight: Expr) -> bool:
    from ..atoms.atom import Invariant
    from ..scalars import ScalarVariable

    return bool(weight.atoms(Invariant)) or any(
        isinstance(s, ScalarVariable) and s.role in ("state", "force", "rate") for s in weight.free_symbols
    )


# -- bounds ------------------------------------------------------------------------------------------------------------------------


def _by_bound(form: MinForm) -> MinForm | None:
    for unknown in sorted((u for u in form.unknowns if isinstance(u, Multiplier)), key=default_sort_key, reverse=True):
        found = _bounded_both_ways(form, unknown) if isinstance(unknown, FreeMultiplier) else _bounded(form, unknown)
        if found is not None:
            return found
    return None


def _bounded(form: MinForm, unknown: Multiplier) -> MinForm | None:
    if any(mentions(e, {unknown}) for e in form.equalities):
        return None
    bounds, others = [], []
    for f in form.inequalities:
        if not mentions(f, {unknown}):
            others.append(f)
            continue
        expanded = f.expand()
        weight = expanded.coeff(unknown, 1)
        rest = (expanded - weight * unknown).expand()
        if (
            not mentions(rest, {unknown})
            and weight.could_extract_minus_sign()
            and not _has_duals(weight)
            and not weight.has(Multiplier)
        ):
            bounds.append(gathered(rest) / -weight)
        elif _rises(f, unknown):
            others.append(f)
        else:
            return None
    kinds = _growth(form.value, unknown)
    if kinds is None:
        return _stationary(form, unknown, bounds, others)
    rising, falling = kinds
    conditions: tuple[Expr, ...] = ()
    if not falling:
        if not rising and not bounds:
            solution: Any = S.Zero
        else:
            solution = _largest(bounds)
            conditions = tuple(
                c for c, q in rising if q == 1 and not c.is_positive and not c.has(Multiplier) and not _has_duals(c)
            )
    elif not bounds and len(rising) == 1 and len(falling) == 1:
        (b, one), (a, q) = rising[0], falling[0]
        if one != 1 or b.is_negative:
            return None
        p = -q
        solution = powsimp((p * a / b) ** (1 / (p + 1)))
        conditions = (b,) if not b.is_positive else ()
        value = form.value - b * unknown - a * unknown**q
        best = (1 + 1 / p) * b * _root(p * a / b, 1 / (p + 1))
        return replace(
            form,
            value=gathered(value) + best,
            unknowns=tuple(u for u in form.unknowns if u != unknown),
            conditions=(*form.conditions, *conditions),
        )
    else:
        return None
    table = {unknown: solution}
    return replace(
        form,
        value=substituted(form.value, table),
        inequalities=tuple(substituted(f, table) for f in others),
        unknowns=tuple(u for u in form.unknowns if u != unknown),
        conditions=tuple(dict.fromkeys((*form.conditions, *conditions))),
    )


def _bounded_both_ways(form: MinForm, unknown: Multiplier) -> MinForm | None:
    """A free multiplier κ with lower bounds l and upper bounds u takes the one that the objective, linear in κ, asks for."""
    if any(mentions(e, {unknown}) for e in form.equalities):
        return None
    lower, upper, others = [], [], []
    for f in form.inequalities:
        if not mentions(f, {unknown}):
            others.append(f)
            continue
        weight = f.expand().coeff(unknown, 1)
        rest = gathered((f - weight * unknown).expand())
        if weight == 0 or mentions(rest, {unknown}) or _has_duals(weight) or weight.has(Multiplier):
            return None
        down = weight.could_extract_minus_sign()
        (lower if down else upper).append(rest / -weight if down else rest / weight)
    slope = form.value.expand().coeff(unknown, 1)
    if mentions((form.value - slope * unknown).expand(), {unknown}) or _has_duals(slope) or slope.has(Multiplier):
        return None
    falling = slope.could_extract_minus_sign()
    if (falling and not upper) or (not falling and not lower):
        return None
    # κ ≤ −u for the upper bounds: the least of them is minus the largest u
    solution = -_greatest(upper) if falling else _greatest(lower)
    table = {unknown: solution}
    crossed = tuple(a + b for a in lower for b in upper)
    return replace(
        form,
        value=substituted(form.value, table),
        inequalities=(*others, *crossed),
        unknowns=tuple(u for u in form.unknowns if u != unknown),
        conditions=form.conditions if slope.is_number else (*form.conditions, -slope if falling else slope),
    )


def _stationary(form: MinForm, unknown: Multiplier, bounds: list[Expr], others: list[Expr]) -> MinForm | None:
    """A convex objective with the minimum at a known γ₀ takes γ = max(γ₀, bounds)."""
    part = Add(*(t for t in Add.make_args(form.value.expand()) if mentions(t, {unknown})))
    if not part.has(log) or any(mentions(f, {unknown}) for f in others):
        return None
    try:
        found = solve(part.diff(unknown), unknown)
    except NotImplementedError:
        return None
    if len(found) != 1 or _has_duals(found[0]) or found[0].has(Multiplier):
        return None
    table = {unknown: _greatest([found[0], *bounds])}
    return replace(
        form,
        value=substituted(form.value, table),
        inequalities=tuple(others),
        unknowns=tuple(u for u in form.unknowns if u != unknown),
    )


def _rises(inequality: Expr, unknown: Multiplier) -> bool:
    """True for a length √(γ² + …) of multipliers, or a multiple of γ, on the small side of an inequality."""
    for term in Add.make_args(inequality):
        if not mentions(term, {unknown}):
            continue
        if term.could_extract_minus_sign():
            return False
        core = Mul(*(f for f in Mul.make_args(term) if mentions(f, {unknown})))
        inside = core.base if isinstance(core, Pow) and core.exp == S.Half else core
        if any(a.could_extract_minus_sign() for a in Add.make_args(inside)):
            return False
        if any(not isinstance(a.as_base_exp()[0], Multiplier) for a in Add.make_args(inside) if mentions(a, {unknown})):
            return False
    return True


def _root(inside: Expr, exponent: Expr) -> Expr:
    if exponent == S.Half:
        from .groups import length_of

        return length_of(tidy_scalar(inside) if not inside.has(NormLeaf) else inside)
    return inside**exponent


def _growth(value: Expr, unknown: Multiplier) -> tuple[list[tuple[Expr, Expr]], list[tuple[Expr, Expr]]] | None:
    """Terms c γ^q of the objective, rising (q > 0) and falling (q < 0); None if γ stands elsewhere in it."""
    rising, falling = [], []
    for term in Add.make_args(value.expand()):
        if not mentions(term, {unknown}):
            continue
        fixed, moving = [], []
        for factor in Mul.make_args(term):
            (moving if mentions(factor, {unknown}) else fixed).append(factor)
        exponent: Expr = S.Zero
        for factor in moving:
            base, power = factor.as_base_exp()
            ratio = base / unknown
            if mentions(ratio, {unknown}) or mentions(power, {unknown}):
                return None
            fixed.append(ratio**power)
            exponent = exponent + power
        weight = Mul(*fixed)
        if exponent.is_number and exponent < 0:
            falling.append((weight, exponent))
        else:
            # an exponent in parameters is that of a conjugate power, n/(n−1) > 1
            rising.append((weight, exponent))
        if weight.is_negative:
            return None
    return _gathered_powers(rising), _gathered_powers(falling)


def _gathered_powers(pairs: list[tuple[Expr, Expr]]) -> list[tuple[Expr, Expr]]:
    found: dict[Expr, Expr] = {}
    for weight, power in pairs:
        found[power] = found.get(power, S.Zero) + weight
    return [(weight, power) for power, weight in found.items()]


def _largest(bounds: list[Expr]) -> Expr:
    """max(0, bounds)."""
    unique = sorted(dict.fromkeys(bounds), key=default_sort_key)
    if not unique:
        return S.Zero
    found = _greatest(unique)
    return found if any(_is_length(b) for b in unique) else PositivePart(found)


def _greatest(values: list[Expr]) -> Any:
    found: Any = values[0]
    for other in values[1:]:
        found = Maximum(found, other)
    return found


def _is_length(bound: Expr) -> bool:
    leaves = bound.atoms(NormLeaf, PositiveTraceLeaf)
    if len(leaves) == 1:
        weight = bound / next(iter(leaves))
        return not weight.has(NormLeaf, PositiveTraceLeaf) and weight.could_extract_minus_sign() is False
    return isinstance(bound, Pow) and bound.exp == S.Half
