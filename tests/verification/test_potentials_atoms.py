"""Every atom of the table is what it says: curvature, monotonicity, sign, degree, domain, derivatives, conic form, on its own examples.

Truth: the definitions themselves (Jensen's inequality, order, homogeneity, the subgradient inequality), central differences, and a cone
program solved by clarabel. A registered atom is tried because it is registered.
"""

import subprocess
import sys
import textwrap

import numpy as np
import pytest
from sympy import Expr, Lambda

from fenchel.potentials.atoms import ATOMS, Atom, atom_of, register
from fenchel.potentials.atoms.atom import Invariant
from fenchel.potentials.derivative import partial, second_derivative
from fenchel.potentials.evaluate import evaluate
from fenchel.potentials.operator_numbers import operator_matrix
from fenchel.potentials.scalars import ScalarVariable
from fenchel.potentials.tensor import TensorSymbol
from fenchel.potentials.vector import VectorSymbol

EXAMPLES = [pytest.param(node, id=str(node)) for atom in ATOMS.values() for node in atom.examples()]
LEAVES = [p for p in EXAMPLES if isinstance(p.values[0], Invariant)]
COUNT = 400


def variables(node):
    return sorted(node.atoms(TensorSymbol, VectorSymbol, ScalarVariable), key=str)


def size(variable):
    return 1 if isinstance(variable, ScalarVariable) else (6 if variable.rank == 2 else 3)


def sample(node, rng, count=COUNT, scale=1.0):
    """Points in the domain of the node."""
    found = {}
    for v in variables(node):
        x = scale * rng.normal(size=(count, size(v)))
        found[v] = x[:, 0] if size(v) == 1 else x
    for condition in atom_of(node).domain(node):
        # the domain of a scalar function is a half line
        (x,) = condition.free_symbols
        assert condition == x
        found[x] = np.abs(found[x]) + 0.05
    return found


def special(node, rng):
    """Points where eigenvalues are repeated, zero, or all zero; scalars at zero."""
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    diagonals = [
        (1, 1, -1),
        (2, 0, 0),
        (0, 0, 0),
        (1, 1, 1),
        (-1, -1, 0.5),
        (0.5, 0, -0.5),
        (0.5, 0.5, 0.5),
        (-2, -2, -2),
    ]
    mandel = []
    for d in diagonals:
        # a spherical tensor is the same in all axes, but for rounding, which would be all of its deviator
        for q in (np.eye(3), np.eye(3) if len(set(d)) == 1 else rotation):
            m = q @ np.diag(np.array(d, dtype=float)) @ q.T
            r = np.sqrt(2)
            mandel.append([m[0, 0], m[1, 1], m[2, 2], r * m[1, 2], r * m[0, 2], r * m[0, 1]])
    count = len(mandel)
    found = {}
    for v in variables(node):
        found[v] = np.array(mandel) if size(v) == 6 else (np.zeros((count, 3)) if size(v) == 3 else np.zeros(count))
    for condition in atom_of(node).domain(node):
        (x,) = condition.free_symbols
        found[x] = np.full(count, 0.5)
    return found


def combine(a, b, weight):
    return {v: weight * a[v] + (1 - weight) * b[v] for v in a}


def pairing(slopes, a, b):
    total = 0.0
    for v, g in slopes.items():
        product = np.broadcast_to(g, np.shape(a[v])) * (b[v] - a[v])
        total = total + (product if product.ndim == 1 else product.sum(-1))
    return total


def curvature(node):
    needs = []
    found = atom_of(node).curvature(node, needs.append)
    assert found in ("affine", "convex", "concave", "unknown") and not needs
    return found


@pytest.mark.parametrize("node", EXAMPLES)
def test_curvature_is_that_of_the_numbers(node):
    rng = np.random.default_rng(1)
    declared = curvature(node)
    worst_up, worst_down = -np.inf, -np.inf
    for scale in (0.3, 1.0, 4.0):
        a, b = sample(node, rng, scale=scale), sample(node, rng, scale=scale)
        for weight in (0.5, 0.2):
            f = [evaluate(node, z) for z in (a, b, combine(a, b, weight))]
            excess = f[2] - weight * f[0] - (1 - weight) * f[1]
            excess = excess / (np.abs(f[0]) + np.abs(f[1]) + 1.0)
            worst_up, worst_down = max(worst_up, excess.max()), max(worst_down, -excess.min())
    if declared in ("convex", "affine"):
        assert worst_up <= 1e-12
    if declared in ("concave", "affine"):
        assert worst_down <= 1e-12
    if declared in ("convex", "concave"):
        # strictly somewhere: the declaration is not an understatement of "affine"
        assert max(worst_up, worst_down) > 1e-6
    if declared == "unknown":
        assert worst_up > 1e-6 and worst_down > 1e-6


@pytest.mark.parametrize("node", EXAMPLES)
def test_sign_degree_and_order_are_those_of_the_numbers(node):
    rng = np.random.default_rng(2)
    atom = atom_of(node)
    scalars = [a for a in node.args if isinstance(a, Expr) and not isinstance(a, Lambda)]
    z = sample(node, rng)
    value = evaluate(node, z)
    unknown = atom.sign(node, (0,) * len(node.args))
    assert unknown != 1 or (value >= 0).all()
    assert unknown != -1 or (value <= 0).all()
    assert unknown != 0 or (value < 0).any() or (value > 0).all()
    degree = atom.degree(node)
    # of arguments without a constant part
    if degree is not None and not any(len(a.terms()) > 1 for a in node.args if not isinstance(a, Expr)):
        for t in (0.3, 2.0):
            scaled = {v: t * x for v, x in z.items()}
            np.testing.assert_allclose(evaluate(node, scaled), t ** float(degree) * value, rtol=1e-11, atol=1e-12)
    for sign in (0, 1, -1) if scalars and not atom.domain(node) else ((1,) if scalars else ()):
        signs = tuple(sign for _ in node.args)
        for k, direction in enumerate(atom.monotone(node, signs)):
            if not direction or not all(isinstance(a, ScalarVariable) for a in scalars):
                continue
            low = {v: (x if sign == 0 else sign * np.abs(x)) for v, x in z.items()}
            step = np.abs(rng.normal(size=COUNT)) * (np.abs(low[node.args[k]]) if sign < 0 else 1.0)
            high = {**low, node.args[k]: np.minimum(low[node.args[k]] + step, 0.0 if sign < 0 else np.inf)}
            assert (direction * (evaluate(node, high) - evaluate(node, low)) >= -1e-12).all()


@pytest.mark.parametrize("node", EXAMPLES)
def test_gradient_equals_central_differences(node):
    rng = np.random.default_rng(3)
    z, h = sample(node, rng, 60), 1e-6
    if atom_of(node).word == "step":
        return  # its derivative is taken as zero
    for v in variables(node):
        slope = np.broadcast_to(evaluate(partial(node, v), z), z[v].shape)
        for k in range(size(v)):
            shift = h * (1.0 if size(v) == 1 else np.eye(size(v))[k])
            ends = [evaluate(node, {**z, v: z[v] + s * shift}) for s in (1, -1)]
            found = slope if size(v) == 1 else slope[:, k]
            np.testing.assert_allclose(found, (ends[0] - ends[1]) / (2 * h), rtol=2e-6, atol=2e-7)


@pytest.mark.parametrize("node", EXAMPLES)
def test_gradient_is_a_subgradient_at_kinks_too(node):
    declared = curvature(node)
    if declared == "unknown" or atom_of(node).word == "step":
        return
    rng = np.random.default_rng(4)
    at = special(node, rng)
    slopes = {v: evaluate(partial(node, v), at) for v in variables(node)}
    here = evaluate(node, at)
    for _ in range(30):
        other = sample(node, rng, len(here))
        rest = evaluate(node, other) - here - pairing(slopes, at, other)
        if declared in ("convex", "affine"):
            assert rest.min() >= -1e-12 * (1 + np.abs(here).max())
        if declared in ("concave", "affine"):
            assert rest.max() <= 1e-12 * (1 + np.abs(here).max())


@pytest.mark.parametrize("node", LEAVES)
def test_second_derivative_equals_central_differences_of_the_gradient(node):
    rng = np.random.default_rng(5)
    z, h = sample(node, rng, 40), 1e-6
    for x in variables(node):
        for y in variables(node):
            if size(x) != size(y):
                continue
            matrix = operator_matrix(second_derivative(node, x, y), z, rank=2 if size(x) == 6 else 1)
            matrix = np.broadcast_to(matrix, (40, size(x), size(x)))
            slope = partial(node, x)
            for k in range(size(y)):
                shift = h * np.eye(size(y))[k]
                ends = [np.broadcast_to(evaluate(slope, {**z, y: z[y] + s * shift}), z[x].shape) for s in (1, -1)]
                difference = (ends[0] - ends[1]) / (2 * h)
                scale = 1.0 + np.abs(matrix).max()
                np.testing.assert_allclose(matrix[:, :, k], difference, rtol=0, atol=1e-6 * scale**2)


@pytest.mark.parametrize("node", LEAVES)
def test_generalised_hessian_is_right_where_eigenvalues_meet(node):
    """Finite, symmetric, of the sign of the curvature; where the gradient is smooth along a direction, equal to its difference."""
    rng = np.random.default_rng(6)
    at = special(node, rng)
    declared = curvature(node)
    for x in variables(node):
        matrix = operator_matrix(second_derivative(node, x, x), at, rank=2 if size(x) == 6 else 1)
        matrix = np.broadcast_to(matrix, (len(at[x]), size(x), size(x)))
        assert np.isfinite(matrix).all()
        np.testing.assert_allclose(
            matrix, np.swapaxes(matrix, 1, 2), rtol=0, atol=1e-12 * max(1.0, np.abs(matrix).max())
        )
        eigen, rounding = np.linalg.eigvalsh(matrix), 1e-12 * max(1.0, np.abs(matrix).max())
        assert declared not in ("convex", "affine") or eigen.min() >= -rounding
        assert declared not in ("concave", "affine") or eigen.max() <= rounding
        if size(x) != 6 or atom_of(node).smoothness != "C1":
            continue
        # off the kinks: no eigenvalue of the argument, nor its trace, is zero; repeated ones are there
        inside = node.args[-1]
        values = np.linalg.eigvalsh(_matrices(evaluate(inside, at)))
        smooth = np.abs(values).min(axis=1) > 0.1
        h, slope = 1e-6, partial(node, x)
        for k in range(6):
            ends = [evaluate(slope, {**at, x: at[x] + s * h * np.eye(6)[k]}) for s in (1, -1)]
            np.testing.assert_allclose(
                matrix[smooth][:, :, k], ((ends[0] - ends[1]) / (2 * h))[smooth], atol=1e-6 * (1 + np.abs(matrix).max())
            )
        assert smooth.any()


def _matrices(mandel):
    r = np.sqrt(0.5)
    a, b, c, d, e, f = np.moveaxis(np.asarray(mandel), -1, 0)
    return np.stack(
        [np.stack([a, r * f, r * e], -1), np.stack([r * f, b, r * d], -1), np.stack([r * e, r * d, c], -1)], -2
    )


@pytest.mark.parametrize("node", EXAMPLES)
def test_conic_form_has_the_value_of_the_atom_at_its_optimum(node):
    """min t over the conic form of a convex atom with its arguments fixed (max of a concave one) is its value."""
    import cvxpy

    from fenchel.potentials.conic_form import Frame, conic_expression

    declared = curvature(node)
    if declared == "unknown" or atom_of(node).word == "step":
        return
    rng = np.random.default_rng(7)
    z = sample(node, rng, 3)
    places, start = {}, 0
    for v in variables(node):
        places[v], start = start, start + size(v)
    for row in range(3):
        unknown = cvxpy.Variable(start)
        constraints: list = [
            unknown == np.concatenate([np.atleast_1d(z[v][row]) for v in variables(node)]),
        ]
        shown = conic_expression(node, Frame(places, start, {}), unknown, constraints)
        goal = cvxpy.Maximize(shown) if declared == "concave" else cvxpy.Minimize(shown)
        problem = cvxpy.Problem(goal, constraints)
        problem.solve(solver=cvxpy.CLARABEL)
        expected = float(np.broadcast_to(evaluate(node, {v: x[row : row + 1] for v, x in z.items()}), 1)[0])
        assert problem.status == "optimal"
        assert float(problem.value) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def test_every_atom_has_examples_and_a_word():
    for atom in ATOMS.values():
        assert atom.word and atom.examples()
        assert all(atom_of(node) is atom for node in atom.examples())
        assert atom.smoothness in ("smooth", "C1", "continuous")


def test_what_is_no_atom_or_is_there_already_is_refused():
    from fenchel.errors import DeclarationError

    with pytest.raises(DeclarationError, match="Atom"):
        register(3)
    again = type("Again", (Atom,), {"node": next(iter(ATOMS)), "word": "again"})
    with pytest.raises(DeclarationError, match="registered already"):
        register(again())


USER_ATOM = '''
"""Largest shear (e_max - e_min)/2 of a tensor as an atom of its own, and laws that use it."""
import numpy as np
from sympy import S
from fenchel.potentials import Law, forces, indicator, inner, parameter, sym_tensor, tr
from fenchel.potentials.atoms import Atom, Invariant, register
from fenchel.potentials.atoms.linear import adjoint, linear_part
from fenchel.potentials.spectral import EigenDyad, as_matrix, eigenvalues


class ShearLeaf(Invariant):
    __slots__ = ()
    word = "shear"
    is_nonnegative = True


class Shear(Atom):
    word = "shear"
    node = ShearLeaf
    smoothness = "continuous"

    def curvature(self, node, require):
        return "convex"

    def sign(self, node, signs):
        return 1

    def degree(self, node):
        return S.One

    def gradient(self, node, variable):
        t = node.args[0]
        return (adjoint(linear_part(t, variable), EigenDyad(t, 1)) - adjoint(linear_part(t, variable), EigenDyad(t, -1))) / 2

    def value(self, node, arguments):
        e = eigenvalues(arguments[0])
        return (e[..., 2] - e[..., 0]) / 2


register(Shear())

E, k = parameter("E", lower=0, unit="Pa"), parameter("k", lower=0, unit="Pa")
eps, eps_p = sym_tensor("eps"), sym_tensor("eps_p")
A = forces(eps_p, names="A")
psi = E / 2 * inner(eps - eps_p, eps - eps_p)
tresca = Law("my_tresca", psi=psi, phi_star=indicator(ShearLeaf(A) - k), observable=eps, internal=(eps_p,))
wrong = Law("wrong", psi=psi, phi_star=indicator(inner(A, A) - ShearLeaf(A) * 3 - k), observable=eps, internal=(eps_p,))
'''


def test_an_atom_of_the_user_in_one_file_goes_all_the_way(tmp_path):
    (tmp_path / "mine.py").write_text(USER_ATOM)
    script = textwrap.dedent(
        """
        import json, sys
        import numpy as np
        sys.path.insert(0, ".")
        import mine
        from fenchel.potentials.derivative import partial
        from fenchel.potentials.evaluate import evaluate

        report = mine.tresca.check()
        a = np.array([[3.0, 1.0, -2.0, 0.0, 0.0, 0.0]])
        f = mine.tresca.surfaces[0]
        wrong = mine.wrong.check()
        print(json.dumps({
            "verdict": report.verdict,
            "conditions": [str(c) for c in report.conditions],
            "table": mine.tresca.table("strain").text(),
            "value": float(evaluate(f, {mine.A: a, mine.k: 1.0})[0]),
            "normal": evaluate(partial(f, mine.A), {mine.A: a})[0].tolist(),
            "wrong": wrong.verdict,
            "points": wrong.as_dict()["counterexample"],
        }))
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    import json

    found = json.loads(done.stdout)
    assert found["verdict"] == "proved" and found["conditions"] == ["E >= 0", "k >= 0"]
    assert "shear(A)" in found["table"]
    assert found["value"] == pytest.approx(1.5)
    np.testing.assert_allclose(found["normal"], [0.5, 0.0, -0.5, 0.0, 0.0, 0.0], atol=1e-12)
    # |A|² - 3 shear(A) <= k is not convex: its points are computed again here
    assert found["wrong"] == "refuted"
    a, b, m = (np.array(z["A"]) for z in found["points"]["points"])
    k = found["points"]["parameters"]["k"]

    def f(t):
        e = np.linalg.eigvalsh(_matrices(t))
        return (t * t).sum() - 1.5 * (e[2] - e[0]) - k

    assert f(a) <= 1e-9 and f(b) <= 1e-9 and f(m) > 1e-6
