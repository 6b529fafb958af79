"""Conjugates of the potentials of laws: sign rules of the partial and the total conjugate, the dissipation of every library law, the
composite by infimal convolution, laws declared by ψ* or φ, independence of the split, and certified numbers."""

import numpy as np
import pytest
from scipy.optimize import minimize
from sympy import Function, exp, simplify

from fenchel.errors import ConvergenceError, DeclarationError, InputError
from fenchel.potentials import (
    Law,
    dev,
    entropy_flux,
    forces,
    frozen,
    gradient,
    indicator,
    inner,
    norm,
    numerical_conjugate,
    parameter,
    parameters,
    partial_conjugate,
    pos,
    rates,
    scalar,
    sym_tensor,
    temperature,
    total_conjugate,
    tr,
    unilateral_conjugate,
    unilateral_energy,
    vector,
)
from fenchel.potentials.conjugation import numerical
from fenchel.potentials.derivative import partial
from fenchel.potentials.evaluate import evaluate
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.potentials.ranked import Ranked
from fenchel.potentials.table import irreversible_of

eps, x, alpha, p = sym_tensor("eps"), sym_tensor("x"), sym_tensor("alpha"), scalar("p")
K, G, H, eta = parameters("K G H eta")
I6 = np.array([1.0, 1, 1, 0, 0, 0])
T = temperature("T")


def length(symbol):
    return 1 if not isinstance(symbol, Ranked) else 6 if symbol.rank == 2 else 3


def draw(symbol, rng, scale=1.0):
    found = scale * rng.normal(size=length(symbol))
    return found if length(symbol) > 1 else float(found[0])


def data_of(name):
    """Parameters at their trial values, temperature and frozen state."""
    entry = ENTRIES[name]
    table = {q: entry.values[q.name] for q in entry.law.parameters}
    table |= {frozen(v): 0.01 for v in entry.law.frozen}
    return table | ({entry.law.temperature: 310.0} if entry.law.temperature is not None else {})


# -- signs (theory §2.3) ---------------------------------------------------------------------------------------------------


def test_partial_and_total_conjugate_of_a_quadratic_in_two_variables():
    """φ(a, b) = a² + a b + b². At s = 1, b = 1/4 the supremum over a is at a = 3/8, and ∂φ/∂b = a + 2b = 0.875 there."""
    a, b = scalar("a_0"), scalar("b_0")
    phi = a**2 + a * b + b**2
    first = partial_conjugate(phi, a, names="s_0")
    s = first.duals[a]
    at = {s: 1.0, b: 0.25}
    assert first.value(at) == pytest.approx((1 - 0.25) ** 2 / 4 - 0.25**2)
    argument = float(first.gradient(at)[a])
    assert argument == pytest.approx(0.375)
    slope = float(evaluate(partial(phi, b), {a: argument, b: 0.25}))
    # the sign of the printed column holds for the conjugate in the first slot
    assert slope == pytest.approx(0.875)
    assert float(evaluate(partial(first.expression, b), at)) == pytest.approx(-slope) == pytest.approx(-0.875)
    # it does not hold for the total conjugate, where the rate is the derivative by the force
    total = total_conjugate(phi, a, b, names="s_0 r_0")
    r = total.duals[b]
    back = total.gradient({s: 1.0, r: slope})
    assert (float(back[a]), float(back[b])) == (pytest.approx(0.375), pytest.approx(0.25))
    # concave in the slot that is not exchanged
    assert evaluate(partial(partial(first.expression, b), b), at) < 0


def test_sign_rules_on_random_points_of_a_law():
    law = Law(
        "two", psi=G * inner(eps - x, eps - x), phi=eta * inner(rates(x), rates(x)) + eta / 2 * inner(rates(eps), rates(eps)) + eta
        / 2 * inner(rates(eps), rates(x)), observable=eps, internal=x,
    )  # fmt: skip
    rng, values = np.random.default_rng(0), {G: 2.0, eta: 3.0}
    de, dx = rates(eps), rates(x)
    first, total = partial_conjugate(law, potential="dissipation"), total_conjugate(law)
    for _ in range(5):
        point = {de: draw(eps, rng), dx: draw(x, rng), **values}
        stress, force = (evaluate(partial(law.phi.finite, z), point) for z in (de, dx))
        (dual,) = first.duals.values()
        at = {**values, dual: stress, dx: point[dx]}
        assert evaluate(partial(first.expression, dual), at) == pytest.approx(point[de])
        assert evaluate(partial(first.expression, dx), at) == pytest.approx(-force)
        found = total.gradient({**values, total.duals[de]: stress, total.duals[dx]: force})
        assert found[de] == pytest.approx(point[de]) and found[dx] == pytest.approx(point[dx])


@pytest.mark.parametrize("name", LAWS)
def test_envelope_theorem_of_every_energy(name):
    """A = −∂ψ/∂α = +∂ψ*/∂α and s = −∂ψ/∂T = +∂ψ*/∂T at conjugate points, and ψ + ψ* = σ:ε."""
    law, rng, numbers = LAWS[name], np.random.default_rng(1), data_of(name)
    star = partial_conjugate(law)
    (dual,) = star.duals.values()
    for _ in range(2):
        state = {v: draw(v, rng, 1e-3) for v in (eps, *law.internal)}
        table = {**numbers, **state}
        stress = evaluate(law.stress, table)
        given = {**numbers, **{v: state[v] for v in law.internal}, dual: stress}
        work = float(stress @ state[eps])
        size = abs(work) + abs(float(evaluate(law.energy, table)))
        assert star.value(given) == pytest.approx(work - float(evaluate(law.energy, table)), abs=2e-6 * size)
        if star.closed and star.has_gradient:
            for v in law.internal:
                force = evaluate(law.force_laws[v], table)
                scale = np.abs(stress).max() + np.abs(force).max()
                assert evaluate(partial(star.expression, v), given) == pytest.approx(force, abs=1e-9 * scale)
            if law.temperature is not None:
                found = float(evaluate(partial(star.expression, law.temperature), given))
                assert found == pytest.approx(float(evaluate(law.entropy, table)), rel=1e-9)


# -- dissipation of the library ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", [name for name, law in LAWS.items() if law.phi_star is not None or law.phi is not None]
)
def test_dissipation_potential_of_every_law(name):
    """φ at rates of the flow rule equals the sum of products of forces and rates less φ*, and the certified supremum."""
    law, rng, numbers = LAWS[name], np.random.default_rng(2), data_of(name)
    other = total_conjugate(law)
    assert other.closed, other.text()
    declared = other.function
    for _ in range(3):
        # the forces lie on the surfaces that carry a multiplier: f(t Y) = 0 by bisection on the ray through Y
        point = {s: draw(s, rng, 1e5) for s in other.slots}
        active = declared.surfaces[:1]
        for f in active:
            low, high = 0.0, 1.0
            while float(evaluate(f, {**numbers, **{s: high * y for s, y in point.items()}})) < 0 and high < 1e12:
                high *= 2
            for _ in range(200):
                middle = 0.5 * (low + high)
                above = float(evaluate(f, {**numbers, **{s: middle * y for s, y in point.items()}})) > 0
                low, high = (low, middle) if above else (middle, high)
            point = {s: low * y for s, y in point.items()}
        if any(float(evaluate(f, {**numbers, **point})) > 1e-6 for f in declared.surfaces):
            continue
        table, gamma = {**numbers, **point}, 1e-3
        flow = {}
        for s in other.slots:
            flow[s] = np.zeros(length(s)) if length(s) > 1 else 0.0
            if declared.finite != 0:
                flow[s] = flow[s] + evaluate(partial(declared.finite, s), table)
            for f in active:
                flow[s] = flow[s] + gamma * evaluate(partial(f, s), table)
        work = sum(float(np.dot(flow[s], point[s])) for s in other.slots)
        found = other.value({**numbers, **{other.duals[s]: flow[s] for s in other.slots}})
        assert found == pytest.approx(work - float(evaluate(declared.finite, table)), rel=1e-8, abs=1e-12)
        assert found >= 0


def test_the_dissipation_of_sand_is_printed_as_in_the_theory():
    text = total_conjugate(LAWS["sand"]).text()
    assert "C_0*dp/dt if" in text and "norm(dev(deps_p/dt)) <= sqrt(2)*dp/dt/2" in text
    assert "tr(deps_p/dt) = dp/dt*tan(theta_f)" in text


# -- the wires and the composite ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("eigenvalues", "value"),
    [((1, 1, 1), 0.375), ((3, 1, 0.2), 4.26), ((1, 0, 0), 0.5), ((2, 2, 0.1), 3.615), ((1, 0.5, 0.5), 0.25), ((1, 1, -0.01), np.inf)],
)  # fmt: skip
def test_printed_values_of_the_wires(eigenvalues, value):
    star = partial_conjugate(LAWS["wire"])
    found = star.value({"sig": [*eigenvalues, 0, 0, 0], "lambda_w": 1.0, "mu_w": 0.5})
    assert found == pytest.approx(value, rel=1e-12)
    assert len(star.cases) == 3


@pytest.mark.parametrize("lam", [0.0, 0.3, 20.0])
def test_the_closed_form_of_the_wires_is_that_of_the_numbers(lam):
    rng, star = np.random.default_rng(3), partial_conjugate(LAWS["wire"])
    root = rng.normal(size=(50, 3, 3))
    m = np.einsum("nij,nkj->nik", root, root)
    stress = np.stack(
        [m[:, 0, 0], m[:, 1, 1], m[:, 2, 2], *(np.sqrt(2) * m[:, i, j] for i, j in ((1, 2), (0, 2), (0, 1)))], axis=1
    )
    found = star.value({"sig": stress, "lambda_w": lam, "mu_w": 0.7})
    assert found == pytest.approx(unilateral_conjugate(stress, lam, 0.7), rel=1e-10)


def test_the_composite_is_an_infimal_convolution():
    """Against the direct supremum, by a minimisation written here; A = ∂ψ*/∂ε^p = σ_s, and ψ* concave in ε^p."""
    law, rng = LAWS["texsol"], np.random.default_rng(4)
    numbers = data_of("texsol")
    star = partial_conjugate(law)
    assert [str(phase.share) for phase in star.phases] == ["sig_s", "sig_w"]
    young, ratio = numbers[_named(law, "E_s")], numbers[_named(law, "nu_s")]
    lam, mu = young * ratio / (1 + ratio) / (1 - 2 * ratio), young / 2 / (1 + ratio)
    lam_w, mu_w = numbers[_named(law, "lambda_w")], numbers[_named(law, "mu_w")]

    def ground(e):
        return lam / 2 * e[:3].sum() ** 2 + mu * e @ e

    eps_p = next(v for v in law.internal if v.name == "eps_p")
    rest = {v: np.zeros(6) if isinstance(v, Ranked) else 0.0 for v in law.internal}

    def direct(stress, plastic):
        def function(z):
            e = 1e-3 * z
            return (ground(e - plastic) + unilateral_energy(e, lam_w, mu_w) - stress @ e) / 10.0

        return -10.0 * minimize(function, 1e3 * plastic, method="BFGS", tol=1e-13).fun

    for _ in range(3):
        plastic = 1e-3 * rng.normal(size=6)
        stress = 1e4 * rng.normal(size=6)
        at = {**numbers, **rest, eps_p: plastic, star.duals[eps]: stress}
        found = star.value(at)
        assert found == pytest.approx(direct(stress, plastic), rel=1e-6)
        e = star.gradient(at)[eps]
        share = lam * (e - plastic)[:3].sum() * I6 + 2 * mu * (e - plastic)
        step = 1e-5 * rng.normal(size=6)
        up, down = direct(stress, plastic + step), direct(stress, plastic - step)
        assert (up - down) / 2 == pytest.approx(share @ step, rel=2e-3)
        assert up + down - 2 * found <= 1e-6 * abs(found)


def _named(law, name):
    return next(q for q in law.parameters if q.name == name)


# -- laws declared by their conjugates ---------------------------------------------------------------------------------------------------


def test_energy_of_a_law_declared_by_its_conjugate():
    sig, rho = sym_tensor("sig"), parameter("rho", lower=0)
    compliance = (
        tr(sig) ** 2 / (18 * K) + inner(dev(sig), dev(sig)) / (4 * G) + inner(sig, x) - H / 2 * inner(alpha, alpha)
    )
    law = Law("a", psi_star=compliance, observable=eps, internal=(x, alpha))
    expected = K / 2 * tr(eps - x) ** 2 + G * inner(dev(eps - x), dev(eps - x)) + H / 2 * inner(alpha, alpha)
    rng, values = np.random.default_rng(5), {K: 2.0, G: 0.7, H: 0.3, rho: 5.0}
    point = {**values, **{v: draw(v, rng) for v in (eps, x, alpha)}}
    assert evaluate(law.energy, point) == pytest.approx(float(evaluate(expected, point)))
    # with a density, psi_star is per unit mass: ρψ = sup σ:ε − ρψ*
    dense = Law("b", psi_star=compliance / rho, observable=eps, internal=(x, alpha), density=rho)
    assert evaluate(dense.energy, point) == pytest.approx(float(evaluate(expected, point)))
    assert evaluate(dense.stress, point) == pytest.approx(evaluate(law.stress, point))
    with pytest.raises(DeclarationError, match="infinite outside"):
        _ = Law("c", psi_star=inner(dev(sig), dev(sig)) / G, observable=eps).energy
    with pytest.raises(DeclarationError, match="no closed conjugate"):
        _ = Law("d", psi_star=inner(sig, sig) * (1 + norm(sig)) * exp(tr(sig)), observable=eps).energy


def test_force_function_of_a_law_declared_by_its_dissipation():
    dx, c = rates(x), parameter("c", lower=0)
    viscous = Law(
        "a", psi=G * inner(eps - x, eps - x), phi=c * norm(dev(dx)) + eta * inner(dx, dx), observable=eps, internal=x
    )
    found, rng = viscous.force_potential, np.random.default_rng(6)
    A = forces(x)
    assert found is not None and not found.surfaces
    for _ in range(5):
        rate = draw(x, rng)
        table = {dx: rate, c: 0.8, eta: 1.7}
        force = evaluate(partial(viscous.phi.finite, dx), table)
        value = float(evaluate(found.finite, {A: force, c: 0.8, eta: 1.7}))
        assert value + float(evaluate(viscous.phi.finite, table)) == pytest.approx(float(force @ rate))
    plastic = Law("b", psi=G * inner(eps - x, eps - x), phi=c * norm(dx), observable=eps, internal=x).force_potential
    assert plastic.finite == 0 and str(plastic.surfaces[0]) == "-c + norm(A_x)"
    # heat: φ = T/(2k) j·j gives φ* = k/(2T) ∇T·∇T
    k = parameter("k", lower=0)
    j = entropy_flux(T)
    heat = Law("d", psi=G * inner(eps, eps) - k * T**2, phi=T / (2 * k) * inner(j, j), observable=eps).force_potential
    g = gradient(T)
    assert simplify(heat.finite - k / (2 * T) * inner(g, g)) == 0


# -- the split ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LAWS)
def test_the_response_does_not_depend_on_the_split(name):
    """State laws in ε^r = ε − ε^ir, with A = σ + A^r for each part of ε^ir, are those in ε: a symbolic identity."""
    law = LAWS[name]
    parts = irreversible_of(law)
    reversible = sym_tensor("eps_r")
    total = reversible
    for v in parts:
        total = total + v
    energy = law.energy.xreplace({eps: total})
    back = {reversible: eps - sum(parts[1:], parts[0]) if parts else eps}
    stress = partial(energy, reversible).xreplace(back)
    assert _vanishes(stress - law.stress)
    for v in law.internal:
        force = (-partial(energy, v)).xreplace(back)
        if v in parts:
            force = force + stress
        assert _vanishes(force - law.force_laws[v])


def _vanishes(quantity):
    if not isinstance(quantity, Ranked):
        return simplify(quantity) == 0
    return all(simplify(c) == 0 for c in quantity.terms().values())


def test_the_irreversible_strain_is_inferred_or_asked_for():
    assert [v.name for v in irreversible_of(LAWS["texsol"])] == ["eps_p"]
    assert irreversible_of(LAWS["linear_elastic"]) == ()
    energy = K / 2 * tr(eps - x - alpha) ** 2 + G * inner(eps - x - alpha, eps - x - alpha)
    assert irreversible_of(Law("a", psi=energy, observable=eps, internal=(x, alpha))) == (x, alpha)
    parallel = Law(
        "b", psi=G * inner(eps - x, eps - x) + K * inner(eps - alpha, eps - alpha), observable=eps, internal=(x, alpha)
    )
    with pytest.raises(DeclarationError, match="irreversible="):
        parallel.table("strain", split="reversible")
    told = Law("c", psi=parallel.psi, observable=eps, internal=(x, alpha), irreversible=(x,))
    assert "A_x_r = -dpsi/dx = " in told.table("strain", split="reversible").text()


# -- certified numbers ---------------------------------------------------------------------------------------------------


def test_certified_numbers_enclose_the_supremum():
    rng = np.random.default_rng(7)
    for function, exact in (
        (G * inner(eps, eps) + K * tr(eps) ** 2, True),
        (exp(norm(eps)) + tr(eps) ** 2 * K, False),
        (indicator(norm(dev(eps)) + tr(eps) - 1) + G * inner(eps, eps), False),
        (K / 2 * pos(tr(eps)) ** 2 + G * inner(pos(eps), pos(eps)), True),
    ):
        values = {K: 1.4, G: 0.6}
        root = rng.normal(size=6) * 0.3 + I6
        found = numerical_conjugate(function, eps, {eps: root}, values)
        assert 0.0 <= found.gap <= 1e-6 * (1 + abs(found.value))
        if exact:
            rule = float(total_conjugate(function, eps).value({**values, "eps_star": root}))
            assert found.value - 1e-12 <= rule <= found.value + found.gap + 1e-12
        # the value is attained at the argument: an independent lower bound
        e = found.argument[eps]
        inside = function.finite if hasattr(function, "finite") else function
        assert found.value == pytest.approx(float(root @ e - evaluate(inside, {**values, eps: e})), abs=1e-12)


def test_the_gap_is_honest_when_the_solver_stops_early(monkeypatch):
    monkeypatch.setattr(numerical, "SOLVER", 3e-2)
    rng, values = np.random.default_rng(8), {K: 1.4, G: 0.6}
    function = K / 2 * pos(tr(eps)) ** 2 + G * inner(pos(eps), pos(eps)) + norm(eps) + K * inner(eps, eps)
    for _ in range(20):
        dual = {eps: 5 * rng.normal(size=6)}
        rough = numerical_conjugate(function, eps, dual, values, tolerance=np.inf)
        monkeypatch.setattr(numerical, "SOLVER", 1e-10)
        fine = numerical_conjugate(function, eps, dual, values)
        monkeypatch.setattr(numerical, "SOLVER", 3e-2)
        assert fine.gap < 1e-6 * (1 + abs(fine.value))
        assert rough.value <= fine.value + fine.gap and fine.value <= rough.value + rough.gap


def test_an_infinite_supremum_and_bad_requests():
    assert numerical_conjugate(norm(eps), eps, {eps: 3 * I6}).value == np.inf
    assert numerical_conjugate(tr(eps), eps, {eps: 3 * I6}).value == np.inf
    with pytest.raises(InputError, match="no dual is given"):
        numerical_conjugate(norm(eps), eps, {})
    with pytest.raises(InputError, match="shape"):
        numerical_conjugate(norm(eps), eps, {eps: [1.0, 2.0]})
    with pytest.raises(ConvergenceError, match="gap"):
        numerical_conjugate(exp(tr(eps)) + inner(eps, eps), eps, {eps: I6}, tolerance=0.0)
    with pytest.raises(DeclarationError):
        numerical_conjugate(Function("f")(p) + p**2, p, {p: 1.0})
    with pytest.raises(InputError, match="variables of the supremum"):
        partial_conjugate(norm(eps))
    with pytest.raises(InputError, match="2 names for 1"):
        partial_conjugate(norm(eps), eps, names="a b")
    with pytest.raises(DeclarationError, match="no force function"):
        total_conjugate(LAWS["wire"])


def test_a_vector_and_its_dual():
    v = vector("v")
    conjugate = total_conjugate(G * inner(v, v) + norm(v), v)
    for y in ([3.0, 0, 0], [0.1, 0.2, 0.0]):
        assert conjugate.value({G: 0.5, "v_star": y}) == pytest.approx(max(np.linalg.norm(y) - 1, 0) ** 2 / 2)
