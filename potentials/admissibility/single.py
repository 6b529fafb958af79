"""Functions of one scalar: convex where the second derivative is not negative, exactly.

A polynomial with numbers as coefficients is decided by its real roots of odd order (Sturm), anything else by the signs of the factors of
the second derivative. The scalar may be a variable or one trace.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy import Expr, Poly, PolynomialError, Pow, S, factor, log, simplify, together

from ..atoms import ATOMS
from ..atoms.atom import Invariant
from ..atoms.maximum import Maximum
from ..atoms.positive_part import PositivePart, Step
from ..atoms.trace import TraceLeaf
from ..scalars import ScalarVariable, Temperature

if TYPE_CHECKING:
    from .convexity import Proof, Prover

__all__ = ["convex_by_second_derivative", "nonnegative_polynomial"]


def convex_by_second_derivative(prover: Prover, expression: Any, goal: int) -> Proof | None:
    """Proof that goal·expression is convex if it depends on one scalar only and its second derivative has a sign there; of a
    convex non-negative atom, as a norm, also its first derivative must not be negative at zero."""
    variable = _only_argument(prover, expression)
    if variable is None or expression.has(PositivePart, Maximum, Step):
        return None
    from .convexity import Proof, Prover

    outer = isinstance(variable, Invariant) and not isinstance(variable, TraceLeaf)
    positive = outer or isinstance(variable, Temperature)
    stand_in: Any = Temperature("x") if positive else ScalarVariable("x")
    body = expression.xreplace({variable: stand_in})
    domain: tuple[Expr, ...] = ()
    if not positive and any(_open_to_the_right(node, stand_in) for node in body.atoms(log)):
        # log x is defined for x > 0 only: the same as if x were a temperature
        positive, domain = True, (variable,)
        body, stand_in = body.xreplace({stand_in: Temperature("x")}), Temperature("x")
    second = goal * body.diff(stand_in, 2)
    if second.has(Step):
        return None
    inner = Prover([stand_in])
    if not _defined(inner, body):
        return None
    proof = _not_negative(inner, second, stand_in, positive)
    if proof is None:
        return None
    shown = factor(together(goal * second)).xreplace({stand_in: variable})
    word = "convex" if goal > 0 else "concave"
    where = f" for {variable} > 0" if positive and not outer else ""
    how = f"its second derivative is {shown}"
    if outer:
        rising = _rising_from_zero(inner, goal * body.diff(stand_in), stand_in)
        inside = prover.curved(variable, 1)
        if rising is None or inside is None:
            return None
        proof = inside + proof + rising
        how = f"a convex function, rising from zero on, of {variable}, which is convex and not negative"
    return Proof(proof.needs, (*proof.steps, f"{expression} is {word}{where}: {how}"), domain)


def _defined(prover: Prover, body: Any) -> bool:
    """True if powers and logarithms in it are defined wherever its scalar may be."""
    for node in body.atoms(Pow, log):
        base = node.args[0]
        whole = isinstance(node, Pow) and node.exp.is_integer
        if prover.constant(base) or (whole and node.exp.is_nonnegative):
            continue
        root = isinstance(node, Pow) and not whole and prover.positive(node.exp) is not None
        if (prover.nonnegative(base) if root else prover.positive(base)) is None:
            return False
    return True


def _not_negative(prover: Prover, second: Any, x: Any, half_line: bool) -> Proof | None:
    from .convexity import Proof

    found = _polynomial(second, x, half_line)
    if found is not None:
        return Proof() if found else None
    for form in (lambda: second, lambda: factor(together(second)), lambda: factor(simplify(second))):
        proof = prover.nonnegative(form())
        if proof is not None:
            return proof
    return None


def _rising_from_zero(prover: Prover, slope: Any, x: Any) -> Proof | None:
    """The slope at zero is not negative, so that a convex function rises everywhere on the right."""
    at_zero = simplify(slope.xreplace({x: S.Zero}))
    if at_zero.has(S.NaN, S.ComplexInfinity, S.Infinity, S.NegativeInfinity):
        return None
    return prover.data_nonnegative(at_zero)


def _open_to_the_right(node: Any, x: Any) -> bool:
    """True for log(c x) with c > 0 data."""
    quotient = node.args[0] / x
    return not quotient.has(x) and bool(quotient.is_positive)


def _only_argument(prover: Prover, expression: Any) -> Any:
    """The one scalar, trace, or convex non-negative atom that the expression depends on through, or None."""
    leaves = {n for n in expression.atoms(Invariant) if not prover.constant(n)}
    scalars = {v for v in prover.variables if isinstance(v, ScalarVariable) and expression.has(v)}
    if len(leaves) + len(scalars) != 1:
        return None
    (one,) = leaves | scalars
    if isinstance(one, (TraceLeaf, ScalarVariable)):
        return one
    record = ATOMS[type(one)]
    outer = record.curvature(one, lambda _: None) == "convex" and record.sign(one, (0,) * len(one.args)) == 1
    return one if outer and expression != one else None


def _polynomial(expression: Any, x: Any, half_line: bool) -> bool | None:
    """Sign of a polynomial with rational coefficients, decided exactly; None if it is none."""
    try:
        found = Poly(expression, x)
    except PolynomialError:
        return None
    if not all(c.is_Rational for c in found.all_coeffs()):
        return None
    return nonnegative_polynomial(found, half_line)


def nonnegative_polynomial(polynomial: Poly, half_line: bool = False) -> bool:
    """True if a polynomial with rational coefficients is nowhere negative on the line, or on x > 0: no real root of odd order there."""
    if polynomial.is_zero:
        return True
    if polynomial.LC() < 0 or (not half_line and polynomial.degree() % 2):
        return False
    _, factors = polynomial.sqf_list()
    return all(
        part.count_roots(S.Zero if half_line else None, None) - _at_zero(part, half_line) == 0
        for part, n in factors
        if n % 2
    )


def _at_zero(part: Poly, half_line: bool) -> int:
    """1 if zero is a root, which the open half line does not hold."""
    return int(half_line and part.eval(0) == 0)
