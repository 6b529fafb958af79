"""Bad declarations, from the user's side: every message is one line that names the symbol, the rule and what to write instead.

Each case is a declaration and words that must stand in its message.
"""

import re

import numpy as np
import pytest
from sympy import (
    DiracDelta,
    Function,
    Heaviside,
    I,
    Integral,
    Matrix,
    MatrixSymbol,
    Piecewise,
    Symbol,
    exp,
    log,
    nan,
    oo,
    sin,
    sqrt,
    zoo,
)

from fenchel.errors import DeclarationError, FenchelError, InputError
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_sum,
    entropy_flux,
    forces,
    frozen,
    gradient,
    indicator,
    inner,
    isotropic,
    lame,
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
from fenchel.potentials.library import ENTRIES, LAWS

E, nu, C, H = parameters("E nu C H")
eps, eps_p, alpha, p, q, flux = (
    sym_tensor("eps"),
    sym_tensor("eps_p"),
    sym_tensor("alpha"),
    scalar("p"),
    scalar("q"),
    vector("flux"),
)
T = temperature("T")
A, R = forces(eps_p, p)
X = forces(alpha)
ELASTIC = isotropic(E, nu).energy(eps - eps_p)
YIELD = norm(dev(A)) - C


DOMAIN = indicator(YIELD)


def law(psi=ELASTIC, phi_star=DOMAIN, internal=(eps_p,), **more):
    return Law("clay", psi=psi, phi_star=phi_star, observable=eps, internal=internal, **more)


UNDECLARED = [
    (lambda: law(internal=()), "'eps_p' is used in psi but not declared; add it to internal="),
    (lambda: law(phi_star=indicator(YIELD + R)), "'p' is used in phi_star but not declared; add it to internal="),
    (lambda: law(phi_star=indicator(YIELD + norm(X))), "'alpha' is used in phi_star but not declared"),
    (lambda: law(psi=ELASTIC * Symbol("x")), "'x' in psi is a bare symbol; declare it with parameter"),
    (lambda: law(psi=ELASTIC * Symbol("E")), "'E' in psi is a bare symbol"),
    (lambda: law(phi_star=indicator(YIELD + Symbol("k"))), "'k' in phi_star is a bare symbol"),
    (lambda: law(psi=ELASTIC - scalar("T") ** 2), "'T' is used in psi but not declared"),
    (lambda: law(psi=ELASTIC + p**2, internal=(eps_p, p)).compile(), "'p' cannot evolve.*add forces.p. to phi_star"),
    (lambda: law(phi_star=None).compile(), "'eps_p' cannot evolve"),
    (lambda: law(internal=(eps_p, eps_p)), "'eps_p' is declared twice"),
    (lambda: law(internal=(eps_p, eps)), "'eps' is declared twice"),
    (lambda: law(internal=(eps_p, C)), "internal variable C must be sym_tensor"),
    (lambda: law(internal=(A,)), "internal variable A_eps_p must be"),
    (lambda: law(internal=None), "internal variable None must be"),
    (lambda: law(internal=3), "internal variable 3 must be"),
    (lambda: Law("clay", psi=p**2, observable=p), "observable must be a tensor variable, sym_tensor"),
    (lambda: Law("clay", psi=tr(A) ** 2, observable=A), "observable must be a tensor variable"),
    (
        lambda: law(irreversible=alpha),
        "irreversible names 'alpha', which is not an internal tensor; list it in internal=",
    ),
]

RANKS = [
    (lambda: eps + 1, "adding a tensor and a scalar; write scalar \\* identity"),
    (lambda: 1 + eps, "adding a tensor and a scalar; write scalar \\* identity"),
    (lambda: eps - C, "subtracting a tensor and a scalar; write scalar \\* identity"),
    (lambda: C - eps, "a tensor and a scalar; write scalar \\* identity"),
    (lambda: eps * eps, "multiplying a tensor and a tensor is not defined; use inner"),
    (lambda: eps / eps, "dividing a tensor and a tensor is not defined; use inner"),
    (lambda: C / eps, "nothing can be divided by a tensor"),
    (lambda: eps**2, "a tensor has no power; write inner"),
    (lambda: abs(eps), "a tensor has no absolute value; write norm"),
    (lambda: flux + eps, "adding a vector and a tensor"),
    (lambda: eps + flux, "adding a tensor and a vector"),
    (lambda: flux * flux, "multiplying a vector and a vector is not defined; use inner"),
    (lambda: flux * eps, "multiplying a vector and a tensor"),
    (lambda: norm(C), "norm takes a tensor or a vector, not a scalar; write Abs"),
    (lambda: tr(C), "tr takes a tensor, not a scalar"),
    (lambda: tr(flux), "tr takes a tensor, not a vector"),
    (lambda: dev(p), "dev takes a tensor, not a scalar"),
    (lambda: dev(flux), "dev takes a tensor, not a vector"),
    (lambda: inner(C, eps), "inner takes two tensors or two vectors, not a scalar"),
    (lambda: inner(flux, eps), "inner of a vector and a tensor; both must be of one rank"),
    (lambda: pos(flux), "pos takes a scalar or a tensor, not a vector"),
    (lambda: eig_max(C), "eig_max takes a tensor, not a scalar"),
    (lambda: eig_max(flux), "eig_max takes a tensor, not a vector"),
    (lambda: law(psi=eps), "psi is a tensor, it must be a scalar"),
    (lambda: law(psi=flux), "psi is a vector, it must be a scalar"),
    (lambda: law(phi_star=A), "phi_star is a tensor, it must be a scalar"),
    (lambda: law(density=eps), "density is a tensor, it must be a scalar"),
    (lambda: indicator(dev(A)), "indicator takes scalar functions f of .f <= 0., not a tensor"),
    (lambda: indicator(YIELD) + eps, "added to an indicator is a tensor"),
    (lambda: law(psi=ELASTIC + exp(eps)), "psi holds a function of the tensor eps; scalar functions take scalars"),
    (lambda: law(psi=tr(p * eps) ** 2, internal=(eps_p, p)), "coefficient p of a tensor.*may hold parameters only"),
    (lambda: law(phi_star=indicator(norm(R * A) - C), internal=(eps_p, p)), "coefficient A_p of a tensor"),
]

NUMBERS = [
    *(
        (lambda bad=bad: law(psi=ELASTIC * bad), "psi holds a number that is not finite and real")
        for bad in (1 + I, 1 + 2j, nan, float("nan"), oo, float("inf"), sqrt(-1), log(-1))
    ),
    (lambda: law(psi=ELASTIC + tr(eps) * zoo), "not finite and real"),
    (lambda: law(psi=ELASTIC / (C - C)), "not finite and real"),
    (lambda: law(psi=inner(eps * I, eps), internal=()), "not finite and real"),
    (lambda: law(phi_star=indicator(YIELD * nan)), "phi_star holds a number that is not finite and real"),
    (lambda: eps * nan, "a coefficient of a tensor must be finite"),
    (lambda: eps * float("inf"), "a coefficient of a tensor must be finite"),
    (lambda: eps / 0, "a tensor cannot be divided by zero"),
    *(
        (lambda bad=bad: law(density=bad), "density must be a positive number")
        for bad in (0, -1.0, T, p, float("nan"), oo, I)
    ),
    (lambda: parameter("a", lower=1, upper=0), "'a': the lower bound 1 must not exceed the upper bound 0"),
    (lambda: parameter("a", lower=float("nan")), "'a': the lower bound nan"),
    (lambda: parameter("a", lower=0, default=-1), "'a': the default -1 lies outside"),
    (lambda: parameter("a", lower="0"), "'a': lower must be a number, not str"),
    (lambda: parameter("a", unit=3), "'a': unit must be text, not int"),
]

FUNCTIONS = [
    (lambda: law(psi=ELASTIC + Heaviside(tr(eps)) * tr(eps) ** 2), "psi holds Heaviside; write kinks with pos"),
    (lambda: law(psi=ELASTIC + DiracDelta(tr(eps))), "psi holds DiracDelta; write kinks with pos"),
    (lambda: law(psi=ELASTIC + Piecewise((tr(eps) ** 2, tr(eps) > 0), (0, True))), "psi holds Piecewise; write kinks"),
    (lambda: law(psi=ELASTIC + sin(tr(eps))), "psi holds 'sin' of a variable.*they know.*norm"),
    (lambda: law(psi=ELASTIC + Function("g")(tr(eps))), "psi holds 'g' of a variable"),
    (
        lambda: law(psi=ELASTIC + Integral(Symbol("x"), (Symbol("x"), 0, p)), internal=(eps_p, p)),
        "psi holds 'Integral'",
    ),
    (lambda: law(psi=Matrix([[1]])), "psi must be a scalar expression"),
    (lambda: law(psi=MatrixSymbol("M", 3, 3)), "psi must be a scalar expression, not MatrixSymbol"),
    (lambda: law(phi_star=indicator(norm(dev(A)) <= C)), "write indicator.f., not indicator.f <= 0."),
    (lambda: law(phi_star=norm(dev(A)) <= C), "phi_star must be a scalar expression, not LessThan; write.*indicator.f"),
    (lambda: indicator(True), "indicator takes the left side of f <= 0"),
    (lambda: indicator(None), "indicator takes the left side of f <= 0"),
    (lambda: indicator([YIELD]), "not list; indicator takes the left side"),
    (lambda: indicator(), "indicator needs at least one function"),
    (lambda: law(phi_star=[YIELD]), "phi_star must be a scalar expression, not list; write.*indicator"),
    (lambda: indicator(YIELD) ** 2, "an indicator has no power"),
    (lambda: inner(A, A) - indicator(YIELD), "an indicator cannot be subtracted"),
    (lambda: -indicator(YIELD), "an indicator cannot be subtracted"),
    (lambda: -1 * indicator(YIELD), "the factor -1 of a potential is not positive"),
    (lambda: p * indicator(YIELD), "the factor p of a potential is not positive for sure"),
    (lambda: law(psi=indicator(tr(eps))), "psi holds an indicator; a free energy is finite.*phi_star"),
]

ROLES = [
    (
        lambda: law(psi=ELASTIC + frozen(p) * tr(eps), internal=(eps_p, p)),
        "psi mentions a frozen.*state variables only",
    ),
    (lambda: law(psi=ELASTIC + tr(A)), "psi mentions a force.*'A_eps_p'.*state variables only"),
    (lambda: law(psi=ELASTIC + tr(rates(eps))), "psi mentions a rate.*state variables only"),
    (lambda: law(psi=ELASTIC + norm(gradient(T))), "psi mentions a force.*'grad_T'"),
    (lambda: law(phi_star=indicator(YIELD + p), internal=(eps_p, p)), "phi_star mentions the state 'p'.*frozen.p."),
    (lambda: law(phi_star=norm(rates(eps_p))), "phi_star mentions the rate 'deps_p/dt'; it is a function of forces"),
    (
        lambda: Law("clay", psi=ELASTIC, phi=norm(A), observable=eps, internal=eps_p),
        "phi mentions the force 'A_eps_p'; it is a function of rates",
    ),
    (lambda: gradient(p), "gradient takes a temperature declared by temperature"),
    (lambda: entropy_flux(p), "entropy_flux takes a temperature"),
    (lambda: forces(T), "forces does not take the temperature 'T'; its force is gradient"),
    (lambda: rates(T), "rates does not take the temperature 'T'"),
    (lambda: frozen(T), "frozen does not take the temperature 'T'"),
    (lambda: forces(A), "'A_eps_p' is a force already; forces takes state variables"),
    (lambda: forces(C), "forces takes variables declared by sym_tensor, vector or scalar, not C"),
    (lambda: forces(eps_p, p, names="A"), "1 names for 2 variables"),
    (lambda: law(internal=(eps_p, T)), "the temperature 'T' is not an internal variable"),
    (lambda: law(psi=ELASTIC - T**2 - temperature("T_2") ** 2), "two temperatures: T, T_2; a law has one"),
    (lambda: law(phi=norm(rates(eps_p))), "give one of phi= and phi_star=, not both"),
    (lambda: law(psi_star=inner(alpha, alpha)), "give one of psi= and psi_star=, not both"),
    (lambda: Law("clay", observable=eps), "give one of psi= and psi_star=, not neither"),
    (lambda: Law("clay", psi_star=inner(eps, eps), observable=eps), "psi_star must be written in one stress tensor"),
    (
        lambda: law(phi_star=indicator(YIELD, norm(forces(eps_p, names="B")) - C)),
        "two names for the force of 'eps_p'; call forces.*once",
    ),
    (lambda: law(psi=ELASTIC + parameter("E", lower=0) * tr(eps)), "two parameters are called 'E'.*declare it once"),
    (lambda: law(psi=ELASTIC + parameter("eps_p") * tr(eps)), "'eps_p' is both a parameter and a variable; rename one"),
    (lambda: law(psi=ELASTIC + parameter("A_eps_p") * tr(eps)), "'A_eps_p' is both a parameter and"),
]

TEXT = [
    (lambda: law(psi="E*tr(eps)**2"), "psi must be a scalar expression, not str"),
    (lambda: law(phi_star="norm(A)"), "phi_star must be a scalar expression, not str"),
    (lambda: law(density="2000"), "density must be a scalar expression, not str"),
    (lambda: law(internal="eps_p"), "internal variable eps_p must be sym_tensor"),
    (lambda: law(internal=("eps_p",)), "internal variable eps_p must be sym_tensor"),
    (lambda: law(irreversible="eps_p"), "irreversible names 'eps_p', which is not an internal tensor"),
    (lambda: law(note=3), "note must be text, not int"),
    (lambda: Law("clay", psi=ELASTIC, observable="eps", internal=eps_p), "observable must be a tensor variable"),
    (lambda: indicator("f"), "the argument of indicator must be a scalar expression, not str"),
    (lambda: eps * "2", "multiplying a tensor and str is not defined"),
    (lambda: eps + "2", "rank mismatch"),
    (lambda: pos("1"), "str is not defined"),
    (lambda: norm("eps"), "norm takes a tensor or a vector"),
    (lambda: inner("a", "b"), "inner takes two tensors"),
    (lambda: forces("eps_p"), "forces takes variables declared by"),
    (lambda: isotropic("E", 0.2), "Young's modulus must be a scalar expression, not str"),
    (lambda: lame(1.0, "0.2"), "Poisson's ratio must be a scalar expression, not str"),
    (
        lambda: LAWS["sand"].with_parameters(C_0="1+1"),
        "the replacement of parameter 'C_0' must be a scalar expression, not str",
    ),
    (lambda: eig_sum("x**2", eps), "give a function of one scalar"),
    (lambda: parameters(3), "parameters takes one string of names"),
    (lambda: law(psi=ELASTIC, internal=(eps_p,)).with_parameters(x=1), "no parameter 'x'; it has: "),
]

DECLARATIONS = UNDECLARED + RANKS + NUMBERS + FUNCTIONS + ROLES + TEXT


def refused(declare, words, kind=DeclarationError):
    with pytest.raises(kind) as caught:
        declare()
    message = str(caught.value)
    assert re.search(words, message), message
    assert "\n" not in message and len(message) < 500
    return message


@pytest.mark.parametrize(("declare", "words"), DECLARATIONS)
def test_a_bad_declaration_is_refused_with_its_symbol_rule_and_remedy(declare, words):
    refused(declare, words)


def test_a_power_of_a_tensor_through_sympy_is_refused():
    with pytest.warns(), pytest.raises(DeclarationError, match="a tensor has no power"):
        sqrt(eps)


def test_text_never_reaches_the_evaluation_of_sympy(monkeypatch):
    """sympify of text runs it: no declaration may get there."""
    reached = []
    monkeypatch.setattr("sympy.parsing.sympy_parser.eval_expr", lambda *a, **k: reached.append(a))
    for declare, _ in TEXT:
        with pytest.raises(FenchelError):
            declare()
    assert reached == []


HOSTILE = [
    "__import__('os').system('true')",
    "__class__",
    "a\nb",
    "a\n",
    "a'b",
    'a"b',
    "a`b",
    "a;b",
    "a b",
    "a.b",
    "a[0]",
    "a#b",
    "a\\b",
    "a\x00b",
    "",
    " ",
    "1a",
    "_a",
    "a_",
    "a" * 61,
    "a" * 10_000,
    "\u0435ps",  # Cyrillic ie
    "\u03b5",
    "\uff25",  # fullwidth E
    "a\u0301",
    "a\u200b",
    "lambda",
    "None",
    "True",
    "class",
    "match",
    "np",
    "dt",
    "eps_new",
    "state",
    "print",
    "numba",
    None,
    3,
    b"a",
    ["a"],
]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_is_refused_by_whatever_takes_a_name(name):
    makers = [
        parameter,
        scalar,
        sym_tensor,
        vector,
        temperature,
        lambda n: Law(n, psi=ELASTIC, observable=eps, internal=(eps_p,)),
        lambda n: forces(eps_p, names=n) if isinstance(n, str) and n.split() == [n] else parameter(n),
    ]
    for make in makers:
        refused(lambda make=make: make(name), "name")


def test_nothing_is_written_or_run_for_a_refused_declaration(tmp_path, monkeypatch):
    monkeypatch.setenv("FENCHEL_CACHE", str(tmp_path))
    for name in HOSTILE:
        with pytest.raises(DeclarationError):
            Law(name, psi=ELASTIC, phi_star=indicator(YIELD), observable=eps, internal=(eps_p,)).compile()
    assert not any(tmp_path.rglob("*"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"H_k": -1.0}, "'H_k' = -1 lies outside \\[0, inf\\] Pa; softening is not modelled"),
        ({"H_i": -1e-12}, "'H_i'.*softening is not modelled"),
        ({"C_0": -1.0}, "'C_0' = -1 lies outside"),
        ({"nu_s": 0.7}, "'nu_s' = 0.7 lies outside \\[-1, 0.5\\]"),
        ({"theta_f": 1.6}, "'theta_f' = 1.6 lies outside"),
        ({"E_s": float("nan")}, "'E_s' is nan; it must be finite"),
        ({"E_s": float("inf")}, "'E_s' is inf; it must be finite"),
        ({"E_s": "stiff"}, "'E_s' must be a number, not str"),
        ({"E_s": [1.0]}, "'E_s' must be a number, not list"),
        ({"E_s": 1j}, "'E_s' must be a number, not complex"),
        ({"E_x": 1.0}, "no parameter 'E_x'; it has: C_0"),
    ],
)
def test_a_value_outside_its_bounds_is_refused_by_name(change, words):
    refused(lambda: LAWS["sand"].values({**ENTRIES["sand"].values, **change}), words, InputError)


def test_a_missing_value_is_asked_for():
    values = {name: value for name, value in ENTRIES["sand"].values.items() if name != "C_0"}
    refused(lambda: LAWS["sand"].values(values), r"'C_0' \[Pa\] has no value; give C_0=", InputError)


GIVEN = dict(E=1.0, nu=0.2)
SOFT = parameter("S", lower=0)
REFUTED = [
    # a non-convex set with the two points that show it, and the point half way
    (
        lambda: law(phi_star=indicator(C - norm(dev(A)))),
        dict(C=1.0),
        "not convex.*f\\(A_eps_p = .* and f\\(A_eps_p = .*half way",
    ),
    (lambda: law(phi_star=indicator(tr(A) - tr(A) ** 2 / C)), dict(C=1.0), "not convex.* and .*half way"),
    (lambda: law(phi_star=sqrt(norm(A))), {}, "phi_star is not convex.* and .*half way"),
    (lambda: law(phi_star=inner(A, A) - C * norm(A)), dict(C=1.0), "phi_star"),
    # zero outside, negative at zero
    (lambda: law(phi_star=indicator(norm(dev(A)) + C)), dict(C=1.0), "f\\(0\\) > 0: f\\(A_eps_p = 0\\) = 1"),
    (lambda: law(phi_star=YIELD), dict(C=1.0), "phi_star is not zero at zero"),
    # softening, and energies that are not convex
    (
        lambda: law(psi=ELASTIC - SOFT * p**2, phi_star=indicator(YIELD + R), internal=(eps_p, p)),
        dict(C=1.0, S=1.0),
        "psi is not convex: .*p = .* and .*p = .*half way",
    ),
    (lambda: law(psi=ELASTIC - 100 * tr(eps) ** 2), dict(C=1.0), "psi is not convex: .*eps = .* and .*half way"),
    (lambda: law(psi=ELASTIC + T**2), dict(C=1.0), "psi is not concave: .*T = .* and .*T = .*half way"),
]


@pytest.mark.parametrize(("declare", "more", "words"), REFUTED)
def test_an_inadmissible_law_is_refuted_by_numbers_that_show_it(declare, more, words):
    report = declare().check(**GIVEN, **more)
    assert report.admissible is False
    shown = str(report.counterexample)
    assert re.search(words, shown), shown
    assert "\n" not in shown


@pytest.mark.parametrize(("declare", "more", "words"), REFUTED)
def test_an_inadmissible_law_is_not_compiled(declare, more, words):
    """Before any code is written, or, where it depends on the values, before the first step."""
    bad = declare()
    heat = {} if bad.temperature is None else {bad.temperature.name: 300.0}
    refused(
        lambda: bad.compile()(np.full((1, 6), 1e-3), None, **GIVEN, **more, **heat),
        "not admissible|not be convex|non-convex|negative|zero force|not be concave|softening|no conic form",
        InputError,
    )
