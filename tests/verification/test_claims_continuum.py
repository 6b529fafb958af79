"""Claims 11 to 16 of the reference study: the wire energy, dissipation, the cone of sand, the step as a projection, its tangent.

What concerns every law runs over the registry. The truth is `law_truth.py` (numpy and cvxpy, without fenchel), closed forms stated in the
tests, quadrature and finite differences.
"""

import warnings
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from law_states import derivative, moving, number, random_states, temperatures
from law_truth import (
    DEV,
    I6,
    ROOT2,
    TRUTHS,
    lame,
    matrix,
    projection,
    projection_objective,
    stiffness,
    turned,
    wire_conjugate,
    wire_energy,
    wire_hessian,
    wire_stress,
)
from scipy.optimize import brentq

from fenchel.potentials import frozen
from fenchel.potentials.library import ENTRIES, LAWS, cone, cone_values

written = [name for name in LAWS if name in TRUTHS]
LAMBDA_W, MU_W = 5e6 / 3, 2.5e6


@pytest.fixture(scope="module")
def wire():
    return LAWS["wire"].compile()


def wire_step(update, strains):
    return update(strains, None, lambda_w=LAMBDA_W, mu_w=MU_W)


# -- claim 11 --------------------------------------------------------------------------------------------------------------------


def test_claim_11_wires_resist_extension_only(wire):
    rng = np.random.default_rng(11)
    slack = turned(rng, -np.abs(rng.normal(size=(200, 3))) * 10.0 ** rng.uniform(-6, 0, size=(200, 1)))
    slack[:20] = -np.abs(slack[:20, :1]) * I6  # spherical compression
    slack[20] = 0.0
    out = wire_step(wire, slack)
    assert np.abs(out.stress).max() <= 1e-9 * MU_W * np.abs(slack).max() and not out.dissipation.any()
    # stretched in one direction only, and volume growing or not
    strain = turned(rng, np.array([[2.0, -1.0, -3.0], [3.0, -1.0, -1.0]]))
    stress = wire_step(wire, strain).stress
    assert np.linalg.eigvalsh(matrix(stress[0])) == pytest.approx([0, 0, 4 * MU_W], abs=1e-6)
    assert np.linalg.eigvalsh(matrix(stress[1])) == pytest.approx([LAMBDA_W, LAMBDA_W, LAMBDA_W + 6 * MU_W], rel=1e-12)


def strains_with_repeats(rng, n):
    values = rng.normal(size=(n, 3))
    values[: n // 4, 1] = values[: n // 4, 0]
    values[n // 4 : n // 3, 1:] = values[n // 4 : n // 3, :1]
    return turned(rng, values)


def test_claim_11_gradient_hessian_and_conjugate_of_the_wire_energy(wire):
    rng = np.random.default_rng(111)
    strains = strains_with_repeats(rng, 120)
    out = wire_step(wire, strains)
    assert out.stress == pytest.approx(wire_stress(strains, LAMBDA_W, MU_W), rel=1e-12, abs=1e-9 * MU_W)
    # Euler: degree two, secant = tangent
    psi = wire_energy(strains, LAMBDA_W, MU_W)
    assert (out.stress * strains).sum(1) / 2 == pytest.approx(psi, rel=1e-12)
    for strain, stress, tangent in zip(strains, out.stress, out.tangent, strict=True):
        exact = wire_hessian(strain, LAMBDA_W, MU_W)
        assert tangent == pytest.approx(exact, abs=1e-9 * MU_W)
        assert tangent @ strain == pytest.approx(stress, abs=1e-9 * MU_W)
        difference = np.column_stack(
            [derivative(lambda s, e=strain, d=d: wire_stress(e + s * d, LAMBDA_W, MU_W), 0.0, 1e-5) for d in np.eye(6)]
        )
        values = np.linalg.eigvalsh(matrix(strain))
        if min(np.abs(values).min(), abs(values.sum())) > 1e-3:
            assert tangent == pytest.approx(difference, abs=1e-6 * MU_W)
    # Fenchel equality against the conjugate in closed form, also where eigenvalues coincide
    inside = out.stress + 1e-12 * np.abs(out.stress).max() * I6
    total = wire_conjugate(inside, LAMBDA_W, MU_W) + psi
    assert total == pytest.approx((out.stress * strains).sum(1), rel=1e-9, abs=1e-9 * MU_W)


def test_claim_11_wires_carry_less_shear_than_bilateral_ones_at_equal_strain(wire):
    strains = strains_with_repeats(np.random.default_rng(112), 20000)
    unilateral = wire_step(wire, strains).stress
    bilateral = strains @ stiffness(LAMBDA_W, MU_W)
    shear = [np.linalg.norm(s @ DEV, axis=1) for s in (unilateral, bilateral)]
    assert (shear[0] <= shear[1] + 1e-9 * MU_W).all()
    pressure = [-s[:, :3].sum(1) / 3 for s in (unilateral, bilateral)]
    assert (pressure[0] <= np.minimum(0.0, pressure[1]) + 1e-6).all()


# -- claim 12 --------------------------------------------------------------------------------------------------------------------


def kinks(strain):
    """Times in (0, 1) at which an eigenvalue of the strain or its trace vanishes."""
    times = np.linspace(0, 1, 129)

    def functions(t):
        values = np.linalg.eigvalsh(matrix(strain(t)))
        return np.append(values, values.sum())

    table = np.array([functions(t) for t in times])
    found = [0.0, 1.0]
    for k in range(4):
        for i in np.flatnonzero(table[:-1, k] * table[1:, k] < 0):
            found.append(brentq(lambda t, k=k: functions(t)[k], times[i], times[i + 1], xtol=1e-15))
    return np.sort(found)


def test_claim_12_wires_do_no_work_over_a_closed_cycle(wire):
    rng = np.random.default_rng(12)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    for _ in range(5):
        corners = 1e-3 * rng.normal(size=(5, 6))
        work, passed = 0.0, 0.0
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            times = kinks(lambda t, a=a, b=b: a + t * (b - a))
            panels = np.concatenate([np.linspace(t0, t1, 16, endpoint=False) for t0, t1 in pairwise(times)])
            for t0, t1 in pairwise([*panels, 1.0]):
                t = t0 + (t1 - t0) * (nodes + 1) / 2
                power = wire_step(wire, a + t[:, None] * (b - a)).stress @ (b - a)
                work += (t1 - t0) / 2 * weights @ power
                passed += (t1 - t0) / 2 * weights @ np.abs(power)
        assert abs(work) <= 1e-12 * passed
        assert passed > 0


@pytest.mark.parametrize(
    "name", [n for n, law in LAWS.items() if not law.internal and law.observable not in law.forces]
)
def test_claim_12_laws_without_flow_dissipate_nothing(name):
    law, entry = LAWS[name], ENTRIES[name]
    strains = moving(entry, np.random.default_rng(121), 3, 5)
    assert not law.compile()(strains, None, **entry.values).dissipation.any()


# -- claim 13 --------------------------------------------------------------------------------------------------------------------


def test_claim_13_texsol_dissipates_what_sand_dissipates_namely_C_0_dp():
    entry = ENTRIES["texsol"]
    values = entry.values
    sand_values = {k: v for k, v in values.items() if not k.endswith("_w")}
    texsol, sand = LAWS["texsol"].compile(), LAWS["sand"].compile()
    state = other = None
    before, total = 0.0, 0.0
    for eps in moving(entry, np.random.default_rng(13), 6, 25):
        out = texsol(eps[None, :], state, **values)
        alone = sand(eps[None, :], other, **sand_values)
        p = float(out.state["p"][0])
        expected = values["C_0"] * (p - before)
        assert out.dissipation[0] == pytest.approx(expected, rel=1e-12, abs=1e-12 * values["C_0"] * p)
        assert alone.dissipation[0] == pytest.approx(out.dissipation[0], rel=1e-12, abs=1e-15)
        assert out.dissipation[0] >= 0.0
        before, state, other, total = p, out.state, alone.state, total + out.dissipation[0]
    assert total == pytest.approx(values["C_0"] * before) and before > 0


# -- claim 14 --------------------------------------------------------------------------------------------------------------------


def lode_directions(count=721):
    """Unit deviators (principal values) over the Lode angle, from triaxial compression over pure shear to triaxial extension and on."""
    angle = np.linspace(0, 2 * np.pi, count)
    x, y = np.array([1.0, -1.0, 0.0]) / np.sqrt(2), np.array([1.0, 1.0, -2.0]) / np.sqrt(6)
    return np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y


def mohr_coulomb_radius(direction, pressure, phi, c):
    """‖dev σ‖ at which σ₁ − σ₃ = 2c cos φ − (σ₁ + σ₃) sin φ along the direction, σ = −P I + r d."""
    high, low = direction.max(1), direction.min(1)
    return 2 * (c * np.cos(phi) + pressure * np.sin(phi)) / (high - low + (high + low) * np.sin(phi))


@pytest.mark.parametrize("phi", [0.079, 0.3, 0.6])
def test_claim_14_distance_to_mohr_coulomb_along_the_lode_angle(phi):
    c, pressure = 3000.0, 5e4
    directions = lode_directions()
    hexagon = mohr_coulomb_radius(directions, pressure, phi, c)
    compression = np.isclose(directions, np.array([1, 1, -2]) / np.sqrt(6), atol=1e-12).all(1)
    extension = np.isclose(directions, np.array([2, -1, -1]) / np.sqrt(6), atol=2e-3).all(1)
    assert compression.sum() == 1 and extension.any()
    ratio = {}
    for reading in ("compression", "extension", "plane_strain"):
        a, k = cone(phi, c, reading)
        radius = np.sqrt(2) * (k + 3 * a * pressure)  # √J₂ = k − a I₁, ‖dev σ‖ = √2 √J₂, I₁ = −3P
        ratio[reading] = radius / hexagon
    # the compressive cone passes through the compressive edges and contains the hexagon
    assert ratio["compression"][compression] == pytest.approx(1.0, rel=1e-12)
    assert ratio["compression"].min() >= 1 - 1e-12
    # the ratio of the edges is (3 + sin φ)/(3 − sin φ), the largest distance lies between
    edges = (3 + np.sin(phi)) / (3 - np.sin(phi))
    assert ratio["compression"][extension] == pytest.approx(edges, rel=2e-3)
    assert ratio["extension"][compression] == pytest.approx(1 / edges, rel=1e-12)
    assert ratio["extension"].max() >= 1 and ratio["compression"].max() >= edges * (1 - 1e-12)
    # the plane-strain cone touches the hexagon from inside, at the Lode angle tan ω = −sin φ/√3
    assert ratio["plane_strain"].max() == pytest.approx(1.0, abs=2e-5)
    assert ratio["plane_strain"].max() <= 1 + 1e-12
    # at equal angle the extensive cone lies between the other two
    assert ratio["plane_strain"].max() <= ratio["extension"].max() <= ratio["compression"].max()


def test_claim_14_the_friction_angle_of_the_study_in_the_other_readings():
    a, k = np.tan(0.079) / 3, 2842.0
    for reading, degrees, cohesion in (
        ("compression", 3.84, 2412.0),
        ("extension", 4.02, None),
        ("plane_strain", 4.55, 2854.0),
    ):
        phi = brentq(lambda angle, reading=reading: cone(angle, 1.0, reading)[0] - a, 1e-3, 0.5)
        assert np.degrees(phi) == pytest.approx(degrees, abs=5e-3)
        if cohesion is not None:
            assert k / cone(phi, 1.0, reading)[1] == pytest.approx(cohesion, abs=0.6)
    assert cone(0.079, 2842.0) == pytest.approx((a, k))
    assert cone(0.079, 2842.0, "sine") == pytest.approx((np.sin(0.079) / 3, 2842.0 * np.cos(0.079)))
    assert cone(0.079, 2842.0, form="norm") == pytest.approx((a * ROOT2, k * ROOT2))
    assert cone(0.079, 2842.0, form="q") == pytest.approx((a * np.sqrt(3), k * np.sqrt(3)))


def test_claim_14_the_cone_of_sand_and_the_hexagon_are_those_of_the_laws():
    """The declared f vanish at the closed radii above."""
    phi, c, pressure = 0.5, 3000.0, 5e4
    directions = lode_directions(61)
    hexagon = mohr_coulomb_radius(directions, pressure, phi, c)
    points = np.zeros((61, 6))
    points[:, :3] = -pressure + hexagon[:, None] * directions
    law = LAWS["mohr_coulomb"]
    A, R = (law.forces[v] for v in law.internal)
    f = number(
        law.surfaces[0],
        law,
        ENTRIES["mohr_coulomb"].values | dict(phi=phi, c=c),
        {},
        symbols={A: points, R: np.zeros(61)},
    )
    assert np.abs(f).max() <= 1e-9 * pressure
    law = LAWS["sand"]
    values = ENTRIES["sand"].values | cone_values(*cone(phi, c, "compression"))
    A, chi, R = (law.forces[v] for v in law.internal)
    points[:, :3] = -pressure + hexagon[15] * directions  # index 15 of 61 is triaxial compression
    zero = np.zeros((61, 6))
    f = number(law.surfaces[0], law, values, {}, symbols={A: points, chi: zero, R: np.zeros(61)})
    assert np.abs(f).max() <= 1e-9 * pressure


@pytest.mark.parametrize("name", [name for name in written if LAWS[name].surfaces])
def test_claim_14_domains_are_convex_and_contain_zero(name):
    law, v, truth = LAWS[name], ENTRIES[name].values, TRUTHS[name]
    rng = np.random.default_rng(141)
    unit = truth.unit(SimpleNamespace(**v))
    old = random_states(ENTRIES[name], rng, 1)
    old = {key: np.repeat(value, 400, axis=0) for key, value in old.items()}
    symbols, forces = [{}, {}, {}], [{}, {}, {}]
    for variable, force in law.forces.items():
        if variable == law.temperature:
            continue
        a, b = 2 * unit * rng.normal(size=(2, *old[variable.name].shape))
        for k, value in enumerate((a, b, (a + b) / 2)):
            symbols[k][force] = value
            forces[k][variable.name] = value
    start = {frozen(variable): old[variable.name] for variable in law.frozen}
    for j, f in enumerate(law.surfaces):
        at = [number(f, law, v, old, symbols=s | start) for s in symbols]
        mine = [truth.f(v, here, old)[j] for here in forces]
        for one, two in zip(at, mine, strict=True):
            assert one == pytest.approx(two, rel=1e-11, abs=1e-11 * unit)
        assert (at[2] <= (at[0] + at[1]) / 2 + 1e-10 * unit).all()
        origin = {force: np.zeros_like(value) for force, value in symbols[0].items()}
        assert (number(f, law, v, old, symbols=origin | start) <= 1e-12 * unit).all()


# -- claim 15 --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in written if LAWS[name].internal])
def test_claim_15_the_step_is_the_projection_of_the_trial_forces(name):
    """The compiled step against the dual program, written by hand in cvxpy: the same least value at admissible forces."""
    law, entry, truth = LAWS[name], ENTRIES[name], TRUTHS[name]
    rng = np.random.default_rng(15)
    update, v, dt = law.compile(), entry.values, entry.worked.dt
    heat = temperatures(law)
    strains = moving(entry, rng, 6, 1)
    strains[3:] += np.abs(strains[3:]).max() * np.array([[20.0], [-20.0], [3.0]]) * I6  # caps and apices
    state = update(0.5 * moving(entry, rng, 6, 1), None, dt, **v, **heat).state
    out = update(strains, state, dt, **v, **heat)
    unit = truth.unit(SimpleNamespace(**v))
    _, mu = truth.moduli(SimpleNamespace(**v))
    for i in range(6):
        old = {variable.name: state[variable.name][i] for variable in law.internal}
        forces, least = projection(truth, v, old, strains[i], dt, heat.get("T"))
        new = {variable.name: out.state[variable.name][i] for variable in law.internal}
        reached = truth.forces(v, {**new, "eps": strains[i], **heat})
        scale = unit + max(np.abs(np.asarray(value)).max() for value in reached.values())
        for f in truth.f(v, reached, old):
            assert f <= 1e-9 * scale
        # the objective is strongly convex: ½|Y − Y*|² in its metric is at most what the value exceeds the least one by
        value = projection_objective(truth, v, old, strains[i], reached, dt, heat.get("T"))
        assert value <= least + 1e-8 * (abs(least) + unit**2 / mu)
        for key, force in forces.items():
            assert np.asarray(reached[key]) == pytest.approx(np.asarray(force), abs=1e-3 * scale), key
        if law.observable not in law.forces:
            expected = reached[truth.plastic] + truth.wire_part(v, {"eps": strains[i]})
            assert out.stress[i] == pytest.approx(expected, abs=1e-9 * (scale + np.abs(expected).max()))


def sand_primal(v, eps, old, cp):
    """The primal of the step of sand in units of C_0: stored energy and C_0 Δp over the flows of the cone."""
    unit = v["C_0"]
    lam, mu = lame(v["E_s"] / unit, v["nu_s"])
    t = np.tan(v["theta_f"])
    flow, p = cp.Variable(6), cp.Variable()
    root = np.linalg.cholesky(stiffness(lam, mu)).T
    stored = cp.sum_squares(root @ (eps - old["eps_p"] - flow)) / 2 + v["H_i"] / unit / 2 * cp.square(old["p"] + p)
    stored = stored + v["H_k"] / unit / 2 * cp.sum_squares(old["alpha"] + flow)
    constraints = [flow[0] + flow[1] + flow[2] == t * p, cp.norm(DEV @ flow, 2) * ROOT2 <= p]
    return cp.Problem(cp.Minimize(mu * (stored + p)), constraints), flow, mu


def primal_value(v, eps, old, flow, p):
    lam, mu = lame(v["E_s"], v["nu_s"])
    e = eps - old["eps_p"] - flow
    stored = e @ stiffness(lam, mu) @ e / 2 + v["H_k"] / 2 * np.sum((old["alpha"] + flow) ** 2)
    return stored + v["H_i"] / 2 * (old["p"] + p) ** 2 + v["C_0"] * p


def dual_value(v, eps, old, A, chi, R):
    """−ψ*-like side: sup over the strains of the same Lagrangian, at admissible forces."""
    lam, mu = lame(v["E_s"], v["nu_s"])
    elastic = A @ np.linalg.solve(stiffness(lam, mu), A) / 2
    value = A @ (eps - old["eps_p"]) - elastic
    value -= chi @ old["alpha"] + chi @ chi / (2 * v["H_k"])
    return value - R * old["p"] - R**2 / (2 * v["H_i"])


def test_claim_15_return_map_of_sand_between_its_primal_and_its_dual():
    import cvxpy as cp

    entry, law = ENTRIES["sand"], LAWS["sand"]
    v, rng, update = entry.values, np.random.default_rng(151), law.compile()
    strains = moving(entry, rng, 9, 1)
    strains[5:] += 20 * np.abs(strains[5:]).max(1)[:, None] * I6
    state = update(0.5 * moving(entry, rng, 9, 1), None, **v).state
    out = update(strains, state, **v)
    apex = 0
    for i, eps in enumerate(strains):
        old = {key: value[i] for key, value in state.items()}
        problem, flow, mu = sand_primal(v, eps, old, cp)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # asked for more than it can reach; what was reached is compared
            problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
        primal = problem.value / mu * v["C_0"]
        change = {key: out.state[key][i] - old[key] for key in old}
        mine = primal_value(v, eps, old, change["eps_p"], change["p"])
        A = out.stress[i]
        chi, R = -v["H_k"] * out.state["alpha"][i], -v["H_i"] * out.state["p"][i]
        below = dual_value(v, eps, old, A, chi, R)
        assert abs(mine - below) <= 1e-7 * abs(mine)  # in fact rounding: both are the optimum
        assert abs(mine - below) <= 1e-11 * (abs(mine) + abs(A @ eps))
        assert mine == pytest.approx(primal, rel=1e-7)
        assert out.state["eps_p"][i] - old["eps_p"] == pytest.approx(flow.value, abs=1e-6 * np.abs(eps).max())
        apex += np.linalg.norm((A + chi) @ DEV) < 1e-6 * v["C_0"]
    assert 1 <= apex <= 8


@pytest.mark.parametrize("kind", ["cone", "apex"])
def test_claim_15_the_gap_bounds_the_error_of_any_admissible_pair(kind):
    entry, law = ENTRIES["sand"], LAWS["sand"]
    v, rng, update = entry.values, np.random.default_rng(152), law.compile()
    t = np.tan(v["theta_f"])
    eps = np.array(entry.worked.eps) + (2e-2 * I6 if kind == "apex" else 0)
    old = {key: value[0] for key, value in update(0.5 * eps[None], None, **v).state.items()}
    out = update(eps[None], {key: value[None] for key, value in old.items()}, **v)
    flow, p = out.state["eps_p"][0] - old["eps_p"], out.state["p"][0] - old["p"]
    A, chi, R = out.stress[0], -v["H_k"] * out.state["alpha"][0], -v["H_i"] * out.state["p"][0]
    K = stiffness(*lame(v["E_s"], v["nu_s"]))
    smallest = np.inf
    for _ in range(300):
        size = 10.0 ** rng.uniform(-4, 0)
        # any admissible flow and any admissible forces, near the answer and far from it
        p_any = abs(p + size * 1e-3 * rng.normal())
        direction = (flow + size * 1e-3 * rng.normal(size=6)) @ DEV
        direction *= min(1.0, p_any / (ROOT2 * np.linalg.norm(direction)))
        flow_any = direction + t * p_any / 3 * I6
        unit = v["C_0"] * size
        A_any, chi_any = A + unit * rng.normal(size=6), chi + unit * rng.normal(size=6)
        B = A_any + chi_any
        R_any = min(R + unit * rng.normal(), v["C_0"] - np.linalg.norm(B @ DEV) / ROOT2 - t / 3 * B[:3].sum())
        gap = primal_value(v, eps, old, flow_any, p_any) - dual_value(v, eps, old, A_any, chi_any, R_any)
        dz, dp = flow_any - flow, p_any - p
        primal_error = dz @ K @ dz / 2 + v["H_k"] / 2 * dz @ dz + v["H_i"] / 2 * dp**2
        dA, dchi, dR = A_any - A, chi_any - chi, R_any - R
        dual_error = dA @ np.linalg.solve(K, dA) / 2 + dchi @ dchi / (2 * v["H_k"]) + dR**2 / (2 * v["H_i"])
        assert gap >= (primal_error + dual_error) * (1 - 1e-9) - 1e-12 * abs(primal_value(v, eps, old, flow, p))
        smallest = min(smallest, gap)
    assert smallest >= 0


@pytest.mark.parametrize("name", {str(law.phi_star): name for name, law in LAWS.items()}.values())
def test_claim_15_the_certified_gap_of_every_force_function_is_small(name):
    law, entry = LAWS[name], ENTRIES[name]
    update, rng = law.compile(), np.random.default_rng(153)
    out = update(moving(entry, rng, 4, 1), None, entry.worked.dt, certify=True, **entry.values, **temperatures(law))
    energy = update.energy(moving(entry, np.random.default_rng(153), 4, 1), None, **entry.values, **temperatures(law))
    assert out.gap is not None and (out.gap >= -1e-12 * np.abs(energy)).all()
    assert (out.gap <= 1e-7 * np.abs(energy)).all()


# -- claim 16 --------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LAWS)
def test_claim_16_tangents_agree_with_finite_differences(name):
    law, entry = LAWS[name], ENTRIES[name]
    update, rng = law.compile(), np.random.default_rng(16)
    n, dt = 24, entry.worked.dt
    strains = moving(entry, rng, n, 1)
    strains[2 * n // 3 :] += rng.normal(size=(n - 2 * n // 3, 1)) * np.abs(strains).max() * I6
    state = update(0.4 * moving(entry, rng, n, 1), None, dt, **entry.values, **temperatures(law)).state
    if not law.internal and not update.state_size:
        state = None

    def stress(eps):
        return update(eps, state, dt, **entry.values, **temperatures(law)).stress

    size = np.linalg.norm(entry.worked.eps)
    tangent = update(strains, state, dt, **entry.values, **temperatures(law)).tangent
    stiff = np.abs(tangent).max()
    found, smooth = np.empty((n, 6, 6)), np.ones(n, dtype=bool)
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-4 * size
        columns = [
            derivative(lambda s, d=step: stress(strains + s * d), 0.0, h) / np.linalg.norm(step) for h in (0.25, 0.125)
        ]
        found[:, :, k] = columns[1]
        # two widths disagree where a kink lies between: those points say nothing
        smooth &= np.abs(columns[0] - columns[1]).max(1) <= 1e-7 * stiff
    assert smooth.sum() >= n // 2
    error = np.abs(found - tangent)[smooth].max() / stiff
    assert error <= 1e-6
    assert tangent == pytest.approx(np.swapaxes(tangent, 1, 2), abs=1e-9 * stiff)
    assert np.linalg.eigvalsh((tangent + np.swapaxes(tangent, 1, 2)) / 2).min() >= -1e-9 * stiff
