"""Every rule of conjugation against a supremum that is computed apart: cvxpy programs and scalar searches written by hand here.

Beside the values: the Fenchel inequality and equality, F** = F, and +∞ exactly where the supremum is unbounded.
"""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Abs, Max, Rational, exp, log, sqrt

from fenchel.potentials import (
    dev,
    eig_max,
    eig_min,
    eig_sum,
    identity,
    indicator,
    inner,
    norm,
    parameter,
    pos,
    scalar,
    sym_tensor,
    total_conjugate,
    tr,
    vector,
)
from fenchel.potentials.atoms import atom_of
from fenchel.potentials.derivative import partial
from fenchel.potentials.evaluate import evaluate
from fenchel.potentials.extended import as_extended

a, b, c, n = (parameter(name, lower=0) for name in ("a", "b", "c", "n"))
NUMBERS = {a: 1.3, b: 0.7, c: 2.1, n: 2.5}
A, B, C, N = NUMBERS.values()
x, x_1, x_2 = (sym_tensor(name) for name in ("x", "x_1", "x_2"))
p, r, v = scalar("p"), scalar("r"), vector("v")
I6 = np.array([1.0, 1, 1, 0, 0, 0])
DEV = np.eye(6) - np.outer(I6, I6) / 3
COUPLED = np.block(
    [
        [np.eye(6), np.eye(6) / 4, I6[:, None] / 2],
        [np.eye(6) / 4, A * np.eye(6), np.zeros((6, 1))],
        [I6[None] / 2, np.zeros((1, 6)), 3.0],
    ]
)


def length(symbol):
    return 1 if symbol in (p, r) else 3 if symbol is v else 6


# -- the same functions by hand, over cvxpy variables; (objective, constraints) ------------------------------------------------------


def trace(X):
    return I6 @ X


def sq(X):
    return cp.sum_squares(X)


def matrix(X):
    h = np.sqrt(0.5)
    rows = [[X[0], h * X[5], h * X[4]], [h * X[5], X[1], h * X[3]], [h * X[4], h * X[3], X[2]]]
    return cp.bmat(rows)


def plus(X, function):
    """`function` of the positive part P of X, increasing in P ⪰ 0: the least one over P ⪰ X, P ⪰ 0."""
    P = cp.Variable(6)
    return function(P), [matrix(P) - matrix(X) >> 0, matrix(P) >> 0]


def largest(X):
    return cp.lambda_max(matrix(X))


def smallest(X):
    return cp.lambda_min(matrix(X))


def held(f, *more):
    return 0, [f <= 0, *(g <= 0 for g in more)]


CASES = {
    # quadratic forms
    "three tensors": (
        c / 2 * tr(x - x_1 - x_2) ** 2 + a * inner(dev(x - x_1 - x_2), dev(x - x_1 - x_2)),
        (x, x_1, x_2),
        lambda X, Y, Z: C / 2 * trace(X - Y - Z) ** 2 + A * sq(DEV @ (X - Y - Z)),
    ),
    "tensors and scalar": (
        inner(x, x) + a * inner(x_1, x_1) + inner(x, x_1) / 2 + p * tr(x) + 3 * p**2,
        (x, x_1, p),
        lambda X, Y, s: cp.quad_form(cp.hstack([X, Y, s]), COUPLED),
    ),
    "deviatoric": (a * inner(dev(x), dev(x)), (x,), lambda X: A * sq(DEV @ X)),
    "spherical": (a * tr(x) ** 2, (x,), lambda X: A * trace(X) ** 2),
    "tilted": (
        a * inner(x, x) + b * tr(x) - c * p + p**2,
        (x, p),
        lambda X, s: A * sq(X) + B * trace(X) - C * s + s**2,
    ),
    # one scalar
    "even power": (a * p**4, (p,), lambda s: A * cp.power(s, 4)),
    "positive power": (
        a * pos(p - b) ** n + c * pos(b - p) ** 2,
        (p,),
        lambda s: A * cp.power(cp.pos(s - B), N) + C * cp.square(cp.pos(B - s)),
    ),
    "modulus and square": (a * Abs(p) + b * p**2, (p,), lambda s: A * cp.abs(s) + B * s**2),
    "positive part": (a * pos(p), (p,), lambda s: A * cp.pos(s)),
    "exponential": (a * exp(b * p - c), (p,), lambda s: A * cp.exp(B * s - C)),
    "entropy": (a * p * log(p / b), (p,), lambda s: -A * cp.entr(s) - A * np.log(B) * s),
    "logarithm": (-a * log(b * p + c), (p,), lambda s: -A * cp.log(B * s + C)),
    "inverse": (a / p, (p,), lambda s: A * cp.inv_pos(s)),
    "root": (-a * sqrt(p), (p,), lambda s: -A * cp.sqrt(s)),
    "scalar of a trace": (
        a * exp(tr(x) / b) + c * inner(dev(x), dev(x)),
        (x,),
        lambda X: A * cp.exp(trace(X) / B) + C * sq(DEV @ X),
    ),
    "two moduli": (
        c / 2 * tr(x) ** 2 + a * pos(tr(x)) ** 2 + b * inner(dev(x), dev(x)),
        (x,),
        lambda X: C / 2 * trace(X) ** 2 + A * cp.square(cp.pos(trace(X))) + B * sq(DEV @ X),
    ),
    "a combination of scalars": (
        a * exp(p - 2 * r) + p**2,
        (p, r),
        lambda s, t: A * cp.exp(s - 2 * t) + s**2,
    ),
    # norms
    "norm": (a * norm(x), (x,), lambda X: A * cp.norm(X)),
    "norm of a vector": (a * inner(v, v) + b * norm(v), (v,), lambda V: A * sq(V) + B * cp.norm(V)),
    "norm of a deviator": (a * norm(dev(x)), (x,), lambda X: A * cp.norm(DEV @ X)),
    "norm translated": (a * norm(x - b * identity), (x,), lambda X: A * cp.norm(X - B * I6)),
    "norm of a sum": (
        a * norm(x + 2 * x_1) + inner(x, x),
        (x, x_1),
        lambda X, Y: A * cp.norm(X + 2 * Y) + sq(X),
    ),
    "power of a norm": (
        a * norm(dev(x)) ** n + b * tr(x) ** 2,
        (x,),
        lambda X: A * cp.power(cp.norm(DEV @ X), N) + B * trace(X) ** 2,
    ),
    "gauge": (
        c * sqrt(inner(dev(x), dev(x)) + a * tr(x) ** 2),
        (x,),
        lambda X: C * cp.norm(cp.hstack([DEV @ X, np.sqrt(A) * trace(X)])),
    ),
    "power of a quadratic form": (
        (3 * inner(dev(x), dev(x)) + p**2) ** 2 + tr(x) ** 2,
        (x, p),
        lambda X, s: cp.power(cp.norm(cp.hstack([np.sqrt(3) * DEV @ X, s])), 4) + trace(X) ** 2,
    ),
    "hyperbola": (
        a * sqrt(inner(dev(x), dev(x)) + b**2) + tr(x) ** 2,
        (x,),
        lambda X: A * cp.norm(cp.hstack([DEV @ X, B])) + trace(X) ** 2,
    ),
    # eigenvalues
    "largest eigenvalue": (a * eig_max(x), (x,), lambda X: A * largest(X)),
    "smallest eigenvalue": (-a * eig_min(x), (x,), lambda X: -A * smallest(X)),
    "Tresca": (a * eig_max(x) - b * eig_min(x), (x,), lambda X: A * largest(X) - B * smallest(X)),
    "eigenvalue of a deviator": (
        a * eig_max(dev(x)),
        (x,),
        lambda X: A * cp.lambda_max(matrix(DEV @ X)),
    ),
    "positive trace and square": (
        a * tr(pos(x)) + b * inner(pos(x), pos(x)),
        (x,),
        lambda X: plus(X, lambda P: A * trace(P) + B * sq(P)),
    ),
    "square and positive square": (
        a * inner(x, x) + b * inner(pos(x), pos(x)),
        (x,),
        lambda X: plus(X, lambda P: A * sq(X) + B * sq(P)),
    ),
    "unilateral": (
        c / 2 * pos(tr(x)) ** 2 + a * inner(pos(x), pos(x)),
        (x,),
        lambda X: plus(X, lambda P: C / 2 * cp.square(cp.pos(trace(X))) + A * sq(P)),
    ),
    # compositions
    "scaling, dilation, translation": (
        2 * (a * norm(x / 3 - identity) ** 2 + b * norm(x / 3 - identity)),
        (x,),
        lambda X: 2 * (A * sq(X / 3 - I6) + B * cp.norm(X / 3 - I6)),
    ),
    "overstress": (
        b * pos(norm(dev(x)) + a * tr(x) - c) ** 2,
        (x,),
        lambda X: B * cp.square(cp.pos(cp.norm(DEV @ X) + A * trace(X) - C)),
    ),
    "overstress with hardening": (
        b * pos(norm(dev(x)) + a * tr(x) + p - c) ** n,
        (x, p),
        lambda X, s: B * cp.power(cp.pos(cp.norm(DEV @ X) + A * trace(X) + s - C), N),
    ),
    "exponential of a norm": (exp(norm(x)) - 1, (x,), lambda X: cp.exp(cp.norm(X)) - 1),
    "maximum": (
        Max(norm(x) - a, b * tr(x), p) + p**2,
        (x, p),
        lambda X, s: cp.max(cp.hstack([cp.norm(X) - A, B * trace(X), s])) + s**2,
    ),
    # indicators
    "ball": (indicator(norm(x) - a), (x,), lambda X: held(cp.norm(X) - A)),
    "ball by its square": (indicator(inner(x, x) - a), (x,), lambda X: held(sq(X) - A)),
    "cylinder": (indicator(norm(dev(x)) - a), (x,), lambda X: held(cp.norm(DEV @ X) - A)),
    "half-space": (indicator(tr(x) - a), (x,), lambda X: held(trace(X) - A)),
    "Drucker–Prager with apex": (
        indicator(norm(dev(x)) / sqrt(2) + a * tr(x) - b),
        (x,),
        lambda X: held(cp.norm(DEV @ X) / np.sqrt(2) + A * trace(X) - B),
    ),
    "Drucker–Prager with hardening": (
        indicator(norm(dev(x + x_1)) / sqrt(2) + a * tr(x + x_1) + p - b),
        (x, x_1, p),
        lambda X, Y, s: held(cp.norm(DEV @ (X + Y)) / np.sqrt(2) + A * trace(X + Y) + s - B),
    ),
    "Tresca set": (
        indicator(eig_max(x) - eig_min(x) - a),
        (x,),
        lambda X: held(largest(X) - smallest(X) - A),
    ),
    "interval of eigenvalues": (
        indicator(eig_max(x) - a, -eig_min(x) - b),
        (x,),
        lambda X: held(largest(X) - A, -smallest(X) - B),
    ),
    "two surfaces": (
        indicator(norm(dev(x)) - a, tr(x) - b, -tr(x) - c),
        (x,),
        lambda X: held(cp.norm(DEV @ X) - A, trace(X) - B, -trace(X) - C),
    ),
    "cap": (
        indicator(sqrt(inner(dev(x), dev(x)) / 2 + a**2 * pos(-tr(x) / 3 - b) ** 2) - c),
        (x,),
        lambda X: held(cp.norm(cp.hstack([cp.norm(DEV @ X) / np.sqrt(2), A * cp.pos(-trace(X) / 3 - B)])) - C),
    ),
    "ellipse with hardening": (
        indicator(sqrt(Rational(3, 2) / a**2 * inner(dev(x), dev(x)) + (tr(x) / 3 + b - p) ** 2) + p - b),
        (x, p),
        lambda X, s: held(cp.norm(cp.hstack([np.sqrt(1.5) / A * DEV @ X, trace(X) / 3 + B - s])) + s - B),
    ),
    "indicator and quadratic form": (
        indicator(norm(dev(x)) - a) + c * tr(x) ** 2,
        (x,),
        lambda X: (C * trace(X) ** 2, [cp.norm(DEV @ X) <= A]),
    ),
    # minima that stay minima
    "parallel phases": (
        b * pos(tr(x)) ** 2 + a * inner(pos(x), pos(x)) + inner(x - b * identity, x - b * identity),
        (x,),
        lambda X: plus(X, lambda P: B * cp.square(cp.pos(trace(X))) + A * sq(P) + sq(X - B * I6)),
    ),
    "smooth sum of one scalar": (
        a * exp(tr(x) / b) + c * inner(x, x),
        (x,),
        lambda X: A * cp.exp(trace(X) / B) + C * sq(X),
    ),
    "two functions of one scalar": (
        a * exp(p) + b * pos(p) ** 2 - c * p,
        (p,),
        lambda s: A * cp.exp(s) + B * cp.square(cp.pos(s)) - C * s,
    ),
    "extreme and all eigenvalues": (
        a * eig_max(x) + b * inner(pos(x), pos(x)) + inner(x, x),
        (x,),
        lambda X: plus(X, lambda P: A * largest(X) + B * sq(P) + sq(X)),
    ),
    "two cones": (
        indicator(norm(dev(x)) + tr(x) - a, eig_max(x) - b),
        (x,),
        lambda X: held(cp.norm(DEV @ X) + trace(X) - A, largest(X) - B),
    ),
}
OPEN = {
    "two functions of one scalar",
    "extreme and all eigenvalues",
    "maximum",
    "parallel phases",
    "smooth sum of one scalar",
    "two cones",
}


def supremum(by_hand, duals):
    """sup over x of y·x − F(x), by a cone program; +∞ if it is unbounded."""
    variables = [cp.Variable(len(y)) for y in duals]
    arguments = [z if z.size > 1 else z[0] for z in variables]
    found = by_hand(*arguments)
    value, rows = found if isinstance(found, tuple) else (found, [])
    work = sum(y @ z for y, z in zip(duals, variables, strict=True))
    problem = cp.Problem(cp.Maximize(work - value), rows)
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-9, tol_feas=1e-9)
    return np.inf if problem.status.startswith("unbounded") else float(problem.value)


def random_point(slots, rng, potential):
    """A point where F is finite (x > 0 for the functions that ask for it)."""
    for _ in range(1000):
        scale = rng.choice([0.1, 0.5, 1.5])
        point = {s: scale * rng.normal(size=length(s)) for s in slots}
        point = {s: y if length(s) > 1 else (abs(y[0]) + 0.05 if slots == (p,) else y[0]) for s, y in point.items()}
        if all(evaluate(f, {**NUMBERS, **point}) <= 0 for f in potential.surfaces):
            return point
    raise AssertionError("no point of the domain was found")


def slope(potential, slots, point, rng):
    """An element of ∂F, with multiples of the gradients of surfaces, which is one if the surface passes through the point."""
    table = {**NUMBERS, **point}
    found = {}
    weights = [abs(rng.normal()) for _ in potential.surfaces]
    for s in slots:
        y = np.zeros(length(s)) if length(s) > 1 else 0.0
        if potential.finite != 0:
            y = y + evaluate(partial(potential.finite, s), table)
        for w, f in zip(weights, potential.surfaces, strict=True):
            y = y + w * evaluate(partial(f, s), table)
        found[s] = y
    return found


def value_of(conjugate, duals):
    return float(conjugate.value({**NUMBERS, **{conjugate.duals[s]: y for s, y in duals.items()}}))


@pytest.mark.parametrize("name", CASES)
def test_the_rule_gives_the_supremum(name):
    expression, slots, by_hand = CASES[name]
    rng = np.random.default_rng(7)
    potential, conjugate = as_extended(expression, name), total_conjugate(expression, *slots)
    assert conjugate.closed is (name not in OPEN), conjugate.text()
    assert conjugate.rules
    finite = 0
    for k in range(4):
        point = random_point(slots, rng, potential)
        # inside the range of the gradient, and anywhere
        duals = slope(potential, slots, point, rng) if k < 3 else {s: 2 * rng.normal(size=length(s)) for s in slots}
        duals = {s: y if length(s) > 1 else float(np.ravel(y)[0]) for s, y in duals.items()}
        expected = supremum(by_hand, [np.atleast_1d(duals[s]) for s in slots])
        found = value_of(conjugate, duals)
        assert found == pytest.approx(expected, rel=2e-6, abs=2e-6)
        finite += np.isfinite(expected)
    assert finite >= 3


@pytest.mark.parametrize("name", [name for name in CASES if name not in OPEN])
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_fenchel_inequality_and_equality(name, seed):
    expression, slots, _ = CASES[name]
    rng = np.random.default_rng(seed)
    potential, conjugate = as_extended(expression, name), closed(name)
    point, other = random_point(slots, rng, potential), random_point(slots, rng, potential)
    duals = slope(potential, slots, point, rng)
    table = {**NUMBERS, **point}
    star = value_of(conjugate, duals)
    for one in (point, other):
        work = sum(float(np.dot(duals[s], one[s])) for s in slots)
        total = float(evaluate(potential.finite, {**NUMBERS, **one})) + star
        assert total >= work - 1e-9 * (1 + abs(work) + abs(star))
    if not potential.surfaces:
        work = sum(float(np.dot(duals[s], point[s])) for s in slots)
        assert float(evaluate(potential.finite, table)) + star == pytest.approx(work, rel=1e-9, abs=1e-9)


_CLOSED = {}


def closed(name):
    if name not in _CLOSED:
        _CLOSED[name] = total_conjugate(CASES[name][0], *CASES[name][1])
    return _CLOSED[name]


# what is once more an expression that the rules read
TWICE = [
    "deviatoric", "spherical", "tilted", "even power", "positive power", "modulus and square", "positive part", "inverse",
    "two moduli", "norm", "norm of a vector", "norm of a deviator", "power of a norm", "gauge", "largest eigenvalue", "Tresca",
    "positive trace and square", "square and positive square", "ball", "cylinder", "half-space", "Tresca set",
    "indicator and quadratic form", "tensors and scalar",
]  # fmt: skip


@pytest.mark.parametrize("name", TWICE)
def test_the_conjugate_of_the_conjugate_is_the_function(name):
    expression, slots, _ = CASES[name]
    rng = np.random.default_rng(11)
    once = closed(name)
    duals = tuple(once.duals[s] for s in slots)
    twice = total_conjugate(once.extended(), *duals)
    potential = as_extended(expression, name)
    for _ in range(3):
        point = random_point(slots, rng, potential)
        found = twice.value({**NUMBERS, **{twice.duals[once.duals[s]]: z for s, z in point.items()}})
        assert float(found) == pytest.approx(
            float(evaluate(potential.finite, {**NUMBERS, **point})), rel=1e-6, abs=1e-6
        )
    if potential.surfaces:
        outside = {s: 100 * rng.normal(size=length(s)) if length(s) > 1 else 100.0 for s in slots}
        if any(evaluate(f, {**NUMBERS, **outside}) > 0 for f in potential.surfaces):
            assert np.isinf(twice.value({**NUMBERS, **{twice.duals[once.duals[s]]: z for s, z in outside.items()}}))


def test_functions_of_the_eigenvalues():
    """(Σ g(x_i))* = Σ g*(y_i), each g* by a search over one number."""
    rng = np.random.default_rng(3)
    grid = np.linspace(-8, 8, 160001)
    for g, numbers in (
        (lambda t: pos(t) ** 3 + pos(-t) ** 2, np.maximum(grid, 0) ** 3 + np.maximum(-grid, 0) ** 2),
        (lambda t: a * exp(t), A * np.exp(grid)),
        (lambda t: b * t**4, B * grid**4),
        (lambda t: a * pos(t) ** n + c * pos(-t), A * np.maximum(grid, 0) ** N + C * np.maximum(-grid, 0)),
    ):
        conjugate = total_conjugate(eig_sum(g, x), x)
        assert conjugate.closed
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        eigenvalues = np.array([0.3, 0.9, 1.7])
        m = q @ np.diag(eigenvalues) @ q.T
        y = np.array([m[0, 0], m[1, 1], m[2, 2], *(np.sqrt(2) * m[i, j] for i, j in ((1, 2), (0, 2), (0, 1)))])
        expected = sum((e * grid - numbers).max() for e in eigenvalues)
        assert value_of(conjugate, {x: y}) == pytest.approx(expected, abs=1e-6)


ATOMS_ALONE = {
    "trace": (tr(x), x, 1),
    "square": (inner(x, x), x, 1),
    "norm": (norm(x), x, 1),
    "positive square": (inner(pos(x), pos(x)), x, 1),
    "positive trace": (tr(pos(x)), x, 1),
    "largest eigenvalue": (eig_max(x), x, 1),
    "smallest eigenvalue": (eig_min(x), x, -1),
    "sum over eigenvalues": (eig_sum(lambda t: t**4, x), x, 1),
    "positive part": (pos(p), p, 1),
    "even power": (p**4, p, 1),
    "root": (sqrt(p), p, -1),
    "inverse": (1 / p, p, 1),
    "exponential": (exp(p), p, 1),
    "logarithm": (log(p), p, -1),
}


@pytest.mark.parametrize("name", ATOMS_ALONE)
def test_an_atom_knows_its_conjugate(name):
    """f + f* = x·y at y = ∇f(x), inside the domain; of a concave atom, for its negative."""
    node, symbol, sign = ATOMS_ALONE[name]
    rng = np.random.default_rng(13)
    dual = sym_tensor("y_0") if symbol is x else scalar("y_0")
    value, domain = atom_of(node).conjugate(node, dual)
    for _ in range(5):
        z = rng.normal(size=6) if symbol is x else 0.1 + abs(rng.normal())
        y = sign * evaluate(partial(node, symbol), {symbol: z})
        star = float(evaluate(value, {dual: y}))
        assert star + sign * float(evaluate(node, {symbol: z})) == pytest.approx(float(np.dot(y, z)), abs=1e-10)
        assert all(float(evaluate(f, {dual: y})) <= 1e-9 for f in domain)


def test_what_is_not_convex_has_no_rule():
    for expression in (-inner(x, x) * norm(x), -norm(x), a * eig_min(x), norm(x) * exp(tr(x))):
        conjugate = total_conjugate(expression, x)
        assert conjugate.form is None and conjugate.missing
        assert conjugate.words()[0].startswith("sup over x of")
