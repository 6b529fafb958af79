"""Nothing is mislabelled: expressions whose convexity is known by construction, laws whose defect is known, the whole library.

Truth: a convex expression is built by the rules of disciplined convex programming together with its own numpy function; a spoiled one is
a convex one minus a square, large enough that two given points break Jensen's inequality in that numpy function. Counter-examples of the
check are computed again here, by formulas written in numpy for this file.
"""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sympy import Abs, Expr, Float, Integer, Max, Rational, exp, log, sin, sqrt

from fenchel.errors import DeclarationError
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    forces,
    identity,
    indicator,
    inner,
    norm,
    parameters,
    pos,
    scalar,
    sym_tensor,
    temperature,
    tr,
)
from fenchel.potentials.admissibility import check
from fenchel.potentials.library import ENTRIES, LAWS

eps, eps_p, alpha, p, r = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("alpha"), scalar("p"), scalar("r")
A, X, P, R = forces(eps_p, alpha, p, r, names="A X P R")
T = temperature("T")
I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
RATES = indicator(Abs(P) + Abs(R) - 1)
SMALL = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], database=None
)


# -- numbers, written here --------------------------------------------------------------------------------------------------------


def trace(t):
    return t[..., :3].sum(-1)


def deviator(t):
    return t - trace(t)[..., None] / 3 * I6


def length(t):
    return np.sqrt((t * t).sum(-1))


def principal(t):
    t = np.asarray(t, dtype=float)
    d, e, f = (t[..., k] / math.sqrt(2) for k in (3, 4, 5))
    rows = [[t[..., 0], f, e], [f, t[..., 1], d], [e, d, t[..., 2]]]
    return np.linalg.eigvalsh(np.stack([np.stack(row, -1) for row in rows], -2))


# -- convex expressions with their own numpy function -------------------------------------------------------------------------------

number = st.sampled_from([Rational(1, 3), Rational(1, 2), Integer(1), Integer(2), Rational(7, 2)])
signed = st.builds(lambda x, s: x * s, number, st.sampled_from([-1, 1]))


@st.composite
def affine(draw):
    a, b, c, d = (draw(st.one_of(st.just(Integer(0)), signed)) for _ in range(4))
    return a * tr(
        eps
    ) + b * p + c * r + d, lambda z: float(a) * trace(z["eps"]) + float(b) * z["p"] + float(c) * z["r"] + float(d)


@st.composite
def tensor(draw):
    a, deviatoric = draw(signed), draw(st.booleans())
    shift = draw(st.one_of(st.just(Integer(0)), signed))

    def value(z):
        found = float(a) * z["eps"] + float(shift) * I6
        return deviator(found) if deviatoric else found

    found = a * eps + shift * identity
    return (dev(found) if deviatoric else found), value


@st.composite
def convex(draw, depth=2):
    """(expression, numpy function, non-negative)."""
    kinds = ["norm", "square", "root", "eig_max", "pos_square", "exp", "softplus", "abs"]
    kinds += ["sum", "max", "pos", "power", "exp_of", "scaled"] if depth else []
    kind = draw(st.sampled_from(kinds))
    if kind in ("norm", "eig_max", "pos_square"):
        t, f = draw(tensor())
        if kind == "norm":
            return norm(t), lambda z: length(f(z)), True
        if kind == "eig_max":
            return eig_max(t), lambda z: principal(f(z))[..., 2], False
        return inner(pos(t), pos(t)), lambda z: (np.maximum(principal(f(z)), 0) ** 2).sum(-1), True
    if kind in ("square", "root", "exp", "softplus", "abs"):
        u, f = draw(affine())
        if kind == "square":
            return u**2, lambda z: f(z) ** 2, True
        if kind == "root":
            w, g = draw(affine())
            return sqrt(u**2 + 2 * w**2), lambda z: np.sqrt(f(z) ** 2 + 2 * g(z) ** 2), True
        if kind == "exp":
            return exp(u / 2), lambda z: np.exp(f(z) / 2), True
        if kind == "softplus":
            return log(1 + exp(p)), lambda z: np.log1p(np.exp(z["p"])), True
        return Abs(u), lambda z: np.abs(f(z)), True
    e, f, positive = draw(convex(depth - 1))
    if kind in ("sum", "max"):
        e2, f2, positive2 = draw(convex(depth - 1))
        if kind == "sum":
            return e + e2, lambda z: f(z) + f2(z), positive and positive2
        return Max(e, e2), lambda z: np.maximum(f(z), f2(z)), positive or positive2
    if kind == "pos":
        return pos(e), lambda z: np.maximum(f(z), 0), True
    if kind == "power":
        n = draw(st.sampled_from([Integer(2), Integer(3), Rational(3, 2)]))
        return pos(e) ** n, lambda z: np.maximum(f(z), 0) ** float(n), True
    if kind == "exp_of":
        # small arguments, so that numbers stay numbers
        return (
            exp(Float(0.125) * e) if e.has(exp) is False else exp(p),
            ((lambda z: np.exp(0.125 * f(z))) if e.has(exp) is False else (lambda z: np.exp(z["p"]))),
            True,
        )
    w = draw(number)
    return w * e, lambda z: float(w) * f(z), positive


def point(rng):
    return {"eps": rng.normal(size=6), "p": float(rng.normal()), "r": float(rng.normal())}


def middle(a, b):
    return {k: 0.5 * (a[k] + b[k]) for k in a}


def energy(expression):
    return Law("tried", psi=expression + inner(eps, eps) + p**2 + r**2, phi_star=RATES, observable=eps, internal=(p, r))


def whole(f):
    return lambda z: f(z) + (z["eps"] ** 2).sum(-1) + z["p"] ** 2 + z["r"] ** 2


COUNT = {"convex": [0, 0, 0], "spoiled": [0, 0, 0]}


def count(kind, admissible):
    COUNT[kind][{True: 0, None: 1, False: 2}[admissible]] += 1


@SMALL
@given(convex())
def test_convex_by_construction_is_never_refuted(built):
    expression, f, _ = built
    if not isinstance(expression, Expr) or not expression.free_symbols | expression.atoms(type(eps)):
        return
    # the construction itself: Jensen's inequality holds in the numpy function
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = point(rng), point(rng)
        fa, fb, fm = f(a), f(b), f(middle(a, b))
        assert fm <= 0.5 * (fa + fb) + 1e-9 * (abs(fa) + abs(fb) + 1)
    report = check(energy(expression), {}, seconds=0.4)
    assert report.admissible is not False, (expression, report.counterexample)
    count("convex", report.admissible)


@SMALL
@given(convex(), st.integers(0, 10**6), st.sampled_from(["p", "tr", "both"]))
def test_spoiled_by_a_square_is_never_proved(built, seed, where):
    expression, f, _ = built
    rng = np.random.default_rng(seed)
    a, b = point(rng), point(rng)
    b["p"] = a["p"] + 1.0
    b["eps"] = b["eps"] + (trace(a["eps"]) + 1.5 - trace(b["eps"])) / 3 * I6
    weights = {"p": (1, 0), "tr": (0, 1), "both": (1, 1)}[where]

    def direction(z):
        return weights[0] * z["p"] + weights[1] * trace(z["eps"])

    f = whole(f)
    rise = 0.5 * (f(a) + f(b)) - f(middle(a, b))
    size = abs(f(a)) + abs(f(b)) + abs(f(middle(a, b)))
    gap = (0.5 * (direction(a) - direction(b))) ** 2
    factor = Rational(math.ceil(1000 * (1.2 * rise + 0.1 * size + 0.1) / gap), 1000)
    spoil = factor * (weights[0] * p + weights[1] * tr(eps)) ** 2

    def spoiled(z):
        return f(z) - float(factor) * direction(z) ** 2

    assert spoiled(middle(a, b)) > 0.5 * (spoiled(a) + spoiled(b))
    report = check(energy(expression - spoil), {}, seconds=0.8)
    assert report.admissible is not True, (expression, spoil)
    count("spoiled", report.admissible)
    if report.admissible is False:
        verify(report.counterexample, spoiled, names=("eps", "p", "r"))


def test_the_answers_are_worth_something():
    """Enough is decided: what is convex is proved, what is not is refuted, nearly always."""
    if not sum(COUNT["convex"]) or not sum(COUNT["spoiled"]):
        pytest.skip("counts come from the two tests above, run in the same process")
    proved, open_, refuted = COUNT["convex"]
    assert refuted == 0 and proved >= 0.97 * (proved + open_), COUNT
    proved, open_, refuted = COUNT["spoiled"]
    assert proved == 0 and refuted >= 0.9 * (refuted + open_), COUNT


# -- counter-examples, computed again -----------------------------------------------------------------------------------------------


def values_of(point):
    return {k: np.array(x) if isinstance(x, list) else x for k, x in point.items()}


def verify(example, function, names, concave=False):
    """Jensen's inequality broken at the points of the example, in a function written in this file."""
    assert len(example.points) == 3
    zero = {n: np.zeros(6) if n in ("eps", "eps_p", "alpha", "A", "X") else 0.0 for n in names}
    a, b, m = ({**zero, **values_of(z)} for z in example.points)
    for name in names:
        np.testing.assert_allclose(m[name], 0.5 * (np.asarray(a[name]) + np.asarray(b[name])), rtol=1e-12, atol=1e-300)
    fa, fb, fm = function(a), function(b), function(m)
    sign = -1 if concave else 1
    violation = sign * (fm - 0.5 * (fa + fb))
    assert violation > 1e-9 * (abs(fa) + abs(fb) + abs(fm))
    # the function here may differ by what does not matter to the middle: terms that are affine
    assert violation == pytest.approx(example.violation, rel=1e-5)


def verify_set(example, function, names):
    assert len(example.points) == 3
    zero = {n: np.zeros(6) if n in ("A", "X") else 0.0 for n in names}
    a, b, m = ({**zero, **values_of(z)} for z in example.points)
    for name in names:
        np.testing.assert_allclose(m[name], 0.5 * (np.asarray(a[name]) + np.asarray(b[name])), rtol=1e-12, atol=1e-300)
    size = abs(function(a)) + abs(function(b))
    assert function(a) <= 1e-12 * size and function(b) <= 1e-12 * size and function(m) > 1e-9 * size
    assert function(m) == pytest.approx(example.violation, rel=1e-6)


def elastic(z):
    return 0.5 * trace(z["eps"]) ** 2 + (z["eps"] ** 2).sum(-1)


def shear(z, name="A"):
    return length(deviator(z[name]))


STIFF = tr(eps) ** 2 / 2 + inner(eps, eps)
PLASTIC = tr(eps - eps_p) ** 2 / 2 + inner(eps - eps_p, eps - eps_p)
BALL = indicator(norm(dev(A)) + Abs(P) - 1)
ENERGIES = {
    "concave scalar": (STIFF - p**2, lambda z: elastic(z) - z["p"] ** 2),
    "double well": (STIFF + p**4 - p**2, lambda z: elastic(z) + z["p"] ** 4 - z["p"] ** 2),
    "cubic": (STIFF + p**3, lambda z: elastic(z) + z["p"] ** 3),
    "sine": (STIFF + exp(p) - 4 * pos(p) ** 2, lambda z: elastic(z) + np.exp(z["p"]) - 4 * max(z["p"], 0) ** 2),
    "coupling beyond the determinant": (
        STIFF + Rational(3, 2) * tr(eps) * p + p**2 / 2,
        lambda z: elastic(z) + 1.5 * trace(z["eps"]) * z["p"] + z["p"] ** 2 / 2,
    ),
    "product of scalars": (STIFF + p * r, lambda z: elastic(z) + z["p"] * z["r"]),
    "product of squares": (STIFF + p**2 * r**2, lambda z: elastic(z) + z["p"] ** 2 * z["r"] ** 2),
    "second invariant": (
        STIFF + tr(eps) ** 2 - 2 * inner(eps, eps),
        lambda z: elastic(z) + trace(z["eps"]) ** 2 - 2 * (z["eps"] ** 2).sum(-1),
    ),
    "damage": (
        (1 - p) ** 2 * STIFF + p**2 / 10,
        lambda z: (1 - z["p"]) ** 2 * elastic(z) + z["p"] ** 2 / 10,
    ),
    "smallest eigenvalue": (
        STIFF / 100 + eig_min(eps),
        lambda z: elastic(z) / 100 + principal(z["eps"])[0],
    ),
    "difference of norms": (
        STIFF + norm(eps) - 3 * norm(dev(eps)),
        lambda z: elastic(z) + length(z["eps"]) - 3 * length(deviator(z["eps"])),
    ),
    "root": (STIFF / 100 + sqrt(norm(eps)), lambda z: elastic(z) / 100 + np.sqrt(length(z["eps"]))),
}


@pytest.mark.parametrize("name", ENERGIES)
def test_energies_that_are_not_convex_are_refuted_with_points_that_show_it(name):
    psi, function = ENERGIES[name]
    law = Law("zoo", psi=psi, phi_star=indicator(Abs(P) + Abs(R) - 1), observable=eps, internal=(p, r))
    report = law.check()
    assert report.admissible is False
    verify(report.counterexample, function, ("eps", "p", "r"))
    with pytest.raises(DeclarationError, match="not convex"):
        law.compile()


def equivalent(z):
    return 1.5 * (deviator(z["A"]) ** 2).sum(-1)


def pressure(z):
    return -trace(z["A"]) / 3


Q2, M = Rational(3, 2) * inner(dev(A), dev(A)), -tr(A) / 3
SETS = {
    "textbook Cam-Clay, p_c a force": (
        Q2 / Rational(6, 5) ** 2 + M * (M - P),
        lambda z: equivalent(z) / 1.44 + pressure(z) * (pressure(z) - z["P"]),
    ),
    "textbook Cam-Clay, p_c = p_0 + force": (
        Q2 + M * (M - P - 100),
        lambda z: equivalent(z) + pressure(z) * (pressure(z) - z["P"] - 100),
    ),
    "squared von Mises with hardening": (Q2 - (1 - P) ** 2, lambda z: equivalent(z) - (1 - z["P"]) ** 2),
    "outside of a ball": (1 - norm(A) - Rational(3, 2), lambda z: -0.5 - length(z["A"])),
    "smallest stress": (eig_min(A) - 1, lambda z: principal(z["A"])[0] - 1),
    "two balls": (
        -Max(1 - norm(A - 3 * identity), 1 - norm(A + 3 * identity)) - 6,
        lambda z: -max(1 - length(z["A"] - 3 * I6), 1 - length(z["A"] + 3 * I6)) - 6,
    ),
    "norms of two forces": (
        norm(dev(A)) - 2 * norm(dev(X)) - 1,
        lambda z: length(deviator(z["A"])) - 2 * length(deviator(z["X"])) - 1,
    ),
    "friction that grows with the shear": (
        norm(dev(A)) ** 2 + tr(A) * norm(dev(A)) - 1,
        lambda z: length(deviator(z["A"])) ** 2 + trace(z["A"]) * length(deviator(z["A"])) - 1,
    ),
}


@pytest.mark.parametrize("name", SETS)
def test_domains_that_are_not_convex_are_refuted_with_two_points_inside(name):
    f, function = SETS[name]
    psi = PLASTIC + inner(alpha, alpha) + p**2
    law = Law("zoo", psi=psi, phi_star=indicator(f), observable=eps, internal=(eps_p, alpha, p))
    report = law.check()
    if name == "outside of a ball":
        # -1/2 - |A| <= 0 is everything: the set is convex though the function is concave
        assert report.admissible is not False
        return
    assert report.admissible is False
    if name == "two balls":
        assert "f" in report.counterexample.function
    verify_set(report.counterexample, function, ("A", "X", "P"))


FUNCTIONS = {
    "concave": (-inner(A, A), lambda z: -(z["A"] ** 2).sum(-1)),
    "root of a norm": (sqrt(norm(A)), lambda z: np.sqrt(length(z["A"]))),
    "saddle": (inner(A, A) - 2 * P**2, lambda z: (z["A"] ** 2).sum(-1) - 2 * z["P"] ** 2),
    "wave": (
        inner(A, A) / 100 + sqrt(1 + P**2) - sqrt(1 + 4 * P**2),
        lambda z: (z["A"] ** 2).sum(-1) / 100 + np.sqrt(1 + z["P"] ** 2) - np.sqrt(1 + 4 * z["P"] ** 2),
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_viscous_potentials_that_are_not_convex_are_refuted(name):
    phi_star, function = FUNCTIONS[name]
    report = Law("zoo", psi=PLASTIC + p**2, phi_star=phi_star, observable=eps, internal=(eps_p, p)).check()
    assert report.admissible is False and report.dissipative is False
    verify(report.counterexample, function, ("A", "P"))


@pytest.mark.parametrize(
    ("phi_star", "rule", "value"),
    [
        (indicator(norm(dev(A)) + 1), "zero lies outside", 1.0),
        (indicator(norm(A - 2 * identity) - 3), "zero lies outside", 2 * math.sqrt(3) - 3),
        (inner(A, A) + 2, "not zero at zero", 2.0),
        (exp(P) + inner(A, A), "not zero at zero", 1.0),
    ],
)
def test_values_at_zero(phi_star, rule, value):
    report = Law("zoo", psi=PLASTIC + p**2, phi_star=phi_star, observable=eps, internal=(eps_p, p)).check()
    assert report.admissible is False and rule in report.counterexample.rule
    assert report.counterexample.violation == pytest.approx(value, rel=1e-12)


def test_negative_dissipation_is_refuted_where_it_is():
    report = Law("zoo", psi=PLASTIC, phi_star=inner(A, A) + tr(A), observable=eps, internal=(eps_p,)).check()
    assert report.admissible is False and "negative" in report.counterexample.rule
    stress = np.array(report.counterexample.points[0]["A"])
    assert (stress**2).sum() + trace(stress) == pytest.approx(-report.counterexample.violation)
    assert report.counterexample.violation > 0


def test_convexity_in_temperature_is_refuted():
    for psi, function in [
        (STIFF + T**2, lambda t: t**2),
        (STIFF + T * log(T), lambda t: t * np.log(t)),
        (STIFF + exp(-T / 100), lambda t: np.exp(-t / 100)),
    ]:
        report = Law("zoo", psi=psi, observable=eps).check()
        assert report.admissible is False
        a, b, m = (z["T"] for z in report.counterexample.points)
        assert min(a, b) > 0 and m == pytest.approx(0.5 * (a + b))
        assert 0.5 * (function(a) + function(b)) > function(m)
    for psi in (STIFF - T**2, STIFF - T * log(T), STIFF + sqrt(T), STIFF + log(T), STIFF - 1 / T):
        assert Law("zoo", psi=psi, observable=eps).check().admissible is True, psi


def test_a_function_that_potentials_do_not_know_is_no_valid_declaration():
    with pytest.raises(DeclarationError, match="sin"):
        Law("zoo", psi=STIFF + sin(p), phi_star=BALL, observable=eps, internal=(p,))


def test_softening_is_refuted_and_named():
    (H,) = (parameters("H"),)
    psi = PLASTIC + H * p**2 / 2
    law = Law("zoo", psi=psi, phi_star=indicator(norm(dev(A)) + P - 1), observable=eps, internal=(eps_p, p))
    assert law.check().admissible is True and "H >= 0" in law.check().conditions
    report = law.check(H=-0.1)
    assert report.admissible is False and report.softening == ("H",)
    a, b, m = (z["p"] for z in report.counterexample.points)
    assert -0.05 * m**2 > 0.5 * (-0.05 * a**2 - 0.05 * b**2)


# -- the library --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LAWS)
def test_every_law_of_the_library_is_proved_and_its_negative_is_refuted(name):
    law = LAWS[name]
    report = law.check()
    assert report.admissible is True and report.dissipative is not False
    values = law.check(**ENTRIES[name].values)
    assert values.admissible is True and not [c for c in values.conditions if not c.on_state]
    # the same energy upside down is not convex, whatever the parameters
    if law.psi is None:
        return
    turned = Law(
        name, psi=-law.psi, phi_star=law.phi_star, phi=law.phi, observable=law.observable, internal=law.internal
    )
    report = check(turned, {}, seconds=3.0)
    assert report.admissible is False and report.counterexample.violation > 0
