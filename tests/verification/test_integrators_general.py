"""The general step of declared convex laws against independent truths: closed forms, scalar equations, enumeration of principal values, and
cone programs written here by hand, term by term, in the dual of what the engine solves."""

from itertools import combinations

import cvxpy as cp
import numpy as np
import pytest
from sympy import Rational, exp, sqrt

from fenchel.errors import ConvergenceError, DeclarationError, InputError
from fenchel.integrators.certificate import natural_map
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    eig_sum,
    forces,
    frozen,
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
from fenchel.potentials.library import ENTRIES, LAWS
from fenchel.potentials.spectral import from_matrix, to_matrix

I6 = np.array([1.0, 1, 1, 0, 0, 0])
DEV = np.eye(6) - np.outer(I6, I6) / 3
E, NU, YIELD = 12e6, 0.2, 3e3
G, K = E / 2 / (1 + NU), E / 3 / (1 - 2 * NU)
C = 2 * G * DEV + K * np.outer(I6, I6)
ROOT = np.sqrt(2 * G) * DEV + np.sqrt(3 * K) * np.outer(I6, I6) / 3
COMPLIANCE_ROOT = np.linalg.inv(ROOT)

k, H, a, b, eta, q0, M = parameters("k H a b eta q0 M")
n = parameter("n", lower=0)
eps, eps_p, x1, x2 = sym_tensor("eps"), sym_tensor("eps_p"), sym_tensor("x1"), sym_tensor("x2")
p, s = scalar("p"), scalar("s")
A, X1, X2, R = forces(eps_p, x1, x2, p)
ELASTIC = isotropic(E, NU).energy(eps - eps_p)


def strains(seed, count, low=-4.5, high=-2):
    """Random strains, a fifth of them nearly spherical, of either sign."""
    rng = np.random.default_rng(seed)
    found = rng.normal(size=(count, 6)) * 10 ** rng.uniform(low, high, size=(count, 1))
    found[::5] = I6 * found[::5, :1] + 0.02 * found[::5]
    return found


class HandWritten:
    """min ½ |σ − σ^tr|² in the elastic metric + more, in units of the yield stress, written for cvxpy as it stands."""

    def __init__(self, trial, build):
        self.sig = cp.Variable(6)
        more, rows, self.others = build(self.sig)
        objective = 0.5 * cp.sum_squares(COMPLIANCE_ROOT @ (self.sig - trial / YIELD)) * E + more
        self.problem = cp.Problem(cp.Minimize(objective), rows)

    def judge(self, stress, state):
        """The step is admissible, and no worse than clarabel's answer: by strong convexity it is then nearer to the truth than that."""
        self.problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-9, tol_feas=1e-9)
        best, near = self.problem.value, np.asarray(self.sig.value) * YIELD
        self.sig.value = stress / YIELD
        for variable, value in self.others.items():
            variable.value = value(state) / YIELD
        assert max(np.max(row.violation()) for row in self.problem.constraints) <= 1e-9 * max(
            1, np.abs(stress).max() / YIELD
        )
        assert self.problem.objective.value <= best + 1e-10 * (1 + best)
        assert np.abs(stress - near).max() <= 1e-3 * max(YIELD, np.abs(stress).max())


# -- laws with a truth ------------------------------------------------------------------------------------------------------


def cone_and_cap():
    law = Law(
        "cone_and_cap",
        psi=ELASTIC,
        phi_star=indicator(
            norm(dev(A)) / sqrt(2) + a * tr(A) / 3 - k, sqrt(inner(dev(A), dev(A)) / 2 + (tr(A) / 3 + k) ** 2) - b
        ),
        observable=eps,
        internal=eps_p,
    )
    values = dict(a=0.3, k=YIELD, b=1.2 * YIELD)

    def truth(strain, dt):
        def rows(sig):
            shear, mean = cp.norm2(DEV @ sig) / np.sqrt(2), cp.sum(sig[:3]) / 3
            ball = cp.norm2(cp.hstack([DEV @ sig / np.sqrt(2), mean + 1]))
            return 0, [shear + 0.3 * mean <= 1, ball <= 1.2], {}

        return HandWritten(C @ strain, rows)

    return law, values, truth


def cam_clay_gauge():
    law = Law(
        "gauge",
        psi=ELASTIC + H / 2 * p**2,
        phi_star=indicator(sqrt(Rational(3, 2) * inner(dev(A), dev(A)) / M**2 + (tr(A) / 3 + a - R) ** 2) - (a - R)),
        observable=eps,
        internal=(eps_p, p),
    )
    values = dict(H=1e6, a=2 * YIELD, M=1.1)

    def truth(strain, dt):
        hard = cp.Variable()  # R in yield stresses, metric 1/H

        def rows(sig):
            shear, mean = np.sqrt(1.5) / 1.1 * DEV @ sig, cp.sum(sig[:3]) / 3
            gauge = [cp.norm2(cp.hstack([shear, mean + 2 - hard])) <= 2 - hard]
            return cp.square(hard) * E / 2e6, gauge, {hard: lambda state: -1e6 * state["p"]}

        return HandWritten(C @ strain, rows)

    return law, values, truth


def two_back_stresses():
    law = Law(
        "two_backs",
        psi=ELASTIC + a / 2 * inner(x1, x1) + b / 2 * inner(x2, x2) + a / 4 * inner(x1, x2),
        phi_star=indicator(norm(dev(A + X1)) + norm(dev(A + X2)) / 2 - k),
        observable=eps,
        internal=(eps_p, x1, x2),
    )
    values = dict(a=2e6, b=5e6, k=YIELD)
    weights = np.linalg.inv(np.array([[2e6, 0.5e6], [0.5e6, 5e6]]))

    def truth(strain, dt):
        one, two = cp.Variable(6), cp.Variable(6)
        factor = np.linalg.cholesky(weights * E).T

        def rows(sig):
            both = cp.vstack([one, two])
            more = 0.5 * cp.sum_squares(factor @ both)
            forces_of = {
                one: lambda state: -2e6 * state["x1"] - 0.5e6 * state["x2"],
                two: lambda state: -0.5e6 * state["x1"] - 5e6 * state["x2"],
            }
            return more, [cp.norm2(DEV @ (sig + one)) + cp.norm2(DEV @ (sig + two)) / 2 <= 1], forces_of

        return HandWritten(C @ strain, rows)

    return law, values, truth


def saturating_hardening():
    """ψ = elastic + a (p + b e^(−p/b)) + H p^(n+1)/(n+1): the radial return with the hardening stress a (1 − e^(−p/b)) + H pⁿ."""
    law = Law(
        "saturating",
        psi=ELASTIC + a * (p + b * exp(-p / b)) + H * p ** (n + 1) / (n + 1),
        phi_star=indicator(norm(dev(A)) + R - k),
        observable=eps,
        internal=(eps_p, p),
    )
    values = dict(a=2 * YIELD, b=1e-3, H=1e5, n=0.4, k=YIELD)

    def truth(strain, dt):
        trial = C @ strain
        shear = np.linalg.norm(DEV @ trial)
        hardened = lambda x: YIELD + 2 * YIELD * (1 - np.exp(-x / 1e-3)) + 1e5 * x**0.4  # noqa: E731
        gamma = bisected(lambda x: shear - 2 * G * x - hardened(x), shear / (2 * G)) if shear > YIELD else 0.0
        return trial - 2 * G * gamma * (DEV @ trial) / max(shear, 1e-300)

    return law, values, truth


def overstress(power):
    """φ* = (eta/(n+1)) ⟨f⟩^(n+1): the rate is eta fⁿ."""
    f = (norm(dev(A)) - k) / k
    law = Law("overstress", psi=ELASTIC, phi_star=k * eta / (n + 1) * pos(f) ** (n + 1), observable=eps, internal=eps_p)
    values = dict(k=YIELD, eta=1e-3, n=float(power))

    def truth(strain, dt):
        trial = C @ strain
        shear = np.linalg.norm(DEV @ trial)
        if shear <= YIELD:
            return trial
        over = bisected(
            lambda f: shear - YIELD * (1 + f) - 2 * G * dt * 1e-3 * f**power,
            min(shear / YIELD, (1e4 / dt) ** (1 / power) * shear / YIELD),
        )
        return trial - 2 * G * dt * 1e-3 * over**power * (DEV @ trial) / shear

    return law, values, truth


def bingham_limit():
    law = Law(
        "bingham_and_limit",
        psi=ELASTIC,
        phi_star=pos(norm(dev(A)) - k) ** 2 / (2 * eta) + indicator(norm(dev(A)) - a),
        observable=eps,
        internal=eps_p,
    )
    values = dict(k=YIELD, eta=2e6, a=5 * YIELD)

    def truth(strain, dt):
        trial = C @ strain
        shear = np.linalg.norm(DEV @ trial)
        gamma = max(shear - YIELD, 0) / (2 * G + 2e6 / dt)
        gamma = max(gamma, (shear - 5 * YIELD) / (2 * G))
        return trial - 2 * G * gamma * (DEV @ trial) / max(shear, 1e-300)

    return law, values, truth


def kelvin_voigt():
    S = forces(eps)
    law = Law(
        "dashpot",
        psi=isotropic(E, NU).energy(eps),
        phi_star=inner(dev(S), dev(S)) / (4 * eta) + tr(S) ** 2 / (18 * a),
        observable=eps,
    )
    values = dict(eta=1e5, a=3e5)

    def truth(strain, dt):
        return C @ strain + (2e5 * DEV + 3e5 * np.outer(I6, I6)) @ strain / dt

    return law, values, truth


def flow_potential():
    """φ declared: k |ε̇^p| + eta |ε̇^p|²/2 on traceless rates, by its Legendre dual: the same return as Bingham."""
    rate = rates(eps_p)
    law = Law(
        "rates",
        psi=ELASTIC,
        phi=k * norm(rate) + eta / 2 * inner(rate, rate) + indicator(tr(rate), -tr(rate)),
        observable=eps,
        internal=eps_p,
    )
    values = dict(k=YIELD, eta=1e6)

    def truth(strain, dt):
        trial = C @ strain
        shear = np.linalg.norm(DEV @ trial)
        gamma = max(shear - YIELD, 0) / (2 * G + 1e6 / dt)
        return trial - 2 * G * gamma * (DEV @ trial) / max(shear, 1e-300)

    return law, values, truth


def mohr_coulomb():
    top, bottom = eig_max(A), eig_min(A)
    law = Law(
        "mohr", psi=ELASTIC, phi_star=indicator((1 + a) * top - (1 - a) * bottom - k), observable=eps, internal=eps_p
    )
    values = dict(a=0.5, k=YIELD)
    normals = np.zeros((6, 3))
    for row, (i, j) in enumerate([(i, j) for i in range(3) for j in range(3) if i != j]):
        normals[row, i], normals[row, j] = 1.5, -0.5
    stiff = 2 * G * np.eye(3) + (K - 2 * G / 3)

    def truth(strain, dt):
        e, vectors = np.linalg.eigh(to_matrix(strain))
        trial, best = stiff @ e, None
        for count in range(4):
            for active in map(list, combinations(range(6), count)):
                N = normals[active]
                lam = np.linalg.lstsq(N @ stiff @ N.T, N @ trial - YIELD, rcond=1e-12)[0] if active else np.zeros(0)
                sig = trial - stiff @ N.T @ lam
                good = (lam >= -1e-14).all() and (normals @ sig <= YIELD * (1 + 1e-10) + 1e-12 * abs(trial).max()).all()
                if good:
                    cost = 0.5 * (sig - trial) @ np.linalg.solve(stiff, sig - trial)
                    best = (cost, sig) if best is None or cost < best[0] else best
        assert best is not None
        return from_matrix(vectors @ np.diag(best[1]) @ vectors.T)

    return law, values, truth


def spectral_energy():
    """ψ = Σ (a/3) ⟨e_i⟩³ beside the elastic part, elastic: the stress is its gradient."""
    law = Law(
        "spectral", psi=isotropic(E, NU).energy(eps) + eig_sum(lambda e: a / 3 * pos(e) ** 3, eps), observable=eps
    )
    values = dict(a=1e9)

    def truth(strain, dt):
        e, vectors = np.linalg.eigh(to_matrix(strain))
        return C @ strain + from_matrix(vectors @ np.diag(1e9 * np.maximum(e, 0) ** 2) @ vectors.T)

    return law, values, truth


def linked_slip():
    """Two vectors and a kink in ψ: k |u| in the energy, moved by a ball of forces; checked by a program in primal form."""
    u = vector("u")
    U = forces(u)
    law = Law(
        "kinked",
        psi=ELASTIC + a / 2 * inner(u, u) + b * pos(p - q0) ** 3,
        phi_star=indicator(norm(dev(A)) + R - k, norm(U) - k),
        observable=eps,
        internal=(eps_p, p, u),
    )
    values = dict(a=1e6, b=1e12, q0=1e-4, k=YIELD)

    def truth(strain, dt):
        trial = C @ strain
        shear = np.linalg.norm(DEV @ trial)
        hardened = lambda x: YIELD + 3e12 * max(x - 1e-4, 0) ** 2  # noqa: E731
        gamma = bisected(lambda x: shear - 2 * G * x - hardened(x), shear / (2 * G)) if shear > YIELD else 0.0
        return trial - 2 * G * gamma * (DEV @ trial) / max(shear, 1e-300)

    return law, values, truth


def bisected(function, high):
    """Root of a decreasing function on [0, high]."""
    low = 0.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) > 0 else (low, middle)
    return 0.5 * (low + high)


CASES = {
    "cone_and_cap": (cone_and_cap, 0.0),
    "cam_clay": (cam_clay_gauge, 0.0),
    "two_back_stresses": (two_back_stresses, 0.0),
    "saturating_hardening": (saturating_hardening, 1e-9),
    "power_1": (lambda: overstress(1), 1e-9),
    "power_3": (lambda: overstress(3), 1e-9),
    "power_20": (lambda: overstress(20), 1e-9),
    "bingham_limit": (bingham_limit, 1e-9),
    "kelvin_voigt": (kelvin_voigt, 1e-11),
    "rates": (flow_potential, 1e-9),
    "mohr_coulomb": (mohr_coulomb, 1e-9),
    "spectral_energy": (spectral_energy, 1e-8),
    "kinked": (linked_slip, 1e-8),
}


@pytest.fixture(scope="module")
def made():
    """Every case compiled once."""
    return {name: (make(), tolerance) for name, (make, tolerance) in CASES.items()}


@pytest.mark.parametrize("name", CASES)
def test_stress_is_the_true_one(made, name):
    (law, values, truth), tolerance = made[name]
    update = law.compile(solver="general")
    dt = 0.7
    loads = strains(3, 40)
    out = update(loads, None, dt, **values)
    moved = 0
    for i, (strain, stress) in enumerate(zip(loads, out.stress, strict=True)):
        expected = truth(strain, dt)
        if isinstance(expected, HandWritten):
            expected.judge(stress, {name: value[i] for name, value in out.state.items()})
            expected = stress
        scale = max(YIELD, np.abs(expected).max(), 1e-3 * np.abs(C @ strain).max())
        assert np.abs(stress - expected).max() <= tolerance * scale, strain
        moved += np.abs(expected - C @ strain).max() > 1e-6 * scale
    assert moved >= 15


@pytest.mark.parametrize("name", CASES)
def test_natural_map_gap_and_dissipation(made, name):
    (law, values, _), _ = made[name]
    update = law.compile(solver="general")
    loads = strains(4, 300, -7, -1)
    old = update.packing.pack(None, 300)
    numbers, heat = update.arguments(values, 300)
    found = update.solve(loads, old, 1.0, numbers, heat)
    assert (found.status == 0).all()
    assert max(natural_map(part).max() for part in found.parts) <= 1e-11
    out = update(loads, None, 1.0, certify=True, **values)
    work = np.abs(update.energy(loads, out.state, **values)) + np.abs(out.dissipation)
    # the floor: the energy at yield; rounding is that of the trial
    trial = np.einsum("ij,ij->i", loads @ C, loads)
    assert (out.gap >= 0).all() and (out.gap <= 1e-10 * (work + YIELD**2 / E) + 1e-12 * trial).all()
    assert (out.dissipation >= -1e-10 * (work + YIELD**2 / E) - 1e-12 * trial).all()


@pytest.mark.parametrize("name", CASES)
def test_tangent_is_the_derivative(made, name):
    (law, values, _), _ = made[name]
    update = law.compile(solver="general")
    loads, count = strains(5, 40, -4), 40
    state = update(0.6 * loads, None, 0.7, **values).state
    out = update(loads, state, 0.7, **values)
    assert np.abs(out.tangent - out.tangent.transpose(0, 2, 1)).max() <= 1e-8 * np.abs(out.tangent).max()
    numeric = []
    for width in (1e-4, 0.5e-4):
        h = width * np.abs(loads).max(axis=1)
        column = []
        for j in range(6):
            step = h[:, None] * np.eye(6)[j]
            ends = [update(loads + sign * step, state, 0.7, **values).stress for sign in (1, -1)]
            column.append((ends[0] - ends[1]) / (2 * h[:, None]))
        numeric.append(np.stack(column, axis=2))
    size = np.abs(numeric[0]).max(axis=(1, 2))
    smooth = np.abs(numeric[0] - numeric[1]).max(axis=(1, 2)) <= 3e-6 * size
    better = (4 * numeric[1] - numeric[0]) / 3
    error = np.abs(out.tangent - better).max(axis=(1, 2)) / size
    assert smooth.sum() >= 0.6 * count
    assert (error[smooth] <= 1e-6).all(), error[smooth].max()


@pytest.mark.parametrize(
    "name", ["cone_and_cap", "power_3", "mohr_coulomb", "kinked", "kelvin_voigt", "saturating_hardening"]
)
def test_routes_agree(made, name):
    (law, values, _), _ = made[name]
    loads = strains(6, 6, -3.5, -2.5)
    general = law.compile(solver="general", tangent=False)(loads, None, 0.7, **values)
    polished = law.compile(solver="conic", tangent=False)(loads, None, 0.7, **values)
    plain = law.compile(solver="cvxpy", tangent=False)(loads, None, 0.7, **values)
    scale = max(YIELD, np.abs(general.stress).max())
    assert np.abs(polished.stress - general.stress).max() <= 1e-9 * scale
    assert np.abs(plain.stress - general.stress).max() <= 1e-4 * scale
    step = law.conic(loads[0], None, dt=0.7, **values)
    assert isinstance(step.problem, cp.Problem)
    found = step.solve()
    assert np.abs(found.stress - general.stress[0]).max() <= 1e-9 * scale
    for key, value in general.state.items():
        assert np.abs(found.state[key] - value[0]).max() <= 1e-8 * np.abs(loads[0]).max()


# -- data of the points -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("inside", [False, True])
def test_frozen_state_enters_as_data(inside):
    """Cohesion, or the slope of the cone, that depends on the accumulated strain at the start of the step."""
    limit = k + H * (1 - exp(-frozen(p) / b))
    surface = norm(dev(A)) * (1 + frozen(p) / b) + R - k if inside else norm(dev(A)) + R - limit
    law = Law("semi", psi=ELASTIC, phi_star=indicator(surface), observable=eps, internal=(eps_p, p))
    values = dict(k=YIELD, b=1e-3) | ({} if inside else dict(H=YIELD))
    update = law.compile(solver="general")
    loads = strains(8, 30, -3.5)
    old = np.abs(np.random.default_rng(1).normal(size=30)) * 1e-3
    out = update(loads, dict(eps_p=np.zeros((30, 6)), p=old), **values)
    factor = 1 + old / 1e-3 if inside else np.ones(30)
    limits = YIELD / factor if inside else YIELD + YIELD * (1 - np.exp(-old / 1e-3))
    shear = np.linalg.norm((loads @ C) @ DEV, axis=1)
    gamma = np.maximum(shear - limits, 0) / (2 * G)
    expected = loads @ C - (2 * G * gamma / shear)[:, None] * (loads @ C @ DEV)
    assert np.abs(out.stress - expected).max() <= 1e-10 * np.abs(loads @ C).max()
    assert out.state["p"] - old == pytest.approx(gamma / factor, abs=1e-15)
    one = update(loads[:1], dict(eps_p=np.zeros((1, 6)), p=old[:1]), **values)
    assert np.abs(one.stress - out.stress[:1]).max() <= 1e-11 * np.abs(loads @ C).max()


def test_temperature_is_data():
    T = temperature("T")
    growth, T_0 = parameters("growth T_0")
    law = Law(
        "warm",
        psi=ELASTIC - 3 * K * growth * (T - T_0) * tr(eps - eps_p),  # concave in T, as it must be
        phi_star=indicator(norm(dev(A)) - k * (2 - T / T_0)),
        observable=eps,
        internal=eps_p,
    )
    update = law.compile(solver="general")
    heat = np.linspace(280, 360, 20)
    loads = strains(9, 20, -3.5)
    out = update(loads, None, T=heat, growth=1e-5, T_0=300.0, k=YIELD)
    trial = (loads - (1e-5 * (heat - 300))[:, None] * I6) @ C
    shear = np.linalg.norm(trial @ DEV, axis=1)
    excess = np.maximum(shear - YIELD * (2 - heat / 300), 0)
    assert np.abs(out.stress - trial + (excess / shear)[:, None] * (trial @ DEV)).max() <= 1e-10 * np.abs(trial).max()
    with pytest.raises(InputError, match="give T="):
        update(loads, None, growth=1e-5, T_0=300.0, k=YIELD)


def test_old_strain_is_kept_for_a_dashpot(made):
    (law, values, _), _ = made["kelvin_voigt"]
    update = law.compile(solver="general")
    first = np.array([[1e-3, 0, 0, 2e-3, 0, 0]])
    out = update(first, None, 0.5, **values)
    again = update(first, out.state, 0.5, **values)
    assert out.state["eps"] == pytest.approx(first)
    assert again.stress == pytest.approx(first @ C, rel=1e-12)
    assert again.dissipation == pytest.approx([0.0], abs=1e-12)
    viscous = (2e5 * DEV + 3e5 * np.outer(I6, I6)) @ first[0] / 0.5
    assert out.dissipation[0] == pytest.approx(viscous @ first[0], rel=1e-12)


def test_path_under_mixed_control_follows_the_closed_form():
    """Uniaxial stress of the Bingham body in one dimension of strain control."""
    from fenchel.integrators import drive_arrays

    f = norm(dev(A)) - k
    law = Law("paced", psi=ELASTIC, phi_star=pos(f) ** 2 / (2 * eta), observable=eps, internal=eps_p)
    times = np.linspace(0, 1, 21)
    targets = np.zeros((21, 6))
    targets[:, 0] = 4e-3 * times
    control = np.array([False, True, True, True, True, True])
    history = drive_arrays(law.compile(solver="general"), control, targets, dict(k=YIELD, eta=1e5), times=times)
    plastic, stress = 0.0, []
    for t, strain in zip(times, targets[:, 0], strict=True):
        dt = 0.05
        trial = E * (strain - plastic)
        # |dev σ| = σ √(2/3), Δε^p_11 = γ √(2/3), γ = dt ⟨|dev σ| − k⟩/η
        root = np.sqrt(2 / 3)
        gamma = max(trial * root - YIELD, 0) / (1e5 / dt + E * 2 / 3) if t else 0.0
        plastic += gamma * root
        stress.append(E * (strain - plastic))
    assert history.sig[:, 0] == pytest.approx(stress, rel=1e-9, abs=1e-6)
    assert np.abs(history.sig[:, 1:]).max() <= 1e-9 * YIELD


# -- refusals -----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("psi", "star", "values", "word"),
    [
        (ELASTIC + a / 2 * inner(x1, x1), indicator(norm(dev(A + X1)) - k), dict(a=-1.0, k=1.0), "convex"),
        (ELASTIC, indicator(norm(dev(A)) - k), dict(k=-1.0), "zero force"),
        (ELASTIC, indicator(k - norm(dev(A))), dict(k=0.0), "convex"),
        (ELASTIC + b * p**4 + a * p, indicator(norm(dev(A)) + R), dict(a=1.0, b=-1.0), "convex"),
    ],
)
def test_what_is_not_convex_is_refused_in_one_line(psi, star, values, word):
    internal = tuple(v for v in (eps_p, x1, p) if psi.has(v))
    with pytest.raises(InputError, match=word) as caught:
        law = Law("bad", psi=psi, phi_star=star, observable=eps, internal=internal)
        law.compile(solver="general")([1e-3, 0, 0, 0, 0, 0], None, **values)
    assert "\n" not in str(caught.value)


def test_a_term_without_conic_form_is_named():
    with pytest.raises(DeclarationError) as caught:
        Law(
            "odd",
            psi=ELASTIC + a * p**2 * s**2,
            phi_star=indicator(norm(dev(A)) + R - k),
            observable=eps,
            internal=(eps_p, p, s),
        ).compile(solver="general")
    assert "\n" not in str(caught.value)


def test_a_step_without_solution_says_so():
    """A rate of the strain that is bounded, asked to go faster."""
    rate = rates(eps)
    law = Law("bounded", psi=isotropic(E, NU).energy(eps), phi=indicator(norm(rate) - a), observable=eps)
    update = law.compile(solver="general")
    assert update([1e-3, 0, 0, 0, 0, 0], None, 1.0, a=2e-3).stress[0] == pytest.approx(C @ [1e-3, 0, 0, 0, 0, 0])
    with pytest.raises(ConvergenceError, match="point"):
        update([1e-2, 0, 0, 0, 0, 0], None, 1.0, a=2e-3)


def test_viscous_terms_of_different_units_beside_a_surface():
    """Overstress in shear (cubic) and in tension (quadratic) within a ball, with a back-stress: optimality alone is the judge."""
    shear, tension = pos(norm(dev(A + X1)) - k) ** 3 / k**2 / 1000, pos(tr(A) / 3 - k) ** 2 / (2 * eta)
    law = Law(
        "two_viscous",
        psi=ELASTIC + H / 2 * inner(x1, x1),
        phi_star=shear + tension + indicator(norm(A) - 10 * k),
        observable=eps,
        internal=(eps_p, x1),
    )
    update = law.compile(solver="general")
    loads = strains(11, 60, -4.5, -2)
    values = dict(k=YIELD, H=1e6, eta=1e6)
    numbers, heat = update.arguments(values, 60)
    found = update.solve(loads, update.packing.pack(None, 60), 0.5, numbers, heat)
    assert (found.status == 0).all() and (found.increment != 0).any(axis=1).sum() >= 30
    assert max(natural_map(part).max() for part in found.parts) <= 1e-11
    out = update(loads, None, 0.5, certify=True, **values)
    assert (out.gap <= 1e-10 * (np.einsum("ij,ij->i", loads @ C, loads) + YIELD**2 / E)).all()


def test_tangent_of_an_elastic_step_at_coinciding_principal_values():
    """Nothing flows there: the tangent is the elastic stiffness, though the multipliers of the eigenvalue cones are not unique."""
    law, values = LAWS["mohr_coulomb"], dict(ENTRIES["mohr_coulomb"].values)
    eps = np.array([[-1.35523e-3, -1.35523e-3, 1.201e-4, 0, 0, 0], [1e-5, -2e-5, 1e-5, 0, 0, 0], [0.0] * 6])
    out = law.compile(solver="general")(eps, None, **values)
    assert (out.dissipation == 0.0).all()
    E, nu = values["E"], values["nu"]
    unit = np.array([1.0, 1, 1, 0, 0, 0])
    stiffness = E / (1 + nu) * (np.eye(6) + nu / (1 - 2 * nu) * np.outer(unit, unit))
    assert np.abs(out.tangent - stiffness).max() <= 1e-12 * stiffness.max()


@pytest.mark.parametrize("name", ["von_mises", "cam_clay"])
def test_the_gap_of_the_route_by_cvxpy_is_that_of_its_own_answer(name):
    """|σ − σ*| ≤ √(2 L δ), L the stiffness: an answer that errs by 1e-8 of the stress cannot have the gap zero."""
    entry = ENTRIES[name]
    values = dict(entry.values)
    eps = 3e-3 * np.random.default_rng(1).normal(size=(4, 6)) - 1e-3 * np.array([1.0, 1, 1, 0, 0, 0])
    exact = entry.law.compile()(eps, None, entry.worked.dt, **values)
    rough = entry.law.compile(solver="cvxpy")(eps, None, entry.worked.dt, certify=True, **values)
    stiffness = np.linalg.eigvalsh(entry.law.compile()(0 * eps, None, entry.worked.dt, **values).tangent).max()
    error = np.linalg.norm(rough.stress - exact.stress, axis=1)
    assert (error > 0.0).any() and (rough.gap > 0.0).all()
    assert (error <= np.sqrt(2 * stiffness * rough.gap)).all()
