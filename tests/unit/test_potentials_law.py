"""Declaration of a law: what is refused, and what the table, the report and the library say."""

import json
import subprocess
import sys

import pytest
from sympy import Symbol, exp, sqrt, tan

from fenchel.errors import DeclarationError, InputError
from fenchel.potentials import (
    Law,
    dev,
    forces,
    identity,
    indicator,
    inner,
    isotropic,
    lame,
    load_law,
    norm,
    parameter,
    parameters,
    pos,
    scalar,
    sym_tensor,
    tr,
)
from fenchel.potentials.library import LAWS, sand, texsol

E, nu, C, H = parameters("E nu C H")
eps, eps_p, p = sym_tensor("eps"), sym_tensor("eps_p"), scalar("p")
A, R = forces(eps_p, p)
ENERGY = isotropic(E, nu).energy(eps - eps_p)
VALUES = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3, lambda_w=1e6, mu_w=1e6)


def test_the_declaration_of_the_design_works_and_equals_the_library():
    E_s, nu_s, lambda_w, mu_w, H_k, H_i, C_0, theta_f = parameters("E_s nu_s lambda_w mu_w H_k H_i C_0 theta_f")
    alpha = sym_tensor("alpha")
    ground = isotropic(E_s, nu_s).energy(eps - eps_p) + H_k / 2 * inner(alpha, alpha) + H_i / 2 * p**2
    wire = lambda_w / 2 * pos(tr(eps)) ** 2 + mu_w * inner(pos(eps), pos(eps))
    force, chi, resistance = forces(eps_p, alpha, p)
    f = norm(dev(force + chi)) / sqrt(2) + tan(theta_f) / 3 * tr(force + chi) + resistance - C_0
    law = Law("texsol", psi=ground + wire, phi_star=indicator(f), observable=eps, internal=(eps_p, alpha, p))
    assert [q.name for q in law.parameters] == [q.name for q in texsol.parameters]
    assert str(law.stress) == str(texsol.stress)
    assert str(law.force_laws[eps_p]) == str(texsol.force_laws[texsol.internal[0]])


@pytest.mark.parametrize(
    ("declare", "words"),
    [
        (lambda: Law("a", psi=ENERGY, observable=eps), "'eps_p' is used in psi but not declared"),
        (lambda: Law("a", psi=eps, observable=eps), "rank mismatch"),
        (lambda: Law("a", psi=Symbol("x") * tr(eps), observable=eps), "bare symbol"),
        (lambda: Law("a", psi=tr(eps) * tr(A), observable=eps, internal=(eps_p,)), "mentions a force"),
        (
            lambda: Law("a", psi=ENERGY, phi_star=indicator(norm(dev(eps_p)) - C), observable=eps, internal=(eps_p,)),
            "state",
        ),
        (lambda: Law("a", psi=ENERGY, phi_star=dev(A), observable=eps, internal=(eps_p,)), "rank mismatch"),
        (lambda: Law("a", psi=ENERGY, observable=eps, internal=(eps_p, eps_p)), "declared twice"),
        (lambda: Law("a", psi=ENERGY, observable=p, internal=(eps_p,)), "observable must be a tensor"),
        (lambda: Law("a b", psi=ENERGY, observable=eps, internal=(eps_p,)), "name begins with a letter"),
        (
            lambda: Law("a", psi=ENERGY + parameter("E", lower=0) * tr(eps), observable=eps, internal=(eps_p,)),
            "two parameters",
        ),
        (lambda: Law("a", psi=parameter("eps") * tr(eps), observable=eps), "both a parameter and a variable"),
        (lambda: Law("a", psi=tr(p * eps), observable=eps, internal=(p,)), "parameters only"),
        (lambda: indicator(norm(dev(A)) <= C), "indicator\\(f\\)"),
        (lambda: indicator(dev(A)), "rank mismatch"),
        (lambda: indicator(), "at least one"),
    ],
)
def test_wrong_declarations_are_refused_in_one_line(declare, words):
    with pytest.raises(DeclarationError, match=words) as caught:
        declare()
    assert "\n" not in str(caught.value)


def test_a_variable_that_cannot_evolve_is_refused_at_compile():
    law = Law("a", psi=ENERGY + H * p**2, phi_star=indicator(norm(dev(A)) - C), observable=eps, internal=(eps_p, p))
    assert any("cannot evolve" in reason for reason in law.check().reasons)
    with pytest.raises(DeclarationError, match="'p' cannot evolve"):
        law.compile()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"H_k": -1.0}, "H_k.*softening is not modelled"),
        ({"C_0": -1.0}, "C_0.*outside"),
        ({"nu_s": 0.7}, "nu_s.*outside"),
        ({"H_i": float("nan")}, "H_i.*finite"),
        ({"E_s": "stiff"}, "E_s.*number"),
        ({"E_x": 1.0}, "no parameter 'E_x'"),
    ],
)
def test_wrong_values_are_refused_in_one_line(change, words):
    with pytest.raises(InputError, match=words) as caught:
        texsol.values(VALUES | change)
    assert "\n" not in str(caught.value)


def test_a_missing_value_is_named():
    with pytest.raises(InputError, match=r"'C_0' \[Pa\], .* have no value; give C_0="):
        sand.values({})


def test_parameters_can_be_replaced_by_expressions():
    E_w, nu_w = parameters("E_w nu_w")
    lam, mu = lame(E_w, nu_w)
    law = texsol.with_parameters(lambda_w=lam, mu_w=mu)
    names = [q.name for q in law.parameters]
    assert "E_w" in names and "lambda_w" not in names
    with pytest.raises(DeclarationError, match="no parameter 'x'"):
        texsol.with_parameters(x=1)


@pytest.mark.parametrize("name", LAWS)
def test_library_laws_print_and_are_admissible(name):
    law = LAWS[name]
    assert law.note and all(q.unit and q.note for q in law.parameters)
    report = law.check()
    assert report.admissible is True and report.conditions
    table = law.table("strain")
    assert table.text().splitlines()[0].startswith(name)
    assert {"title", "text", "latex"} == set(json.loads(table.json())["rows"][0])
    assert table.latex().count("&") == len(table.rows)


def test_check_decides_with_values():
    assert texsol.check(**VALUES).admissible is True
    assert texsol.check(**VALUES).conditions == ()
    assert texsol.check(**VALUES | {"H_k": -1.0}).admissible is False
    assert texsol.check(**VALUES | {"C_0": -1.0}).admissible is False
    # a linear term is convex of either sign
    assert Law("tilted", psi=ENERGY - H * tr(eps), observable=eps, internal=(eps_p,)).check(E=1, nu=0.2, H=1).admissible
    assert (
        Law("bent", psi=ENERGY - H * tr(eps) ** 2, observable=eps, internal=(eps_p,)).check(E=1, nu=0.2, H=1).admissible
        is False
    )
    odd = Law(
        "odd", psi=ENERGY + H * tr(eps) ** 4, phi_star=indicator(norm(dev(A)) - C), observable=eps, internal=(eps_p,)
    )
    assert odd.check().admissible is True and any("H >= 0" in c for c in odd.check().conditions)


def test_table_of_the_stress_formulation():
    text = texsol.table("stress").text()
    assert "min over sig_s + sig_w = sig" in text and "smallest eigenvalue" in text
    assert "A = dpsi_star/deps_p = sig_s" in text
    assert "eps = dpsi_star/dsig = eps_p + (nu_s + 1)/E_s*sig - nu_s*tr(sig)/E_s*I" in sand.table("stress").text()
    reversible = texsol.table("strain", split="reversible").text()
    assert "A_r = -dpsi/deps_p = -2*mu_w*pos(eps_p + eps_r)" in reversible
    with pytest.raises(InputError):
        sand.table("both")


def test_table_of_laws_without_internal_variables_and_of_a_single_unilateral_phase():
    wire, elastic, bilateral = LAWS["wire"], LAWS["linear_elastic"], LAWS["reinforced_sand"]
    stress = wire.table("stress").text()
    assert "psi_star = psi_star" not in stress and "for lambda_w = 0 wherever it is >= 0" in stress
    assert r"\psi_{}" not in wire.table("stress").latex()
    reversible = elastic.table("strain", split="reversible").text()
    assert "eps = eps_r, eps_ir = 0" in reversible and "sig = dpsi/deps" in reversible and "sig_ir" not in reversible
    assert "+ -" not in bilateral.table("stress").text() + bilateral.table("stress").latex()
    # the apex is in the table: an inclusion, as the gradient of f does not exist there
    assert "in dphi_star(A, chi, R)" in sand.table("strain").text()


def test_what_has_no_closed_conjugate_is_stated_as_what_it_is():
    prestressed = Law("a", psi=inner(pos(eps + C * identity), pos(eps + C * identity)), observable=eps)
    assert "psi_star = -C*tr(sig) + inner(sig, sig)/4 if eig_min(sig) >= 0" in prestressed.table("stress").text()
    quartic = Law("a", psi=H * tr(eps) ** 4, observable=eps)
    assert "if dev(sig) = 0, else +oo" in quartic.table("stress").text()
    # no rule: the supremum is printed, and the state law as an inclusion
    odd = Law("a", psi=inner(eps, eps) + norm(eps) * exp(tr(eps)), observable=eps).table("stress").text()
    assert "psi_star = sup over eps of {inner(sig, eps) - (exp(tr(eps))*norm(eps) + inner(eps, eps))}" in odd
    assert "eps in dpsi_star/dsig" in odd


def test_load_law(tmp_path):
    assert load_law("texsol") is texsol
    file = tmp_path / "mine.py"
    file.write_text("from fenchel.potentials.library import sand\nmine = sand\nother = 3\n")
    assert load_law(f"{file}:mine").name == "sand"
    for where, words in [
        ("nothing", "no law is called"),
        (f"{file}:other", "not a Law"),
        (f"{file}:absent", "has no law"),
        (f"{tmp_path}/absent.py:x", "does not exist"),
    ]:
        with pytest.raises(InputError, match=words):
            load_law(where)
    file.write_text("1/0")
    with pytest.raises(InputError, match="ZeroDivisionError"):
        load_law(f"{file}:mine")
    file.write_text("raise SystemExit(0)")
    with pytest.raises(InputError, match="leaves Python"):
        load_law(f"{file}:mine")


def test_import_is_light():
    code = "import sys, fenchel.potentials; print([m for m in ('numba', 'cvxpy', 'matplotlib', 'scipy') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_a_bare_import_from_the_checkout_fails():
    found = subprocess.run([sys.executable, "-c", "import potentials"], capture_output=True, text=True, check=False)
    assert found.returncode != 0
