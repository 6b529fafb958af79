"""The implicit step against independent truths: its conic program, its optimality conditions, finite differences.

The optimality conditions are written out by hand from the theory of the sand (associated Drucker–Prager with mixed hardening), and share
nothing with the derivation: f ≤ 0, Δ in the normal cone, γ f = 0.
"""

import numpy as np
import pytest
from sympy import sqrt, tan

from fenchel.errors import InputError
from fenchel.integrators.compiled_step import packed_values
from fenchel.potentials import (
    Law,
    dev,
    forces,
    identity,
    indicator,
    inner,
    isotropic,
    norm,
    parameters,
    pos,
    scalar,
    sym_tensor,
    tr,
)
from fenchel.potentials.library import LAWS, sand, texsol

SAND = dict(E_s=12e6, nu_s=0.2, theta_f=0.079, C_0=2842.0, H_k=944e3, H_i=472e3)
WIRE = dict(lambda_w=6e6 * 0.2 / 1.2 / 0.6, mu_w=6e6 / 2.4)
VALUES = {
    "linear_elastic": dict(E=12e6, nu=0.2),
    "wire": WIRE,
    "von_mises": dict(E=12e6, nu=0.3, sigma_y=5e3, H_k=1e6, H_i=4e5),
    "drucker_prager": dict(E=12e6, nu=0.25, theta_f=0.3, C_0=2842.0, H_i=1e5),
    "sand": SAND,
    "reinforced_sand": SAND | WIRE,
    "texsol": SAND | WIRE,
}
YIELD = 2842.0
I6 = np.array([1.0, 1, 1, 0, 0, 0])
DEV = np.eye(6) - np.outer(I6, I6) / 3


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


def mandel(t):
    return np.array([t[0, 0], t[1, 1], t[2, 2], *(np.sqrt(2) * x for x in (t[1, 2], t[0, 2], t[0, 1]))])


def random_strains(rng, count, top=-2.0):
    """Strains over some decades; one in four near the tensile axis (apex), one in eight with two equal principal values."""
    found = []
    for k in range(count):
        size = 10 ** rng.uniform(-5, top)
        if k % 4 == 0:
            eigen = 10 ** rng.uniform(-2.3, -1.7) * np.ones(3) + 1e-4 * rng.normal(size=3)
        elif k % 8 == 1:
            eigen = size * np.array([1.0, 1.0, rng.normal()]) * rng.choice([-1, 1])
        else:
            eigen = size * rng.normal(size=3)
        q = rotation(rng)
        found.append(mandel(q @ np.diag(eigen) @ q.T))
    return np.array(found)


def random_state(rng, law, count, scale=1e-4):
    state = {}
    for v in law.internal:
        state[v.name] = np.abs(scale * rng.normal(size=count)) if v.name == "p" else scale * rng.normal(size=(count, 6))
    return state


def row(state, i):
    return {name: value[i] for name, value in state.items()}


# -- closed form against the conic program ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("sand", 40),
        pytest.param("sand", 200, marks=pytest.mark.validate),
        ("texsol", 40),
        pytest.param("texsol", 200, marks=pytest.mark.validate),
        ("reinforced_sand", 40),
        ("drucker_prager", 60),
        ("von_mises", 40),
        ("wire", 20),
        ("linear_elastic", 5),
    ],
)
def test_update_equals_the_conic_program(name, count):
    rng = np.random.default_rng(len(name))
    law, values = LAWS[name], VALUES[name]
    strains = random_strains(rng, count, top=-2.3)
    old = random_state(rng, law, count)
    update = law.compile()
    out = update(strains, old, **values)
    apex = 0
    for i in range(count):
        found = law.conic(strains[i], row(old, i), **values).solve()
        assert found.residual <= 1e-11
        # measured: 4e-12 of the yield stress at worst; the contract says 1e-7
        assert np.abs(found.stress - out.stress[i]).max() <= 1e-9 * values.get("sigma_y", YIELD), (i, strains[i])
        for key, value in found.state.items():
            assert np.abs(value - out.state[key][i]).max() * 12e6 <= 1e-7 * YIELD, (i, key)
        total = (
            update.energy(strains[i], {k: v[i : i + 1] for k, v in out.state.items()}, **values)[0] + out.dissipation[i]
        )
        assert found.objective == pytest.approx(total, rel=1e-7, abs=1e-7)
        apex += bool(out.dissipation[i] > 0 and in_apex(out, old, i)) if law.internal else 0
    if name in ("sand", "texsol", "reinforced_sand", "drucker_prager"):
        assert apex >= 0.2 * count


def in_apex(out, old, i):
    """At the apex the flow is strictly inside its cone: √2 ‖dev Δε^p‖ < Δp."""
    slip = np.sqrt(2) * np.linalg.norm(DEV @ (out.state["eps_p"][i] - old["eps_p"][i]))
    return slip < (1 - 1e-6) * (out.state["p"][i] - old["p"][i])


# -- optimality conditions by hand ------------------------------------------------------------------------------------------


def assert_kkt(strain, old, new, values, tolerance):
    """Conditions of the sand's step at one point; `tolerance` in Pa."""
    E, nu, C_0 = values["E_s"], values["nu_s"], values["C_0"]
    K, G, t = E / 3 / (1 - 2 * nu), E / 2 / (1 + nu), np.tan(values["theta_f"])
    elastic = strain - new["eps_p"]
    A = K * (I6 @ elastic) * I6 + 2 * G * DEV @ elastic
    B = A - values["H_k"] * new["alpha"]
    q = np.linalg.norm(DEV @ B)
    f = q / np.sqrt(2) + t / 3 * (I6 @ B) - values["H_i"] * new["p"] - C_0
    step, gamma = new["eps_p"] - old["eps_p"], new["p"] - old["p"]
    rounding = 1e-15 * (np.abs(strain).max() + np.abs(new["eps_p"]).max())
    assert f <= tolerance
    assert gamma >= 0
    assert np.allclose(new["alpha"] - old["alpha"], step, rtol=1e-12, atol=rounding)
    assert I6 @ step == pytest.approx(t * gamma, rel=1e-11, abs=4 * rounding)
    slip = DEV @ step
    assert np.sqrt(2) * np.linalg.norm(slip) <= gamma * (1 + 1e-12) + 4 * rounding
    assert abs(gamma * f) <= tolerance * max(gamma, 1e-300)
    # the flow maximises its power over the cone ‖slip‖ ≤ γ/√2: slip : B = ‖slip‖ q, and ‖slip‖ = γ/√2 unless q = 0
    assert slip @ B == pytest.approx(np.linalg.norm(slip) * q, rel=1e-9, abs=tolerance * gamma + q * 4 * rounding)
    if q > 10 * tolerance:
        assert np.sqrt(2) * np.linalg.norm(slip) == pytest.approx(gamma, rel=1e-9, abs=4 * rounding)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"H_k": 0.0},
        {"H_i": 0.0},
        {"theta_f": 0.0},
        {"H_k": 0.0, "H_i": 0.0},
        {"H_k": 0.0, "H_i": 0.0, "theta_f": 0.0},
        {"C_0": 0.0},
        {"theta_f": 1.2},
    ],
)
@pytest.mark.parametrize("law", [sand, texsol], ids=lambda law: law.name)
def test_optimality_conditions(law, change):
    values = {k: v for k, v in (SAND | WIRE | change).items() if k in {q.name for q in law.parameters}}
    rng = np.random.default_rng(7)
    count = 400
    strains = random_strains(rng, count, top=-1.0)
    old = random_state(rng, law, count)
    out = law.compile()(strains, old, **values)
    regions = set()
    for i in range(count):
        new = row(out.state, i)
        trial = 12e6 * np.abs(strains[i]).max()
        assert_kkt(strains[i], row(old, i), new, values, 1e-10 * YIELD + 2e-14 * trial)
        moved = new["p"] > old["p"][i]
        regions.add("elastic" if not moved else ("apex" if in_apex(out, old, i) else "cone"))
    assert "cone" in regions
    if values["theta_f"] > 0:
        assert "apex" in regions
    plastic = out.state["p"] - old["p"]
    assert np.allclose(out.dissipation, values["C_0"] * plastic, rtol=1e-8, atol=1e-9 * YIELD * plastic.max())


# -- tangent ----------------------------------------------------------------------------------------------------------------


def smooth_difference(update, strain, old, values, width):
    """Central differences of the stress, or None if the difference at half the width disagrees (a kink in between)."""
    found = []
    for h in (width, 0.5 * width):
        steps = h * np.eye(6)
        points = np.concatenate([strain + steps, strain - steps])
        state = {k: np.repeat(v[None], 12, axis=0) for k, v in old.items()}
        stress = update(points, state, **values).stress
        found.append((stress[:6] - stress[6:]).T / (2 * h))
    size = np.abs(found[0]).max()
    return (4 * found[1] - found[0]) / 3 if np.abs(found[0] - found[1]).max() <= 3e-5 * size else None


@pytest.mark.parametrize("name", VALUES)
def test_tangent_equals_finite_differences(name):
    rng = np.random.default_rng(3)
    law, values = LAWS[name], VALUES[name]
    update = law.compile()
    count = 160
    strains = random_strains(rng, count, top=-2.0)
    # exactly repeated principal values, axis-parallel: two and three equal, of either sign, and zero strain
    special = [
        [1e-3, 1e-3, -2.5e-3],
        [-1e-3, -1e-3, 3e-3],
        [1e-3] * 3,
        [-1e-3] * 3,
        [2e-2, 2e-2, 2e-2],
        [1e-3, 1e-3, 1.5e-3],
    ]
    strains[: len(special)] = 0.0
    strains[: len(special), :3] = special
    old = random_state(rng, law, count, scale=3e-5)
    out = update(strains, old, **values)
    assert np.abs(out.tangent - out.tangent.transpose(0, 2, 1)).max() <= 1e-9 * np.abs(out.tangent).max()
    assert np.linalg.eigvalsh(out.tangent).min() >= -1e-9 * np.abs(out.tangent).max()
    checked = 0
    stiffness = np.abs(out.tangent).max()
    for i in range(count):
        width = 2e-4 * np.abs(strains[i]).max()
        numeric = smooth_difference(update, strains[i], row(old, i), values, width)
        if numeric is None:
            continue
        noise = 1e-15 * stiffness * np.abs(strains[i]).max() / width
        assert np.abs(out.tangent[i] - numeric).max() <= 1e-6 * np.abs(numeric).max() + noise + 1e-9 * stiffness, i
        checked += 1
    assert checked >= 0.75 * count


# -- laws that are not in the library ---------------------------------------------------------------------------------------

E, nu, a, b, c, C, t, k2 = parameters("E nu a b c C t k2")
eps, eps_p, x1, x2, s1, s2 = (*(sym_tensor(n) for n in ("eps", "eps_p", "x1", "x2")), scalar("s1"), scalar("s2"))
A, B1, B2, R1, R2 = forces(eps_p, x1, x2, s1, s2)
ELASTIC = isotropic(E, nu).energy(eps - eps_p)
NUMBERS = dict(E=12e6, nu=0.2, C=YIELD, t=0.2)

ODD = {
    # two back stresses of different moduli and weights, one of them deviatoric only, two scalars that couple
    "two_tensors": (
        Law(
            "two_tensors",
            psi=ELASTIC + a * inner(x1, x1) + b * inner(x2, x2) + b * tr(x2) ** 2 + a / 2 * s1**2 + b * (s1 + s2) ** 2,
            phi_star=indicator(norm(dev(A + B1 + 2 * B2)) / sqrt(2) + t / 3 * tr(A + B2) + R1 + 3 * R2 - C),
            observable=eps,
            internal=(s1, eps_p, x1, s2, x2),
        ),
        dict(a=1e5, b=2e5),
    ),
    # kinematic variable deviatoric only
    "k2": (
        Law(
            "k2",
            psi=ELASTIC + a * inner(x1, x1) / 2,
            phi_star=indicator(norm(dev(A) + dev(B1)) / sqrt(2) + tan(t) / 3 * tr(A) - C),
            observable=eps,
            internal=(eps_p, x1),
        ),
        dict(a=1e6),
    ),
    # wires whose natural state is a compressed one
    "prestressed": (
        Law(
            "prestressed",
            psi=ELASTIC
            + a / 2 * pos(tr(eps + c * (1 - 2 * nu) / E * identity)) ** 2
            + b * inner(pos(eps + c * (1 - 2 * nu) / E * identity), pos(eps + c * (1 - 2 * nu) / E * identity)),
            phi_star=indicator(norm(dev(A)) / sqrt(2) + t / 3 * tr(A) - C),
            observable=eps,
            internal=(eps_p,),
        ),
        dict(a=1e6, b=2e6, c=5e4),
    ),
    # no deviator at all: a cut-off in tension
    "cutoff": (Law("cutoff", psi=ELASTIC, phi_star=indicator(tr(A) / 3 - C), observable=eps, internal=(eps_p,)), {}),
}


@pytest.mark.parametrize("name", ODD)
def test_laws_of_the_same_structure_equal_their_program(name):
    law, extra = ODD[name]
    values = {k: v for k, v in (NUMBERS | extra).items() if k in {q.name for q in law.parameters}}
    rng = np.random.default_rng(11)
    count = 24
    strains = random_strains(rng, count, top=-2.3)
    update = law.compile(solver="closed")
    scale = 3e-5
    old = {
        v.name: scale * rng.normal(size=(count, 6)) if v.name[0] in "ex" else scale * rng.normal(size=count)
        for v in law.internal
    }
    out = update(strains, old, **values)
    assert (out.dissipation > 0).sum() >= count // 3
    for i in range(count):
        found = law.conic(strains[i], row(old, i), **values).solve()
        assert np.abs(found.stress - out.stress[i]).max() <= 1e-7 * YIELD, i
        numeric = smooth_difference(update, strains[i], row(old, i), values, 2e-4 * np.abs(strains[i]).max())
        if numeric is not None:
            assert np.abs(out.tangent[i] - numeric).max() <= 2e-6 * np.abs(out.tangent).max(), i


def test_two_surfaces_are_exact_on_each():
    cone = norm(dev(A)) / sqrt(2) + t / 3 * tr(A) - C
    law = Law("capped", psi=ELASTIC, phi_star=indicator(cone, -tr(A) / 3 - k2), observable=eps, internal=(eps_p,))
    update = law.compile()
    assert update.solver in ("reduced", "general")
    values = NUMBERS | {"k2": 5e3}
    squeezed = np.array([-1e-2, -1e-2, -1.1e-2, 0, 0, 0])
    out = update(squeezed, None, **values)
    assert -out.stress[0, :3].mean() == pytest.approx(5e3, rel=1e-7)
    sheared = np.array([1e-3, -1e-3, 0, 0, 0, 0])
    only_cone = Law("uncapped", psi=ELASTIC, phi_star=indicator(cone), observable=eps, internal=(eps_p,)).compile(
        solver="closed"
    )
    expected = only_cone(sheared, None, **{k: v for k, v in values.items() if k != "k2"})
    out = update(sheared, None, **values)
    assert np.abs(out.stress - expected.stress).max() <= 1e-7 * YIELD
    assert np.abs(out.tangent - expected.tangent).max() <= 1e-3 * np.abs(expected.tangent).max()


def test_two_intersecting_surfaces_satisfy_the_optimality_conditions():
    from scipy.optimize import nnls

    cone, cut = norm(dev(A)) / sqrt(2) + t / 3 * tr(A) - C, tr(A) / 3 - k2
    law = Law("cut", psi=ELASTIC, phi_star=indicator(cone, cut), observable=eps, internal=(eps_p,))
    update = law.compile(tangent=False)
    rng = np.random.default_rng(6)
    strains = 10 ** rng.uniform(-3.5, -2, size=(24, 1)) * (rng.normal(size=(24, 6)) + I6)
    out = update(strains, None, **NUMBERS, k2=2e3)
    seen = set()
    for stress, flow in zip(out.stress, out.state["eps_p"], strict=True):
        shear = np.linalg.norm(DEV @ stress)
        f = np.array([shear / np.sqrt(2) + 0.2 / 3 * (I6 @ stress) - YIELD, (I6 @ stress) / 3 - 2e3])
        assert (f <= 1e-8 * YIELD).all()
        active = f >= -1e-7 * YIELD
        normals = np.column_stack([DEV @ stress / shear / np.sqrt(2) + 0.2 / 3 * I6, I6 / 3]) * active
        assert nnls(normals, flow)[1] <= 1e-8 * np.linalg.norm(flow) + 1e-15
        seen.add(tuple(active.tolist()))
    assert {(True, True), (True, False)} <= seen, seen


def test_a_weight_that_is_a_difference_is_judged_by_its_value():
    surface = (a - 1) * norm(dev(A)) + norm(A) - C
    law = Law("split", psi=ELASTIC, phi_star=indicator(surface), observable=eps, internal=(eps_p,))
    update = law.compile(tangent=False)
    values = dict(E=12e6, nu=0.2, C=YIELD)
    stress = update([1e-3, 0, 0, 0, 0, 0], None, **values, a=2.0).stress[0]
    assert np.linalg.norm(DEV @ stress) + np.linalg.norm(stress) == pytest.approx(YIELD, rel=1e-9)
    with pytest.raises(InputError, match="negative weight"):
        update([1e-3, 0, 0, 0, 0, 0], None, **values, a=0.5)


def test_certificate_is_small_for_the_step_and_large_for_a_wrong_one():
    from fenchel.integrators.certificate import duality_gap

    rng = np.random.default_rng(5)
    strains = random_strains(rng, 100)
    update = texsol.compile()
    values = SAND | WIRE
    out = update(strains, None, certify=True, **values)
    scale = update.energy(strains, out.state, **values) + out.dissipation
    assert (out.gap <= 1e-10 * scale + 1e-12).all()
    plastic = out.dissipation > 0
    old, new = update.pack(None, 100), update.pack({k: 0.99 * v for k, v in out.state.items()}, 100)
    wrong = duality_gap(update, strains, old, new, packed_values(update, values))
    assert (wrong[plastic] >= 1e-6 * out.dissipation[plastic]).all()


@pytest.mark.parametrize("solver", ["closed", "conic"])
@pytest.mark.parametrize(
    ("energy", "internal", "good", "bad"),
    [
        # convex in each back stress, not in both: a (x1:x1 + x2:x2)/2 + b x1:x2 with |b| > a
        (
            a / 2 * (inner(x1, x1) + inner(x2, x2)) + b * inner(x1, x2),
            (eps_p, x1, x2),
            dict(a=1e6, b=9e5),
            dict(b=1.1e6),
        ),
        # the same in the spherical parts alone
        (
            a / 2 * (inner(x1, x1) + inner(x2, x2)) + b * tr(x1) * tr(x2),
            (eps_p, x1, x2),
            dict(a=1e6, b=3e5),
            dict(b=4e5),
        ),
        # two scalars
        (a / 2 * (s1**2 + s2**2) + b * s1 * s2, (eps_p, s1, s2), dict(a=1e6, b=9e5), dict(b=1.1e6)),
        # a coupling with the plastic strain that eats the stiffness
        (a / 2 * inner(x1, x1) - b * inner(eps_p, x1), (eps_p, x1), dict(a=1e6, b=0.0), dict(b=1e4)),
    ],
)
def test_softening_that_hides_off_the_diagonal_is_refused(solver, energy, internal, good, bad):
    surface = norm(dev(sum((f for v, f in ((x1, B1), (x2, B2)) if v in internal), A))) / sqrt(2) + t / 3 * tr(A) - C
    surface += sum((f for v, f in ((s1, R1), (s2, R2)) if v in internal), 0)
    law = Law("hidden", psi=ELASTIC + energy, phi_star=indicator(surface), observable=eps, internal=internal)
    update = law.compile(solver=solver, tangent=False)
    if solver == "conic":
        update([1e-3, -1e-3, 0, 0, 0, 0], None, **NUMBERS, **good)
    else:
        packed_values(update, NUMBERS | good)  # what a call does first; spares a compilation
    with pytest.raises(InputError, match=r"convex.*softening is not modelled") as caught:
        update([1e-3, -1e-3, 0, 0, 0, 0], None, **NUMBERS, **good | bad)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("solver", ["closed", "conic"])
@pytest.mark.parametrize("bad", [{"C": -1.0}, {"a": -1.0}, {"b": -1e5}, {"c": -1e5}])
def test_values_that_break_convexity_of_an_unbounded_parameter_are_refused(solver, bad):
    # no bounds are declared: what the composition rules ask for is enforced on the values
    wires = b / 2 * pos(tr(eps)) ** 2 + c * inner(pos(eps), pos(eps))
    law = Law("loose", psi=ELASTIC + wires, phi_star=indicator(a * norm(dev(A)) - C), observable=eps, internal=(eps_p,))
    good = dict(E=12e6, nu=0.2, C=YIELD, a=1.0, b=1e5, c=1e5)
    update = law.compile(solver=solver, tangent=False)
    if solver == "conic":
        update([1e-3, 1e-3, 0, 0, 0, 0], None, **good)
    else:
        packed_values(update, good)
    with pytest.raises(InputError) as caught:
        update([1e-3, 1e-3, 0, 0, 0, 0], None, **good | bad)
    assert "\n" not in str(caught.value)
