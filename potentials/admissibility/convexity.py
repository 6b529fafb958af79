"""Convexity by composition: a function is convex if the rules of its atoms, put together, say so.

Goal-directed: `Prover.curved(g, ±1)` looks for a proof that g (or −g) is convex in the given variables, everything else (parameters,
temperature, frozen state) being data of unknown value, and returns it with the conditions on the data that it needs and with its steps;
None means only that no rule was found. Rules:

* the terms of degree at most two together are one quadratic form, convex if and only if its blocks are semidefinite (exact);
* sums of convex terms, products with non-negative data;
* an atom of a convex function where it is non-decreasing, of a concave one where it is non-increasing, of an affine one always;
* powers, roots of sums of powers (gauges), a square over a positive affine function (`powers`);
* functions of one scalar through the sign of their second derivative (`single`).

Source of the composition rules: Grant, Boyd and Ye (2006); of the gauge rule: Rockafellar (1970), theorem 15.3.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sympy import Add, Expr, Lambda, Mul, Pow, S

from ..atoms import ATOMS, atom_of
from ..atoms.maximum import Maximum
from ..ranked import Ranked
from ..scalars import FrozenScalar, Parameter, ScalarVariable, Temperature
from .bounds import interval, natural_range, sharp_interval
from .conditions import Need, only_at_zero_of
from .powers import convex_power, convex_quotient
from .quadratic import degree_of, quadratic_form
from .single import convex_by_second_derivative
from .squares import convex_by_squares

__all__ = ["Proof", "Prover", "one_variable"]


@dataclass(frozen=True)
class Proof:
    """What a proof needs, its steps in order, and where the function is defined (expressions that are positive there)."""

    needs: tuple[Need, ...] = ()
    steps: tuple[str, ...] = ()
    domain: tuple[Expr, ...] = ()

    def __add__(self, other: Proof) -> Proof:
        steps = self.steps + tuple(s for s in other.steps if s not in self.steps)
        return Proof(self.needs + other.needs, steps, self.domain + other.domain)

    def step(self, text: str) -> Proof:
        """The same with one step more."""
        return self + Proof(steps=(text,))


class Prover:
    """Rules for functions of `variables`."""

    def __init__(self, variables: Iterable[Any]) -> None:
        self.variables = frozenset(variables)
        self.known: dict[tuple[Any, int], Proof | None] = {}
        self.asked: list[Expr] = []
        """Data that some rule wanted non-negative, whether or not a proof came of it."""

    # -- what is data, what is variable ------------------------------------------------------------------------------------------

    def constant(self, expression: Any) -> bool:
        """True if no variable stands in the expression."""
        return not expression.has(*self.variables)

    def affine(self, expression: Any) -> bool:
        """True if the expression is affine in the variables."""
        degree = degree_of(expression, self.variables)
        if degree is not None and degree <= 1:
            return True
        parts = Add.make_args(expression)
        if len(parts) > 1:
            return all(self.affine(p) for p in parts)
        _, rest = self.split(expression)
        record = ATOMS.get(type(rest))
        return (
            record is not None
            and all(isinstance(a, Ranked) for a in rest.args)
            and record.curvature(rest, lambda _: None) == "affine"
        )

    def split(self, term: Any) -> tuple[Any, Any]:
        """(data, rest) of a product."""
        parts = Mul.make_args(term)
        data = [p for p in parts if self.constant(p)]
        return Mul(*data), Mul(*(p for p in parts if not self.constant(p)))

    def terms(self, expression: Any) -> list[Any]:
        """Summands, with data distributed over sums."""
        found = []
        for part in Add.make_args(expression):
            weight, rest = self.split(part)
            found += [weight * t for t in self.terms(rest)] if rest.is_Add else [part]
        return found

    def _range(self, symbol: Any) -> Any:
        return natural_range(symbol)

    # -- signs -------------------------------------------------------------------------------------------------------------------

    def sign(self, expression: Any) -> int:
        """+1 if never negative, −1 if never positive, 0 if unknown, without conditions."""
        low, high = interval(expression, self._range)
        return 1 if low >= 0.0 else (-1 if high <= 0.0 else 0)

    def data_nonnegative(self, expression: Any, about: str = "weight", names: tuple[Any, ...] = ()) -> Proof | None:
        """Data that is not negative, or a condition that it be so; None if bounds contradict it, or if it depends on the state."""
        if expression.is_number and not expression.is_real:
            return None
        need = Need(expression, about, names)
        low, high = sharp_interval(expression, self._range)
        if low >= 0.0:
            return Proof((need,) if expression.atoms(Parameter) else ())
        if high <= 0.0:
            return None
        self.asked.append(expression)
        states = {s for s in expression.atoms(ScalarVariable) if not isinstance(s, (Temperature, FrozenScalar))}
        states |= {s for s in expression.atoms(Ranked) if getattr(s, "role", "frozen") != "frozen"}
        frozen = {s for s in expression.atoms(Ranked) if getattr(s, "role", "") == "frozen"}
        states -= {s.variable for s in frozen}  # type: ignore[attr-defined]
        return None if states else Proof((need,))

    def nonnegative(self, expression: Any) -> Proof | None:
        """A function that is nowhere negative."""
        if self.constant(expression):
            return self.data_nonnegative(expression)
        if self.sign(expression) == 1:
            return Proof()
        terms = self.terms(expression)
        if len(terms) > 1:
            parts = [self.nonnegative(t) for t in terms]
            if None not in parts:
                return sum(parts, Proof())  # type: ignore[arg-type]
            return self.square_sum(expression)
        weight, rest = self.split(terms[0])
        if weight != 1:
            for s in (1, -1):
                inside = self.nonnegative(rest) if s > 0 else (Proof() if self.sign(rest) < 0 else None)
                data = None if inside is None else self.data_nonnegative(s * weight)
                if inside is not None and data is not None:
                    return inside + data
            return None
        if isinstance(rest, Pow):
            return self.nonnegative(rest.base)
        if rest.is_Mul:
            parts = [self.nonnegative(p) for p in rest.args]
            return None if None in parts else sum(parts, Proof())  # type: ignore[arg-type]
        return None

    def square_sum(self, expression: Any) -> Proof | None:
        """A polynomial of degree two that is nowhere negative: its root is then a norm of affine functions."""
        degree = degree_of(expression, self.variables)
        if degree is None or degree > 2:
            return None
        return self._minors(quadratic_form(expression, self.variables).minors(True, self.variables))

    def positive(self, expression: Any) -> Proof | None:
        """A function that is positive everywhere."""
        low, _ = interval(expression, self._range)
        if low > 0.0 or expression.is_positive:
            return Proof()
        if expression.is_Add:
            parts = [self.nonnegative(t) for t in expression.args]
            if None not in parts:
                for k, t in enumerate(expression.args):
                    found = self.positive(t)
                    if found is not None:
                        return sum((p for i, p in enumerate(parts) if i != k), found)  # type: ignore[misc]
        if expression.is_Mul:
            parts = [self.positive(p) for p in expression.args]
            if None not in parts:
                return sum(parts, Proof())  # type: ignore[arg-type]
        if isinstance(expression, Pow) and not self.constant(expression):
            return self.positive(expression.base)
        if self.constant(expression):
            found = self.data_nonnegative(expression)
            return None if found is None else Proof((Need(expression, "domain", (), True),))
        return None

    # -- curvature ---------------------------------------------------------------------------------------------------------------

    def curved(self, expression: Any, goal: int) -> Proof | None:
        """Proof that goal·expression is convex, or None."""
        key = (expression, goal)
        if key not in self.known:
            self.known[key] = None  # a rule that comes back to its own question has found nothing
            self.known[key] = self._curved(expression, goal)
        return self.known[key]

    def _curved(self, expression: Any, goal: int) -> Proof | None:
        if self.constant(expression):
            return Proof()
        terms = self._gathered(expression)
        low: list[Any] = []
        rest: list[Any] = []
        for term in terms:
            degree = degree_of(term, self.variables)
            (low if degree is not None and degree <= 2 else rest).append(term)
        proof: Proof | None = self._quadratic(Add(*low), goal)
        for term in rest:
            part = None if proof is None else self._term(term, goal)
            proof = None if proof is None or part is None else proof + part
        if proof is None:
            return self._apart(terms, goal)
        if len(rest) + bool(low) > 1:
            word = "convex" if goal > 0 else "concave"
            proof = proof.step(f"a sum of {word} terms is {word}")
        return proof

    def _gathered(self, expression: Any) -> list[Any]:
        """Terms that are not data, those alike with one weight."""
        weights: dict[Any, Any] = {}
        for term in self.terms(expression):
            weight, rest = self.split(term)
            if rest != 1:
                weights[rest] = weights.get(rest, S.Zero) + weight
        return [weight * rest for rest, weight in weights.items() if weight != 0]

    def _apart(self, terms: list[Any], goal: int) -> Proof | None:
        """Groups of terms without a common variable, each by itself; the last resort of one group are exact programs."""
        groups: list[tuple[set[Any], list[Any]]] = []
        for term in terms:
            mine, parts = {v for v in self.variables if term.has(v)}, [term]
            for group in [g for g in groups if g[0] & mine]:
                mine, parts = mine | group[0], parts + group[1]
                groups.remove(group)
            groups.append((mine, parts))
        if len(groups) == 1:
            whole = Add(*terms)
            return convex_by_second_derivative(self, whole, goal) or convex_by_squares(self, whole, goal)
        proof = Proof()
        for _, parts in groups:
            found = self.curved(Add(*parts), goal)
            if found is None:
                return None
            proof = proof + found
        return proof.step(f"a sum of {'convex' if goal > 0 else 'concave'} functions of different variables is so")

    def _quadratic(self, expression: Any, goal: int) -> Proof | None:
        degree = degree_of(expression, self.variables)
        if degree == 0:
            return Proof()
        if degree == 1:
            return Proof(steps=(f"{_shown(expression)} is affine",))
        minors = quadratic_form(goal * expression, self.variables).minors(False, self.variables)
        proof = self._minors(minors)
        if proof is None:
            return None
        names = ", ".join(sorted({str(v) for v in self.variables if expression.has(v)}))
        word = "convex" if goal > 0 else "concave"
        if not minors:
            return proof.step(f"{_shown(expression)} is affine in {names}")
        return proof.step(
            f"{_shown(expression)} is a quadratic form in {names}, {word} exactly where its moduli are not "
            f"{'negative' if goal > 0 else 'positive'}"
        )

    def _minors(self, minors: Any) -> Proof | None:
        if minors is None:
            return None
        proof = Proof()
        for minor, names in minors:
            part = self.data_nonnegative(minor, "modulus", names)
            if part is None and only_at_zero_of(minor) is not None and minor.free_symbols <= minor.atoms(Parameter):
                # a coupling that no stiffness carries must vanish
                part = Proof((Need(minor, "modulus", names),))
            if part is None:
                return None
            proof = proof + part
        return proof

    def _term(self, term: Any, goal: int) -> Proof | None:
        weight, rest = self.split(term)
        if weight == 1:
            return self._node(rest, goal)
        if self.affine(rest):
            return Proof(steps=(f"{_shown(term)} is affine",))
        for s in (1, -1):
            data = self.data_nonnegative(s * weight, _about(rest))
            inside = None if data is None else self._node(rest, s * goal)
            if data is not None and inside is not None:
                return inside + data
        return None

    def _node(self, node: Any, goal: int) -> Proof | None:
        if self.affine(node):
            return Proof(steps=(f"{_shown(node)} is affine",))
        if node.is_Add:
            return self.curved(node, goal)
        if node.is_Mul:
            node = _with_absolute(node)
        if node.is_Mul:
            found = convex_quotient(self, node) if goal > 0 else None
            return found or convex_by_second_derivative(self, node, goal)
        if isinstance(node, Pow):
            return convex_power(self, node, goal) or convex_by_second_derivative(self, node, goal)
        return self._atom(node, goal)

    def _atom(self, node: Any, goal: int) -> Proof | None:
        if type(node) not in ATOMS:
            return None
        atom = atom_of(node)
        needs: list[Expr] = []
        curvature = atom.curvature(node, needs.append)
        word = "convex" if goal > 0 else "concave"
        if curvature not in (word, "affine"):
            return None
        proof = Proof(tuple(Need(n, _about(node)) for n in needs))
        for need in needs:
            if self.data_nonnegative(need) is None:
                return None
        scalars = [a for a in node.args if isinstance(a, Expr) and not isinstance(a, Lambda)]
        signs = tuple(0 if isinstance(a, (Ranked, Lambda)) else self.sign(a) for a in node.args)
        directions = atom.monotone(node, signs) if scalars else ()
        inner_steps = Proof()
        for argument, direction in zip(node.args, directions, strict=False):
            if argument not in scalars or self.constant(argument) or self.affine(argument):
                continue
            part = self.curved(argument, goal * direction) if direction else None
            if part is None:
                return None
            inner_steps = inner_steps + part
        for condition in atom.domain(node):
            if self.positive(condition) is None:
                # a concave argument: the function is defined on a convex set
                if self.curved(condition, -1) is None:
                    return None
                proof = proof + Proof(domain=(condition,))
        how = (
            ""
            if not inner_steps.steps
            else f", {_direction(directions)} in {'its argument' if len(scalars) == 1 else 'its arguments'}"
        )
        return inner_steps + proof.step(f"{_shown(node)} is {word if curvature != 'affine' else 'affine'}{how}")


def one_variable(expression: Any, x: Any, require: Any) -> str:
    """ "affine", "convex", "concave" or "unknown" of a function of the scalar symbol x; `require` receives what has to be ≥ 0."""
    variable = ScalarVariable(x.name)
    body = expression.xreplace({x: variable})
    prover = Prover([variable])
    if prover.affine(body):
        return "affine"
    for goal, word in ((1, "convex"), (-1, "concave")):
        proof = prover.curved(body, goal)
        if proof is not None and not proof.domain and not any(n.strict for n in proof.needs):
            for need in proof.needs:
                require(need.expression)
            return word
    return "unknown"


def _with_absolute(node: Any) -> Any:
    """x² |x| as |x|³: sympy writes odd powers of |x| in the first way."""
    factors = dict(part.as_base_exp() for part in node.args)
    for base, exponent in list(factors.items()):
        if not isinstance(base, Maximum) or base.args[0] != -base.args[1]:
            continue
        for x in base.args:
            if x in factors and factors[x].is_even:
                factors[base] = exponent + factors.pop(x)
                return Mul(*(b**e for b, e in factors.items()))
    return node


def _about(node: Any) -> str:
    name = type(node).__name__
    return "norm" if name == "NormLeaf" else "weight"


def _direction(directions: Iterable[int]) -> str:
    found = set(directions)
    return "non-decreasing" if found == {1} else ("non-increasing" if found == {-1} else "monotone")


def _shown(expression: Any) -> str:
    text = str(expression)
    return text if len(text) <= 160 else text[:157] + "..."
