"""The symbolic layer: ranked tensors, invariants, derivatives, and the traps of sympy, one test each."""

import numpy as np
import pytest
from sympy import Integer, Rational, Symbol, latex, sqrt, srepr

from fenchel.errors import DeclarationError
from fenchel.potentials import (
    dev,
    identity,
    inner,
    norm,
    parameter,
    parameters,
    pos,
    scalar,
    sym_tensor,
    tr,
)
from fenchel.potentials.atoms.positive_part import Step
from fenchel.potentials.derivative import partial, second_derivative

eps, eps_p, alpha, p = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha"), scalar("p")
a, b = parameters("a b")


@pytest.mark.parametrize("factor", [a, Integer(2), Rational(1, 3), sqrt(2), 2, 0.5, np.float64(0.5), a * b])
def test_scalars_multiply_tensors_from_both_sides(factor):
    assert factor * eps == eps * factor
    assert (factor * eps).terms()[eps] == factor


def test_linear_combinations_are_canonical():
    assert eps + eps_p == eps_p + eps
    assert (eps - eps).terms() == {}
    assert 2 * eps - eps == eps
    assert dev(identity).terms() == {}
    assert dev(dev(eps)) == dev(eps)
    assert dev(2 * eps + 3 * identity) == 2 * dev(eps)
    assert sum([eps, eps_p]) == eps + eps_p


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: eps * eps_p,
        lambda: eps + a,
        lambda: a + eps,
        lambda: 1 - eps,
        lambda: eps**2,
        lambda: eps * "a",
        lambda: tr(a),
        lambda: norm(p),
        lambda: dev(p),
        lambda: inner(eps, a),
        lambda: a / eps,
    ],
)
def test_rank_mismatch_is_refused(wrong):
    with pytest.raises((DeclarationError, TypeError)):
        wrong()


def test_strings_are_never_evaluated():
    with pytest.raises(DeclarationError):
        eps * "__import__('os').getpid()"
    with pytest.raises(DeclarationError):
        pos("__import__('os').getpid()")


def test_derivative_of_squared_positive_trace():
    # MatrixSymbol returns 0 here, Max returns Heaviside(0) = 1/2
    energy = pos(tr(eps)) ** 2
    assert partial(energy, eps) == 2 * pos(tr(eps)) * identity
    operator = second_derivative(energy, eps, eps)
    assert operator.c1 == 2 * Step(tr(eps))
    assert (operator.c0, operator.dyads, operator.spectral) == (0, (), ())


def test_spectral_square_is_recognised():
    assert inner(pos(eps), pos(eps)) == inner(eps, pos(eps))
    assert partial(inner(pos(eps), pos(eps)), eps) == 2 * pos(eps)
    assert second_derivative(a * inner(pos(eps), pos(eps)), eps, eps).spectral == ((2 * a, eps),)
    with pytest.raises(DeclarationError):
        inner(pos(eps), eps_p)
    assert str(tr(pos(eps) + 2 * eps)) == "tr(pos(eps)) + tr(2*eps)"


def test_derivative_of_norm_of_deviator():
    q = norm(dev(eps + eps_p))
    assert partial(q, eps) == dev(eps + eps_p) / q
    assert partial(q**2, alpha).terms() == {}


def test_inner_differentiates_both_sides():
    assert partial(inner(eps - eps_p, eps - eps_p), eps_p) == -2 * eps + 2 * eps_p
    block = second_derivative(a * inner(eps - eps_p, eps - eps_p) / 2, eps, eps_p)
    assert (block.c0, block.c1) == (-a, 0)
    spherical = second_derivative(inner(dev(eps), eps), eps, eps)
    assert (spherical.c0, spherical.c1) == (2, -Rational(2, 3))


def test_step_has_zero_derivative_and_survives_xreplace():
    x = Symbol("x", real=True)
    assert Step(x).diff(x) == 0
    assert pos(x).diff(x) == Step(x)
    assert pos(tr(eps)).xreplace({tr(eps): tr(eps_p)}) == pos(tr(eps_p))


def test_parameter_inside_a_tensor_argument_does_not_lose_its_derivative_silently():
    with pytest.raises(NotImplementedError):
        tr(eps + a * eps_p).diff(a)


def test_names_print_as_tensors():
    assert str(dev(eps + eps_p)) == "dev(eps + eps_p)"
    assert str(2 * a * eps - identity) == "2*a*eps - I"
    assert "varepsilon" in latex(eps)
    assert latex(pos(tr(eps)) ** 2).startswith(r"\left\langle")
    assert srepr(tr(eps))


def test_bounds_of_parameters():
    nu = parameter("nu", lower=-1, upper=0.5, unit="1", default=0.2)
    assert (nu.lower, nu.upper, nu.unit, nu.default) == (-1.0, 0.5, "1", 0.2)
    assert nu == parameter("nu", lower=-1, upper=0.5, unit="1", default=0.2)
    assert nu != parameter("nu")
    with pytest.raises(DeclarationError, match="lower bound"):
        parameter("nu", lower=1, upper=0)


@pytest.mark.parametrize(
    "name",
    [
        "__import__",
        "a\nb",
        "a'b",
        "x" * 10_000,
        "lambda",
        "import",
        "np",
        "dt",
        "1a",
        "a b",
        "",
        "a_",
        "_a",
        "é",
        "a;b",
        "certify",
        "self",
        "norm6",
        "positive_part",
        "add_positive_derivative",
    ],
)
def test_hostile_and_reserved_names_are_refused(name):
    with pytest.raises(DeclarationError):
        parameter(name)
    with pytest.raises(DeclarationError):
        sym_tensor(name)
    with pytest.raises(DeclarationError):
        scalar(name)
