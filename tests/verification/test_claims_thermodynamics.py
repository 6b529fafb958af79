"""Claims 4 to 10 of the reference study: the two formulations, the two splits, the rows of Table 1.

Every test runs over the registry of laws where the claim applies. The truth is `law_truth.py` (the laws written again in numpy), finite
differences, programs written by hand, and formulas stated beside the test.
"""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from law_states import derivative, environment, moving, number, random_states, temperatures
from law_truth import DEV, I6, ROOT2, TRUTHS, mandel, matrix, sand_f, stiffness, turned, wire_stress
from scipy.optimize import brentq, root

from fenchel.potentials import Law, dev, frozen, inner, norm, parameter, pos, rates, scalar, sym_tensor, tr
from fenchel.potentials.conjugation import numerical_conjugate, partial_conjugate, total_conjugate
from fenchel.potentials.derivative import partial
from fenchel.potentials.evaluate import evaluate
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.potentials.scalars import ScalarVariable

written = [name for name in LAWS if name in TRUTHS]  # laws that are written a second time
energies = list({LAWS[name].energy: name for name in reversed(written)}.values())[::-1]  # one law for each energy


def truth_of(name):
    return ENTRIES[name].law, ENTRIES[name].values, TRUTHS[name]


def path_of(entry, rng):
    """Smooth functions of time for every variable: sums of two sines; scalars and temperature stay positive."""
    law, size = entry.law, np.linalg.norm(entry.worked.eps)
    found = {}
    for variable in (law.observable, *law.internal, *([law.temperature] if law.temperature is not None else [])):
        width = np.shape(random_states(entry, rng, 1)[variable.name])[1:]
        a, b, c = rng.normal(size=(3, *width))
        amplitude, offset = (0.3 * size, 0.0) if width else (0.3 * size, 3 * size)
        if variable == law.temperature:
            amplitude, offset = 10.0, 320.0
        found[variable.name] = lambda t, a=a, b=b, c=c, s=amplitude, o=offset: (
            o + s * (a * np.sin(t) + b * np.sin(2 * t + c))
        )
    return found


def smooth_window(truth, path, t, width):
    """True if the wires meet no kink in the window: no eigenvalue of the strain and not its trace changes sign."""
    if truth.wires is None or truth.bilateral:
        return True
    values = np.array([np.linalg.eigvalsh(matrix(path["eps"](s))) for s in np.linspace(t - width, t + width, 33)])
    signs = np.sign(np.column_stack([values, values.sum(1)]))
    return bool((signs == signs[0]).all())


def power_balance(law, v, truth, path, t, h):
    """σ:ε̇ − (u̇ − Tṡ) with u from ψ, the same with u from ψ*, and the sum of the sizes of the terms."""

    def at(s):
        return {key: value(s) for key, value in path.items()}

    def entropy(s):
        return float(number(law.entropy, law, v, at(s)))

    def inner_energy(s):
        return float(number(law.energy, law, v, at(s))) + float(at(s).get("T", 0.0)) * entropy(s)

    def stress(s):
        return number(law.stress, law, v, at(s))

    here, rate = at(t), {key: derivative(value, t, h) for key, value in path.items()}
    T, sigma, stress_rate = float(here.get("T", 0.0)), stress(t), derivative(stress, t, h)
    power = sigma @ rate["eps"]
    energy_rate, heat = derivative(inner_energy, t, h), T * derivative(entropy, t, h)

    # the same with psi_star(sigma, X, T), which knows nothing of the strain, one argument at a time
    def along(key):
        return derivative(lambda s: truth.conjugate(v, sigma, {**here, key: here[key] + s * rate[key]}), 0.0, h)

    by_stress = derivative(lambda s: truth.conjugate(v, sigma + s * stress_rate, here), 0.0, h)
    by_state = sum(along(key) for key in rate if key not in ("eps", "T"))
    by_temperature = along("T") if "T" in rate else 0.0
    change = rate["eps"] @ sigma + (here["eps"] @ stress_rate - by_stress) - by_state
    change += entropy(t) * rate.get("T", 0.0) - by_temperature
    scale = abs(power) + abs(energy_rate) + abs(heat) + abs(by_stress) + abs(by_state) + abs(by_temperature)
    return power - (energy_rate - heat), power - change, scale


@pytest.mark.parametrize("name", energies)
def test_claim_04_both_forms_of_clausius_duhem_agree_along_any_process(name):
    law, v, truth = truth_of(name)
    rng = np.random.default_rng(4)
    h, checked = 2e-3, 0
    while checked < 3:
        path, t = path_of(ENTRIES[name], rng), rng.uniform(0, 6)
        if truth.moduli(SimpleNamespace(**v))[1] == 0:  # wires alone: their stress must stay inside its domain
            stretched = turned(rng, np.array([1.0, 2.0, 3.0])) * 1e-3
            path["eps"] = lambda s, base=path["eps"], stretched=stretched: base(s) * 0.05 + stretched
        if not smooth_window(truth, path, t, 4 * h):
            continue
        first, second, scale = power_balance(law, v, truth, path, t, h)
        assert scale > 0
        assert abs(first - second) <= 1e-10 * scale
        checked += 1


@pytest.mark.parametrize("name", energies)
def test_claim_05_primal_and_dual_state_laws_are_equivalent(name):
    law, v, truth = truth_of(name)
    rng = np.random.default_rng(5)
    x = random_states(ENTRIES[name], rng, 40)
    x["eps"][:8] = turned(rng, np.abs(rng.normal(size=(8, 3))) * np.linalg.norm(ENTRIES[name].worked.eps))
    x["eps"][8:12, 1], x["eps"][8:12, 3:] = x["eps"][8:12, 0], 0.0  # repeated eigenvalues
    psi, sigma = number(law.energy, law, v, x), number(law.stress, law, v, x)
    assert psi == pytest.approx(truth.energy(v, x), rel=1e-11, abs=1e-12 * np.abs(psi).max())
    scale = np.abs(psi) + np.abs((sigma * x["eps"]).sum(1)) + 1e-300
    for i in range(40):
        here = {key: value[i] for key, value in x.items()}
        conjugate = truth.conjugate(v, sigma[i], here)
        if np.isinf(conjugate):  # rounding puts a stress on the boundary of its domain a hair outside
            conjugate = truth.conjugate(v, sigma[i] + 1e-13 * np.abs(sigma[i]).max() * I6, here)
        assert psi[i] + conjugate == pytest.approx(sigma[i] @ here["eps"], abs=1e-10 * scale[i])
        # and nowhere less: Fenchel–Young at strains that do not belong to this stress
        other = x["eps"][(i + 7) % 40]
        above = float(number(law.energy, law, v, {**here, "eps": other})) + conjugate - sigma[i] @ other
        assert above >= -1e-10 * (scale[i] + abs(sigma[i] @ other))


@pytest.mark.parametrize("name", energies)
def test_claim_05_conjugates_by_rule_and_by_number_are_the_written_ones(name):
    """ψ* by rule (or as the minimum the rules give) and the certified supremum, against ψ* written by hand; then σ = ∂ψ, ε ∈ ∂ψ*."""
    law, v, truth = truth_of(name)
    rng = np.random.default_rng(51)
    x = random_states(ENTRIES[name], rng, 3)
    if truth.moduli(SimpleNamespace(**v))[1] == 0:  # wires alone: cases (i) and (ii), and a stress outside the domain
        x["eps"] = turned(rng, np.array([[1.0, 2.0, 3.0], [2.0, 1.0, -0.1], [1.0, 1.0, 1.0]])) * 1e-3
    sigma = number(law.stress, law, v, x)
    rule = partial_conjugate(law)
    (dual,) = rule.duals.values()
    table = environment(law, v, x)
    del table[law.observable]
    values = rule.value(table | {dual: sigma})
    scale = np.abs((sigma * x["eps"]).sum(1)) + np.abs(truth.energy(v, x))
    tight = 1e-10 if rule.closed else 1e-7
    for i in range(3):
        here = {key: value[i] for key, value in x.items()}
        exact = truth.conjugate(
            v, sigma[i] + (1e-13 * np.abs(sigma[i]).max() * I6 if rule.closed and rule.domain else 0), here
        )
        assert values[i] == pytest.approx(exact, abs=tight * scale[i])
        # Fenchel equality with the declared energy
        psi = float(number(law.energy, law, v, here))
        assert psi + values[i] == pytest.approx(sigma[i] @ here["eps"], abs=tight * scale[i])
    data = {symbol: np.asarray(value)[0] if np.ndim(value) else value for symbol, value in table.items()}
    certified = numerical_conjugate(law.energy, law.observable, {law.observable: sigma[0]}, data)
    assert certified.gap >= 0 and certified.gap <= 1e-5 * (1 + abs(certified.value))
    assert certified.value - 1e-7 * scale[0] <= values[0] <= certified.value + certified.gap + 1e-7 * scale[0]
    if truth.moduli(SimpleNamespace(**v))[1] == 0:
        outside = sigma[0] - 2 * np.abs(sigma[0]).max() * I6
        assert rule.value(table | {dual: outside[None]})[0] == np.inf


def eigenvalues_of(s):
    return np.linalg.eigvalsh(matrix(s))


E_, C_ = parameter("G", lower=0), parameter("c", lower=0)
e = sym_tensor("e_0")
KINKED = {
    "norm": (C_ * norm(e), lambda s, G, c: 0.0 if np.linalg.norm(s) <= c else np.inf),
    "norm and square": (
        E_ * inner(e, e) + C_ * norm(e),
        lambda s, G, c: max(np.linalg.norm(s) - c, 0.0) ** 2 / (4 * G),
    ),
    "norm of the deviator and square": (
        E_ * inner(e, e) + C_ * norm(dev(e)),
        lambda s, G, c: max(np.linalg.norm(s @ DEV) - c, 0.0) ** 2 / (4 * G) + s[:3].sum() ** 2 / (12 * G),
    ),
    "positive trace and square": (
        E_ * inner(e, e) + C_ * pos(tr(e)),
        lambda s, G, c: (
            (np.linalg.norm(s @ DEV) ** 2 + 3 * (s[:3].sum() / 3 - np.clip(s[:3].sum() / 3, 0, c)) ** 2) / (4 * G)
        ),
    ),
    "trace of the positive part and square": (
        E_ * inner(e, e) + C_ * tr(pos(e)),
        lambda s, G, c: ((w := eigenvalues_of(s)) - np.clip(w, 0, c)) @ (w - np.clip(w, 0, c)) / (4 * G),
    ),
    "power of a norm": (
        C_ * norm(e) ** 3,
        lambda s, G, c: 2 / 3 * np.linalg.norm(s) * np.sqrt(np.linalg.norm(s) / (3 * c)),
    ),
}


@pytest.mark.parametrize("word", KINKED)
def test_claim_05_holds_for_energies_with_kinks(word):
    """Closed conjugates of energies without a gradient everywhere, by rule and by certified number."""
    energy, exact = KINKED[word]
    G, c = 3.0, 2.0
    rng = np.random.default_rng(52)
    duals = rng.normal(size=(12, 6)) * 10.0 ** rng.uniform(-1, 1, size=(12, 1))
    duals[0] = 0.0
    rule = partial_conjugate(energy, e, names="s")
    (dual,) = rule.duals.values()
    found = rule.value({dual: duals, E_: G, C_: c})
    for s, value in zip(duals, found, strict=True):
        expected = exact(s, G, c)
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-12)
        certified = numerical_conjugate(energy, e, {e: s}, {E_: G, C_: c})
        assert certified.value == pytest.approx(expected, rel=1e-5, abs=1e-5)
        if np.isfinite(expected):  # and the pair attains the equality, or the bound is off by no more than the gap
            argument = certified.argument[e]
            attained = float(evaluate(energy, {e: argument, E_: G, C_: c})) + expected - s @ argument
            assert -1e-9 * (1 + abs(expected)) <= attained <= 1e-4 * (1 + abs(expected))


@pytest.mark.parametrize("name", energies)
def test_claim_05_a_law_declared_by_its_conjugates_is_the_same_law(name):
    """ψ* and φ in place of ψ and φ*, as the rules give them, declared anew: the worked value of the library comes out again."""
    entry = ENTRIES[name]
    law, worked = entry.law, entry.worked
    energy = partial_conjugate(law)
    if not energy.closed or energy.domain:
        pytest.skip("psi_star is a minimum over shares, or not finite everywhere")
    potential = {"phi": total_conjugate(law).extended()} if law.forces else {}
    dual = Law(
        f"{name}_dual", psi_star=energy.expression, observable=law.observable, internal=law.internal, **potential
    )
    out = dual.compile()(np.array([worked.eps]), None, worked.dt, **entry.values, **worked.temperatures)
    assert out.stress[0] == pytest.approx(np.array(worked.stress), abs=1e-9 * np.abs(worked.stress).max())
    for variable, value in worked.state.items():
        assert out.state[variable][0] == pytest.approx(value, rel=1e-8)


def driven(name, rng, segments=3, steps=12):
    """States, strains and results along a random path of the compiled law."""
    entry = ENTRIES[name]
    law = entry.law
    update = law.compile()
    state, rows, dt = update.initial_state(1), [], entry.worked.dt
    for eps in moving(entry, rng, segments, steps):
        out = update(eps[None, :], state, dt, **entry.values, **temperatures(law))
        old = {v.name: state[v.name][0] for v in law.internal}
        new = {v.name: out.state[v.name][0] for v in law.internal}
        rows.append((eps, old, new, out))
        state = out.state
    return rows


@pytest.mark.parametrize("name", written)
def test_claim_06_dissipation_is_flux_times_force_in_both_blocks_and_forms(name):
    law, v, truth = truth_of(name)
    before = np.zeros(6)
    total = 0.0
    for step, (eps, old, new, out) in enumerate(driven(name, np.random.default_rng(6))):
        x = {**new, "eps": eps, **temperatures(law)}
        delta = {key: new[key] - old[key] for key in new}
        forces = truth.forces(v, x)
        irreversible_stress = out.stress[0] - truth.stress(v, x)  # zero unless the law is viscous in parallel
        block2 = irreversible_stress @ (eps - before) + sum(np.vdot(forces[key], delta[key]) for key in delta)
        # block 1: the reversible strain is the variable; the wires then pull on the plastic strain with A_r = −σ_w
        block1 = irreversible_stress @ (eps - before)
        if truth.plastic:
            reversible = {**forces, truth.plastic: -truth.wire_part(v, x)}
            block1 += truth.stress(v, x) @ delta[truth.plastic] + sum(np.vdot(reversible[k], delta[k]) for k in delta)
        # stress form: A = +∂ψ*/∂X at fixed stress, by differences
        stress_form = irreversible_stress @ (eps - before)
        for key in delta if step % 6 == 5 else ():
            size = 1e-3 * max(np.abs(new[key]).max(), np.linalg.norm(eps))
            direction = delta[key] / (np.abs(delta[key]).max() or 1.0)
            slope = derivative(
                lambda s, key=key, d=direction, x=x: truth.conjugate(v, truth.stress(v, x), {**x, key: x[key] + s * d}),
                0.0,
                size / 8,
            )
            stress_form += slope * np.abs(delta[key]).max()
        scale = abs(out.stress[0] @ eps) + sum(abs(np.vdot(forces[k], new[k])) for k in new) + 1e-300
        assert block2 == pytest.approx(out.dissipation[0], abs=1e-9 * scale)
        assert block1 == pytest.approx(block2, abs=1e-11 * scale)
        if step % 6 == 5 or not delta:
            assert stress_form == pytest.approx(block2, abs=1e-7 * scale)
        assert out.dissipation[0] >= -1e-12 * scale
        total += out.dissipation[0]
        before = eps
    dissipative = bool(law.internal) or law.observable in law.forces
    assert (total > 0) if dissipative else (total == 0)


@pytest.mark.parametrize("name", energies)
def test_claim_07_state_laws_are_the_derivatives_of_the_energy(name):
    law, v, truth = truth_of(name)
    entry = ENTRIES[name]
    rng = np.random.default_rng(7)
    x = random_states(entry, rng, 12)
    size = np.linalg.norm(entry.worked.eps)
    symbols = {s.name: s for s in (law.observable, *law.internal)}
    rows = {law.observable.name: number(law.stress, law, v, x)}
    rows |= {variable.name: -number(law.force_laws[variable], law, v, x) for variable in law.internal}
    assert set(rows) == set(symbols)
    if law.temperature is not None:
        rows[law.temperature.name] = -number(law.entropy, law, v, x)
    for key, slope in rows.items():
        step = 1e-4 * (size if key != "T" else 300.0)
        direction = rng.normal(size=x[key].shape)
        found = derivative(lambda s, key=key, d=direction: truth.energy(v, {**x, key: x[key] + s * d}), 0.0, step)
        slope = np.broadcast_to(slope, x[key].shape)
        expected = (slope * direction).sum(-1) if slope.ndim > 1 else slope * direction
        assert found == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
        if law.internal and truth.plastic:
            closed = {truth.plastic: -truth.phase_stress(v, x), law.observable.name: truth.stress(v, x)}
            if key in closed:
                assert slope == pytest.approx(closed[key], rel=1e-11, abs=1e-11 * np.abs(slope).max())


@pytest.mark.parametrize("name", energies)
def test_claim_07_stress_formulation_has_the_other_signs(name):
    """A_m = +∂ψ*/∂α_m and s = +∂ψ*/∂T at fixed stress, ε = ∂ψ*/∂σ: differences of ψ* against the declared state laws."""
    law, v, truth = truth_of(name)
    x = {key: value[0] for key, value in random_states(ENTRIES[name], np.random.default_rng(71), 1).items()}
    if truth.moduli(SimpleNamespace(**v))[1] == 0:  # wires alone: inside the domain of their stress
        x["eps"] = turned(np.random.default_rng(71), np.array([1.0, 2.0, 3.0])) * 1e-3
    sigma = number(law.stress, law, v, x)
    size = np.linalg.norm(x["eps"])

    def slope(key, direction, step):
        return derivative(lambda s: truth.conjugate(v, sigma, {**x, key: x[key] + s * direction}), 0.0, step)

    rows = {variable.name: number(law.force_laws[variable], law, v, x) for variable in law.internal}
    if law.temperature is not None:
        rows["T"] = number(law.entropy, law, v, x)
    for key, force in rows.items():
        direction = np.random.default_rng(72).normal(size=np.shape(x[key]))
        step = 1e-2 if key == "T" else 1e-3 * size
        assert slope(key, direction, step) == pytest.approx(
            np.vdot(force, direction), rel=1e-7, abs=1e-9 * np.abs(force).max()
        )
    direction = sigma / np.linalg.norm(sigma)
    found = derivative(lambda s: truth.conjugate(v, sigma + s * direction, x), 0.0, 1e-4 * np.linalg.norm(sigma))
    assert found == pytest.approx(x["eps"] @ direction, rel=1e-7)


@pytest.mark.parametrize("name", [n for n, law in LAWS.items() if law.temperature is not None])
def test_claim_07_heat_flux_and_temperature_gradient_are_a_dual_pair(name):
    """φ*_th = k|∇T|²/2T gives −q/T = (k/T) ∇T, φ_th = T|j|²/2k gives ∇T back, and their sum is the dissipation j·∇T."""
    law, v = LAWS[name], ENTRIES[name].values
    rng = np.random.default_rng(73)
    gradient_of_T = law.forces[law.temperature]
    g, T = rng.normal(size=(50, 3)) * 100.0, 280.0 + 60.0 * rng.random(50)
    values = {gradient_of_T: g, law.temperature: T}
    flux = number(partial(law.viscous, gradient_of_T), law, v, {}, symbols=values)
    assert flux == pytest.approx(v["k"] / T[:, None] * g, rel=1e-12)
    force = number(law.viscous, law, v, {}, symbols=values)
    rate = T * (flux**2).sum(1) / (2 * v["k"])
    assert force + rate == pytest.approx((flux * g).sum(1), rel=1e-12)
    # q = −T j = −k ∇T runs from warm to cold
    assert -T[:, None] * flux == pytest.approx(-v["k"] * g, rel=1e-12)
    # ψ is concave in T: the entropy grows with it
    x = random_states(ENTRIES[name], rng, 30)
    warmer = {**x, "T": x["T"] + 20.0}
    s, s_warmer = (number(law.entropy, law, v, y) for y in (x, warmer))
    assert (s_warmer > s).all()
    middle = number(law.energy, law, v, {**x, "T": x["T"] + 10.0})
    ends = number(law.energy, law, v, x) + number(law.energy, law, v, warmer)
    assert (middle >= ends / 2).all()


def words_of_tables():
    """What the printed rows of a table are made of, as functions on numbers; tensors are Mandel components."""

    def pos(x):
        if np.ndim(x) == 0:
            return np.maximum(x, 0.0)
        values, q = np.linalg.eigh(matrix(x))
        return mandel(q @ np.diag(np.maximum(values, 0)) @ q.T)

    return {
        "I": I6,
        "tr": lambda a: a[:3].sum(),
        "inner": np.dot,
        "dev": lambda a: DEV @ a,
        "pos": pos,
        "log": np.log,
        "sqrt": np.sqrt,
    }


@pytest.mark.parametrize("split", ["total", "reversible"])
@pytest.mark.parametrize("formulation", ["strain", "stress"])
@pytest.mark.parametrize("name", energies)
def test_claim_07_the_printed_rows_of_table_1_hold_in_numbers(name, formulation, split):
    """Every state law as it is printed, read back and evaluated, against the law written by hand."""
    law, v, truth = truth_of(name)
    x = {key: value[0] for key, value in random_states(ENTRIES[name], np.random.default_rng(74), 1).items()}
    forces = truth.forces(v, x)
    stress, wires = truth.stress(v, x), truth.wire_part(v, x)
    plastic = x[truth.plastic] if truth.plastic else np.zeros(6)
    eps = law.observable.name
    expected = {"sig": stress, "sig_r": stress, eps: x["eps"], f"{eps}_r": x["eps"] - plastic}
    for variable in law.internal:
        word = law.forces[variable].name
        expected[word] = forces[variable.name]
        expected[f"{word}_r"] = -wires  # block 1: what is left of the force of ε^p when the stress is counted apart
    if law.temperature is not None:
        expected["-s"] = derivative(lambda t: truth.energy(v, {**x, "T": x["T"] + t}), 0.0, 0.1)
        expected["s"] = -expected["-s"]
    numbers = words_of_tables() | dict(v) | x | {"sig": stress, "sig_r": stress, f"{eps}_r": x["eps"] - plastic}
    numbers |= {"sig_s": stress - wires, "sig_w": wires}
    checked = set()
    for row in json.loads(law.table(formulation, split).json())["rows"]:
        left, *middle = row["text"].split(" = ")
        if row["title"] == "state law" and len(middle) > 1:
            right = middle[-1]
            found = eval(right, {"__builtins__": {}}, numbers)  # our own text, printed by the line above
            scale = max(np.abs(expected[left]).max(), np.abs(stress).max() if np.ndim(expected[left]) else 0.0)
            assert np.broadcast_to(found, np.shape(expected[left])) == pytest.approx(
                expected[left], rel=1e-8, abs=1e-9 * scale
            ), row["text"]
            checked.add(left)
    kinks = formulation == "stress" and truth.wires is not None and not truth.bilateral  # inclusions, printed as such
    assert len(checked) >= len(law.internal) + (law.temperature is not None) + (0 if kinks else 1)


@pytest.mark.parametrize("name", [n for n, law in LAWS.items() if law.temperature is not None])
@pytest.mark.parametrize("split", ["total", "reversible"])
@pytest.mark.parametrize("formulation", ["strain", "stress"])
def test_claim_07_no_row_of_table_1_is_missing_for_a_law_with_heat(name, formulation, split):
    text = LAWS[name].table(formulation, split).text()
    entropy = "-s = dpsi/dT" if formulation == "strain" else " s = dpsi_star/dT"
    driving = "inner(sig, deps_p/dt)" if split == "reversible" else "inner(A, deps_p/dt)"
    for words in (
        entropy,
        driving,
        "inner(-q/T, grad_T) >= 0",
        "grad_T = dphi/d(-q/T) = T/k*(-q/T)",
        "-q/T = k/T*grad_T",
    ):
        assert words in text, words


# -- claim 9 ---------------------------------------------------------------------------------------------------------------------


def reversible_step(truth, v, old, eps):
    """One implicit step in block 1: ε^r is the variable, σ = ∂ψ̂/∂ε^r the whole stress, and the wires pull on ε^p with A_r = −σ_w.

    Solves ε^r + ε^p = ε, the flow in the normal cone at Y = σ + A_r, χ, R, and f = 0, by Newton on (ε^r, ε^p, γ).
    """
    space = SimpleNamespace(**v)
    lam, mu = truth.moduli(space)
    elastic, t = stiffness(lam, mu), np.tan(space.theta_f)
    lam_w, mu_w = truth.wires(space)
    unit = 1.0 / mu

    def wires(strain):
        return strain @ stiffness(lam_w, mu_w) if truth.bilateral else wire_stress(strain, lam_w, mu_w)

    def state(z):
        reversible, plastic, gamma = z[:6], z[6:12], z[12]
        sigma = elastic @ reversible + wires(reversible + plastic)
        driving = sigma - wires(reversible + plastic)
        chi = -space.H_k * (old["alpha"] + plastic - old["eps_p"])
        forces = {"eps_p": driving, "alpha": chi, "p": -space.H_i * (old["p"] + gamma)}
        return sigma, forces, truth.f(v, forces, old)[0]

    def flow(forces):
        deviator = DEV @ (forces["eps_p"] + forces["alpha"])
        return deviator / (ROOT2 * np.linalg.norm(deviator)) + t / 3 * I6

    def cone(z):
        _, forces, f = state(z)
        return np.concatenate([z[:6] + z[6:12] - eps, z[6:12] - old["eps_p"] - z[12] * flow(forces), [unit * f]])

    def apex(z):
        _, forces, f = state(z)
        deviator = DEV @ (forces["eps_p"] + forces["alpha"])
        volume = (z[6:9] - old["eps_p"][:3]).sum() - t * z[12]
        return np.concatenate([z[:6] + z[6:12] - eps, unit * deviator + volume * I6, [unit * f]])

    start = np.concatenate([eps - old["eps_p"], old["eps_p"], [0.0]])
    sigma, forces, f = state(start)
    if f <= 0:
        return sigma, {**old}
    size = np.abs(start).max()
    for residual in (cone, apex):
        solution = root(lambda y, r=residual: r(y * size) / size, start / size, tol=1e-15)
        z = solution.x * size
        sigma, forces, f = state(z)
        change = z[6:12] - old["eps_p"]
        admissible = z[12] >= 0 and ROOT2 * np.linalg.norm(DEV @ change) <= z[12] * (1 + 1e-9)
        aligned = (DEV @ change) @ (DEV @ (forces["eps_p"] + forces["alpha"])) >= -1e-12 * abs(f + space.C_0) * size
        if np.abs(residual(z)).max() <= 1e-13 * size and admissible and aligned:
            return sigma, {"eps_p": z[6:12], "alpha": old["alpha"] + change, "p": old["p"] + z[12]}
    raise AssertionError("block 1 has no solution here")


@pytest.mark.parametrize("name", [n for n in written if TRUTHS[n].wires is not None and TRUTHS[n].surfaces is sand_f])
def test_claim_09_the_split_changes_the_laws_and_not_the_response(name):
    law, v, truth = truth_of(name)
    entry = ENTRIES[name]
    update = law.compile()
    state, old = None, {"eps_p": np.zeros(6), "alpha": np.zeros(6), "p": 0.0}
    path = moving(entry, np.random.default_rng(9), 3, 10)
    path = np.vstack([path, path[-1] + np.linspace(0, 6e-3, 6)[1:, None] * I6])  # ends at the apex
    largest, apex = 0.0, 0
    for eps in path:
        out = update(eps[None, :], state, **v)
        sigma, old = reversible_step(truth, v, old, eps)
        largest = max(largest, np.abs(sigma).max())
        assert out.stress[0] == pytest.approx(sigma, abs=1e-8 * largest)
        assert out.state["eps_p"][0] == pytest.approx(old["eps_p"], abs=1e-8 * np.abs(path).max())
        state = out.state
        B = truth.phase_stress(v, {"eps": eps, **old}) - v["H_k"] * old["alpha"]
        apex += np.linalg.norm(DEV @ B) < 1e-6 * v["C_0"]
    assert old["p"] > 0 and apex > 0


# -- claim 10 --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", [n for n in written if TRUTHS[n].wires is not None and TRUTHS[n].plastic and not TRUTHS[n].bilateral]
)
def test_claim_10_the_conjugate_of_the_parallel_assembly_is_an_infimal_convolution(name):
    """sup over ε of σ:ε − ψ, by Newton, against min over σ_s + σ_w = σ, a semidefinite program in stresses."""
    import cvxpy as cp

    law, v, truth = truth_of(name)
    space = SimpleNamespace(**v)
    lam, mu = truth.moduli(space)
    lam_w, mu_w = truth.wires(space)
    rng = np.random.default_rng(10)
    x = random_states(ENTRIES[name], rng, 6)
    for i in range(6):
        here = {key: value[i] for key, value in x.items()}
        sigma = number(law.stress, law, v, here)
        unit = np.abs(sigma).max()
        sand, y, excess = cp.Variable(6), cp.Variable(nonneg=True), cp.Variable((3, 3), PSD=True)
        half = np.sqrt(0.5)
        spherical = [
            [half**k * (sigma / unit - sand)[place] - (y if a == b else 0) == excess[a, b]]
            for place, (a, b, k) in enumerate([(0, 0, 0), (1, 1, 0), (2, 2, 0), (1, 2, 1), (0, 2, 1), (0, 1, 1)])
        ]
        root_of_compliance = np.linalg.cholesky(np.linalg.inv(stiffness(lam / mu, 1.0))).T
        objective = cp.sum_squares(root_of_compliance @ sand) / 2 + (mu / unit) * (here["eps_p"] @ sand)
        objective += mu / (2 * lam_w) * cp.square(y) + mu / (4 * mu_w) * cp.sum_squares(excess)
        problem = cp.Problem(cp.Minimize(objective), [row for rows in spherical for row in rows])
        problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12)
        stored = sum(w / 2 * np.vdot(here[key], here[key]) for key, w in truth.weights(space).items())
        convolution = problem.value * unit**2 / mu - stored
        assert truth.conjugate(v, sigma, here) == pytest.approx(convolution, rel=1e-7)
        # the phases share the strain: their stresses are those of the minimiser
        assert sand.value * unit == pytest.approx(truth.phase_stress(v, here), abs=1e-5 * unit)


def test_claim_10_stresses_of_the_phases_add_up_at_equal_strain():
    v = ENTRIES["texsol"].values
    strains = moving(ENTRIES["texsol"], np.random.default_rng(101), 40, 1)
    together = LAWS["texsol"].compile()(strains, None, **v)
    sand = LAWS["sand"].compile()(strains, None, **{k: x for k, x in v.items() if not k.endswith("_w")})
    wire = LAWS["wire"].compile()(strains, None, lambda_w=v["lambda_w"], mu_w=v["mu_w"])
    assert together.stress == pytest.approx(sand.stress + wire.stress, rel=1e-12, abs=1e-9)
    assert together.state["p"] == pytest.approx(sand.state["p"], rel=1e-12, abs=1e-18)


# -- claim 8 ---------------------------------------------------------------------------------------------------------------------


def test_claim_08_the_sign_of_the_force_function_column_depends_on_the_conjugate():
    """φ(x, y) quadratic: the conjugate in x alone has ∂φ*/∂y = −∂φ/∂y, the conjugate in both has ∂φ*/∂A = +y; the printed signs are the
    first, the total conjugate of the study's [7] has the second."""
    x, y = rates(scalar("x"), scalar("y"))
    a, b, c = 2.0, 0.5, 1.25
    phi = a / 2 * x**2 + b * x * y + c / 2 * y**2
    one, both = partial_conjugate(phi, x, names="s"), total_conjugate(phi, x, y, names="s A")
    (s,) = one.duals.values()
    s_both, A = both.duals.values()
    rng = np.random.default_rng(8)
    for x_n, y_n in rng.normal(size=(20, 2)):
        s_n, A_n = a * x_n + b * y_n, b * x_n + c * y_n  # = ∂φ/∂x, ∂φ/∂y

        def first(t, s_n=s_n):
            return float(one.value({s: s_n, y: t}))

        def second(t, s_n=s_n):
            return float(both.value({s_both: s_n, A: t}))

        assert derivative(first, y_n, 1e-2) == pytest.approx(-A_n, rel=1e-9, abs=1e-9)
        assert derivative(second, A_n, 1e-2) == pytest.approx(y_n, rel=1e-9, abs=1e-9)
        # by formula, independently of the conjugates: φ*₁ = (s − b y)²/2a − c y²/2, φ* = ½ (s, A) Q⁻¹ (s, A)
        assert first(y_n) == pytest.approx((s_n - b * y_n) ** 2 / (2 * a) - c / 2 * y_n**2)
        pair = np.array([s_n, A_n])
        assert second(A_n) == pytest.approx(pair @ np.linalg.solve([[a, b], [b, c]], pair) / 2)
        # concave in what is not exchanged, convex in what is
        assert first(y_n + 1) + first(y_n - 1) <= 2 * first(y_n)
        assert second(A_n + 1) + second(A_n - 1) >= 2 * second(A_n)


@pytest.mark.parametrize("name", [name for name in written if LAWS[name].forces])
def test_claim_08_rates_follow_the_total_conjugate_with_a_plus_sign(name):
    """At admissible forces, rates of ∂φ* satisfy φ(rates) + φ*(forces) = forces·rates; at no other admissible forces is the work larger."""
    law, v, truth = truth_of(name)
    rng = np.random.default_rng(81)
    unit = truth.unit(SimpleNamespace(**v))
    phi = total_conjugate(law)
    start = {frozen(variable): 0.01 for variable in law.frozen}
    start |= {} if law.temperature is None else {law.temperature: 300.0}
    slots = {law.forces[variable]: variable for variable in law.forces}

    def draw():
        found = {}
        for force, variable in slots.items():
            width = () if isinstance(variable, ScalarVariable) else (6,)
            heat = variable == law.temperature
            found[force] = 1e2 * rng.normal(size=3) if heat else 2 * unit * rng.normal(size=width)
        return found

    def numbers(thing, forces):
        return number(thing, law, v, {}, symbols=start | forces)

    def surface_value(forces):
        return max((float(numbers(f, forces)) for f in law.surfaces), default=-1.0)

    def to_domain(forces):
        """Scaled towards zero until inside, and on the boundary if they were outside."""
        if surface_value(forces) <= 0:
            return forces
        scaled = brentq(lambda t: surface_value({k: t * x for k, x in forces.items()}), 0.0, 1.0, xtol=1e-15)
        return {k: (1 - 1e-13) * scaled * x for k, x in forces.items()}

    for _ in range(8):
        forces = to_domain(draw())
        rate = {force: numbers(partial(law.viscous, force), forces) for force in forces}
        if law.surfaces:
            values = [float(numbers(f, forces)) for f in law.surfaces]
            j = int(np.argmax(values))
            if values[j] >= -1e-9 * unit:
                for force in forces:
                    rate[force] = rate[force] + numbers(partial(law.surfaces[j], force), forces)
        duals = {phi.duals[force]: np.broadcast_to(rate[force], np.shape(forces[force])) for force in forces}
        table = {symbol: v[symbol.name] for symbol in law.parameters} | start | duals
        dissipated = float(phi.value(table, rounding=1e-8))
        work = sum(float(np.vdot(forces[k], rate[k])) for k in forces)
        star = float(numbers(law.viscous, forces))
        assert dissipated + star == pytest.approx(work, rel=1e-7, abs=1e-9 * unit)
        assert dissipated >= 0
        other = to_domain(draw())
        bound = dissipated + float(numbers(law.viscous, other))
        assert sum(float(np.vdot(other[k], rate[k])) for k in forces) <= bound + 1e-7 * (abs(work) + 1e-6 * unit)
