"""From a declared expression to a convex program: quadratic terms exactly, every other term through the conic form of its atoms.

A convex function F of a packed vector z (tensors in Mandel components) is taken apart as

    F(z) = ½ zᵀQz + gᵀz + c + Σ rest,

the quadratic part collected from the whole sum, so that it may be convex only together (a negative λ beside a positive bulk modulus),
and the rest written for cvxpy by the atoms. Roots and powers of quadratic forms are recognised as norms, and (Σ w_k |x_k|ⁿ)^(1/n) as a
gauge. Parameters, temperature and frozen state have numbers by then.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sympy import (
    Add,
    Dummy,
    Expr,
    Float,
    Integer,
    Lambda,
    Mul,
    Poly,
    PolynomialError,
    Pow,
    S,
    Symbol,
    exp,
    expand,
    expand_mul,
    log,
)

from ..errors import DeclarationError
from .atoms import atom_of
from .atoms.atom import Invariant
from .atoms.inner import InnerLeaf
from .atoms.norm import NormLeaf
from .atoms.trace import TraceLeaf
from .evaluate import evaluate
from .ranked import Ranked
from .tensor import Deviator, IdentityTensor

__all__ = ["Frame", "Quadratic", "conic_expression", "split", "weighted_term"]


@dataclass(frozen=True)
class Frame:
    """Where each variable stands in the packed vector z of length `size`, and the numbers of everything else.

    With `marked`, every auxiliary variable that stands for a convex or concave function is dressed so that cvxpy's rules see its
    curvature; without, it is bare, which is the same program with fewer unknowns.
    """

    places: Mapping[Any, int]
    size: int
    numbers: Mapping[Any, Any]
    marked: bool = False

    def substituted(self, expression: Expr) -> Expr:
        """The expression with scalar numbers put in; tensor-valued data stay symbols."""
        table = {s: Float(float(v), 17) for s, v in self.numbers.items() if isinstance(s, Symbol)}
        return expression.xreplace(table)

    def number(self, expression: Any) -> float:
        """Value of an expression without variables."""
        return float(evaluate(expression, self.numbers))

    def moves(self, thing: Any) -> bool:
        """True if a variable is in it."""
        return any(v in self.places for v in thing.atoms(Ranked, Symbol))

    def ranked(self, quantity: Ranked) -> tuple[Any, Any]:
        """(M, s) with components M z + s."""
        import numpy as np

        length = 6 if quantity.rank == 2 else 3
        identity = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        deviator = np.eye(6) - np.outer(identity, identity) / 3.0
        matrix, shift = np.zeros((length, self.size)), np.zeros(length)
        for atom, coefficient in quantity.terms().items():
            value = self.number(coefficient)
            base = atom.args[0] if isinstance(atom, Deviator) else atom
            operator = deviator if isinstance(atom, Deviator) else np.eye(length)
            if isinstance(atom, IdentityTensor):
                shift += value * identity
            elif base in self.places:
                start = self.places[base]
                matrix[:, start : start + length] += value * operator
            elif base in self.numbers:
                shift += value * (operator @ np.asarray(self.numbers[base], dtype=float).reshape(length))
            else:
                raise DeclarationError(f"'{quantity}' has no linear form")
        return matrix, shift


@dataclass(frozen=True)
class Quadratic:
    """½ zᵀQz + gᵀz + c."""

    Q: Any
    g: Any
    c: float

    @classmethod
    def zero(cls, size: int) -> Quadratic:
        import numpy as np

        return cls(np.zeros((size, size)), np.zeros(size), 0.0)

    def __add__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.Q + other.Q, self.g + other.g, self.c + other.c)

    def times(self, factor: float) -> Quadratic:
        return Quadratic(factor * self.Q, factor * self.g, factor * self.c)

    def as_square(self) -> tuple[Any, Any] | None:
        """(F, s) with the form equal to |F z + s|², or None where it is negative somewhere."""
        import numpy as np

        values, vectors = np.linalg.eigh(0.5 * (self.Q + self.Q.T))
        top = float(np.abs(values).max(initial=0.0))
        if top == 0.0 or values.min(initial=0.0) < -1e-12 * top:
            return None
        keep = values > 1e-12 * top
        slope = vectors.T @ self.g
        if np.abs(slope[~keep]).max(initial=0.0) > 1e-12 * max(float(np.abs(slope).max(initial=0.0)), 1e-300):
            return None
        # ½ Σ v (y + b/v)² + rest
        v, b = values[keep], slope[keep]
        rest = self.c - 0.5 * float((b * b / v).sum())
        if rest < -1e-12 * max(abs(self.c), 1e-300):
            return None
        factor = np.sqrt(0.5 * v)[:, None] * vectors[:, keep].T
        shift = np.sqrt(0.5 * v) * b / v
        if rest > 1e-12 * abs(self.c):
            factor, shift = np.vstack([factor, np.zeros(self.g.size)]), np.append(shift, np.sqrt(rest))
        return factor, shift


def _quadratic(expression: Expr, frame: Frame) -> Quadratic | None:
    """The expression as a polynomial of degree two in z, or None. Numbers are substituted already."""
    import numpy as np

    leaves = sorted((a for a in expression.atoms(Invariant) if frame.moves(a)), key=str)
    scalars = sorted((s for s in expression.atoms(Symbol) if s in frame.places), key=str)
    if any(not isinstance(leaf, (TraceLeaf, InnerLeaf, NormLeaf)) for leaf in leaves):
        return None
    generators = [*leaves, *scalars]
    if not generators:
        return Quadratic.zero(frame.size) + Quadratic(0.0, 0.0, frame.number(expression))
    dummies = [Dummy(f"g{i}", real=True) for i in range(len(generators))]
    body = expression.xreplace(dict(zip(leaves, dummies, strict=False)))
    body = body.xreplace(dict(zip(scalars, dummies[len(leaves) :], strict=True)))
    try:
        terms = Poly(expand(body), *dummies).terms()
    except PolynomialError:
        return None
    total = Quadratic.zero(frame.size)
    for powers, coefficient in terms:
        present = [(generators[i], k) for i, k in enumerate(powers) if k]
        degree = sum(k * (2 if isinstance(x, InnerLeaf) else 1) for x, k in present)
        if degree > 2 or any(isinstance(x, NormLeaf) and k != 2 for x, k in present):
            return None
        weight = frame.number(coefficient)
        if not present:
            total = total + Quadratic(0.0, 0.0, weight)
        elif isinstance(present[0][0], (InnerLeaf, NormLeaf)):
            leaf = present[0][0]
            (a, s), (b, t) = frame.ranked(leaf.args[0]), frame.ranked(leaf.args[-1])
            mixed = a.T @ b
            total = total + Quadratic(mixed + mixed.T, a.T @ t + b.T @ s, float(s @ t)).times(weight)
        else:
            rows = [_row(x, frame) for x, k in present for _ in range(k)]
            if len(rows) == 1:
                total = total + Quadratic(0.0, weight * rows[0][0], weight * rows[0][1])
            else:
                (a, s), (b, t) = rows
                mixed = np.outer(a, b)
                total = total + Quadratic(mixed + mixed.T, s * b + t * a, s * t).times(weight)
    return total


def _row(thing: Any, frame: Frame) -> tuple[Any, float]:
    """(r, s) with thing = r·z + s, for a trace or a scalar variable."""
    import numpy as np

    if isinstance(thing, TraceLeaf):
        matrix, shift = frame.ranked(thing.args[0])  # type: ignore[arg-type]
        return matrix[:3].sum(axis=0), float(shift[:3].sum())
    row = np.zeros(frame.size)
    row[frame.places[thing]] = 1.0
    return row, 0.0


def split(expression: Expr, frame: Frame) -> tuple[Quadratic, list[tuple[float, Expr]]]:
    """Quadratic part and the remaining terms (weight, term) of a sum, with numbers substituted."""
    total, rest = Quadratic.zero(frame.size), []
    for weight, term in _terms(frame.substituted(expression), frame):
        found = _quadratic(term, frame)
        if found is None:
            rest.append((weight, term))
        else:
            total = total + found.times(weight)
    return total, rest


def _terms(expression: Expr, frame: Frame) -> list[tuple[float, Expr]]:
    """Additive terms with their numerical factors; a number times a sum is multiplied out."""
    found: list[tuple[float, Expr]] = []
    for term in Add.make_args(expression):
        fixed = [f for f in Mul.make_args(term) if not frame.moves(f)]
        moving = [f for f in Mul.make_args(term) if frame.moves(f)]
        weight = frame.number(Mul(*fixed))
        if not moving:
            found.append((weight, S.One))
        elif len(moving) == 1 and isinstance(moving[0], Add):
            found += [(weight * w, t) for w, t in _terms(moving[0], frame)]
        elif (opened := expand_mul(Mul(*moving))).is_Add:
            # x (xⁿ + c) is a sum of powers of x
            found += [(weight * w, t) for w, t in _terms(opened, frame)]
        else:
            found.append((weight, Mul(*moving)))
    return found


def conic_expression(expression: Expr, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    """cvxpy expression of `expression` at z (numbers substituted); auxiliary constraints are appended.

    Raises `DeclarationError` that names the term without a conic form.
    """
    quadratic, rest = split(expression, frame)
    total = quadratic_expression(quadratic, z, str(expression))
    for weight, term in rest:
        total = total + weighted_term(weight, term, frame, z, constraints)
    return total


def weighted_term(
    weight: float, term: Expr, frame: Frame, z: Any, constraints: list[Any], *, inside: bool = True
) -> Any:
    """weight · term. The weight of a convex power goes `inside`, w xⁿ = (w^(1/n) x)ⁿ, so that the cone's entries are of one size; where the
    program is dualised it stays outside, unless it is extreme, so that the multipliers keep the unit of the rates."""
    if isinstance(term, Pow) and weight > 0.0 and not frame.moves(term.exp):
        exponent = frame.number(term.exp)
        if exponent > 1.0 and exponent != 2.0 and (inside or not 1e-12 < weight < 1e12):
            return _node(
                Pow(Float(weight ** (1.0 / exponent), 17) * term.base, term.exp, evaluate=False), frame, z, constraints
            )
    return weight * _node(term, frame, z, constraints)


def quadratic_expression(quadratic: Quadratic, z: Any, shown: str) -> Any:
    """cvxpy expression of a convex or concave quadratic form."""
    import cvxpy
    import numpy as np

    linear = quadratic.g @ z + quadratic.c
    values, vectors = np.linalg.eigh(0.5 * (quadratic.Q + quadratic.Q.T))
    top = float(np.abs(values).max(initial=0.0))
    if top == 0.0:
        return linear
    keep = np.abs(values) > 1e-14 * top
    sign = 1.0 if values[np.abs(values).argmax()] > 0.0 else -1.0
    if (sign * values[keep] < -1e-12 * top).any():
        raise DeclarationError(f"{shown} is neither convex nor concave: it is a quadratic form with both curvatures")
    factor = np.sqrt(0.5 * np.abs(values[keep]))[:, None] * vectors[:, keep].T
    return sign * cvxpy.sum_squares(factor @ z) + linear


def _node(node: Expr, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    """cvxpy expression of one node that is neither a sum nor quadratic."""
    import cvxpy

    if not frame.moves(node):
        return frame.number(node)
    if node in frame.places:
        return z[frame.places[node]]
    before = len(constraints)
    found, curvature = _special(node, frame, z, constraints), "convex"
    if found is None:
        arguments = tuple(_argument(a, frame, z, constraints) for a in node.args)
        try:
            found = atom_of(node).conic(node, arguments, constraints)
        except DeclarationError as error:
            raise DeclarationError(f"{node} has no conic form: {error}") from None
        curvature = atom_of(node).curvature(node, lambda _: None)
    if frame.marked and len(constraints) > before:
        nonnegative = curvature == "convex" and atom_of(node).sign(node, (1,) * len(node.args)) == 1
        found = (cvxpy.min if curvature == "concave" else cvxpy.max)(cvxpy.hstack([found]))
        found = cvxpy.maximum(found, 0.0) if nonnegative else found
    return found


def _special(node: Expr, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    """Convex forms of several nodes together: norms and gauges, x log x, log Σ exp; None for everything else."""
    import cvxpy

    if isinstance(node, Pow):
        return _power(node, frame, z, constraints)
    if isinstance(node, Mul):
        logs = [f for f in node.args if isinstance(f, log)]
        if len(node.args) == 2 and len(logs) == 1:
            x = next(f for f in node.args if f is not logs[0])
            factor = logs[0].args[0] / x
            if not frame.moves(factor):
                inside = _argument(x, frame, z, constraints)
                return -cvxpy.entr(inside) + frame.number(log(factor)) * inside
        raise DeclarationError(f"{node} has no conic form: it is a product of variables")
    if isinstance(node, log) and isinstance(node.args[0], Add):
        terms = _terms(node.args[0], frame)
        if all(w > 0.0 and (isinstance(t, exp) or not frame.moves(t)) for w, t in terms):
            exponents = [
                frame.number(log(w * t))
                if not frame.moves(t)
                else _argument(t.args[0], frame, z, constraints) + frame.number(log(w))
                for w, t in terms
            ]
            return cvxpy.log_sum_exp(cvxpy.hstack(exponents))
    return None


def _argument(argument: Any, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    if isinstance(argument, Lambda):
        return argument
    if isinstance(argument, Ranked):
        matrix, shift = frame.ranked(argument)
        return matrix @ z + shift
    return conic_expression(argument, frame, z, constraints) if frame.moves(argument) else frame.number(argument)


def _power(node: Pow, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    """Powers of a quadratic form, by its norm, and gauges (Σ w |x|ⁿ)^(1/n); None for other powers."""
    import cvxpy

    if frame.moves(node.exp):
        raise DeclarationError(f"{node} has no conic form: its exponent depends on a variable")
    exponent = frame.number(node.exp)
    if exponent < 0.5:
        return None if not isinstance(node.base, Add) else _gauge(node.base, exponent, frame, z, constraints)
    form = _quadratic(node.base, frame)
    square = None if form is None or not form.Q.any() else form.as_square()
    if square is None:
        gauge = isinstance(node.base, Add) and exponent < 1.0
        return _gauge(node.base, exponent, frame, z, constraints) if gauge else None
    length = cvxpy.norm2(square[0] @ z + square[1])
    if exponent == 0.5:
        return length
    power = Pow(
        Dummy("r"), Float(2.0 * exponent) if 2.0 * exponent != int(2.0 * exponent) else Integer(round(2.0 * exponent))
    )
    return atom_of(power).conic(power, (length, 2.0 * exponent), constraints)


def _gauge(base: Expr, exponent: float, frame: Frame, z: Any, constraints: list[Any]) -> Any:
    """(Σ w_k x_k^n)^(1/n), n = 1/exponent, with x_k convex and non-negative, or affine with n even: a norm of degree n."""
    import cvxpy

    n = 1.0 / exponent
    parts: list[tuple[float, Any]] = []
    for weight, term in _terms(base, frame):
        if weight < 0.0:
            return None
        form = _quadratic(term, frame)
        square = None if form is None or not form.Q.any() else form.as_square()
        if square is not None and n == 2.0:
            parts += [(weight**0.5, (square[0] @ z + square[1])[i]) for i in range(len(square[1]))]
        elif isinstance(term, Pow) and frame.number(term.exp) == n:
            parts.append((weight**exponent, _argument(term.base, frame, z, constraints)))
        elif isinstance(term, Pow) and (root := _quadratic(term.base, frame)) and 2.0 * frame.number(term.exp) == n:
            inside = root.as_square()
            if inside is None:
                return None
            parts.append((weight**exponent, cvxpy.norm2(inside[0] @ z + inside[1])))
        elif not frame.moves(term):
            parts.append(((weight * frame.number(term)) ** exponent, cvxpy.Constant(1.0)))
        else:
            return None
    if n == 2.0 and all(part.is_affine() or part.is_nonneg() for _, part in parts):
        sides = []
        for weight, part in parts:
            side = weight * part
            if not part.is_affine():
                side = cvxpy.Variable()
                constraints.append(side >= weight * part)
            sides.append(side)
        return cvxpy.norm2(cvxpy.hstack(sides))
    top = cvxpy.Variable()
    shares = []
    for weight, part in parts:
        if not (part.is_affine() or part.is_nonneg()):
            return None
        inside, share = cvxpy.Variable(), cvxpy.Variable()
        constraints.append(inside == weight * part if part.is_affine() else inside >= weight * part)
        if part.is_affine() and not part.is_nonneg() and n % 2.0:
            # an odd power of a signed quantity is not convex; it is met only where the quantity is non-negative
            constraints.append(inside >= 0)
        constraints.append(cvxpy.PowCone3D(share, top, inside, 1.0 / n))
        shares.append(share)
    constraints.append(sum(shares) <= top)
    return top
