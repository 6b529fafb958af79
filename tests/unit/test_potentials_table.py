"""Blocks of Table 1 word by word, for laws with every kind of row; what stands in LaTeX and JSON; rows that do not exist are absent.

The blocks were checked by hand against the table of the theory: slots, signs, ρ, both splits and both formulations.
"""
# ruff: noqa: E501

import json
import re

import pytest
from sympy import log

from fenchel.potentials import (
    Law,
    dev,
    forces,
    gradient,
    indicator,
    inner,
    norm,
    parameter,
    pos,
    rates,
    scalar,
    sym_tensor,
    temperature,
    tr,
    vector,
)
from fenchel.potentials.library import LAWS

eps, eps_v, eps_p, sig = (sym_tensor(name) for name in ("eps", "eps_v", "eps_p", "sig"))
p, T = scalar("p"), temperature("T")
K, G, H, eta, k, c, d, rho, a, C, T_0 = (
    parameter(name, lower=0) for name in ["K", "G", "H", "eta", "k", "c", "d", "rho", "a", "C", "T_0"]
)
A, B, R = forces(eps_v, eps_p, p, names="A B R")
ELASTIC = K / 2 * tr(eps - eps_p) ** 2 + G * inner(dev(eps - eps_p), dev(eps - eps_p))
THERMAL = Law(
    "thermal",
    psi=(ELASTIC - 3 * K * a * (T - T_0) * tr(eps - eps_p) + H / 2 * p**2) / rho - C * T * log(T / T_0),
    phi_star=indicator(norm(dev(B)) + R - c) + k / (2 * T) * inner(gradient(T), gradient(T)),
    observable=eps,
    internal=(eps_p, p),
    density=rho,
)
TWO = Law(
    "two",
    psi=ELASTIC + H / 2 * p**2,
    phi_star=indicator(norm(dev(B)) + R - c, tr(B) - d),
    observable=eps,
    internal=(eps_p, p),
)
STAR = Law(
    "star",
    psi_star=tr(sig) ** 2 / (18 * K) + inner(dev(sig), dev(sig)) / (4 * G) + inner(sig, eps_p) - H / 2 * p**2,
    phi_star=indicator(norm(dev(B)) + R - c),
    observable=eps,
    internal=(eps_p, p),
)
RATE = Law(
    "rate",
    psi=ELASTIC,
    phi=c * norm(dev(rates(eps_p))) + eta * inner(rates(eps_p), rates(eps_p)) + d / 2 * inner(rates(eps), rates(eps)),
    observable=eps,
    internal=eps_p,
)
SERIES = Law(
    "series",
    psi=K / 2 * tr(eps - eps_v - eps_p) ** 2 + G * inner(eps - eps_v - eps_p, eps - eps_v - eps_p),
    phi_star=inner(A, A) / (4 * eta) + indicator(norm(dev(B)) - c),
    observable=eps,
    internal=(eps_v, eps_p),
)
WIRES = Law(
    "wires", psi=ELASTIC + a / 2 * pos(tr(eps)) ** 2 + d * inner(pos(eps), pos(eps)), observable=eps, internal=eps_p
)
BLOCKS = {
    "thermal strain total": (THERMAL, "strain", "total"),
    "thermal stress reversible": (THERMAL, "stress", "reversible"),
    "Kelvin–Voigt strain total": (LAWS["kelvin_voigt"], "strain", "total"),
    "Kelvin–Voigt stress reversible": (LAWS["kelvin_voigt"], "stress", "reversible"),
    "two surfaces stress total": (TWO, "stress", "total"),
    "psi_star strain total": (STAR, "strain", "total"),
    "phi strain total": (RATE, "strain", "total"),
    "series strain reversible": (SERIES, "strain", "reversible"),
    "wires stress total": (WIRES, "stress", "total"),
}
GOLDEN = {
    "thermal strain total": """\
thermal: strain formulation, total split
decomposition           sig = sig_r + sig_ir, sig_ir = 0
dissipation inequality  inner(B, deps_p/dt) + R*dp/dt + inner(-q/T, grad_T) >= 0
density                 rho, potentials per unit mass
free energy             psi = -C*T*log(T/T_0) + (G*inner(dev(eps - eps_p), dev(eps - eps_p)) + H*p**2/2 - 3*K*a*(-T_0 + T)*tr(eps - eps_p) + K*tr(eps - eps_p)**2/2)/rho
state law               sig_r = rho*dpsi/deps = 2*G*dev(eps) - 2*G*dev(eps_p) - (3*K*a*(-T_0 + T) - K*tr(eps - eps_p))*I
state law               -s = dpsi/dT = -C*log(T/T_0) - C - 3*K*a*tr(eps - eps_p)/rho
state law               B = -rho*dpsi/deps_p = 2*G*dev(eps) - 2*G*dev(eps_p) - (3*K*a*(-T_0 + T) - K*tr(eps - eps_p))*I
state law               R = -rho*dpsi/dp = -H*p
dissipation potential   phi(deps_p/dt, dp/dt, -q/T) = c*dp/dt + T*inner((-q/T), (-q/T))/(2*k) if tr(deps_p/dt) = 0, norm(dev(deps_p/dt)) <= dp/dt, else +oo
rate form               B in dphi/d(deps_p/dt)
rate form               R in dphi/d(dp/dt)
rate form               grad_T = dphi/d(-q/T) = T/k*(-q/T)
force function          phi_star(B, R, grad_T) = k*inner(grad_T, grad_T)/(2*T) + indicator(R - c + norm(dev(B)))
elastic domain          f = R - c + norm(dev(B)) <= 0
complementary law       deps_p/dt = gamma*(1/norm(dev(B))*dev(B))
complementary law       dp/dt = gamma*(1)
complementary law       -q/T = k/T*grad_T
multiplier              gamma >= 0, f <= 0, gamma*f = 0
force form              (deps_p/dt, dp/dt, -q/T) in dphi_star(B, R, grad_T): the normal cone of f <= 0, also at a vertex, where f has no gradient
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
note                    psi is concave in the temperature: its subdifferential there is that of -psi, with the opposite sign
""",
    "thermal stress reversible": """\
thermal: stress formulation, reversible split
decomposition           eps = eps_r + eps_p
dissipation inequality  inner(sig, deps_p/dt) + inner(B_r, deps_p/dt) + R*dp/dt + inner(-q/T, grad_T) >= 0
density                 rho, potentials per unit mass
conjugate energy        rho*psi_star = C*rho*T*log(T/T_0) - H*p**2/2 + 9*K*a**2*(-T_0 + T)**2/2 + a*(-T_0 + T)*tr(sig) + tr(sig)**2/(18*K) + inner(dev(sig), dev(sig))/(4*G)
state law               eps_r = rho*dpsi_star/dsig = 1/(2*G)*dev(sig) + (a*(-T_0 + T) + tr(sig)/(9*K))*I
state law               s = dpsi_star/dT = C*log(T/T_0) + 9*K*a**2*T/rho + a*tr(sig)/rho - (-C*rho + 9*K*T_0*a**2)/rho
state law               B_r = rho*dpsi_star/deps_p = 0
state law               R = rho*dpsi_star/dp = -H*p
dissipation potential   phi(deps_p/dt, dp/dt, -q/T) = c*dp/dt + T*inner((-q/T), (-q/T))/(2*k) if tr(deps_p/dt) = 0, norm(dev(deps_p/dt)) <= dp/dt, else +oo
rate form               B = sig + B_r in dphi/d(deps_p/dt)
rate form               R in dphi/d(dp/dt)
rate form               grad_T = dphi/d(-q/T) = T/k*(-q/T)
driving force           B = sig + B_r
force function          phi_star(B, R, grad_T) = k*inner(grad_T, grad_T)/(2*T) + indicator(R - c + norm(dev(B)))
elastic domain          f = R - c + norm(dev(B)) <= 0
complementary law       deps_p/dt = gamma*(1/norm(dev(B))*dev(B))
complementary law       dp/dt = gamma*(1)
complementary law       -q/T = k/T*grad_T
multiplier              gamma >= 0, f <= 0, gamma*f = 0
force form              (deps_p/dt, dp/dt, -q/T) in dphi_star(B, R, grad_T): the normal cone of f <= 0, also at a vertex, where f has no gradient
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
""",
    "Kelvin–Voigt strain total": """\
kelvin_voigt: strain formulation, total split
decomposition           sig = sig_r + sig_ir
dissipation inequality  inner(sig_ir, deps/dt) >= 0
free energy             psi = E*nu*tr(eps)**2/(2*(1 - 2*nu)*(nu + 1)) + E*inner(eps, eps)/(2*(nu + 1))
state law               sig_r = dpsi/deps = E/(nu + 1)*eps + E*nu*tr(eps)/((1 - 2*nu)*(nu + 1))*I
dissipation potential   phi(deps/dt) = eta*inner(dev(deps/dt), dev(deps/dt)) + zeta*tr(deps/dt)**2/2
rate form               sig_ir = dphi/d(deps/dt) = 2*eta*dev(deps/dt) + zeta*tr(deps/dt)*I
force function          phi_star(sig_ir) = tr(sig_ir)**2/(18*zeta) + inner(dev(sig_ir), dev(sig_ir))/(4*eta)
complementary law       deps/dt = 1/(2*eta)*dev(sig_ir) + tr(sig_ir)/(9*zeta)*I
force form              (deps/dt) in dphi_star(sig_ir)
""",
    "Kelvin–Voigt stress reversible": """\
kelvin_voigt: stress formulation, reversible split
decomposition           eps = eps_r, eps_ir = 0, sig = sig_r + sig_ir
dissipation inequality  inner(sig_ir, deps/dt) >= 0
conjugate energy        psi_star = -nu*tr(sig_r)**2/(2*E) + (nu + 1)*inner(sig_r, sig_r)/(2*E)
state law               eps = dpsi_star/dsig_r = (nu + 1)/E*sig_r - nu*tr(sig_r)/E*I
dissipation potential   phi(deps/dt) = eta*inner(dev(deps/dt), dev(deps/dt)) + zeta*tr(deps/dt)**2/2
rate form               sig_ir = dphi/d(deps/dt) = 2*eta*dev(deps/dt) + zeta*tr(deps/dt)*I
force function          phi_star(sig_ir) = tr(sig_ir)**2/(18*zeta) + inner(dev(sig_ir), dev(sig_ir))/(4*eta)
complementary law       deps/dt = 1/(2*eta)*dev(sig_ir) + tr(sig_ir)/(9*zeta)*I
force form              (deps/dt) in dphi_star(sig_ir)
""",
    "two surfaces stress total": """\
two: stress formulation, total split
decomposition           sig = sig_r + sig_ir, sig_ir = 0
dissipation inequality  inner(B, deps_p/dt) + R*dp/dt >= 0
conjugate energy        psi_star = -H*p**2/2 + inner(eps_p, sig) + tr(sig)**2/(18*K) + inner(dev(sig), dev(sig))/(4*G)
state law               eps = dpsi_star/dsig = 1/(2*G)*dev(sig) + eps_p + tr(sig)/(9*K)*I
state law               B = dpsi_star/deps_p = sig
state law               R = dpsi_star/dp = -H*p
dissipation potential   phi(deps_p/dt, dp/dt) = c*dp/dt + d*tr(deps_p/dt)/3 if norm(dev(deps_p/dt)) <= dp/dt, tr(deps_p/dt) >= 0, else +oo
rate form               B in dphi/d(deps_p/dt)
rate form               R in dphi/d(dp/dt)
force function          phi_star(B, R) = indicator(R - c + norm(dev(B)), -d + tr(B))
elastic domain          f1 = R - c + norm(dev(B)) <= 0
elastic domain          f2 = -d + tr(B) <= 0
complementary law       deps_p/dt = gamma1*(1/norm(dev(B))*dev(B)) + gamma2*(I)
complementary law       dp/dt = gamma1*(1)
multiplier              gamma1 >= 0, f1 <= 0, gamma1*f1 = 0
multiplier              gamma2 >= 0, f2 <= 0, gamma2*f2 = 0
force form              (deps_p/dt, dp/dt) in dphi_star(B, R): the normal cone of f <= 0, also at a vertex, where f has no gradient
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
""",
    "psi_star strain total": """\
star: strain formulation, total split
decomposition           sig = sig_r + sig_ir, sig_ir = 0
dissipation inequality  inner(B, deps_p/dt) + R*dp/dt >= 0
free energy             psi = G*inner(dev(eps - eps_p), dev(eps - eps_p)) + H*p**2/2 + K*tr(eps - eps_p)**2/2
state law               sig_r = dpsi/deps = 2*G*dev(eps) - 2*G*dev(eps_p) + K*tr(eps - eps_p)*I
state law               B = -dpsi/deps_p = 2*G*dev(eps) - 2*G*dev(eps_p) + K*tr(eps - eps_p)*I
state law               R = -dpsi/dp = -H*p
dissipation potential   phi(deps_p/dt, dp/dt) = c*dp/dt if tr(deps_p/dt) = 0, norm(dev(deps_p/dt)) <= dp/dt, else +oo
rate form               B in dphi/d(deps_p/dt)
rate form               R in dphi/d(dp/dt)
force function          phi_star(B, R) = indicator(R - c + norm(dev(B)))
elastic domain          f = R - c + norm(dev(B)) <= 0
complementary law       deps_p/dt = gamma*(1/norm(dev(B))*dev(B))
complementary law       dp/dt = gamma*(1)
multiplier              gamma >= 0, f <= 0, gamma*f = 0
force form              (deps_p/dt, dp/dt) in dphi_star(B, R): the normal cone of f <= 0, also at a vertex, where f has no gradient
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
""",
    "phi strain total": """\
rate: strain formulation, total split
decomposition           sig = sig_r + sig_ir
dissipation inequality  inner(sig_ir, deps/dt) + inner(A_eps_p, deps_p/dt) >= 0
free energy             psi = G*inner(dev(eps - eps_p), dev(eps - eps_p)) + K*tr(eps - eps_p)**2/2
state law               sig_r = dpsi/deps = 2*G*dev(eps) - 2*G*dev(eps_p) + K*tr(eps - eps_p)*I
state law               A_eps_p = -dpsi/deps_p = 2*G*dev(eps) - 2*G*dev(eps_p) + K*tr(eps - eps_p)*I
dissipation potential   phi(deps/dt, deps_p/dt) = c*norm(dev(deps_p/dt)) + d*inner(deps/dt, deps/dt)/2 + eta*inner(deps_p/dt, deps_p/dt)
rate form               sig_ir = dphi/d(deps/dt) = d*deps/dt
rate form               A_eps_p in dphi/d(deps_p/dt)
force function          phi_star(sig_ir, A_eps_p) = pos(-c + norm(dev(A_eps_p)))**2/(4*eta) + tr(A_eps_p)**2/(12*eta) + inner(sig_ir, sig_ir)/(2*d)
complementary law       deps/dt = 1/d*sig_ir
complementary law       deps_p/dt = pos(-c + norm(dev(A_eps_p)))/(2*eta*norm(dev(A_eps_p)))*dev(A_eps_p) + tr(A_eps_p)/(6*eta)*I
force form              (deps/dt, deps_p/dt) in dphi_star(sig_ir, A_eps_p)
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
""",
    "series strain reversible": """\
series: strain formulation, reversible split
decomposition           eps = eps_r + eps_ir, eps_ir = eps_v + eps_p
dissipation inequality  inner(sig, deps_v/dt) + inner(sig, deps_p/dt) + inner(A_r, deps_v/dt) + inner(B_r, deps_p/dt) >= 0
free energy             psi = G*inner(eps_r, eps_r) + K*tr(eps_r)**2/2
state law               sig = dpsi/deps_r = 2*G*eps_r + K*tr(eps_r)*I
state law               A_r = -dpsi/deps_v = 0
state law               B_r = -dpsi/deps_p = 0
dissipation potential   phi(deps_v/dt, deps_p/dt) = c*norm(dev(deps_p/dt)) + eta*inner(deps_v/dt, deps_v/dt) if tr(deps_p/dt) = 0, else +oo
rate form               A = sig + A_r = dphi/d(deps_v/dt) = 2*eta*deps_v/dt
rate form               B = sig + B_r in dphi/d(deps_p/dt)
driving force           A = sig + A_r
driving force           B = sig + B_r
force function          phi_star(A, B) = inner(A, A)/(4*eta) + indicator(-c + norm(dev(B)))
elastic domain          f = -c + norm(dev(B)) <= 0
complementary law       deps_v/dt = 1/(2*eta)*A
complementary law       deps_p/dt = gamma*(1/norm(dev(B))*dev(B))
multiplier              gamma >= 0, f <= 0, gamma*f = 0
force form              (deps_v/dt, deps_p/dt) in dphi_star(A, B): the normal cone of f <= 0, also at a vertex, where f has no gradient
note                    phi_star is the total conjugate of phi: every rate is +dphi_star/dforce; the conjugate in the first slot alone has the opposite sign in the other slots
""",
    "wires stress total": """\
wires: stress formulation, total split
decomposition           sig = sig_r + sig_ir, sig_ir = 0
dissipation inequality  inner(A_eps_p, deps_p/dt) >= 0
conjugate energy        psi_star = min over sig_1 + sig_2 = sig of {psi_1_star(sig_1) + psi_2_star(sig_2)}
conjugate energy        psi_1_star(sig_1) = inner(eps_p, sig_1) + tr(sig_1)**2/(18*K) + inner(dev(sig_1), dev(sig_1))/(4*G)
conjugate energy        psi_2_star(sig_2) = (3*y**2 - 2*y*tr(sig_2) + inner(sig_2, sig_2))/(4*d) + y**2/(2*a) if eig_min(sig_2) >= 0, else +oo, with y = min(eig_min(sig_2), a*tr(sig_2)/(3*a + 2*d))
case                    psi_2_star(sig_2) = inner(sig_2, sig_2)/(4*d) - a*tr(sig_2)**2/(4*d*(2*d + 3*a)) if the smallest eigenvalue of sig_2 >= a*tr(sig_2)/(2*d + 3*a) (all strains >= 0)
case                    psi_2_star(sig_2) = y**2/(2*a) + inner(sig_2 - y*I, sig_2 - y*I)/(4*d) with y = smallest eigenvalue of sig_2, if 0 < y < a*tr(sig_2)/(2*d + 3*a)
case                    psi_2_star(sig_2) = inner(sig_2, sig_2)/(4*d) if the smallest eigenvalue of sig_2 is 0, and for a = 0 wherever it is >= 0; the strain is then not unique
state law               eps = dpsi_star/dsig_1 = 1/(2*G)*dev(sig_1) + eps_p + tr(sig_1)/(9*K)*I
state law               eps in dpsi_2_star(sig_2)
state law               A_eps_p = dpsi_star/deps_p = sig_1
complementary law       deps_p/dt = 0
""",
}  # fmt: skip


@pytest.mark.parametrize("name", BLOCKS)
def test_block_word_by_word(name):
    law, formulation, split = BLOCKS[name]
    assert law.table(formulation, split).text() + "\n" == GOLDEN[name]


# what MathJax and KaTeX know; everything else in the LaTeX would be an undefined macro
MACROS = re.compile(
    r"alpha|beta|gamma|chi|eta|lambda|mu|nu|phi|psi|rho|sigma|tau|theta|varepsilon|varphi|xi|zeta|Delta|left|right|langle|rangle|frac|sqrt|"
    r"sum|min|sup|partial|nabla|dot|boldsymbol|mathrm|text|quad|otimes|mapsto|begin|end|cdot|leq|geq|in|infty|max|log|sin|cos|tan"
)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("formulation", "split"), [("strain", "total"), ("stress", "reversible")])
def test_latex_is_complete_and_json_says_the_same(name, formulation, split):
    table = LAWS[name].table(formulation, split)
    latex = table.latex()
    assert latex.count("{") == latex.count("}") and latex.count(r"\left") == latex.count(r"\right")
    assert latex.count("&") == len(table.rows)
    assert all(MACROS.fullmatch(macro) for macro in re.findall(r"\\([A-Za-z]+)", latex))
    rows = json.loads(table.json())["rows"]
    assert [(r["title"], r["text"], r["latex"]) for r in rows] == [(r.title, r.text, r.tex) for r in table.rows]
    assert table.text().count("\n") == len(table.rows)
    assert not any(word in table.text() for word in ("nan", "Dummy", "slot_", "Lambda"))


def test_rows_that_do_not_exist_are_absent():
    wire = LAWS["wire"].table("strain").text()
    for word in ("grad_T", "-s ", "phi", "multiplier", "note", "rho", "force form"):
        assert word not in wire
    assert "gamma" not in RATE.table("strain").text()
    assert "multiplier" not in LAWS["maxwell"].table("stress").text()


def test_a_vector_and_a_frozen_state():
    xi = vector("xi")
    force = forces(xi)
    law = Law("m", psi=G * inner(eps, eps) + k / 2 * inner(xi, xi), phi_star=indicator(norm(force) - c), internal=xi)
    text = law.table("stress").text()
    assert "A_xi = dpsi_star/dxi = -k*xi" in text and "phi(dxi/dt) = c*norm(dxi/dt)" in text
    assert r"\cdot \dot{\boldsymbol{\xi}}" in law.table("stress").latex()
    assert "frozen(p)" in LAWS["mobilised_friction"].table("strain").text()


def test_what_has_no_closed_form_is_stated():
    cut = Law("cut", psi=ELASTIC, phi_star=indicator(norm(dev(B)) + tr(B) - c, norm(B) - d), internal=eps_p)
    assert "phi(deps_p/dt) = min over " in cut.table("strain").text()
    star = Law("star", psi_star=inner(dev(sig), dev(sig)) / G + norm(sig))
    strain = star.table("strain").text()
    assert "psi = min over eps_1, eps_2 with eps_1 + eps_2 = eps, norm(eps_2) <= 1" in strain
    assert "sig_r in dpsi/deps" in strain
    assert "eps in dpsi_star/dsig" in star.table("stress").text()
