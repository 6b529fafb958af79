"""An expression as a sum of functions that have a conjugate of their own.

What is not such a function is composed of them, and is opened by a multiplier γ ≥ 0:

    h(f)                = sup over γ of γ f − h*(γ)          (h convex and non-decreasing)
    max(f, g)           = sup of γ₁ f + γ₂ g over γ₁ + γ₂ = 1
    √(f² + g² + …)      = sup of u f + v g + … over ‖(u, v, …)‖ ≤ 1   (f, g ≥ 0)
    I{f ≤ 0}            = sup of γ f

so that the conjugate is the minimum, over the multipliers, of h*(γ) plus the conjugate of a sum (Rockafellar 1970, §16).
"""

from __future__ import annotations

from typing import Any

from sympy import (
    Add,
    Dummy,
    Expr,
    Integer,
    Mul,
    Poly,
    PolynomialError,
    Pow,
    Rational,
    S,
    default_sort_key,
    exp,
    expand_mul,
    log,
    sqrt,
)

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
from ..tensor import from_terms
from .form import MinForm, NoRule
from .groups import E, EigenGroup, GaugeGroup, ScalarGroup, root_of
from .one_variable import conjugate_of_one_variable, positive_view
from .quadratic import Quadratic, tidy_scalar
from .slots import FreeMultiplier, Functional, Multiplier, Parts, functional_of, mentions, parts_of

__all__ = ["Sorter"]

SPECTRAL = (PositiveSquareLeaf, PositiveTraceLeaf, EigMaxLeaf, EigMinLeaf, EigSumLeaf)
HALF = Rational(1, 2)


class Sorter:
    """Collects the terms of a sum over given slots; `extra` holds what the multipliers add."""

    def __init__(self, slots: tuple[Any, ...]) -> None:
        self.slots = slots
        self.known = set(slots)
        self.quadratic = Quadratic(slots)
        self.gauges: list[GaugeGroup] = []
        self.scalars: list[ScalarGroup] = []
        self.eigen: list[EigenGroup] = []
        self.extra = MinForm()
        self.data: Expr = S.Zero

    # -- multipliers -----------------------------------------------------------------------------------------------------------

    def multiplier(self) -> Multiplier:
        """A new unknown γ ≥ 0."""
        count = sum(isinstance(u, Multiplier) for u in self.extra.unknowns)
        found = Multiplier("gamma" if count == 0 else f"gamma_{count + 1}")
        self.extra = self.extra + MinForm(unknowns=(found,))
        return found

    def require(self, weight: Expr, term: Any) -> None:
        """The weight of a convex term must be positive: refused if it is not, noted if it depends on parameters."""
        if weight.is_positive or weight.is_nonnegative:
            return
        if weight.xreplace(positive_view(weight)).is_nonpositive:
            raise NoRule(f"{weight}*({term}) is not convex")
        bare = Mul(*(f for f in Mul.make_args(weight) if not isinstance(f, Multiplier)))
        if not bare.has(Multiplier):
            self.extra = self.extra + MinForm(conditions=(bare,))

    # -- terms -----------------------------------------------------------------------------------------------------------------

    def add(self, expression: Expr) -> None:
        """Sort the terms of an expression; terms in data alone are kept as they stand."""
        moving = []
        for term in Add.make_args(expand_mul(expression, deep=False)):
            if mentions(term, self.known):
                moving.append(term)
            else:
                self.data = self.data + term
        for weight, factors in self._monomials(Add(*moving)) if moving else ():
            self._sort(weight, factors)

    def add_surface(self, function: Expr) -> None:
        """Indicator of {function ≤ 0}."""
        self.extra = self.extra.with_rule(
            "indicator of {f <= 0} ↔ support function, a minimum over the multiplier of f"
        )
        self.add(self.multiplier() * function)

    def add_equation(self, function: Expr) -> None:
        """Indicator of {function = 0} of an affine function."""
        count = sum(isinstance(u, FreeMultiplier) for u in self.extra.unknowns)
        unknown = FreeMultiplier("kappa" if count == 0 else f"kappa_{count + 1}")
        self.extra = self.extra + MinForm(
            unknowns=(unknown,), rules=("indicator of {f = 0} ↔ support function, a minimum over the multiplier of f",)
        )
        self.add((unknown * function).expand(deep=False))

    def _monomials(self, expression: Expr) -> list[tuple[Expr, list[tuple[Any, int]]]]:
        table: dict[Any, Dummy] = {}
        body = self._opened(expression, table)
        generators = sorted(table, key=default_sort_key)
        if not generators:
            return [(body, [])]
        dummies = [table[g] for g in generators]
        try:
            terms = Poly(body, *dummies).terms()
        except PolynomialError:
            raise NoRule(f"no conjugate is known for {expression}") from None
        return [
            (coefficient, [(g, k) for g, k in zip(generators, powers, strict=True) if k])
            for powers, coefficient in terms
        ]

    def _opened(self, expression: Any, table: dict[Any, Dummy]) -> Any:
        if not mentions(expression, self.known):
            return expression
        if expression.is_Add or expression.is_Mul:
            return expression.func(*(self._opened(a, table) for a in expression.args))
        if expression.is_Pow and expression.exp == 2:
            base = expression.base
            if isinstance(base, NormLeaf):
                return self._opened(InnerLeaf(base.args[0], base.args[0]), table)
            functional = functional_of(base, self.known)  # type: ignore[arg-type]
            if functional is not None and (functional.is_isotropic() or not base.is_Add):
                return self._opened(base, table) ** 2
        if expression not in table:
            table[expression] = Dummy("g", real=True)
        return table[expression]

    def _sort(self, weight: Expr, factors: list[tuple[Any, int]]) -> None:
        degree = sum(k for _, k in factors)
        if not factors:
            self.quadratic.add_constant(weight)
            return
        first, power = factors[0]
        functionals = [functional_of(g, self.known) for g, _ in factors]  # type: ignore[arg-type]
        if all(f is not None for f in functionals) and degree <= 2:
            self._polynomial(weight, [f for f, (_, k) in zip(functionals, factors, strict=True) for _ in range(k)])
        elif len(factors) == 1 and power == 1 and isinstance(first, InnerLeaf):
            self.quadratic.add_inner(weight, *first.args)  # type: ignore[arg-type]
        elif len(factors) == 1 and power == 1 and isinstance(first, SPECTRAL):
            self._spectral(weight, first)
        elif len(factors) == 1 and power == 1 and isinstance(first, NormLeaf):
            self._gauge(weight, first, self._square(InnerLeaf(first.args[0], first.args[0])))
        else:
            self._other(weight, factors)

    def _polynomial(self, weight: Expr, functionals: list[Any]) -> None:
        if len(functionals) == 1:
            self.quadratic.add_linear(weight, functionals[0])
        elif functionals[0].is_isotropic() and functionals[1].is_isotropic():
            self.quadratic.add_product(weight, *functionals)
        else:
            raise NoRule("a product of scalar products with data has no closed conjugate")

    def _square(self, expression: Expr) -> Quadratic | None:
        """The expression as a quadratic form, or None."""
        inside = Sorter(self.slots)
        try:
            inside.add(expression)
        except NoRule:
            return None
        if inside.gauges or inside.scalars or inside.eigen or inside.extra.unknowns:
            return None
        inside.quadratic.add_constant(inside.data)
        return inside.quadratic.tidied()

    # -- kinds -----------------------------------------------------------------------------------------------------------------

    def _gauge(self, weight: Expr, term: Any, form: Quadratic | None) -> None:
        assert form is not None
        self.require(weight, term)
        for group in self.gauges:
            if group.form.table == form.table:
                group.weight = group.weight + weight
                return
        self.gauges.append(GaugeGroup(weight, form))

    def _spectral(self, weight: Expr, leaf: Any) -> None:
        tensor = leaf.args[-1]
        parts = parts_of(tensor, self.slots)
        if any(d != 0 for _, d in parts.linear.values()):
            if not isinstance(leaf, (EigMaxLeaf, EigMinLeaf)):
                raise NoRule(f"no conjugate is known for {leaf}, a function of the eigenvalues of a deviator")
            # the extreme eigenvalue of dev X is that of X less a third of the trace
            for slot, (_, d) in parts.linear.items():
                self.quadratic.add_linear(-weight * d / 3, functional_of(TraceLeaf(slot), self.known))  # type: ignore[arg-type]
            parts = Parts({s: (c + d, S.Zero) for s, (c, d) in parts.linear.items()}, parts.rest)
            leaf = type(leaf)(from_terms({s: c for s, (c, _) in parts.linear.items()}) + parts.rest)
        self.require(-weight if isinstance(leaf, EigMinLeaf) else weight, leaf)
        extreme = isinstance(leaf, (EigMaxLeaf, EigMinLeaf))
        for group in self.eigen:
            if extreme is not (group.function == 0):
                continue  # extreme eigenvalues and sums over all of them share the dual
            ratio = _ratio(group.parts, parts)
            if ratio == 1:
                group.add(leaf, weight)
                return
            if ratio == -1 and extreme:
                other = EigMinLeaf if isinstance(leaf, EigMaxLeaf) else EigMaxLeaf
                group.add(other(leaf.args[0]), -weight)
                return
        group = EigenGroup(self.slots, parts)
        group.add(leaf, weight)
        self.eigen.append(group)

    def _other(self, weight: Expr, factors: list[tuple[Any, int]]) -> None:
        term = Mul(*(g**k for g, k in factors))
        one = self._of_one_functional(term)
        if one is not None:
            self._scalar(*one, weight)
            return
        if len(factors) != 1:
            raise NoRule(f"no conjugate is known for {term}, a product of functions")
        self._composition(weight, *factors[0])

    def _scalar(self, direction: Functional, function: Expr, weight: Expr) -> None:
        for group in self.scalars:
            if group.direction.parts == direction.parts:
                group.function = group.function + weight * function
                return
        self.scalars.append(ScalarGroup(self.slots, direction, weight * function))

    def _of_one_functional(self, term: Expr) -> tuple[Functional, Expr] | None:
        """(ℓ, H) with term = H(ℓ), ℓ normalised and without constant."""
        arguments: set[Any] = set()
        if not self._affine_arguments(term, arguments) or not arguments:
            return None
        direction: Functional | None = None
        table = {}
        for argument in sorted(arguments, key=default_sort_key):
            functional = functional_of(argument, self.known)  # type: ignore[arg-type]
            assert functional is not None
            lead = next(s for s in self.slots if s in functional.parts)
            scale = functional.parts[lead]
            if isinstance(scale, Ranked):
                scale = next(iter(scale.terms().values()))
            parts = {s: a / scale for s, a in functional.parts.items()}
            if direction is None:
                direction = Functional(parts)
            elif direction.parts != parts:
                return None
            table[argument] = scale * E + functional.constant
        return None if direction is None else (direction, term.xreplace(table))

    def _affine_arguments(self, thing: Any, found: set[Any]) -> bool:
        """Gather the largest affine subexpressions; False if something is neither affine nor a function of such."""
        if not mentions(thing, self.known):
            return True
        if isinstance(thing, Ranked):
            return False
        if functional_of(thing, self.known) is not None:  # type: ignore[arg-type]
            found.add(thing)
            return True
        if isinstance(thing, Invariant):
            return False
        return all(self._affine_arguments(a, found) for a in thing.args)

    # -- compositions ----------------------------------------------------------------------------------------------------------

    def _composition(self, weight: Expr, node: Any, power: int) -> None:
        if isinstance(node, Maximum) and power == 1:
            self._maximum(weight, node)
            return
        if isinstance(node, NormLeaf):
            self._outer(weight * E**power, node, node)
        elif isinstance(node, PositivePart):
            self._outer(weight * PositivePart(E) ** power, node.args[0], node)
        elif isinstance(node, exp):
            self._outer(weight * exp(power * E), node.args[0], node)
        elif isinstance(node, Pow) and not mentions(node.exp, self.known):
            self._power(weight, node.base, node.exp * power, node)
        elif isinstance(node, log):
            raise NoRule(f"no conjugate is known for {node}")
        else:
            raise NoRule(f"no conjugate is known for {node}" + (f"**{power}" if power > 1 else ""))

    def _power(self, weight: Expr, base: Expr, exponent: Expr, node: Any) -> None:
        if isinstance(base, PositivePart):
            self._outer(weight * PositivePart(E) ** exponent, base.args[0], node)
            return
        form = self._square(base)
        if form is not None and form.curved():
            self.require(weight, node)
            group = GaugeGroup(S.One, form)
            if exponent == HALF:
                self._gauge(weight, node, form)
                return
            if GaugeGroup(S.One, form).half().conjugate({s: s for s in self.slots}).constant == 0:
                # (r²)ⁿ is r²ⁿ with the gauge r
                self.extra = self.extra.with_rule("composition of an increasing function with a norm")
                gamma = self._conjugate_outer(weight * E ** (2 * exponent), node)
                self._gauge(gamma, group, form)
                return
        if exponent == HALF:
            self._length(weight, base, node)
            return
        if exponent.is_number and not exponent >= 1:
            raise NoRule(f"no conjugate is known for {node}")
        self._outer(weight * E**exponent, base, node)

    def _length(self, weight: Expr, base: Expr, node: Any) -> None:
        """√(Σ w f²) with f ≥ 0 convex, or f affine."""
        shares = []
        for coefficient, factors in self._monomials(base):
            self.require(coefficient, node)
            if len(factors) == 1 and isinstance(factors[0][0], InnerLeaf) and factors[0][1] == 1:
                leaf = factors[0][0]
                if leaf.args[0] != leaf.args[1]:
                    raise NoRule(f"no conjugate is known for {node}")
                inside: Any = NormLeaf(leaf.args[0])
            elif len(factors) == 1 and factors[0][1] == 2 and isinstance(factors[0][0], (NormLeaf, PositivePart)):
                inside = factors[0][0]
            elif len(factors) == 1 and isinstance(factors[0][0], Pow) and factors[0][0].exp == 2 and factors[0][1] == 1:
                inside = factors[0][0].base
                if not isinstance(inside, (NormLeaf, PositivePart)):
                    raise NoRule(f"no conjugate is known for {node}")
            elif not factors:
                inside = S.One
            else:
                raise NoRule(f"no conjugate is known for {node}")
            share = self.multiplier()
            shares.append(share)
            self.add(share * root_of(coefficient) * inside)
        self.extra = self.extra + MinForm(
            inequalities=(sqrt(Add(*(u**2 for u in shares))) - weight,),
            rules=("length of several convex functions: a minimum over multipliers in the unit ball",),
        )

    def _maximum(self, weight: Expr, node: Maximum) -> None:
        self.require(weight, node)
        first, second = self.multiplier(), self.multiplier()
        self.extra = self.extra + MinForm(
            equalities=(first + second - weight,),
            rules=("maximum of functions: a minimum over convex combinations",),
        )
        self.add(first * node.args[0])
        self.add(second * node.args[1])

    def _outer(self, function: Expr, inside: Expr, node: Any) -> None:
        """h(f): multiplier γ with h*(γ), and γ f."""
        fixed = Mul(*(f for f in Mul.make_args(inside) if not mentions(f, self.known)))
        if fixed != 1:
            self.require(fixed, node)
        gamma = self._conjugate_outer(function, node)
        self.extra = self.extra.with_rule("composition h(f) of an increasing function: a minimum over its multiplier")
        self.add(gamma * inside)

    def _conjugate_outer(self, function: Expr, node: Any) -> Multiplier:
        gamma = self.multiplier()
        found = conjugate_of_one_variable(function, E, gamma, increasing=not function.has(exp, PositivePart))
        if found is None:
            raise NoRule(f"no conjugate is known for {node}")
        for condition in found.conditions:
            self.require(condition, node)
        self.extra = self.extra + MinForm(
            value=found.value, inequalities=tuple(f for f in found.domain if not f.is_nonpositive), rules=(found.rule,)
        )
        return gamma


def _ratio(a: Parts, b: Parts) -> Expr | None:
    """r with b = r a, for r = ±1; None otherwise."""
    for r in (Integer(1), Integer(-1)):
        same = set(a.linear) == set(b.linear) and all(
            tidy_scalar(b.linear[s][0] - r * a.linear[s][0]) == 0 for s in a.linear
        )
        if same and not (b.rest - a.rest * r).terms():  # type: ignore[operator]
            return r
    return None
