"""What `check` says, rule by rule: conditions, reasons, counter-examples, refusals at compilation and at values."""

import json

import pytest
from sympy import Abs, Rational, exp, log, sqrt

from fenchel.errors import DeclarationError, InputError
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    eig_sum,
    entropy_flux,
    forces,
    frozen,
    gradient,
    indicator,
    inner,
    isotropic,
    norm,
    parameter,
    parameters,
    pos,
    rates,
    scalar,
    sym_tensor,
    temperature,
    tr,
    vector,
)
from fenchel.potentials.admissibility.bounds import interval, sharp_interval
from fenchel.potentials.admissibility.convexity import Prover, one_variable
from fenchel.potentials.atoms.maximum import rewrite_maximum

E, nu, C, H, M, a, c, n = parameters("E nu C H M a c n")
eps, eps_p, alpha, p, r, v = (
    sym_tensor("eps"),
    sym_tensor("eps_p"),
    sym_tensor("alpha"),
    scalar("p"),
    scalar("r"),
    vector("v"),
)
sig = sym_tensor("sig")
A, X, P, R, V = forces(eps_p, alpha, p, r, v, names="A X P R V")
T = temperature("T")
STIFF = isotropic(E, nu).energy(eps)
ELASTIC = isotropic(E, nu).energy(eps - eps_p)
BALL = indicator(Abs(P) - 1)
MISES = indicator(norm(dev(A)) - C)


def law(psi, phi_star=None, internal=(), **more):
    return Law("tried", psi=psi, phi_star=phi_star, observable=eps, internal=internal, **more)


def proved(expression, *variables, goal=1):
    return Prover(variables).curved(rewrite_maximum(expression), goal) is not None


@pytest.mark.parametrize(
    ("expression", "variables"),
    [
        (norm(A) ** Rational(3, 2), (A,)),
        (Abs(P) ** 3 + pos(P - 1) ** 2, (P,)),
        (sqrt(inner(A, A) + (tr(A) - 3 * P) ** 2), (A, P)),
        (sqrt(Rational(3, 2) * inner(dev(A), dev(A)) / M**2 + (tr(A) / 3 + a - P) ** 2), (A, P)),
        ((norm(A) ** 4 + pos(P) ** 4) ** Rational(1, 4), (A, P)),
        (sqrt(P**2 + 1), (P,)),
        (exp(norm(A)) - norm(A), (A,)),
        (exp(P) - P / 2 + exp(-P), (P,)),
        (log(1 + exp(P)), (P,)),
        (P**4 - 4 * P**3 + 6 * P**2, (P,)),
        (P**4 + P**2 * R**2 + R**4, (P, R)),
        (tr(A) ** 4 + 6 * tr(A) ** 2 * P**2 + P**4 + tr(A) ** 2, (A, P)),
        (eig_max(A) - eig_min(A) + tr(pos(A)), (A,)),
        (inner(pos(A), pos(A)) + pos(tr(A)) ** 3, (A,)),
        (eig_sum(lambda x: pos(x) ** 3 + x**2, A), (A,)),
        (inner(V, V) + norm(V), (V,)),
        (norm(A) ** 2 / T, (A,)),
        (inner(A, A) / (2 + P) ** 0, (A,)),
        (-log(T), (T,)),
        (T * log(T / 300), (T,)),
        (norm(A) * (1 + norm(A)), (A,)),
        (P**2 + tr(A) * P / 3 + inner(A, A), (A, P)),
        (pos(norm(dev(A)) + tr(A) - 1) ** 2, (A,)),
        (inner(A + X, A + X) + inner(A - X, A - X), (A, X)),
    ],
)
def test_convex_functions_are_proved(expression, variables):
    assert proved(expression, *variables)


@pytest.mark.parametrize(
    ("expression", "variables"),
    [
        (P**3, (P,)),
        (-norm(A), (A,)),
        (sqrt(norm(A)), (A,)),
        (P * R, (P, R)),
        (P**2 * R**2, (P, R)),
        (P**4 - P**2, (P,)),
        (exp(norm(A)) - 2 * norm(A), (A,)),
        (sqrt(P**2 - 1), (P,)),
        (sqrt((norm(A) - 1) ** 2), (A,)),
        (pos(norm(A) - 1) * norm(A) - norm(A) ** 2, (A,)),
        (eig_min(A), (A,)),
        (eig_sum(lambda x: x**3, A), (A,)),
        (log(1 + P**2), (P,)),
        (P ** Rational(3, 2), (P, R)),
        (1 / P, (P,)),
        (P**4 - 3 * P**2 * R**2 + R**4, (P, R)),
        (inner(A, X), (A, X)),
        (tr(A) ** 2 - inner(A, A), (A,)),
        (norm(A) ** 2 * P**2, (A, P)),
        (Abs(P) - Abs(R), (P, R)),
        (pos(P) - pos(-P) ** 2, (P,)),
        (exp(-norm(A)), (A,)),
        # convex up to 6: a program in floating point alone would let this pass
        (P**4 + (6 + Rational(1, 10**7)) * P**2 * R**2 + R**4, (P, R)),
    ],
)
def test_functions_that_are_not_convex_are_not_proved(expression, variables):
    assert not proved(expression, *variables)


def test_an_x_to_three_halves_is_convex_where_it_is_defined_only():
    # no value below zero: neither finite everywhere nor declared as +inf there
    report = law(STIFF, P ** Rational(3, 2), (p,)).check()
    assert report.admissible is not True


def test_bounds_are_enclosures():
    k, m = parameter("k", lower=0, upper=0.5), parameter("m", lower=2)
    assert 1 - 1e-15 <= sharp_interval(1 / (1 - 2 * k))[0] <= 1.0
    assert sharp_interval(k**2 - k + 1)[0] > 0
    assert sharp_interval(m**2 - m)[0] >= 0 and interval(-m)[1] == -2.0
    assert interval(1 / (k - Rational(1, 4)))[0] < -1e300


def test_conditions_name_the_moduli_and_know_the_declared_bounds():
    k = parameter("k", lower=0)
    report = law(STIFF + k * p**2 / 2 + c * tr(eps) * p, BALL, (p,)).check()
    assert report.admissible is True
    assert {str(x): x.implied for x in report.conditions} == {
        "E/(nu + 1) >= 0": False,
        "E/(1 - 2*nu) >= 0": False,
        "k >= 0": True,
        "(E*k + 6*c**2*nu - 3*c**2)/(1 - 2*nu) >= 0": False,
    }
    good = dict(E=3.0, nu=0.0, k=1.0, c=0.9)
    assert report.holds(good) is True and report.holds(good, c=1.1) is False and report.holds(E=3.0) is None


def test_determinant_of_a_coupling_decides_exactly():
    # E = 3, nu = 0: K = 1, psi = tr²/2 + ... + c tr p + k p²/2 is convex if and only if c² <= k K
    coupled = law(STIFF + H * p**2 / 2 + c * tr(eps) * p, BALL, (p,))
    assert coupled.check(E=3.0, nu=0.0, H=1.0, c=1.0).admissible is True
    report = coupled.check(E=3.0, nu=0.0, H=1.0, c=1.001)
    assert report.admissible is False and report.counterexample.violation > 0


def test_a_coupling_without_stiffness_must_vanish():
    free = law(STIFF + c * tr(eps) * p, BALL, (p,))
    assert "c = 0" in free.check().conditions
    assert free.check(E=1.0, nu=0.2, c=0.0).admissible is True
    assert free.check(E=1.0, nu=0.2, c=1e-3).admissible is False


def test_a_decreasing_atom_turns_the_curvature_of_its_argument():
    from sympy import Function

    from fenchel.potentials.atoms import ATOMS, Atom, register

    class Decay(Function):
        """A stand-in for e^(-x)."""

        is_real = True

    class DecayAtom(Atom):
        word = "decay"
        node = Decay

        def curvature(self, node, require):
            return "convex"

        def monotone(self, node, signs):
            return (-1,)

    register(DecayAtom())
    try:
        assert proved(Decay(-norm(A)), A) and proved(Decay(P), P) and proved(Decay(eig_min(A)), A)
        assert not proved(Decay(norm(A)), A) and not proved(-Decay(P), P)
    finally:
        del ATOMS[Decay]


def test_a_condition_that_fails_does_not_refute_where_another_rule_holds():
    sums = law(STIFF + H * Abs(p) + 2 * Abs(p) + H * p**2 + p**2, BALL, (p,))
    assert sums.check(E=1.0, nu=0.2, H=-0.5).admissible is True
    # one scalar: the second derivative 12 p² - 24 p + 2 (7 + H) decides exactly
    quartic = law(STIFF + H * p**2 + p**4 - 4 * p**3 + 7 * p**2, BALL, (p,))
    assert "H + 1 >= 0" in quartic.check().conditions
    assert quartic.check(E=1.0, nu=0.2, H=-0.99).admissible is True
    assert quartic.check(E=1.0, nu=0.2, H=-1.01).admissible is False
    # no rule with a symbol, a sum of squares with a number
    free = law(STIFF + p**4 + H * p**2 * r**2 + r**4, indicator(Abs(P) + Abs(R) - 1), (p, r))
    assert free.check().admissible is None
    report = free.check(E=1.0, nu=0.2, H=1.0)
    assert report.admissible is True and any("sum of squares" in x for x in report.reasons)
    assert free.check(E=1.0, nu=0.2, H=-1.0).admissible is False
    # admissible for -10 <= H <= -4 only: what plain values refute is not refuted for all
    far = law(STIFF + p**4 + (H + 10) * p**2 * r**2 + r**4, indicator(Abs(P) + Abs(R) - 1), (p, r))
    assert far.check().admissible is not False
    assert far.check(E=1.0, nu=0.2, H=-5.0).admissible is True


def test_exponents_are_conditions():
    report = law(ELASTIC, a * norm(A) ** n, (eps_p,)).check()
    assert report.admissible is True and {"a >= 0", "n - 1 >= 0"} <= set(report.conditions)
    assert law(ELASTIC, norm(A) ** n, (eps_p,)).check(E=1, nu=0.2, n=0.5).admissible is False


def test_a_real_power_of_a_state_is_convex_on_its_axis_and_of_a_force_is_not_known():
    hardening = law(ELASTIC + H * p ** (n + 1) / (n + 1), indicator(norm(dev(A)) + P - C), (eps_p, p)).check()
    assert hardening.admissible is True and "n >= 0" in hardening.conditions
    assert any("p > 0" in x for x in hardening.reasons)
    assert law(ELASTIC + p**2, a * P**n + MISES, (eps_p, p)).check().admissible is not True
    assert not proved(tr(A) ** n, A)


def test_cam_clay_with_the_consolidation_pressure_as_a_force():
    q2, m = Rational(3, 2) * inner(dev(A), dev(A)), -tr(A) / 3
    textbook = law(ELASTIC + H * p**2 / 2, indicator(q2 / M**2 + m * (m - P)), (eps_p, p)).check()
    assert textbook.admissible is False and len(textbook.counterexample.points) == 3
    gauge = law(ELASTIC + H * p**2 / 2, indicator(sqrt(q2 / M**2 + (-m + a - P) ** 2) - (a - P)), (eps_p, p)).check()
    assert gauge.admissible is True
    fixed = law(ELASTIC, indicator(q2 / M**2 + m * (m - C)), (eps_p,)).check()
    assert fixed.admissible is True


def test_a_set_may_be_convex_though_its_function_is_not():
    report = law(ELASTIC, indicator(sqrt(norm(dev(A))) - C), (eps_p,)).check()
    assert report.admissible is True and any("level set" in x for x in report.reasons)


@pytest.mark.parametrize(
    ("phi_star", "rule"),
    [
        (indicator(norm(dev(A)) + 1), "zero lies outside"),
        (inner(A, A) + 1, "not zero at zero"),
        (inner(A, A) + tr(A), "is negative"),
        (-inner(A, A), "not convex"),
    ],
)
def test_what_is_wrong_with_phi_star_is_said(phi_star, rule):
    report = law(ELASTIC, phi_star, (eps_p,)).check()
    assert report.admissible is False and rule in str(report.counterexample)
    assert report.dissipative is False


def test_temperature():
    heat = STIFF - c * (T * log(T / 300) - T)
    report = law(heat, M / (2 * T) * inner(gradient(T), gradient(T))).check()
    assert report.admissible is True and {"c >= 0", "M >= 0"} <= set(report.conditions)
    assert report.kind == "elastic, with heat conduction"
    assert law(STIFF + T**2).check().admissible is False
    flux = law(heat, phi=T / (2 * M) * inner(entropy_flux(T), entropy_flux(T))).check()
    assert flux.admissible is True and "M > 0" in flux.conditions
    # thermal softening of the stiffness: convex at temperatures where it is not negative
    soft = law((1 - a * (T - 300)) * STIFF - c * T**2).check()
    assert any(x.on_state == ("T",) for x in soft.conditions)


def test_density_must_be_positive():
    rho = parameter("rho")
    report = law(STIFF, density=rho).check()
    assert "rho > 0" in report.conditions
    assert law(STIFF, density=rho).check(E=1, nu=0.2, rho=-1).admissible is False


def test_law_declared_by_its_conjugate_and_by_rates():
    ball = indicator(norm(A) - 1)
    good = Law(
        "c",
        psi_star=inner(sig, sig) / (2 * E) + inner(sig, eps_p) - H * inner(eps_p, eps_p),
        phi_star=ball,
        internal=(eps_p,),
    )
    assert good.check().admissible is True and {"E > 0", "H >= 0"} <= set(good.check().conditions)
    bad = Law(
        "c",
        psi_star=inner(sig, sig) / (2 * E) + inner(sig, eps_p) + inner(eps_p, eps_p),
        phi_star=ball,
        internal=(eps_p,),
    )
    assert bad.check(E=1.0).admissible is False
    by_rates = law(
        ELASTIC, phi=C * norm(rates(eps_p)) + a * inner(rates(eps_p), rates(eps_p)), internal=(eps_p,)
    ).check()
    assert by_rates.admissible is True and by_rates.kind == "rate-independent and viscous"
    assert law(ELASTIC, phi=C * norm(rates(eps_p)), internal=(eps_p,)).check().kind == "rate-independent"


def test_frozen_state_makes_a_law_semi_implicit():
    report = law(ELASTIC + p**2, indicator(norm(dev(A)) - C - H * frozen(p) + P), (eps_p, p)).check()
    assert report.frozen == ("p",) and not report.associated
    assert any("semi-implicit" in x and "p frozen" in x for x in report.reasons)
    on_state = [x for x in report.conditions if x.on_state]
    assert len(on_state) == 1 and "frozen(p)" in on_state[0]


def test_what_cannot_evolve_and_what_softens_are_named():
    report = law(ELASTIC + p**2, MISES, (eps_p, p)).check()
    assert report.cannot_evolve == ("p",) and any("'p' cannot evolve" in x for x in report.reasons)
    hard = law(ELASTIC + H * p**2 / 2, indicator(norm(dev(A)) + P - C), (eps_p, p)).check(H=-2.0, E=1.0, nu=0.2, C=1.0)
    assert hard.admissible is False and hard.softening == ("H",)
    assert any("softening" in x and "H = -2" in x for x in hard.reasons)
    declared = law(ELASTIC - parameter("S", lower=0) * p**2 / 2, indicator(norm(dev(A)) + P - 1), (eps_p, p)).check()
    assert declared.admissible is False and declared.softening == ("S",)


def test_without_rule_and_without_counterexample_nothing_is_claimed():
    # convex (a product of increasing convex functions of one norm each is not covered), and no rule knows it
    hidden = exp(norm(A) ** 2 + P**2) * exp(norm(A) ** 2)
    report = law(ELASTIC + p**2, hidden - 1 + BALL, (eps_p, p)).check()
    assert report.admissible is not False
    assert law(ELASTIC, inner(A, A) * (1 + pos(tr(A))) ** 2, (eps_p,)).check().admissible is not True


def test_values():
    mises = law(ELASTIC, MISES, (eps_p,))
    report = mises.check(E=1.0, nu=0.2, C=2.0)
    assert report.admissible is True and report.conditions == ()
    part = mises.check(C=2.0)
    assert part.admissible is True and all("C" not in x for x in part.conditions)
    assert mises.check(nu=0.5).admissible is False
    assert mises.check(E=1.0, nu=0.7).admissible is False
    for bad, words in [(dict(x=1), "no parameter 'x'"), (dict(C="much"), "number"), (dict(C=float("nan")), "finite")]:
        with pytest.raises(InputError, match=words):
            mises.check(**bad)
    bounded = law(STIFF + parameter("k", lower=0) * inner(eps, eps))
    # convex all the same, but not what was declared: neither proved nor refuted
    report = bounded.check(E=1.0, nu=0.2, k=-0.1)
    assert report.admissible is None and any("outside the declaration: k = -0.1" in x for x in report.reasons)
    assert bounded.check(E=1.0, nu=0.2, k=-1.0).admissible is False


def test_the_report_as_text_and_as_json():
    report = law(ELASTIC - p**2, indicator(norm(dev(A)) + P - 1), (eps_p, p)).check()
    assert report.text().startswith("tried: refuted") and "counter-example:" in str(report)
    found = json.loads(report.json())
    assert found["admissible"] is False and found["verdict"] == "refuted"
    assert len(found["counterexample"]["points"]) == 3 and found["counterexample"]["violation"] > 0
    assert report._repr_markdown_().startswith("```")


def test_a_refuted_law_is_compiled_only_if_the_user_insists():
    softening = law(ELASTIC - p**2, indicator(norm(dev(A)) + P - 1), (eps_p, p))
    with pytest.raises(DeclarationError, match=r"not admissible: psi is not convex.*half way.*insist") as caught:
        softening.compile()
    assert "\n" not in str(caught.value)
    assert softening.compile(insist=True).law.psi == softening.psi
    # a law that some parameters make admissible is compiled; its conditions are enforced on the values
    law(ELASTIC + H * p**2, indicator(norm(dev(A)) + P - C), (eps_p, p)).compile()


def test_conditions_are_enforced_on_values():
    free = law(ELASTIC + H * p**2 + a * pos(tr(eps)) ** 2, indicator(c * norm(dev(A)) + P - C), (eps_p, p))
    good = dict(E=1.0, nu=0.2, H=0.0, a=1.0, c=1.0, C=1.0)
    assert free.admissible_values(good) == good
    for change, words in [
        (dict(H=-1.0), "H = -1 gives 'p' a negative modulus; psi would not be convex: softening is not modelled"),
        (dict(E=-1.0), "negative stiffness"),
        (dict(nu=0.5), "infinite"),
        (dict(a=-1.0), "a = -1 breaks the condition a >= 0"),
        (dict(c=-1.0), "negative weight"),
        (dict(C=-1.0), "zero force outside the elastic domain"),
    ]:
        with pytest.raises(InputError, match=words) as caught:
            free.admissible_values(good | change)
        assert "\n" not in str(caught.value)
    # once accepted, values are not decided again, and never mixed up with others
    assert free.admissible_values(good) == good


def test_functions_of_an_eigenvalue():
    from sympy import Symbol

    x = Symbol("x", real=True)
    needs = []
    assert one_variable(x**2 * n, x, needs.append) == "convex" and [str(k) for k in needs] == ["n"]
    assert one_variable(x**3, x, needs.append) == "unknown"
    assert one_variable(2 * x - 1, x, needs.append) == "affine"
    assert one_variable(-exp(x), x, needs.append) == "concave"
