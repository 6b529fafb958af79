"""What has to hold for a law to be admissible, as questions: each knows its proof by rules and its search for a counter-example."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Add, Expr, Mul, Pow, S, Tuple, default_sort_key, simplify, sqrt

from ..atoms import atom_of
from ..atoms.atom import Invariant
from ..atoms.maximum import Maximum
from ..atoms.positive_part import PositivePart
from ..derivative import invariants_of
from ..extended import Extended
from ..invariants import (
    EigMaxLeaf,
    EigMinLeaf,
    EigSumLeaf,
    InnerLeaf,
    NormLeaf,
    PositiveSquareLeaf,
    PositiveTraceLeaf,
    TraceLeaf,
)
from ..law import Law
from ..ranked import Ranked
from ..scalars import ScalarVariable, Temperature
from ..tensor import TensorSymbol, identity
from ..vector import VectorSymbol
from .convexity import Proof, Prover
from .counterexample import CounterExample
from .exact import NotExact
from .search import Budget, Space, search_negative, search_not_convex, search_set

__all__ = ["Question", "at_zero", "questions_of"]

Values = dict[Any, Any]
"""Numbers of parameters, as exact sympy numbers for a proof, as floats for a search."""


@dataclass(frozen=True)
class Question:
    """`what` has to hold; `prove` looks for a proof with some parameters replaced by numbers, `refute` for a counter-example with all."""

    what: str
    potential: str
    prove: Callable[[Values], Proof | None]
    refute: Callable[[dict[Any, float], Any, Budget], CounterExample | None]
    wishes: Callable[[], list[Expr]] = list
    """What rules wanted non-negative on the way to a proof, found or not: parameters that a search should keep to."""


def questions_of(law: Law) -> list[Question]:
    """Questions in the order in which they are answered."""
    found = _density(law) + (_energy(law) if law.psi is not None else _conjugate_energy(law))
    potential, name = (law.phi, "phi") if law.phi is not None else (law.phi_star, "phi_star")
    if potential is not None:
        found += _force_function(potential, name)
    return found


# -- ψ ----------------------------------------------------------------------------------------------------------------------------


def _density(law: Law) -> list[Question]:
    density = law.density
    if density is None or density.is_positive:
        return []

    def prove(values: Values) -> Proof | None:
        return Prover([law.observable]).positive(density.xreplace(values))

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        return _value_at_zero(density, "density", [], values, lambda v: -v, "the density is not positive")

    return [Question("the density is positive", "psi", prove, refute)]


def _energy(law: Law) -> list[Question]:
    variables = [law.observable, *law.internal]
    psi: Expr = law.psi
    used = [v for v in variables if psi.has(v)]
    names = ", ".join(v.name for v in used)
    found = [_convex(psi, used, f"psi is convex in {names} together", "psi", 1)] if used else []
    if law.temperature is not None and psi.has(law.temperature):
        found.append(_convex(psi, [law.temperature], f"psi is concave in {law.temperature}", "psi", -1))
    return found


def _conjugate_energy(law: Law) -> list[Question]:
    psi_star, stress = law.psi_star, law.stress_symbol
    used = [v for v in law.internal if psi_star.has(v)]
    found = [_convex(psi_star, [stress], f"psi_star is convex in {stress}", "psi_star", 1)]
    if used:
        names = ", ".join(v.name for v in used)
        found.append(
            _convex(psi_star, used, f"psi_star is concave in {names} (psi convex in all together)", "psi_star", -1)
        )
    t = law.temperature
    if t is not None and psi_star.has(t):
        joint = _convex(
            psi_star, [stress, t], f"psi is concave in {t}: psi_star convex in {stress}, {t}", "psi_star", 1
        )
        # a supremum of functions that are convex in T is convex in T: where psi_star is not, psi is not concave
        alone = _convex(psi_star, [t], "", "psi_star", 1)
        found.append(Question(joint.what, joint.potential, joint.prove, alone.refute))
    return found


def _convex(
    expression: Expr, variables: Sequence[Any], what: str, name: str, goal: int, surfaces: Sequence[Expr] = ()
) -> Question:
    def prove(values: Values) -> Proof | None:
        return Prover(variables).curved(expression.xreplace(values), goal)

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        for data in _data(expression, variables, rng):
            found = search_not_convex(
                _space(variables, data, values, expression, *surfaces), expression, name, goal, surfaces, rng, budget
            )
            if found is not None or budget.over:
                return found
        return None

    def wishes() -> list[Expr]:
        prover = Prover(variables)
        prover.curved(expression, goal)
        return prover.asked

    return Question(what, name, prove, refute, wishes)


# -- φ* and φ ---------------------------------------------------------------------------------------------------------------------


def _force_function(potential: Extended, name: str) -> list[Question]:
    found: list[Question] = []
    role = "force" if name == "phi_star" else "rate"
    symbols = {
        s
        for f in potential.functions
        for s in f.atoms(TensorSymbol, VectorSymbol, ScalarVariable)
        if getattr(s, "role", "") == role
    }
    variables = sorted(symbols, key=default_sort_key)
    finite, surfaces = potential.finite, potential.surfaces
    if finite != 0:
        found.append(_convex(finite, variables, f"{name} is convex (its finite part)", name, 1, surfaces))
        found += [_zero(finite, variables, name), _nonnegative(finite, variables, name, surfaces)]
    for j, surface in enumerate(surfaces, start=1):
        which = "" if len(surfaces) == 1 else f" {j}"
        found.append(_sublevel(surface, variables, name, which, surfaces))
        found.append(_zero_inside(surface, variables, name, which))
    return found


def _zero(finite: Expr, variables: Sequence[Any], name: str) -> Question:
    value = at_zero(finite, variables)

    def prove(values: Values) -> Proof | None:
        found = _vanishes(Prover(variables), simplify(value.xreplace(values)))
        return None if found is None else found.step(f"{name} is zero at zero")

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        return _value_at_zero(finite, name, variables, values, abs, f"{name} is not zero at zero")

    return Question(f"{name} is zero at zero", name, prove, refute)


def _vanishes(prover: Prover, value: Any) -> Proof | None:
    """Data that is zero: sums of zeros, products with a zero, positive powers of it, ⟨x⟩ for x ≤ 0."""
    if value == 0:
        return Proof()
    if isinstance(value, Add):
        parts = [_vanishes(prover, p) for p in value.args]
        return None if None in parts else sum(parts, Proof())  # type: ignore[arg-type]
    if isinstance(value, Mul):
        return next((p for p in (_vanishes(prover, a) for a in value.args) if p is not None), None)
    if isinstance(value, Pow):
        base, order = _vanishes(prover, value.base), prover.positive(value.exp)
        return None if base is None or order is None else base + order
    if isinstance(value, PositivePart):
        return prover.data_nonnegative(-value.args[0], "zero")
    return None


def _nonnegative(finite: Expr, variables: Sequence[Any], name: str, surfaces: Sequence[Expr]) -> Question:
    def prove(values: Values) -> Proof | None:
        prover = Prover(variables)
        expression = finite.xreplace(values)
        proof = prover.nonnegative(expression)
        if proof is not None:
            return proof.step(f"{name} is not negative: no term of it is")
        curved, flat = prover.curved(expression, 1), _flat_at_zero(prover, expression, variables)
        zero = _vanishes(prover, simplify(at_zero(expression, variables)))
        if curved is None or flat is None or zero is None:
            return None
        return (curved + flat + zero).step(f"{name} is not negative: convex, and zero with a zero slope at zero")

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        for data in _data(Tuple(finite, *surfaces), variables, rng):
            found = search_negative(
                _space(variables, data, values, finite, *surfaces), finite, name, surfaces, rng, budget
            )
            if found is not None or budget.over:
                return found
        return None

    return Question(f"{name} is not negative", name, prove, refute)


def _flat_at_zero(prover: Prover, expression: Any, variables: Sequence[Any]) -> Proof | None:
    """The directional derivatives at zero are not negative: slopes of linear parts vanish, those of norms are not negative."""
    if expression.has(PositivePart, Maximum):
        return None
    leaves = [n for n in invariants_of(expression) if not prover.constant(n)]
    scalars = [v for v in variables if isinstance(v, ScalarVariable) and expression.has(v)]
    if any(at_zero(leaf, variables) != 0 for leaf in leaves):
        return None
    stand_in = {leaf: ScalarVariable(f"l{k}") for k, leaf in enumerate(leaves)}
    body = expression.xreplace(stand_in)
    zero = dict.fromkeys([*stand_in.values(), *scalars], S.Zero)
    proof = Proof()
    for generator in [*leaves, *scalars]:
        slope = simplify(body.diff(stand_in.get(generator, generator)).xreplace(zero))
        if slope.has(S.NaN, S.ComplexInfinity, S.Infinity):
            return None
        if slope == 0 or (isinstance(generator, Invariant) and atom_of(generator).degree(generator) == 2):
            continue
        part = None
        if isinstance(generator, Invariant) and atom_of(generator).sign(generator, (0,)) == 1:
            part = prover.data_nonnegative(slope)
        if part is None:
            return None
        proof = proof + part
    return proof


def _sublevel(surface: Expr, variables: Sequence[Any], name: str, which: str, surfaces: Sequence[Expr]) -> Question:
    def prove(values: Values) -> Proof | None:
        prover = Prover(variables)
        expression = surface.xreplace(values)
        return prover.curved(expression, 1) or _quasi(prover, expression)

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        for data in _data(Tuple(*surfaces), variables, rng):
            found = search_set(_space(variables, data, values, *surfaces), surfaces, name, rng, budget)
            if found is not None or budget.over:
                return found
        return None

    def wishes() -> list[Expr]:
        prover = Prover(variables)
        prover.curved(surface, 1)
        return [*prover.asked, -at_zero(surface, variables)]

    return Question(f"the set {{f{which} <= 0}} of {name} is convex", name, prove, refute, wishes)


def _quasi(prover: Prover, expression: Any) -> Proof | None:
    """{c uⁿ + k ≤ 0} with c > 0, 0 < n < 1, u ≥ 0 is {u ≤ const}: convex if u is."""
    moving = [t for t in prover.terms(expression) if not prover.constant(t)]
    if len(moving) != 1:
        return None
    weight, rest = prover.split(moving[0])
    if not isinstance(rest, Pow) or not prover.constant(rest.exp):
        return None
    data, positive = prover.data_nonnegative(weight), prover.nonnegative(rest.base)
    order, inside = prover.data_nonnegative(rest.exp), prover.curved(rest.base, 1)
    if data is None or positive is None or order is None or inside is None:
        return None
    return (data + order + positive + inside).step(f"{{{expression} <= 0}} is a level set of the convex {rest.base}")


def _zero_inside(surface: Expr, variables: Sequence[Any], name: str, which: str) -> Question:
    value = at_zero(surface, variables)

    def prove(values: Values) -> Proof | None:
        number: Any = simplify(-value.xreplace(values))
        if number.has(S.NaN, S.ComplexInfinity, S.Infinity, S.NegativeInfinity):
            return None
        found = Prover(variables).data_nonnegative(number, "zero")
        return None if found is None else found.step(f"f{which}(0) = {-number} <= 0: zero is in the domain of {name}")

    def refute(values: dict[Any, float], rng: Any, budget: Budget) -> CounterExample | None:
        return _value_at_zero(
            surface, f"f{which}", variables, values, lambda v: v, f"zero lies outside: f{which}(0) > 0"
        )

    return Question(f"zero is in {{f{which} <= 0}} of {name}", name, prove, refute)


def _value_at_zero(
    expression: Expr, name: str, variables: Sequence[Any], values: dict[Any, float], wrong: Any, rule: str
) -> CounterExample | None:
    for data in _data(expression, variables, None):
        space = _space(variables, data, values, expression)
        origin = [0.0] * space.dimension
        try:
            value = space.exact(expression, origin)
        except NotExact:
            return None
        if wrong(value) <= 1e-12:
            return None
        parameters = {s.name: float(v) for s, v in space.parameters.items()}
        shown = {str(s): v for s, v in data.items()}
        return CounterExample(
            rule, name, (space.named(origin),), (float(value),), float(wrong(value)), parameters, shown
        )
    return None


def _space(variables: Sequence[Any], data: dict[Any, Any], values: dict[Any, float], *expressions: Any) -> Space:
    return Space(variables, data, {p: v for p, v in values.items() if any(e.has(p) for e in expressions)})


# -- zero, data -------------------------------------------------------------------------------------------------------------------


def at_zero(expression: Any, variables: Sequence[Any]) -> Any:
    """Value with the variables put to zero."""
    if not expression.has(*variables) if variables else True:
        return expression
    if isinstance(expression, Ranked):
        kept = {a: c for a, c in expression.terms().items() if not a.has(*variables)}
        return expression.linear(kept.items())
    if isinstance(expression, ScalarVariable):
        return S.Zero if expression in variables else expression
    arguments = [at_zero(a, variables) for a in expression.args]
    spherical = _of_spheres(expression, arguments)
    if spherical is not None:
        return spherical
    if isinstance(expression, Invariant):
        ranked = [a for a in arguments if isinstance(a, Ranked)]
        degree = atom_of(expression).degree(expression)
        if degree is not None and degree.is_positive and any(not a.terms() for a in ranked):
            return S.Zero
    return expression.func(*arguments)


def _of_spheres(leaf: Any, arguments: list[Any]) -> Any:
    """Value of an invariant of multiples of the identity; None for anything else."""
    if not isinstance(leaf, Invariant):
        return None
    factors = []
    for argument in arguments:
        if isinstance(argument, Ranked):
            terms = argument.terms()
            if argument.rank != 2 or set(terms) - {identity}:
                return None
            factors.append(terms.get(identity, S.Zero))
    rule = _SPHERES.get(type(leaf))
    if rule is not None:
        return rule(*factors)
    if isinstance(leaf, EigSumLeaf):
        function: Any = arguments[0]
        return 3 * function.expr.xreplace({function.variables[0]: factors[0]})
    return None


_SPHERES: dict[type, Callable[..., Any]] = {
    TraceLeaf: lambda c: 3 * c,
    NormLeaf: lambda c: sqrt(3) * Maximum(c, -c),
    InnerLeaf: lambda c, d: 3 * c * d,
    EigMaxLeaf: lambda c: c,
    EigMinLeaf: lambda c: c,
    PositiveTraceLeaf: lambda c: 3 * PositivePart(c),
    PositiveSquareLeaf: lambda c: 3 * PositivePart(c) ** 2,
}


def _data(expression: Any, variables: Sequence[Any], rng: Any) -> list[dict[Any, Any]]:
    """Temperature and frozen state for a search: the virgin state, at a few temperatures; other state for ψ as a function of T."""
    mine = set(variables)
    symbols = {s for s in expression.atoms(ScalarVariable, TensorSymbol, VectorSymbol) if s not in mine}
    owners = {s.variable for s in expression.atoms(Ranked, ScalarVariable) if getattr(s, "role", "state") != "state"}
    symbols = {s for s in symbols if s.role == "frozen" or s not in owners or isinstance(s, Temperature)}
    if not symbols:
        return [{}]
    found = []
    for temperature in (300.0, 1.0, 1000.0):
        row: dict[Any, Any] = {}
        for s in sorted(symbols, key=default_sort_key):
            size = 1 if isinstance(s, ScalarVariable) else (6 if s.rank == 2 else 3)
            if isinstance(s, Temperature):
                row[s] = temperature
            elif s.role == "frozen" or rng is None:
                row[s] = 0.0 if size == 1 else [0.0] * size
            else:
                row[s] = float(rng.normal()) if size == 1 else [float(x) for x in rng.normal(size=size)]
        found.append(row)
    return found
